import pytest
import sympy as sp

from amoeboid.closed_forms.amplitude import bifurcation, cubic_coefficient
from amoeboid.closed_forms.dimensionless import (
    dimensionless,
    dimensionless_cubic_coefficient,
    viscosity_ratio,
)
from amoeboid.closed_forms.points import infinite_pressure, points
from amoeboid.model.parameters import Parameters
from amoeboid.validation import InvalidInput
from theory.sample_points import sample_points


@pytest.mark.parametrize("function", [dimensionless, dimensionless_cubic_coefficient])
def test_dimensionless_numbers_need_turnover(function):
    with pytest.raises(
        InvalidInput, match="beta must be > 0 for the dimensionless numbers of the paper, got 0"
    ):
        function(Parameters(beta=0.0))
    with pytest.raises(InvalidInput, match="beta must be > 0"):
        function(points(Parameters(), beta=[1.0, 0.0]))


def test_viscosity_ratio_needs_a_bulk_viscosity():
    with pytest.raises(InvalidInput, match="eta_b must be > 0"):
        viscosity_ratio(Parameters(eta_b=0.0))


def test_numbers_do_not_depend_on_the_units():
    p = Parameters(D=0.2, alpha=0.0)
    scaled = p.replace(
        R0=2.0, D=0.2 * 4 / 3, beta=1 / 3, v_p0=3.8 * 2 / 3, c0=6.0, c_r=2.0, delta_P=50.0
    )
    assert pytest.approx(dimensionless(p).D) == dimensionless(scaled).D
    assert dimensionless(scaled).v_p == pytest.approx(dimensionless(p).v_p)
    assert dimensionless(scaled).c0 == pytest.approx(dimensionless(p).c0)
    assert dimensionless_cubic_coefficient(scaled) == pytest.approx(
        float(dimensionless_cubic_coefficient(p)), rel=1e-12
    )


def test_without_turnover_nu_is_the_limit_of_the_dimensionless_one():
    """The exponential law at beta -> 0: the printed nu times beta/c_r^2 has a limit."""
    D, R0, beta, c_r, c, eta = sp.symbols("D R0 beta c_r c eta", positive=True)
    bar = D / (R0**2 * beta)
    braces = (
        ((sp.Rational(3, 2) + 8 * bar) * eta + 5 * bar + 1) * c**2
        - ((5 + 12 * bar) * eta + 3 + 8 * bar) * c
        - (1 + 2 * bar) * eta
    )
    printed = (2 * bar + 1) * braces / (5 * c**2 * ((1 + 12 * bar) * eta + 6 * bar))
    limit = sp.limit(sp.together(beta * printed / c_r**2), beta, 0)
    for p in sample_points(8):
        at = p.replace(beta=0.0, alpha=0.0, law="exponential")
        values = {D: at.D, R0: at.R0, c_r: at.c_r, c: at.c0 / at.c_r, eta: at.eta_s / at.eta_b}
        nu = cubic_coefficient(infinite_pressure(at))
        assert nu == pytest.approx(float(limit.subs(values)), rel=1e-11)


def test_without_turnover_diffusion_does_not_decide_the_type_of_the_bifurcation():
    p = infinite_pressure(points(Parameters(beta=0.0), D=[1e-3, 0.03, 10.0]))
    assert bifurcation(p).tolist() == ["subcritical"] * 3
    assert bifurcation(points(p, c0=1.0)).tolist() == ["supercritical"] * 3

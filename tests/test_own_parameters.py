"""Laws and stresses of a user, added from outside the package, and parameters of their own."""

import json
import pickle
from dataclasses import dataclass
from itertools import islice

import numpy as np
import pytest

import amoeboid
from amoeboid.axisymmetric.onset import branch_tangent, onset_speed, onsets, onsets_anywhere
from amoeboid.axisymmetric.steady import homogeneous
from amoeboid.axisymmetric.system import SteadySystem
from amoeboid.axisymmetric.unknowns import mode_count
from amoeboid.cli.main import main
from amoeboid.closed_forms.amplitude import cubic_coefficient
from amoeboid.closed_forms.linear import critical_speed, growth_rate
from amoeboid.closed_forms.points import points
from amoeboid.config import Config, config_from_toml, config_to_toml, with_settings
from amoeboid.model.constitutive import NoDerivatives
from amoeboid.model.natural_units import in_units
from amoeboid.model.parameters import (
    DIMENSIONS,
    Parameters,
    parameters_from,
    parameters_from_toml,
    parameters_to_toml,
)
from amoeboid.model.polymerization import NAMED_LAWS, Custom, Exponential, Law
from amoeboid.model.stress import Stress
from amoeboid.numerics.branch_points import COMPLEX_STEP, Options
from amoeboid.numerics.continuation import follow
from amoeboid.surface.initial import sphere
from amoeboid.surface.stepping import semi_implicit_step
from amoeboid.validation import InvalidInput
from unit_systems import SI

HILL = "v_p0/(1 + (c/c_r)**n)"


@dataclass(frozen=True)
class Hill(Law):
    """A law with a third parameter, as a user writes it."""

    n: float = 3.0
    name = "hill"

    def value(self, c, v_p0, c_r):
        return v_p0 / (1 + (c / c_r) ** self.n)


def hill(c, v_p0, c_r, n=3.0):
    """The same as a Python function."""
    return v_p0 / (1 + (c / c_r) ** n)


def tabulated(c, v_p0, c_r):
    """A law that is measured: a table, without derivatives."""
    at = np.linspace(0, 30, 301)
    return v_p0 * np.interp(c / c_r, at, np.exp(-at))


def branching(c, v_p0, c_r):
    return v_p0 * np.where(c > c_r, np.exp(-c / c_r), 1.0)


@dataclass(frozen=True)
class Saturating(Stress):
    """A contractility that saturates."""

    chi: float = 0.2
    name = "saturating"

    def value(self, c, c_r):
        return self.chi * c / np.sqrt(1 + (c / c_r) ** 2)


def saturating(c, c_r, chi=0.2):
    return chi * c / np.sqrt(1 + (c / c_r) ** 2)


SATURATING = "chi*c/sqrt(1 + (c/c_r)**2)"


@pytest.mark.parametrize("law", [Hill(), hill, Custom(HILL, n=3), Custom(HILL, n=2.5), Hill(n=2.5)])
def test_every_way_to_write_a_law_has_the_same_values_and_derivatives(law):
    p = Parameters(law=law)
    n = p.value("law.n")
    plain = Parameters(law=HILL.replace("n", repr(n)))
    c = np.array([0.4, 1.0, 3.0])
    for found, expected in zip(p.v_p_derivatives(c, 5), plain.v_p_derivatives(c, 5), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-13)
    np.testing.assert_allclose(p.v_p(c), p.v_p_derivatives(c, 1)[0], rtol=1e-15)
    assert critical_speed(p) == pytest.approx(float(critical_speed(plain)), rel=1e-13)
    assert cubic_coefficient(p) == pytest.approx(float(cubic_coefficient(plain)), rel=1e-11)
    assert onset_speed(p) == pytest.approx(float(critical_speed(p)), rel=1e-9)


@pytest.mark.parametrize("stress", [Saturating(), saturating])
def test_every_way_to_write_a_stress_has_the_same_values_and_derivatives(stress):
    p = Parameters(stress=stress, alpha=0.1)
    text = parameters_from({"stress": SATURATING, "stress.chi": 0.2, "alpha": 0.1})
    c = np.array([0.4, 1.0, 3.0])
    for found, expected in zip(p.tau_derivatives(c, 5), text.tau_derivatives(c, 5), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-13)
    assert p.tau(c) == pytest.approx(-0.1 * c + 0.2 * c / np.hypot(1, c))
    assert critical_speed(p) == pytest.approx(float(critical_speed(text)), rel=1e-13)


def test_own_parameters_have_names_like_any_other():
    p = parameters_from({"law": HILL, "law.n": 3, "stress": "chi*c", "stress.chi": 0.1})
    assert p.names == (*DIMENSIONS, "law.n", "stress.chi")
    assert (p.value("law.n"), p.value("stress.chi"), p.value("D")) == (3.0, 0.1, 0.03)
    changed = p.replace(**{"law.n": 4, "D": 0.1})
    assert changed.value("law.n") == 4
    assert changed.stress == p.stress
    assert p.replace(law="v_p0/(1 + (c/c_r)**k)", **{"law.k": 2}).law.own == {"k": 2.0}
    assert p.as_dict()["law.n"] == 3.0
    assert parameters_from(dict(reversed(p.as_dict().items()))) == p
    with pytest.raises(InvalidInput, match=r"unknown parameter 'law.m';.* allowed: .*law.n"):
        p.value("law.m")


def test_what_is_written_reads_back_equal():
    for given in (
        {"law": HILL, "law.n": 3},
        {"stress": "chi*c/(1 + c/c_r)", "stress.chi": -0.5},
        {"stress": "saturating", "stress.chi": 0.3, "chi": 0.1},
    ):
        p = parameters_from(given)
        assert parameters_from_toml(parameters_to_toml(p)) == p
        config = Config(parameters=p)
        assert config_from_toml(config_to_toml(config)) == config
        assert pickle.loads(pickle.dumps(p)) == p  # noqa: S301


def test_a_law_of_a_user_is_written_once_it_has_a_word(monkeypatch):
    p = Parameters(law=Hill(n=2.5))
    assert pickle.loads(pickle.dumps(p)) == p  # noqa: S301
    with pytest.raises(InvalidInput, match="could not be read back"):
        parameters_to_toml(p)
    monkeypatch.setitem(NAMED_LAWS, "hill", Hill)
    assert parameters_from_toml(parameters_to_toml(p)) == p


def test_functions_pickle_and_are_not_written():
    p = Parameters(law=hill, stress=saturating)
    assert pickle.loads(pickle.dumps(p)) == p  # noqa: S301
    assert p.law.own == {"n": 3.0}
    assert p.replace(**{"law.n": 2.0}).law.own == {"n": 2.0}
    with pytest.raises(InvalidInput, match="a law that is written"):
        parameters_to_toml(p)


@pytest.mark.parametrize("order", [1, -1])
def test_settings_may_stand_in_any_order(order):
    given = [f"law={HILL}", "law.n=3", "stress=chi*c", "stress.chi=0.1", "parameters.D=0.1"]
    p = with_settings(Config(), given[::order]).parameters
    assert (p.law, p.stress.own, p.D) == (Custom(HILL, n=3), {"chi": 0.1}, 0.1)
    at = with_settings(Config(parameters=p), ["law.n=4"]).parameters
    assert at == p.replace(**{"law.n": 4})


MISTAKES = [
    ([f"law={HILL}"], "needs a value of 'n', got none"),
    (["law.n=3"], "'exponential' has no parameter 'n', it has none"),
    ([f"law={HILL}", "law.n=3", "law.m=3"], "has no parameter 'm', it has n"),
    ([f"law={HILL}", "law.n=x"], "law.n must be a finite number, got 'x'"),
    ([f"law={HILL}", "law.n=inf"], "law.n must be a finite number, got inf"),
    ([f"law={HILL}", "law.n=true"], "law.n must be a finite number, got True"),
    (["law=v_p0*exp(-c) + exp", "law.exp=1"], "'exp' is not allowed"),
    (["stress=chi*c"], "the stress 'chi*c' needs a value of 'chi'"),
    (["stress=chi", "stress.chi=1"], "stress must be one of none, saturating or an expression"),
    (["stress=v_p0*c"], "needs a value of 'v_p0'"),
    (["stress.chi=1"], "'none' has no parameter 'chi'"),
    (["stress=saturating", "stress.k=1"], "unknown parameter 'k' of the stress"),
    (["stres.chi=1"], "unknown section 'stres'"),
]


@pytest.mark.parametrize(("settings", "message"), MISTAKES)
def test_mistakes_say_what_is_wrong_and_how_to_give_it(settings, message, capsys):
    with pytest.raises(InvalidInput) as refusal:
        with_settings(Config(), settings)
    assert message in str(refusal.value)
    words = [word for setting in settings for word in ("--set", setting)]
    assert main(["theory", *words]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_the_command_line_takes_a_law_and_a_stress(capsys):
    words = ("--set", "law.n=3", "--set", f"law={HILL}", "--set", "stress=chi*c")
    assert main(["theory", *words, "--set", "stress.chi=0.1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    p = parameters_from({"law": HILL, "law.n": 3, "stress": "chi*c", "stress.chi": 0.1})
    assert found["parameters"] == p.as_dict()
    assert found["v_p_critical"] == float(critical_speed(p))


def test_a_branch_leaves_the_sphere_in_a_parameter_of_the_law():
    """Where it does so, the growth rate of linear theory is 0."""
    p = Parameters(law=Custom(HILL, n=3), v_p0=6.0, D=0.4)
    options = Options(parameter_scale=1.0)
    found = onsets(p, "law.n", 1.0, 4.0)
    assert found
    for n in found:
        assert growth_rate(p.replace(**{"law.n": n}), 1) == pytest.approx(0, abs=1e-9)
        start = branch_tangent(p, "law.n", n, options)
        first, second = islice(follow(start, options), 2)
        system = SteadySystem(p, mode_count(second.x), ("law.n",))
        assert second.parameter not in (n, first.parameter)
        residual = system.residual(second.x, np.array([second.parameter]))
        assert np.abs(residual).max() < 1e-8


@pytest.mark.slow
def test_a_branch_is_followed_in_a_parameter_of_the_law():
    p = Parameters(law=Custom(HILL, n=3), v_p0=6.0, D=0.4)
    found = amoeboid.branch(p, "law.n", 2.0, 3.2)
    assert found.complete
    assert np.max(found.max_retrograde_speed) > 0.1


@pytest.mark.parametrize("name", ["law.n", "stress.chi"])
def test_own_parameters_are_varied_in_the_complex_plane(name):
    """The complex step derivative of the residual agrees with a central difference."""
    p = parameters_from({"law": HILL, "law.n": 2.5, "stress": SATURATING, "stress.chi": 0.2})
    x = homogeneous(p, 8).x * (1 + 0.1 * np.cos(np.arange(27)))
    system, value, h = SteadySystem(p, 8, (name,)), p.value(name), 1e-6
    exact = system.residual(x, np.array([value + 1j * COMPLEX_STEP])).imag / COMPLEX_STEP
    ends = [system.residual(x, np.array([value + k * h])) for k in (-1, 1)]
    assert np.abs(exact).max() > 0
    np.testing.assert_allclose(exact, (ends[1] - ends[0]) / (2 * h), atol=1e-7)


def test_own_parameters_broadcast_in_the_theory():
    p = parameters_from({"law": HILL, "law.n": 3, "stress": "chi*c", "stress.chi": 0.1})
    many = points(p, **{"law.n": [2.0, 3.0], "stress.chi": [[0.1], [0.2], [0.3]]})
    assert many.shape == (3, 2)
    one = p.replace(**{"law.n": 2.0, "stress.chi": 0.3})
    assert critical_speed(many)[2, 0] == pytest.approx(float(critical_speed(one)), rel=1e-12)
    assert critical_speed(many.flat()[4]) == critical_speed(many)[2, 0]
    with pytest.raises(InvalidInput, match=r"law.n must be a finite number"):
        points(p, **{"law.n": [1.0, np.nan]})
    with pytest.raises(InvalidInput, match=r"must broadcast, got shapes .*law.n: \(3,\)"):
        points(p, **{"law.n": [1.0, 2.0, 3.0], "D": [0.1, 0.2]})


def test_laws_and_stresses_are_the_same_in_any_units():
    """Numbers in an expression and own parameters belong to its own units."""
    p = Parameters(law=Custom("v_p0*exp(-(c - 3)/n)", n=2), stress=Saturating(chi=0.3), alpha=0.05)
    q = in_units(p, SI)
    assert q.names == p.names
    c = np.array([0.5, 2.0, 5.0])
    speed, density, tension = (SI.of(d) for d in ("L/T", "N/L^2", "M/T^2"))
    for k in range(4):
        np.testing.assert_allclose(
            q.v_p_derivatives(c / density, 3)[k] * speed / density**k,
            p.v_p_derivatives(c, 3)[k],
            rtol=1e-12,
        )
        np.testing.assert_allclose(
            q.tau_derivatives(c / density, 3)[k] * tension / density**k,
            p.tau_derivatives(c, 3)[k],
            rtol=1e-12,
            atol=1e-15,
        )
    changes = {"law.n": 3.0, "stress.chi": 0.1}
    for exact, other in ((growth_rate(p, 1), growth_rate(q, 1)), (
        growth_rate(p.replace(**changes), 1), growth_rate(q.replace(**changes), 1)
    )):  # fmt: skip
        assert other / SI.time == pytest.approx(float(exact), rel=1e-11)
    assert critical_speed(q) * speed == pytest.approx(float(critical_speed(p)), rel=1e-11)


def test_declared_parameters_of_a_stress_are_given_in_physical_units():
    given = {"stress": "saturating", "stress.chi": "4e-20 Pa m^3"}
    cell = Parameters.physical(**given)
    opposite = Parameters.physical(alpha="4e-20 Pa m^3")
    assert cell.value("stress.chi") == pytest.approx(opposite.alpha, rel=1e-14)
    assert cell.quantities()["stress.chi"].to("Pa m^3").magnitude == pytest.approx(4e-20)
    at = {"law": HILL, "law.n": 3}
    assert Parameters.physical(**at).value("law.n") == 3
    with pytest.raises(InvalidInput, match=r"stress.chi must be a number in the units of the cell"):
        Parameters.physical(**{"stress": "chi*c", "stress.chi": "4e-20 Pa m^3"})
    with pytest.raises(InvalidInput, match=r"stress.chi must have the dimension"):
        Parameters.physical(**given | {"stress.chi": "1 m"})


def test_contractility_is_the_opposite_of_elastic_resistance():
    c = np.array([0.0, 1.0, 2.5])
    elastic = Parameters(alpha=0.3, chi=0.3)
    assert np.all(elastic.tau(c) == 0)
    assert growth_rate(elastic, 1) == growth_rate(Parameters(), 1)


@pytest.mark.parametrize("law", [tabulated, branching])
def test_a_law_without_derivatives_is_refused_where_they_are_needed(law):
    p = Parameters(law=law)
    with pytest.raises(NoDerivatives, match=f"the law '{law.__name__}' must have derivatives here"):
        critical_speed(p)
    with pytest.raises(InvalidInput, match=r"NumPy functions such as np.exp"):
        amoeboid.steady_states(p)


@pytest.mark.parametrize("law", [tabulated, branching])
def test_a_law_without_derivatives_runs_in_3d(law):
    p = Parameters(law=law, D=0.4, v_p0=6.0)
    smooth = Parameters(D=0.4, v_p0=6.0)
    runs = []
    for cell in (p, smooth):
        model, state = sphere(cell, 1)
        start = type(state)(0.0, state.r, 3 + state.r[:, 2], state.zeta0, state.position)
        runs.append((model, semi_implicit_step(model, (start,), 0.01)[0]))
    (model, found), (exact_model, expected) = runs
    assert np.abs(found.c - expected.c).max() < 2e-3
    # difference of two rates of 1.8; the mean slope at a point of the table is off by 0.17 %
    assert model.growth_rate == pytest.approx(exact_model.growth_rate, abs=4e-3)


def test_a_function_that_takes_no_arrays_is_refused_with_the_remedy():
    def stepwise(c, v_p0, c_r):
        return v_p0 if c < c_r else 0.0

    p = Parameters(law=stepwise)
    with pytest.raises(InvalidInput, match=r"must accept an array of concentrations, .*np.where"):
        p.v_p(np.array([0.5, 2.0]))
    with pytest.raises(InvalidInput, match="must take c, v_p0, c_r, got a function of c"):
        Parameters(law=lambda c: c)
    with pytest.raises(InvalidInput, match="must be one number for each c"):
        Parameters(law=lambda c, v_p0, c_r: np.ones(5)).v_p(np.ones(3))
    with pytest.raises(InvalidInput, match="needs a value of 'n'"):
        Parameters(law=lambda c, v_p0, c_r, n: c**n)


def test_values_are_real_floating_point_numbers():
    whole = Parameters(law=lambda c, v_p0, c_r: np.ones(np.shape(c), int))
    assert whole.v_p(np.ones(3)).dtype == float
    for order in (0, 1):
        with pytest.raises(InvalidInput, match="must be a real number, it is complex at c = 2"):
            Parameters(law=lambda c, v_p0, c_r: 1j * c).v_p_derivatives(2.0, order)
        with pytest.raises(InvalidInput, match="must be a real number, it is complex at c = 2"):
            Parameters(stress=lambda c, c_r: 1j * c).tau_derivatives(np.array([2.0, 3.0]), order)
    assert np.iscomplexobj(Parameters().v_p(1.0 + 1.0j))


def test_cells_of_impossible_units_are_refused():
    with pytest.raises(InvalidInput, match="must be within double precision"):
        Parameters.physical(R0="1e300 m")
    with pytest.raises(InvalidInput, match=r"start from Parameters\.physical"):
        Parameters(units=3)
    with pytest.raises(InvalidInput, match="'inverse' has no parameter 'n', it has none"):
        Parameters().replace(**{"law": "inverse", "law.n": 2})


def test_an_expression_is_parsed_once():
    from amoeboid.numerics.expressions import parsed

    parsed.cache_clear()
    p = Parameters(law=Custom("v_p0/(1 + (c/c_r)**n)", n=3))
    for _ in range(5):
        p.v_p(np.ones(3))
    assert parsed.cache_info().misses == 1


def test_a_law_of_the_default_is_that_of_the_paper():
    assert Parameters().law == Exponential()
    assert Parameters().stress.name == "none"
    assert not Parameters().has_isotropic_stress


@pytest.mark.parametrize("start", [0.0, 0.2, -0.2])
def test_onsets_in_a_parameter_of_the_stress_are_found_in_any_units(start):
    """From no stress too: the window is that of the cell. Towards contraction the sphere polarizes.

    lambda_1 = 0 at chi = 2 S/R0 (D/R0 + beta R0/2 + v_p'(c0) c0)/c0 for v_p0 = 3.
    """
    unit = SI.of("M L^2/(T^2 N)")
    exact = 4 / 3 * (0.53 - 9 * np.exp(-3))
    for sizes, chi in ((dict.fromkeys(DIMENSIONS, 1.0), 1.0), (
        {name: SI.of(dimension) for name, dimension in DIMENSIONS.items()}, unit
    )):  # fmt: skip
        values = {name: Parameters(v_p0=3.0).value(name) / size for name, size in sizes.items()}
        p = parameters_from(values | {"stress": "chi*c", "stress.chi": start / chi})
        found = onsets_anywhere(p, "stress.chi")
        # the window has the sign of the parameter
        assert np.multiply(found, chi) == pytest.approx([exact] if start >= 0 else [], rel=1e-9)

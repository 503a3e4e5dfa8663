import numpy as np
import pytest
from scipy.integrate import quad

from amoeboid.closed_forms.monomers import (
    ExponentialDecay,
    consumption,
    growth_speed,
    monomer_ratio,
    monomers,
    speed_at,
    speed_coefficients,
)
from amoeboid.validation import InvalidInput

DECAY = ExponentialDecay(B=1.7, C=0.6, mu_0=2.5)


def test_monomers_are_what_the_growth_has_left():
    for t in (0.3, 2.0, 9.0):
        grown, _ = quad(lambda s: float(growth_speed(DECAY, s)), 0, t)
        assert monomers(DECAY, t) == pytest.approx(2.5 - consumption(DECAY) * grown)


def test_all_monomers_are_used_up_in_the_end():
    assert monomers(DECAY, 1e3) == pytest.approx(0, abs=1e-12)


def test_speed_is_proportional_to_the_monomers_left():
    t = np.linspace(0, 5, 9)
    assert speed_at(DECAY, monomers(DECAY, t)) == pytest.approx(growth_speed(DECAY, t))


def test_speed_coefficients_reproduce_the_speed():
    h, c = 0.19, 560.0
    V_0, V_1 = speed_coefficients(DECAY, h, c)
    assert V_0 == 0
    mu = monomers(DECAY, 1.3)
    assert V_1 * monomer_ratio(mu, h, c) == pytest.approx(growth_speed(DECAY, 1.3))


@pytest.mark.parametrize("change", [{"B": 0.0}, {"C": -1.0}, {"mu_0": float("inf")}])
def test_bad_fit_is_refused(change):
    (name,) = change
    with pytest.raises(InvalidInput, match=f"{name} must be a finite number > 0"):
        ExponentialDecay(**change)


def test_bad_densities_are_refused():
    with pytest.raises(InvalidInput, match="c must be > 0, got 0"):
        monomer_ratio(1.0, 1.0, 0.0)
    with pytest.raises(InvalidInput, match="h must be > 0"):
        speed_coefficients(DECAY, 0.0, 1.0)

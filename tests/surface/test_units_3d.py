"""3D runs do not depend on the units of length, time, mass and number."""

from functools import cache

import numpy as np
import pytest

from amoeboid.config import Config, Initial, Mesh
from amoeboid.model.parameters import Parameters
from amoeboid.observables import OBSERVABLES, observed
from amoeboid.simulation.loop import evolve, start

# One simulation unit of length, time, mass and number of filaments in other units. All are far
# from powers of two, so that nothing agrees by chance of rounding.
UNITS = {
    "SI": (1.03e-5, 10.7, 2.9e-2, 1.37e5),
    "um, s": (10.3, 10.7, 2.9e4, 1.37e5),
    "nm, ms": (1.03e4, 1.07e4, 2.9e-5, 0.9),
    "mm, h": (1.03e-2, 2.97e-3, 2.9e7, 1.1e12),
    "km, ps": (1.03e-8, 1.07e13, 2.9e9, 1.37e-5),
}
DIMENSIONS = {
    "R0": "L", "delta_P": "M/LTT", "eta_s": "M/T", "eta_b": "M/T", "c0": "N/LL", "c_r": "N/LL",
    "beta": "/T", "D": "LL/T", "v_p0": "L/T", "alpha": "MLL/TTN",
}  # fmt: skip
OBSERVED = {
    "max_retrograde_speed": "L/T", "c_front": "N/LL", "c_rear": "N/LL", "zeta0": "M/TT",
    "filament_number": "N", "cortex_drag_speed": "L/T",
}  # fmt: skip
POINTS = {
    "figure 3D": Parameters(D=0.4, v_p0=6.0),
    "swept, soft, elastic": Parameters(D=0.02, v_p0=4.0, delta_P=30.0, alpha=0.05, eta_b=2.0),
    "no turnover": Parameters(D=0.1, v_p0=0.75, beta=0.0),
    "inverse": Parameters(D=0.1, v_p0=2.5, law="inverse"),
    "turns": Parameters(D=0.4, v_p0=8.0, delta_P=20.0),
}


def unit(dimension, units):
    """One simulation unit of a dimension such as "L/TT"."""
    sizes = dict(zip("LTMN", units, strict=True))
    above, _, below = dimension.partition("/")
    return np.prod([sizes[d] for d in above]) / np.prod([sizes[d] for d in below])


def converted(p, units):
    values = {name: getattr(p, name) * unit(of, units) for name, of in DIMENSIONS.items()}
    return Parameters(**values, law=p.law)


@cache
def run(point, units, subdivisions):
    """Steps of a run from a strong and lopsided polarization."""
    p = converted(POINTS[point], units)
    config = Config(
        parameters=p,
        mesh=Mesh(subdivisions=subdivisions),
        initial=Initial(
            perturbation=0.7 * p.c0, direction=(0.1, 0.2, 1.0), noise=0.01 * p.c0,
            harmonics=((2, 1, 0.1 * p.c0),),
        ),
    )  # fmt: skip
    first = start(config)
    return [first, *evolve(first, config.time)]


ONE = (1.0, 1.0, 1.0, 1.0)


# The same equations in numbers that are rounded otherwise: what is left is rounding, in a growth
# rate multiplied by what its difference quotients divide by.
ROUNDING, IN_RATES = 1e-9, 1e-6


@pytest.mark.parametrize("units", UNITS.values(), ids=list(UNITS))
@pytest.mark.parametrize(
    ("point", "subdivisions"),
    [
        ("figure 3D", 2),
        ("no turnover", 2),
        pytest.param("swept, soft, elastic", 2, marks=pytest.mark.slow),
        pytest.param("inverse", 2, marks=pytest.mark.slow),
        pytest.param("turns", 2, marks=pytest.mark.slow),
        pytest.param("figure 3D", 3, marks=pytest.mark.slow),
    ],
)
def test_runs_do_not_depend_on_the_units(point, subdivisions, units):
    reference, found = run(point, ONE, subdivisions), run(point, units, subdivisions)
    assert len(found) == len(reference)
    for a, b in zip(reference, found, strict=True):
        assert b.state.t / unit("T", units) == pytest.approx(a.state.t, rel=ROUNDING)
        assert np.abs(b.state.r / unit("L", units) - a.state.r).max() < ROUNDING
        c = b.state.c / unit("N/LL", units)
        assert np.abs(c - a.state.c).max() < ROUNDING * np.abs(a.state.c).max()
        assert (b.rejected, b.ended, b.rest is None) == (a.rejected, a.ended, a.rest is None)
    a, b = reference[-1], found[-1]
    assert a.ended == ("end of time" if point == "turns" else "steady")
    if point != "turns":
        assert b.growth * unit("T", units) == pytest.approx(a.growth, rel=IN_RATES)
        # made of what iterations leave, which is rounding amplified: up to 2 % between units
        assert b.growth_error * unit("T", units) == pytest.approx(a.growth_error, rel=0.05)
        assert b.stability == a.stability
    numbers = [name for name, known in OBSERVABLES.items() if not known.vector]
    before, after = (observed(s.cell, numbers) for s in (a, b))
    scale = {name: unit(OBSERVED.get(name, "/"), units) for name in before}
    # of what vanishes, rounding is in proportion to its unit
    least = {"area_error": 1e-6, "cortex_drag_speed": 1e-6}
    for name, value in before.items():
        tolerance = {"rel": IN_RATES, "abs": IN_RATES * least.get(name, 0.0)}
        assert after[name] / scale[name] == pytest.approx(value, **tolerance), name
    before, after = (observed(s.cell, ["cortex_drag_heading"]) for s in (a, b))
    for name, value in before.items():
        assert after[name] == pytest.approx(value, abs=IN_RATES), name

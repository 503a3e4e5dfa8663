"""Measurements as a cell of known parameters gives them: to plan an experiment, and for tests."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from amoeboid import display
from amoeboid.arrays import Array
from amoeboid.fitting.followed import FollowedState, polarized
from amoeboid.fitting.measurements import ANGLES, ERROR, THETA, dimension_of
from amoeboid.fitting.predictions import PROFILES, predicted
from amoeboid.model.parameters import Parameters, refuse_no_parameters
from amoeboid.model.units import NO_DIMENSION, customary_unit, measured
from amoeboid.studies.columns import physical_number, text
from amoeboid.studies.states import steady_states
from amoeboid.studies.theory import theory
from amoeboid.threads import one_thread
from amoeboid.validation import InvalidInput


def polarized_state(p: Parameters, names: tuple[str, ...]) -> FollowedState:
    """The fastest stable polarized state of a cell, to be followed as `names` change.

    Raises InvalidInput without one.
    """
    states = steady_states(p, (1,))
    for state in reversed(states.states):
        if polarized(state.solution) and state.stable:
            return FollowedState(p, names, np.zeros(len(names)), state.solution)
    threshold = theory(p).threshold
    known = "" if threshold is None else f" (threshold {display.shown(threshold)})"
    raise InvalidInput(
        f"the cell must have a stable polarized steady state, v_p0 = {text(p, p.v_p0, 'L/T')} has "
        f"none{known}; choose v_p0 slightly above the threshold"
    )


@one_thread
def synthetic(
    p: Parameters, errors: Mapping[str, Any], theta: Any = None, seed: int = 0
) -> dict[str, Array]:
    """Measured values of the stable polarized state of a cell, by the columns that `fit` takes.

    A profile has the shape (angles,), an observable (1,); units are in the names of the columns.

    `errors`: the standard deviation of the noise by quantity, "u", "c" or an observable, as a
    quantity such as "0.01 um/s" where the cell has units; `theta`: angles from the front in
    degrees, 5, 15, ... 175 if left out. The noise is normal, drawn with `seed`. Raises InvalidInput
    for other names, errors that are not > 0, and a cell without such a state.

    >>> import amoeboid as am
    >>> list(am.synthetic(am.Parameters(D=0.4, v_p0=6.0), {"u": 0.02, "zeta0": 1.0}))
    ['theta [deg]', 'u', 'u_error', 'zeta0', 'zeta0_error']
    """
    refuse_no_parameters(p)
    angles = np.arange(5.0, 176.0, 10.0) if theta is None else np.atleast_1d(theta).astype(float)
    if not (angles.size and np.all((angles >= 0) & (angles <= 180))):
        raise InvalidInput(f"theta must be angles from 0 to 180 deg, got {theta!r:.100}")
    state = polarized_state(p, ())
    generator = np.random.default_rng(seed)
    found: dict[str, Array] = {f"{THETA} [deg]": angles} if set(errors) & set(PROFILES) else {}
    for name, given in errors.items():
        dimension = dimension_of(name)
        error = _error(p, name, dimension, given)
        at = angles * ANGLES["deg"] if name in PROFILES else None
        exact = np.array(
            [physical_number(p, v, dimension) for v in predicted(state.solution, name, at)]
        )
        ending = (
            ""
            if p.units is None or dimension in NO_DIMENSION
            else f" [{customary_unit(str(dimension))}]"
        )
        found[f"{name}{ending}"] = exact + error * generator.standard_normal(exact.size)
        found[f"{name}{ERROR}{ending}"] = np.full(exact.size, error)
    return found


def _error(p: Parameters, name: str, dimension: str | None, given: Any) -> float:
    """An error in the unit that the values have. Raises InvalidInput."""
    if p.units is not None and dimension not in NO_DIMENSION:
        size = str(dimension)
        example = f"1 {customary_unit(size)}"
        error = measured(f"the error of {name}", given, size, example) / p.units.of(size)
        error = physical_number(p, error, dimension)
    elif isinstance(given, int | float) and not isinstance(given, bool):
        error = float(given)
    else:
        raise InvalidInput(f"the error of {name} must be a number > 0, got {given!r}")
    if not 0 < error < np.inf:
        raise InvalidInput(f"the error of {name} must be > 0, got {given!r}")
    return error

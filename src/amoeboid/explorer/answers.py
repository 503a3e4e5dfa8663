"""What a parameter point looks like, as messages to the page: theory, branch, steady states.

Numbers are in the units of the parameters; `None` stands for what is not known.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.progress import Watch
from amoeboid.axisymmetric.stability import AZIMUTHAL_NUMBERS
from amoeboid.axisymmetric.steady import homogeneous
from amoeboid.closed_forms.linear import finite_pressure_rates, growth_rate
from amoeboid.closed_forms.points import points as at_points
from amoeboid.explorer.along import curves, nearest_window, states_at
from amoeboid.explorer.words import verdict
from amoeboid.model.parameters import Parameters
from amoeboid.studies import observed
from amoeboid.studies.branch import Branch, branch
from amoeboid.studies.columns import ROUNDING, magnitude, quantity, shortened, text, unit
from amoeboid.studies.migration import migrate
from amoeboid.studies.states import SteadyState
from amoeboid.studies.theory import Theory, theory
from amoeboid.validation import InvalidInput

OBSERVED = (
    "max_retrograde_speed",
    "cortex_drag_speed",
    "polarity",
    "c_front",
    "c_rear",
    "zeta0",
    "deformation",
)
"""What the diagram can show over the parameter."""

ENVIRONMENTS = ("fluid", "matrix", "patch:30", "channel:30", "cortex")
"""Where the migration speed of a state is shown, as `migrate` takes them."""

Answer = dict[str, Any]
MAX_STEP = 0.3
POINTS = 61  # along a meridian
SPHERE_POINTS, SPHERE_TRIALS = 25, 1200
"""Where the sphere is drawn, and where its stability is looked at."""

MAX_KEPT = 48
DIGITS = 5  # of what the page draws
PROFILE_DIGITS = 4
"""Of the largest number of a profile or an outline; all its numbers end at the same digit."""


class Kept:
    """The results that were used last, and only so many."""

    def __init__(self, limit: int = MAX_KEPT) -> None:
        self._found: OrderedDict[Any, Any] = OrderedDict()
        self._limit = limit

    def get(self, key: Any, make: Callable[[], Any]) -> Any:
        """What is kept for a key, or what `make` makes of it now."""
        if key not in self._found:
            self._found[key] = make()
            while len(self._found) > self._limit:
                self._found.popitem(last=False)
        self._found.move_to_end(key)
        return self._found[key]

    def __len__(self) -> int:
        return len(self._found)


class Answers:
    """Answers to one parameter point after another; branches that were followed are kept.

    `points` is the number of points along a meridian, `window` that of the latest branch.
    """

    def __init__(self, points: int = POINTS) -> None:
        self._points, self.window = points, (0.0, 0.0)
        self.theories, self.branches, self.drawn, self.states = Kept(), Kept(), Kept(), Kept()

    def know(self, found: Iterable[Theory]) -> None:
        """Keep what the theory says about points, as if they had been asked for."""
        for one in found:
            self.theories.get((one.parameters, one.parameters.units), partial(_itself, one))

    def of(self, p: Parameters, name: str, watch: Watch) -> Iterator[Answer]:
        """Theory, branch in the parameter `name`, and states at the point, in this order.

        `watch` is called at every step of a computation, and may end it by an exception.
        """
        found = self.theories.get((p, p.units), lambda: theory(p))
        yield theory_answer(found)
        followed: Branch | None = None
        try:
            window = self.window = self._window(p, name, found)
            base = p.replace(v_p0=window[1]) if name == "v_p0" else p
            start, end = (quantity(p, value, p.dimension(name)) for value in window)
            followed = self.branches.get(
                (base, p.units, name, window),
                lambda: branch(base, name, start, end, max_step=MAX_STEP, watch=watch),
            )
        except InvalidInput as error:
            yield {"kind": "branch", "name": name, "curves": [], "problems": [str(error)]}
        else:
            yield self.drawn.get(
                (base, p.units, name, window), lambda: branch_answer(p, followed, window)
            )
        key = (p, p.units, name)
        yield self.states.get(key, lambda: states_answer(p, found, followed, self._points))

    @staticmethod
    def _window(p: Parameters, name: str, found: Theory) -> tuple[float, float]:
        """The window of a branch in the units of the solver. Raises InvalidInput."""
        if name == "v_p0":
            first = found.summary.first_mode
            ends = [float(x) for x in found.summary.thresholds.v_p0[:1]]
            threshold = ends[0] if ends else (first.v_p0 if first else None)
            return 0.0, nearest_window(p, threshold)
        value = p.value(name)
        if value <= 0:
            raise InvalidInput(f"{name} must be > 0 to follow a branch in it, got {value:g}")
        return 0.5 * value, 2.0 * value


def _itself(found: Theory) -> Theory:
    return found


def _shown(p: Parameters, values: Any, dimension: str | None) -> Any:
    """Numbers as the page shows them, with a few digits."""
    found = np.asarray(magnitude(p, np.asarray(values, dtype=float), dimension))
    flat = [float(f"{x:.{DIGITS}g}") for x in found.ravel()]
    return flat if found.ndim else flat[0]


def _drawn(p: Parameters, values: Array, dimension: str) -> list[float]:
    """Numbers along a curve, all to the digit that counts for the largest of them."""
    found = np.asarray(magnitude(p, np.asarray(values, dtype=float), dimension))
    largest = float(np.abs(found).max())
    decimals = PROFILE_DIGITS - 1 - math.floor(math.log10(largest)) if largest > 0 else 0
    return [float(v) + 0.0 for v in np.round(found, decimals)]


def theory_answer(found: Theory) -> Answer:
    """Thresholds, growth rates and what they mean."""
    p, s = found.parameters, found.summary
    rates = [
        {
            "l": l,
            "rate": _shown(p, rate, "1/T"),
            "slow": _shown(p, s.finite_pressure_rates[l][0].real, "1/T")
            if l in s.finite_pressure_rates
            else _shown(p, rate, "1/T"),
        }
        for l, rate in s.growth_rates.items()
    ]
    numbers = [
        {"name": name, "title": vars(Theory)[name].title, "text": found.text(name)}
        for name in ("threshold", "bifurcation", "max_retrograde_speed", "zeta0", "delta_P_star")
    ]
    return {
        "kind": "theory",
        "verdict": verdict(found),
        "notes": shortened(found.notes, 4, "notes", 300),
        "rates": rates,
        "rate_unit": unit(p, "1/T"),
        "numbers": numbers,
        "description": p.description,
    }


def branch_answer(p: Parameters, found: Branch, window: Sequence[float]) -> Answer:
    """Curves to draw, with folds, thresholds and the homogeneous sphere."""
    name, dimension = found.name, p.dimension(found.name)

    def numbers(state: Any) -> dict[str, float]:
        return {o: _shown(p, _number_of(state, o), observed.dimension(o)) for o in OBSERVED}

    return {
        "kind": "branch",
        "name": name,
        "unit": unit(p, dimension),
        "window": _shown(p, window, dimension),
        "observables": [{"name": o, "unit": unit(p, observed.dimension(o))} for o in OBSERVED],
        "curves": [
            {
                "stable": curve.stable,
                "x": _shown(p, curve.x, dimension),
                "y": {o: _shown(p, y, observed.dimension(o)) for o, y in curve.y.items()},
            }
            for curve in curves(found, OBSERVED)
        ],
        "sphere": _sphere(p, name, window, dimension),
        "folds": [
            {"x": _shown(p, f.number, dimension), "y": numbers(f.state)} for f in found.folds
        ],
        "bifurcations": [
            {"x": _shown(p, b.number, dimension), "y": numbers(b.state), "kind": b.kind, "m": b.m}
            for b in found.bifurcations
        ],
        "thresholds": _shown(p, np.array(found.origins), dimension),
        "complete": found.complete,
        "problems": shortened(found.problems, 3, "problems", 300),
        "text": repr(found).splitlines()[0],
    }


def _sphere(p: Parameters, name: str, window: Sequence[float], dimension: str | None) -> Answer:
    """The homogeneous sphere along the window: observables, and whether it is stable.

    Where its stability changes it has two points, one on each side.
    """
    trials = np.linspace(window[0], window[1], SPHERE_TRIALS)
    stable = sphere_is_stable(p, name, trials)
    changes = np.flatnonzero(stable[1:] != stable[:-1])
    even = np.linspace(0, SPHERE_TRIALS - 1, SPHERE_POINTS).astype(int)
    at = np.unique(np.concatenate([even, changes, changes + 1]))
    states = [SteadyState(homogeneous(p.replace(**{name: float(v)}))) for v in trials[at]]
    return {
        "x": _shown(p, trials[at], dimension),
        "stable": stable[at].tolist(),
        "y": {
            o: _shown(p, [_number_of(s, o) for s in states], observed.dimension(o))
            for o in OBSERVED
        },
    }


def sphere_is_stable(p: Parameters, name: str, values: Array) -> Array:
    """Whether the modes l = 1 to 6 of the sphere decay at values (N,) of a parameter; (N,)."""
    many = at_points(p, **{name: values[:, None]})
    slow = finite_pressure_rates(many, np.arange(2, 7))[..., 0]
    first = growth_rate(many, 1)[:, 0]
    return np.asarray((first < 0) & np.all(slow.real < 0, axis=1))


def states_answer(
    p: Parameters, found: Theory, followed: Branch | None, points: int = POINTS
) -> Answer:
    """The steady states at the point: shape, profiles, stability, speeds."""
    polarized: list[SteadyState] = []
    problems: list[str] = []
    if followed is not None:
        polarized, problems = states_at(followed, p.value(followed.name))
    rest = SteadyState(homogeneous(p))
    states = [rest, *polarized]
    return {
        "kind": "states",
        "states": [_state(p, state, rest is state, points) for state in states],
        "units": {o: unit(p, observed.dimension(o)) for o in OBSERVED}
        | {"c": unit(p, "N/L^2"), "u": unit(p, "L/T"), "r": unit(p, "L"), "rate": unit(p, "1/T")},
        "value": None if followed is None else _shown(
            p, p.value(followed.name), p.dimension(followed.name)
        ),
        "verdict": verdict(found, states),
        "problems": shortened(problems, 3, "problems", 300),
    }  # fmt: skip


def _state(p: Parameters, state: SteadyState, resting: bool, points: int) -> Answer:
    x = np.linspace(0.0, np.pi, points)
    r, z = state.solution.outline(points)
    z = z - _center(r, z)
    return {
        "rest": resting,
        "stable": state.stable,
        "unstable_modes": {str(m): count for m, count in state.unstable_modes.items()},
        "numbers": {o: _shown(p, _number_of(state, o), observed.dimension(o)) for o in OBSERVED},
        "texts": {o: text(p, _number_of(state, o), observed.dimension(o), ".4g") for o in OBSERVED},
        "r": _drawn(p, r, "L"),
        "z": _drawn(p, z, "L"),
        "c": _drawn(p, state.solution.concentration(x), "N/L^2"),
        "u": _drawn(p, state.solution.flow(x), "L/T"),
        "migration": {} if resting else _migration(p, state),
        "rates": [
            [float(f"{x:.{DIGITS}g}") for x in (rate.real, rate.imag)]
            for rate in (_number(state.growth_rates(m)[0]) for m in AZIMUTHAL_NUMBERS)
        ],
    }


def _number_of(state: Any, name: str) -> float:
    """An observable; 0 where it is rounding alone, as the speeds of a sphere at rest are."""
    p, value = state.parameters, float(state.number(name))
    scale = {"L/T": p.R0 * p.rate, "1": 1.0}.get(observed.dimension(name) or "", 0.0)
    return value if abs(value) > ROUNDING * scale else 0.0


def _number(found: Any) -> complex:
    return complex(getattr(found, "magnitude", found))


def _migration(p: Parameters, state: SteadyState) -> dict[str, float | None]:
    """Speeds towards the front in environments; None where the cell is not defined in one."""
    found: dict[str, float | None] = {}
    for name in ENVIRONMENTS:
        try:
            speed = migrate(state, name).motion.speed
        except InvalidInput:
            found[name] = None
        else:
            found[name] = _shown(p, speed, "L/T")
    return found


def _center(r: Array, z: Array) -> float:
    """z of the center of the volume inside an outline."""
    weight = (r[1:] ** 2 + r[1:] * r[:-1] + r[:-1] ** 2) * np.diff(z)
    return float((weight * 0.5 * (z[1:] + z[:-1])).sum() / weight.sum())

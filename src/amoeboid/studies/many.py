"""Steady polarized states of thousands of cells side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from numbers import Integral
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric import lanes
from amoeboid.axisymmetric.many import CONVERGED, REASONS, STATUSES, Found, solved
from amoeboid.axisymmetric.steady import SteadySolution
from amoeboid.axisymmetric.system import MAX_MODES, MODES
from amoeboid.closed_forms.points import Points, points
from amoeboid.display import html_table
from amoeboid.extras import needed
from amoeboid.model.parameters import Parameters
from amoeboid.observables import OBSERVABLES
from amoeboid.studies import observed
from amoeboid.studies.columns import TABLE
from amoeboid.studies.recorded import Recorded, single
from amoeboid.terminal import shown_line
from amoeboid.validation import InvalidInput, refuse_unknown

MANY_MODES = 64
"""The most modes of a state that are tried unless more are asked for."""
BATCH = 1000
"""Points that a sweep computes at a time, and keeps when all of them are done."""
AT_REST, POLARIZED = "sphere", "polarized"
SHOWN_AFTER = 2.0
"""Seconds before progress is shown."""
TOLD_EVERY = 100
"""States between two reports of the progress of an observable."""


@dataclass(frozen=True, eq=False, repr=False)
class ManySteadyStates:
    """The polarized steady state of every point of `points`, and of every other why there is none.

    `status` has the shape of the points: "converged", or why there is no state: "sphere" (the
    branch that leaves the sphere has no other state there), "stalled", "unresolved" (more modes are
    needed) or "undefined" (the law has no value there); `reason(index)` says it in words. Numbers
    are in the units of the parameters, NaN where there is no state: `found["c_rear"]`,
    `found["max_retrograde_speed"]`, every observable of docs/notation.md that such a state has.
    """

    points: Points
    found: Found

    @property
    def shape(self) -> tuple[int, ...]:
        """That of the points."""
        return self.points.shape

    @cached_property
    def status(self) -> Array:
        """One word for every point (points,)."""
        return np.array(STATUSES)[self.found.status].reshape(self.shape)

    @property
    def converged(self) -> Array:
        """Where there is a state (points,)."""
        return np.asarray(self.found.status == CONVERGED).reshape(self.shape)

    @property
    def modes(self) -> Array:
        """Number of modes of the series of each state (points,) [1]."""
        return self.found.n.reshape(self.shape)

    def reason(self, *index: int) -> str:
        """Why there is no state at the point `index`, in words; empty where there is one."""
        return self._reason(self._number(index))

    def state(self, *index: int) -> SteadySolution:
        """The state of the point `index`, as the axisymmetric solver gives it; see `converged`."""
        return self._state(self._number(index))

    def states(self) -> list[SteadySolution]:
        """The states of all points, one after the other."""
        return [self._state(k) for k in range(self.found.n.size)]

    def __getitem__(self, name: str) -> Array:
        """An observable at every point, NaN where there is no state. Raises InvalidInput."""
        self._measure(name)
        return self._known[name]

    def _measure(self, *names: str) -> None:
        """Evaluate these observables, each once, of all states."""
        refuse_unknown(names, OBSERVABLES, "observable")
        new = [name for name in names if name not in self._known]
        values = {name: np.full(self.found.n.size, np.nan) for name in new}
        cells = np.flatnonzero(self.found.status == CONVERGED) if new else np.zeros(0, dtype=int)
        with shown_line(SHOWN_AFTER) as show:
            for done, k in enumerate(cells.tolist()):
                if show is not None and done % TOLD_EVERY == 0:
                    show((f"{', '.join(new)}: {done} of {cells.size} states",))
                state = self._state(k)
                for name in new:
                    values[name][k] = getattr(state, name)
        self._known.update({name: column.reshape(self.shape) for name, column in values.items()})

    def to_xarray(self, *names: str) -> Any:
        """An xarray.Dataset of status, modes, parameters and the observables `names`, or four."""
        xarray = needed("xarray", TABLE)
        names = names or ("max_retrograde_speed", "c_front", "c_rear", "zeta0")
        self._measure(*names)
        axes = tuple(f"point_{k}" for k in range(len(self.shape)))
        columns = self.points.columns()
        varying = {k: v for k, v in columns.items() if np.ndim(v) and np.size(v) > 1}
        data = {name: (axes, self[name]) for name in names}
        data |= {"status": (axes, self.status), "modes": (axes, self.modes)}
        coordinates = {k: (axes, np.broadcast_to(v, self.shape)) for k, v in varying.items()}
        fixed = {k: float(np.ravel(v)[0]) for k, v in columns.items() if k not in varying}
        relations = {"law": self.points.law.name, "stress": self.points.stress.name}
        return xarray.Dataset(data, coordinates, attrs=fixed | relations)

    def _number(self, index: tuple[int, ...]) -> int:
        return int(np.ravel_multi_index(index, self.shape)) if self.shape else 0

    def _state(self, k: int) -> SteadySolution:
        good = bool(self.found.status[k] == CONVERGED)
        x, n = self.found.unknowns(k), int(self.found.n[k])
        return SteadySolution(self.points.parameters(k), n, x, good, (), self._reason(k))

    def _reason(self, k: int) -> str:
        return REASONS[self.found.status[k]].format(modes=self.found.n[k])

    @cached_property
    def _known(self) -> dict[str, Array]:
        return {}

    @property
    def _counts(self) -> list[tuple[str, int]]:
        counts = [(word, int(np.sum(self.found.status == k))) for k, word in enumerate(STATUSES)]
        return [(word, count) for word, count in counts if count]

    def __repr__(self) -> str:
        counts = ", ".join(f"{count} {word}" for word, count in self._counts)
        return f"ManySteadyStates({self.found.n.size} cells: {counts})"

    def _repr_html_(self) -> str:
        return html_table("Many steady states", [(word, f"{k} cells") for word, k in self._counts])


def many_steady_states(
    cells: Points | Sequence[Parameters],
    start: SteadySolution | None = None,
    *,
    modes: int = MODES,
    max_modes: int = MANY_MODES,
    chunk: int | None = None,
    progress: bool = True,
) -> ManySteadyStates:
    """The polarized steady state of every cell, computed side by side with JAX.

    `cells` are points, or parameters of one law and one stress; numbers are in the units of the
    first. The state is that on the branch of
    l = 1 that leaves the sphere at the lowest threshold as v_p0 grows, where it is past its folds:
    the fastest. A few cells are followed from there; the others start from the nearest of them, and
    are followed too if that fails. With `start` all start from that state, and are not followed.
    What it leaves out: stability, branches of higher modes, and polarized cells of a law or stress
    without a threshold in v_p0; `steady_states` has them.

    `modes` and `max_modes`: length of the series, doubled where it does not resolve the state.
    `chunk`: how many cells are computed at the same time. Raises InvalidInput without JAX, and for
    a law or a stress that is not made of arithmetic and functions of NumPy.

    As the solver of `sweep` it takes many points at a time (`polarized_states`).
    """
    table = cells if isinstance(cells, Points) else _points_of(cells)
    checked_lengths(modes, max_modes, chunk)
    guess = None
    if start is not None:
        guess = start.n, start.x
    with shown_line(SHOWN_AFTER) as show:

        def told(done: int, of: int) -> None:
            if progress and show is not None:
                show((f"steady states: {done} of {of}",))

        found = solved(table, guess, modes, max_modes, chunk, told)
    return ManySteadyStates(table, found)


def checked_lengths(modes: Any, max_modes: Any, chunk: Any = None) -> None:
    """Raise InvalidInput for lengths of a series, or a number of cells, that cannot be."""
    for name, value, low, high in (
        ("modes", modes, 8, MAX_MODES), ("max_modes", max_modes, modes, MAX_MODES),
        ("chunk", 1 if chunk is None else chunk, 1, 10**6),
    ):  # fmt: skip
        whole = isinstance(value, Integral) and not isinstance(value, bool)
        if not (whole and low <= value <= high):
            raise InvalidInput(
                f"{name} must be a whole number >= {low} and <= {high}, got {value!r:.100}"
            )


def _points_of(cells: Sequence[Parameters]) -> Points:
    """A list of parameters as points, in the units of the first.

    Raises InvalidInput if laws or stresses differ, and if some have units and others none.
    """
    if not cells or not all(isinstance(p, Parameters) for p in cells):
        raise InvalidInput(f"cells must be Points or a list of Parameters, got {cells!r:.200}")
    first = cells[0]
    if len({_relations(p) for p in cells}) > 1:
        raise InvalidInput(
            f"all cells must have the same law ({first.law.name!r}) and stress "
            f"({first.stress.name!r}), got others; compute each law separately"
        )
    if len({p.units is None for p in cells}) > 1:
        raise InvalidInput(
            "all cells must have physical units or none, got both; make them all with "
            "Parameters.physical, or none"
        )
    columns = {name: np.array([p.value_in(name, first.units) for p in cells])
               for name in first.names}  # fmt: skip
    return points(first, **columns)


def _relations(p: Parameters) -> tuple[Any, ...]:
    """Law and stress without the values of their own parameters, to be compared."""
    return tuple(
        relation.with_values(dict.fromkeys(relation.own, 0.0)) for relation in (p.law, p.stress)
    )


@dataclass(frozen=True, eq=False, repr=False)
class PolarizedState:
    """The fastest state of one cell; without a `solution` it is the sphere, and `problems` says so.

    The sphere has no entries but `state`: whether that is the answer, or the state was lost, is
    what the words are for.
    """

    parameters: Parameters
    solution: SteadySolution | None
    problems: tuple[str, ...] = ()

    def recorded(self) -> dict[str, Recorded]:
        """What sweeps record: polarized or sphere, the modes of the series, every observable."""
        state = self.solution
        word = AT_REST if state is None else POLARIZED
        values: dict[str, tuple[Any, str | None]] = {
            name: (
                None if state is None else observed.observed(state, name),
                observed.dimension(name),
            )
            for name in observed.names()
        }
        values["modes"] = (None if state is None else state.n, None)
        return {"state": Recorded(word, title="polarized or sphere")} | single(
            self.parameters, values
        )

    def __repr__(self) -> str:
        word = AT_REST if self.solution is None else POLARIZED
        return f"PolarizedState({word}; {self.parameters.description:.200})"


def polarized_states(cells: Sequence[Any], **options: Any) -> list[Any]:
    """An answer for every cell: a `PolarizedState`, or the InvalidInput that says why not.

    `options` are those of `many_steady_states`. Cells of several laws, stresses or units, with and
    without friction, are computed in turns. Raises InvalidInput without JAX.
    """
    lanes.jax()
    answers: list[Any] = [None] * len(cells)
    groups: dict[Any, list[int]] = {}
    for k, p in enumerate(cells):
        if not isinstance(p, Parameters):
            answers[k] = InvalidInput(f"many_steady_states takes Parameters, got {p!r:.100}")
            continue
        kind = (*_relations(p), repr(p.units), p.has_friction)
        groups.setdefault(kind, []).append(k)
    for places in groups.values():
        found = _answers([cells[k] for k in places], options)
        for k, answer in zip(places, found, strict=True):
            answers[k] = answer
    return answers


def _answers(cells: list[Parameters], options: dict[str, Any]) -> list[Any]:
    try:
        found = many_steady_states(cells, progress=False, **options)
    except InvalidInput as refused:
        return [refused] * len(cells)
    answers: list[Any] = []
    for k, p in enumerate(cells):
        if found.status[k] == "converged":
            answers.append(PolarizedState(p, found.state(k)))
        elif found.status[k] == "sphere":
            answers.append(PolarizedState(p, None, (found.reason(k),)))
        else:
            answers.append(InvalidInput(f"{found.status[k]}: {found.reason(k)}"))
    return answers


many_steady_states.batch = polarized_states  # type: ignore[attr-defined]  # what `sweep` calls
many_steady_states.batch_size = BATCH  # type: ignore[attr-defined]

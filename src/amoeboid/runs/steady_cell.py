"""Steady cells in 3D as users see them: straight, circling and helical ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from amoeboid.arrays import Array
from amoeboid.display import html_picture, html_table, shown
from amoeboid.forces import friction
from amoeboid.meshes.cells import InitialCell
from amoeboid.meshes.checks import placed
from amoeboid.meshes.connectivity import connectivity
from amoeboid.meshes.geometry import volume_centroid
from amoeboid.model.parameters import Parameters, refuse_no_parameters
from amoeboid.observables import cortex_drag_velocity, polarization
from amoeboid.runs.meshes import Icosphere
from amoeboid.runs.snapshot import SHOWN, Snapshot
from amoeboid.studies import observed
from amoeboid.studies.columns import physical_number, quantity, text
from amoeboid.studies.recorded import Recorded, single, title
from amoeboid.studies.states import SteadyState, steady_states
from amoeboid.surface.model import Model
from amoeboid.surface.relative_equilibrium import Moving
from amoeboid.surface.rigid import rotation, turns
from amoeboid.surface.stability import MAX_ERROR, Growth, leading_mode
from amoeboid.surface.state import State
from amoeboid.surface.steadiness import SLOW_ROTATION
from amoeboid.surface.steady import Found, NotSteady, steady_cell
from amoeboid.threads import one_thread
from amoeboid.validation import InvalidInput

# A cell that is less polar than this share of its start is another one.
MIN_KEPT = 0.1
# A path that turns climbs if its pitch angle is larger than this.
MIN_CLIMB = 1e-2

PATH = {"turning": "1/T", "radius_of_curvature": "L", "torsion": "1/L"}
PATH |= {"growth_rate": "1/T", "frequency": "1/T"}
"""Numbers of a steady cell beside its observables, with their dimensions."""


@dataclass(frozen=True, eq=False, repr=False)
class SteadyCell(Snapshot):
    """A cell that moves on forever without a change: straight, on a circle or on a helix.

    A `Snapshot` with all its fields and observables, and in addition its path and its stability.
    Whether it is stable is found when it is first asked for. `iterations`: how many led to it;
    `residual`: the largest rate of change of shape and concentration that is left, in units of the
    rate, relative to R0 and c0 + c.
    """

    iterations: int
    residual: float

    @cached_property
    def plain_velocity(self) -> Array:
        """`velocity` (3,) in the units of the solver."""
        if self.parameters.has_friction:
            return friction.velocity(self.cell)
        return cortex_drag_velocity(self.cell)

    @property
    def plain_angular_velocity(self) -> Array:
        """`angular_velocity` (3,) in the units of the solver."""
        assert self.state.angular_velocity is not None  # noqa: S101
        return self.state.angular_velocity

    @property
    def velocity(self) -> Any:
        """Velocity (3,) of the center of volume [L/T].

        With friction that of the force balance, else as if all drag were on the cortex, uniformly.
        """
        return quantity(self.parameters, self.plain_velocity, "L/T")

    @property
    def angular_velocity(self) -> Any:
        """Angular velocity (3,) with which the cell rotates [1/T]."""
        return quantity(self.parameters, self.plain_angular_velocity, "1/T")

    @property
    def _turning(self) -> float:
        speed = float(np.linalg.norm(self.plain_velocity))
        across = np.cross(self.plain_angular_velocity, self.plain_velocity)
        return float(np.linalg.norm(across)) / speed if speed > 0.0 else 0.0

    @property
    def turning(self) -> Any:
        """How fast the direction of motion changes [1/T]."""
        return quantity(self.parameters, self._turning, "1/T")

    @property
    def radius_of_curvature(self) -> Any:
        """Radius of curvature of the path [L], infinite for a straight one."""
        return quantity(self.parameters, self.number("radius_of_curvature"), "L")

    @property
    def torsion(self) -> Any:
        """Torsion of the path [1/L]: 0 for a circle, positive for a right-handed helix."""
        return quantity(self.parameters, self.number("torsion"), "1/L")

    @property
    def _turns(self) -> bool:
        across = np.array([self._turning, 0.0, 0.0])
        return turns(self.model, across)

    @property
    def path(self) -> str:
        """What the path is: "straight", "circle" or "helix".

        Straight if it turns no faster than the mesh may turn it, by up to 10/nodes of the rate:
        circles as wide as that cannot be told from straight paths on this mesh.
        """
        if not self._turns:
            return "straight"
        climb = abs(float(self.plain_angular_velocity @ self.plain_velocity))
        sizes = np.linalg.norm(self.plain_angular_velocity) * np.linalg.norm(self.plain_velocity)
        return "helix" if climb > MIN_CLIMB * sizes else "circle"

    @cached_property
    def _growth(self) -> Growth:
        return self.growth(MAX_ERROR)[0]

    @one_thread
    def growth(self, max_error: float) -> tuple[Growth, NDArray[np.complex128] | None]:
        """The fastest perturbation: growth rate, to `max_error` in units of the rate, and itself.

        In plain numbers: a mode (2V,) holds c'/(c0 + c) and h/R0 at the nodes.
        """
        x = self.state.r - volume_centroid(self.state.r, self.cell.faces)
        turning = self.plain_angular_velocity
        v_c = self.flow.v_c - rotation(turning, x)
        relative = replace(self.flow, v_c=v_c)
        return leading_mode(self.model, self.state, relative, max_error=max_error, turning=turning)

    @property
    def growth_rate(self) -> Any:
        """Growth rate of the fastest perturbation [1/T]; None if it could not be found."""
        rate = self._growth.rate
        return None if rate is None else quantity(self.parameters, rate, "1/T")

    @property
    def frequency(self) -> Any:
        """Angular frequency [1/T] with which the fastest perturbation oscillates, 0 if it does not.

        Seen from the cell, which turns; None if the perturbation could not be found.
        """
        known = self._growth.rate is not None
        return quantity(self.parameters, self._growth.frequency, "1/T") if known else None

    @property
    def growth_rate_error(self) -> Any:
        """Error of `growth_rate` [1/T], without that of the mesh."""
        return quantity(self.parameters, self._growth.error, "1/T")

    @property
    def stability(self) -> str:
        """ "stable" or "unstable", or "unknown": `stability_problem` says why."""
        if self.stability_problem:
            return "unknown"
        return "stable" if (self._growth.rate or 0.0) < 0.0 else "unstable"

    @property
    def stability_problem(self) -> str:
        """Why it is not known whether the cell is stable; empty if it is."""
        found = self._growth
        if found.rate is None:
            return found.problem
        if abs(found.rate) <= found.error:
            rate, error = (
                text(self.parameters, number, "1/T", form)
                for number, form in ((found.rate, ".3g"), (found.error, ".2g"))
            )
            return (
                f"the growth rate of the fastest perturbation, {rate}, is known only to +- {error}"
            )
        return ""

    @property
    def stable(self) -> bool:
        """Whether every perturbation is known to decay."""
        return self.stability == "stable"

    @property
    def known_stability(self) -> str | None:
        """`stability` if it was asked for before, else None."""
        return self.stability if "_growth" in self.__dict__ else None

    def __getstate__(self) -> dict[str, Any]:
        """The cell, and its growth rate if that was asked for, which takes longest."""
        known = {name: self.__dict__[name] for name in ("_growth",) if name in self.__dict__}
        return {**super().__getstate__(), **known}

    def recorded(self) -> dict[str, Recorded]:
        """What sweeps record: the observables, the path and the stability."""
        numbers: dict[str, tuple[Any, str | None]] = {
            "turning": (self._turning, "1/T"),
            "radius_of_curvature": (self.number("radius_of_curvature"), "L"),
            "torsion": (self.number("torsion"), "1/L"),
            "growth_rate": (self._growth.rate, "1/T"),
            "growth_rate_error": (self._growth.error, "1/T"),
            "residual": (self.residual, None),
        }
        words = {"path": self.path, "stability": self.stability}
        found = super().recorded() | single(self.parameters, numbers)
        return found | {name: Recorded(word, title=title(name)) for name, word in words.items()}

    def number(self, name: str) -> float:
        """The observable `name`, or a number of `PATH`, as a plain number in the solver's units."""
        if name in ("growth_rate", "frequency"):
            known = self._growth.rate
            if known is None:
                return float("nan")
            return known if name == "growth_rate" else self._growth.frequency
        if name == "turning":
            return self._turning
        v, omega = self.plain_velocity, self.plain_angular_velocity
        if name == "radius_of_curvature":
            return float(np.linalg.norm(v)) / self._turning if self._turns else np.inf
        if name == "torsion":
            return float(omega @ v) / float(v @ v) if self._turns else 0.0
        return observed.of_cell(self.cell, name)

    def plain(self, names: Sequence[str] = SHOWN) -> dict[str, float]:
        """The observables `names` as programs read them, in the units that texts show."""
        p = self.parameters
        return {n: physical_number(p, self.number(n), observed.dimension(n)) for n in names}

    def text(self, name: str) -> str:
        """The observable `name` with its unit, if the cell has physical ones."""
        return text(self.parameters, self.number(name), observed.dimension(name))

    def _way(self) -> list[tuple[str, Any]]:
        rows: list[tuple[str, Any]] = [("path", self.path)]
        if self._turns:
            names = ("turning", "radius_of_curvature", "torsion")
            rows += [(name, getattr(self, name)) for name in names]
        return rows

    def __repr__(self) -> str:
        rows = [*self._rows()[:3], *self._way()[1:3]]
        values = ", ".join(f"{name} = {shown(value)}" for name, value in rows)
        how = f"{self.iterations} iterations"
        return f"SteadyCell({self.path}, {len(self.state.r)} nodes, {values}; {how})"

    def _repr_html_(self) -> str:
        rows = [*self._rows(), *self._way(), ("stability", self.stability)]
        rows += [("growth_rate", self.growth_rate), ("iterations", self.iterations)]
        notes = [self.stability_problem] if self.stability_problem else []
        heading = f"Steady cell, {len(self.state.r)} nodes"
        return html_table(heading, rows, notes=notes) + html_picture(self, "runs.draw_cell")


@one_thread
def steady_state(p: Parameters, *, mesh: Any = None, start: Any = None) -> SteadyCell:
    """The steady cell in 3D near a start, solved for by accelerated iterations.

    `start`: where the iterations begin: a steady cell of other parameters, the `final` of a
    solution, a frame, an axisymmetric steady state, or an `InitialCell`; None: the fastest
    axisymmetric state, a stable one if there is one. An axisymmetric one is laid on `mesh`,
    `Icosphere(n)` (3 if left out), the others have their own. From a cell on a circle or a helix
    it finds such a cell, with its velocity and angular velocity. Unstable cells are found, too.
    Without turnover the filament number is c0 A0, that of the sphere, whatever the start has. The
    cue that acts on a start from a run acts on the cell, too, in the direction that it has there.

    Raises InvalidInput where the iterations lead to no steady cell, or from a polarized cell to
    the homogeneous one: a nearer start is needed then.

    >>> import amoeboid as am
    >>> p = am.Parameters(D=0.4, v_p0=6.0)
    >>> cell = am.steady_state(p, mesh=am.Icosphere(2))
    >>> cell.path, cell.stability, round(cell.max_retrograde_speed, 3)
    ('straight', 'stable', 1.818)
    """
    refuse_no_parameters(p)
    model, guess = started(p, mesh, start)
    try:
        return shown_cell(found_from(model, guess))
    except NotSteady as error:
        raise InvalidInput(
            f"the start must be near a steady cell, and this one is not: {error}; start from a "
            "steady cell at closer parameters, or from the end of a run"
        ) from None


def shown_cell(found: Found) -> SteadyCell:
    """A steady cell of the solver as users see it."""
    return SteadyCell(found.model, found.state, found.flow, found.iterations, found.rate)


def found_from(model: Model, guess: Moving, q: float = 0.0) -> Found:
    """The steady cell near a guess, polarized if that is. Raises NotSteady."""
    found = steady_cell(model, guess, q)
    before = replace(found, cell=guess)
    kept, had = (float(np.linalg.norm(polarization(one.seen))) for one in (found, before))
    if kept < MIN_KEPT * had and had > MIN_KEPT**2:
        raise NotSteady(
            f"a cell of polarity {had:.3g} led to one of {kept:.1g}, the homogeneous cell"
        )
    return found


def started(p: Parameters, mesh: Any, start: Any, argument: str = "start") -> tuple[Model, Moving]:
    """The model with parameters p on the mesh of a start, and the start in its frame.

    `argument`: what users call the start.

    Raises InvalidInput for a value that is not a start, and for a mesh beside a start that has one.
    """
    if start is None:
        start = _known(p)
    state, flow = getattr(start, "state", None), getattr(start, "flow", None)
    if isinstance(state, State) and flow is not None:  # a snapshot of any kind
        refuse_mesh(mesh, argument)
        old, faces = start.model, start.model.mesh.faces
        model = Model(p, old.mesh, old.edge_length, t=old.t, cue=old.cue, solvers=old.solvers)
        omega = np.zeros(3) if state.angular_velocity is None else state.angular_velocity
        if np.linalg.norm(omega) < SLOW_ROTATION * model.rate and not isinstance(start, SteadyCell):
            omega = np.zeros(3)  # of a straight cell it is an error of the mesh
        x = state.r - volume_centroid(state.r, faces)
        v_c = flow.v_c - rotation(omega, x)
        r = placed(state.r, faces, model.A0)
        return model, Moving(r, state.c, state.zeta0, v_c, omega)
    if isinstance(start, InitialCell):
        refuse_mesh(mesh, argument)
    elif callable(getattr(start, "as_initial", None)):
        start = start.as_initial(Icosphere() if mesh is None else mesh)
    else:
        raise InvalidInput(
            f"{argument} must be a steady cell, a snapshot such as the final of a solution, an "
            f"axisymmetric steady state or an InitialCell, got {start!r}"
        )
    finite = all(np.isfinite(x).all() for x in (start.r, start.c, start.zeta0))
    if not (finite and start.c.min() >= 0.0 and start.c.max() > 0.0):
        raise InvalidInput(
            f"{argument} must have finite numbers and a concentration >= 0, not 0 everywhere, got "
            f"{start!r}"
        )
    model = Model(p, connectivity(start.faces))
    r = placed(start.r, start.faces, model.A0)
    return model, Moving(r, start.c, start.zeta0, np.zeros_like(r), np.zeros(3))


def _known(p: Parameters) -> SteadyState:
    """The fastest axisymmetric state, a stable one if there is one.

    Raises InvalidInput if that is the sphere only because others have not been found.
    """
    known = steady_states(p, (1,))
    found = next((state for state in reversed(known) if state.stable), known[-1])
    if known.problems and not any(state.number("polarity") > MIN_KEPT**2 for state in known):
        raise InvalidInput(
            "a start is needed because no polarized axisymmetric state was found: "
            f"{known.problems[0]}; give the end of a run"
        )
    return found


def refuse_mesh(mesh: Any, argument: str) -> None:
    """Raise InvalidInput for a mesh beside a start that has one."""
    if mesh is not None:
        raise InvalidInput(f"mesh must be left out when {argument} has its own mesh, got {mesh!r}")

"""The path of a cell in the environment of a run: columns of its time series.

The axes of a run follow the cell, up to a rotation that its surroundings decide. They rotate and
move in the laboratory so that force and torque on the cell vanish. Position and rotation are
integrated from row to row with the trapezoidal rule, of second order in time, from the numbers in
the row before alone: a run that is resumed continues with the same bits.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence

import numpy as np

from amoeboid.arrays import Array
from amoeboid.forces import friction
from amoeboid.meshes.geometry import geometry
from amoeboid.motility.balance import motion
from amoeboid.motility.cells import surface_of_mesh
from amoeboid.motility.environments import CortexDrag, Environment
from amoeboid.observables import MIN_SPEED_WITH_HEADING
from amoeboid.simulation.rows import Row
from amoeboid.simulation.step import Step
from amoeboid.surface.rigid import angular_velocity, rotated
from amoeboid.validation import InvalidInput

VECTORS = {
    "migration": "L",
    "migration_heading": "1",
    "migration_turning": "1/T",
    "migration_axes": "1",
    "migration_axes_turning": "1/T",
}
"""Vectors of the path: position and heading of the cell, its angular velocity, and as a rotation
vector the rotation of the axes of the run, all in the axes of the laboratory; the angular velocity
of the axes of the run, in themselves."""

SPEED = "migration_speed"


class OwnFriction(Environment):
    """The friction of the cell itself, gamma_t, gamma_n and gamma_c.

    The force balance decides how the cell moves and rotates in its surroundings, whose axes are
    those of the run.
    """

    name = "friction of the cell"


def names(vector: str) -> list[str]:
    """The columns of a vector."""
    return [f"{vector}_{axis}" for axis in "xyz"]


MIGRATION = tuple(names("migration"))
PATH_UNITS: dict[str, str | None] = {
    SPEED: "L/T",
    **{name: dimension for vector, dimension in VECTORS.items() for name in names(vector)},
}
"""The columns of a path and their dimensions."""


def recorded(environment: Environment) -> bool:
    """Whether a run has columns of its own for the path in an environment.

    The path with all drag on the cortex is in every run, as `cortex_drag_x` and so on.
    """
    return not (isinstance(environment, CortexDrag) and environment.coupled == 1.0)


def path_values(step: Step, environment: Environment, before: Mapping[str, float] | None) -> Row:
    """The columns of a step, with the row before it; None for the first one.

    Raises InvalidInput for an environment that nothing in it resists.
    """
    turning = _turning(step)
    relative, angular_velocity = _moving(step, environment, turning)
    axes_turning = angular_velocity - turning
    position, axes = advanced(before, step.state.t, relative, axes_turning)
    velocity = axes @ relative
    speed = float(np.linalg.norm(velocity))
    least = MIN_SPEED_WITH_HEADING * step.model.rate * step.model.parameters.R0
    moves = speed > least
    vectors = {
        "migration": position,
        "migration_heading": velocity / speed if moves else np.zeros(3),
        "migration_turning": axes @ angular_velocity,
        "migration_axes": rotation_vector(axes),
        "migration_axes_turning": axes_turning,
    }
    return path_row(speed if moves else 0.0, vectors)


def _moving(step: Step, environment: Environment, turning: Array) -> tuple[Array, Array]:
    """Velocity (3,) and angular velocity (3,) of the cell in the axes of the run."""
    if isinstance(environment, OwnFriction):
        return friction.velocity(step.cell), turning
    found = motion(surface_of_mesh(step.cell, turning), environment)
    return found.velocity, found.angular_velocity


def path_row(speed: float, vectors: Mapping[str, Array]) -> Row:
    """The columns of a path from its speed and the vectors of `VECTORS`."""
    row: Row = {SPEED: speed}
    for name, values in vectors.items():
        row |= dict(zip(names(name), map(float, values), strict=True))
    return row


def advanced(
    before: Mapping[str, float] | None, t: float, velocity: Array, axes_turning: Array
) -> tuple[Array, Array]:
    """Position (3,) in the laboratory and axes (3, 3) of the run, in columns, at a time t.

    From the row before and the present `velocity` and `axes_turning` (3,), in the axes of the run.
    """
    if before is None:
        return np.zeros(3), np.eye(3)
    half = 0.5 * (t - before["t"])
    earlier = _vector(before, "migration_axes_turning")
    axes = rotation_of(_vector(before, "migration_axes"))
    axes = axes @ rotation_of(half * (earlier + axes_turning))
    moved = before[SPEED] * _vector(before, "migration_heading") + axes @ velocity
    return _vector(before, "migration") + half * moved, axes


class RecordedPath:
    """The path that the rows of a run record, at any time up to their last.

    Between rows the velocities, in the axes of the run, are linear in time, and are integrated by
    the rule that made the rows: of second order, and at a row that row.
    """

    def __init__(self, rows: Sequence[Row]) -> None:
        self._rows = [row for row in rows if PATH_UNITS.keys() <= row.keys()]
        self._times = [row["t"] for row in self._rows]

    def at(self, t: float) -> tuple[Array, Array]:
        """Position (3,) in the laboratory [L], and axes (3, 3) of the run, in columns.

        Raises InvalidInput for a time that the rows do not reach.
        """
        if not self._times or not self._times[0] <= t <= self._times[-1]:
            reach = f"t = {self._times[-1]:g}" if self._times else "no time"
            raise InvalidInput(
                f"the time series must record the path up to t = {t:g}, it reaches {reach} (in "
                "numbers of the solver); choose earlier frames, or keep the cell in the center "
                "(--follow)"
            )
        here = bisect_right(self._times, t) - 1
        before, after = self._rows[here], self._rows[min(here + 1, len(self._rows) - 1)]
        if before["t"] == t:
            return _vector(before, "migration"), rotation_of(_vector(before, "migration_axes"))
        share = (t - before["t"]) / (after["t"] - before["t"])
        mean = [
            (1.0 - share) * a + share * b
            for a, b in zip(_motion(before), _motion(after), strict=True)
        ]
        return advanced(before, t, *mean)


def _motion(row: Row) -> tuple[Array, Array]:
    """Velocity (3,), and angular velocity (3,) of the axes of the run, in these axes."""
    velocity = row[SPEED] * _vector(row, "migration_heading")
    axes = rotation_of(_vector(row, "migration_axes"))
    return axes.T @ velocity, _vector(row, "migration_axes_turning")


def _turning(step: Step) -> Array:
    """Angular velocity (3,) of the shape in the axes of the run [1/T]."""
    state, model = step.state, step.model
    if state.angular_velocity is not None:
        return state.angular_velocity
    g = geometry(state.r, model.mesh.faces)
    return angular_velocity(model, state.r, state.c, g, step.flow.v)


def _vector(row: Mapping[str, float], name: str) -> Array:
    return np.array([row[column] for column in names(name)])


def rotation_of(vector: Array) -> Array:
    """The matrix (3, 3) of the rotation around a vector (3,) by its length [rad]."""
    return np.asarray(rotated(np.eye(3), vector, 1.0).T)


def rotation_vector(matrix: Array) -> Array:
    """The vector (3,) of a rotation, of a length from 0 to pi."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(matrix).as_rotvec())

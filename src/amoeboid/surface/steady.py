"""Steady cells on a mesh, solved for by accelerated iterations, without a run.

The fixed points of `relative_equilibrium.ImplicitMap` are found with Anderson acceleration. Along a
branch the parameter q joins the unknowns x, and a plane is given that holds (x, q):
pseudo-arclength (H. B. Keller, in *Applications of Bifurcation Theory*, 1977). Whether a cell is
stable plays no part in it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from amoeboid.arrays import Array
from amoeboid.meshes.geometry import MIN_QUALITY, geometry, mesh_quality, volume_centroid
from amoeboid.meshes.intersections import embedded
from amoeboid.numerics.acceleration import Acceleration
from amoeboid.numerics.sparse import SingularMatrix
from amoeboid.surface.cell import SurfaceCell
from amoeboid.surface.model import Model
from amoeboid.surface.relative_equilibrium import ImplicitMap, Moving
from amoeboid.surface.rigid import rotation
from amoeboid.surface.state import Flow, State
from amoeboid.surface.stepping import StepFailed
from amoeboid.validation import InvalidInput

# Length of the implicit step in units of 1/model.rate, and the number of iterations that are
# combined. With steps from 0.3 to 1 the iteration converges equally well.
STEP, DEPTH = 0.5, 16
# The iteration has converged when it changes no unknown by more than this, and tension, angular
# velocity and flow by no more than CARRIED times that.
TOLERANCE, CARRIED = 1e-8, 100.0
# Iterations around one base, and bases that are tried in turn, each where the last one led.
MAX_ITERATIONS, MAX_BASES = 80, 3
# A larger change of an unknown by one iteration is no approach to a steady cell.
MAX_CHANGE = 10.0


class NotSteady(ArithmeticError):
    """No steady cell was found near the guess; the message says why."""


@dataclass(frozen=True, eq=False, repr=False)
class Found:
    """A steady cell, its model, and how it was found.

    `change`: by how much the last iteration changed an unknown at most; `q`: the value of the
    parameter that is followed.
    """

    model: Model
    cell: Moving
    iterations: int
    change: float
    q: float = 0.0

    def __repr__(self) -> str:
        return f"Found({len(self.cell.c)} nodes, q = {self.q:.6g}, {self.iterations} iterations)"

    @property
    def rate(self) -> float:
        """The largest rate of change of an unknown, in units of model.rate."""
        return self.change / STEP

    @cached_property
    def flow(self) -> Flow:
        """The flow in axes that do not rotate, as a run gives it."""
        cell, faces = self.cell, self.model.mesh.faces
        g = geometry(cell.r, faces)
        v_p = self.model.v_p(cell.r, cell.c)[:, None] * g.normals
        x = cell.r - volume_centroid(cell.r, faces)
        v_c = cell.v_c + rotation(cell.angular_velocity, x)
        return Flow(v_c, v_p, cell.zeta0, g.normals, g.node_areas)

    @property
    def state(self) -> State:
        """The state at t = 0, at the origin."""
        cell = self.cell
        return State(0.0, cell.r, cell.c, cell.zeta0, np.zeros(3), cell.angular_velocity)

    @cached_property
    def seen(self) -> SurfaceCell:
        """The cell as observables see it."""
        return SurfaceCell(self.model, self.state, self.flow)


@dataclass(frozen=True, eq=False)
class Plane:
    """Where a cell of a branch is sought: <x - `x`, `along`>/len(x) + (q - `q`) `slope` = 0.

    q in units of the `scale` of its branch; the direction (along, slope) has unit length.
    """

    x: Array
    q: float
    along: Array
    slope: float

    def distance(self, x: Array, q: float) -> float:
        """The distance of (x, q) from the plane."""
        return float((x - self.x) @ self.along / len(x) + (q - self.q) * self.slope)


def around(model: Model, base: Moving) -> ImplicitMap:
    """The iteration around a cell. Raises NotSteady."""
    try:
        return ImplicitMap(model, base, STEP / model.rate)
    except (StepFailed, SingularMatrix, InvalidInput, np.linalg.LinAlgError) as error:
        raise NotSteady(str(error)) from None


def steady_cell(model: Model, guess: Moving, q: float = 0.0) -> Found:
    """The steady cell near a guess. Raises NotSteady.

    Where the iteration does not converge, it starts anew around the cell that it has reached.
    """
    total = 0
    for _ in range(MAX_BASES):
        iteration = around(model, guess)
        found = iterated(iteration, iteration.vector(guess), q)
        total += found.iterations
        if found.change <= TOLERANCE:
            return checked(replace(found, iterations=total))
        guess = found.cell
    raise NotSteady(
        f"the iteration does not converge: iteration {total + 1} still changes the cell by "
        f"{found.change:.2g}"
    )


def cell_in_plane(
    iteration: ImplicitMap,
    z: Array,
    q: float,
    plane: Plane,
    model_at: Callable[[float], Model],
    scale: float,
) -> Found:
    """The steady cell in a plane, near (z, q). Raises NotSteady."""
    found = iterated(iteration, z, q, plane, model_at, scale)
    if found.change > TOLERANCE:
        raise NotSteady(f"the iteration does not converge near q = {found.q:.6g}")
    return checked(found)


def iterated(
    iteration: ImplicitMap,
    z: Array,
    q: float,
    plane: Plane | None = None,
    model_at: Callable[[float], Model] | None = None,
    scale: float = 1.0,
) -> Found:
    """Where the accelerated iteration leads from (z, q), converged or not. Raises NotSteady.

    Without a plane q is constant.
    """
    n, model = 2 * iteration.n, iteration.model
    # q enters as the root mean square of the unknowns does
    unit = scale / np.sqrt(n)
    next_of, y = Acceleration(DEPTH, n + 1), np.concatenate([z[:n], [q / unit], z[n:]])
    count = 0
    while count < MAX_ITERATIONS:
        count += 1
        x, q = y[:n], float(y[n] * unit)
        after = q
        try:
            if plane is not None and model_at is not None:
                model = model_at(q)
                towards = 1.0 if plane.slope >= 0.0 else -1.0
                after = q - towards * scale * plane.distance(x, q / scale)
            z = iteration.image(np.delete(y, n), model)
        except (StepFailed, SingularMatrix, InvalidInput) as error:
            raise NotSteady(str(error)) from None
        g = np.concatenate([z[:n], [after / unit], z[n:]])
        changes = np.abs(g - y)
        change = float(max(changes[: n + 1].max(), changes[n + 1 :].max() / CARRIED))
        if not change < MAX_CHANGE:
            raise NotSteady("the iteration diverges")
        if change <= TOLERANCE:
            break
        y = next_of(y, g)
    return Found(model, iteration.cell(z), count, change, q)


def checked(found: Found) -> Found:
    """The cell if its surface is one. Raises NotSteady."""
    r, faces = found.cell.r, found.model.mesh.faces
    if mesh_quality(r, faces) < MIN_QUALITY:
        raise NotSteady(
            f"a triangle of the steady shape has degenerated (quality below {MIN_QUALITY:g}): "
            "this shape is too far from the initial shape"
        )
    if not embedded(r, faces):
        raise NotSteady("the surface of the steady shape self-intersects")
    return found

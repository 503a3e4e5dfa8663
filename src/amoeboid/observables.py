"""What a cell is measured by: each observable once, for every solver; docs/notation.md lists them.

An observable is a function of a `Cell`, which a 3D state and an axisymmetric one both offer. It
must depend neither on the orientation of the cell nor on the frame that its velocities are given
in. One of your own, here the area mean of the concentration squared, takes three lines,

    @observable("N^2/L^4")
    def mean_c_squared(cell):
        return cell.integral(cell.c**2) / cell.area

and is from then on a column of the time series of 3D runs and an attribute of every cell:
`solution["mean_c_squared"]`, `solution.final.mean_c_squared`, `steady_state.mean_c_squared`.
"""

from __future__ import annotations

from collections import UserDict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Any, Protocol

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.meshes import geometry
from amoeboid.model.parameters import Parameters
from amoeboid.validation import InvalidInput

# Slower than this, in units of rate R0, a cell has no heading.
MIN_SPEED_WITH_HEADING = 1e-6


class Cell(Protocol):
    """A cell as observables see it: fields at points of its surface, and integrals over it.

    Arrays have one entry a point: (P,) for a number, (P, 3) for a vector. An axisymmetric cell
    gives the points of one meridian, with the axis along z; there a field of numbers that is
    integrated must be the same all around, as products of c and scalar products of vectors are.
    """

    @property
    def parameters(self) -> Parameters:
        """The parameters of the cell."""

    @property
    def c(self) -> Array:
        """Filament concentration (P,) [N/L^2]."""

    @property
    def x(self) -> Array:
        """Position (P, 3) relative to the center of the enclosed volume [L]."""

    @property
    def normals(self) -> Array:
        """Outward unit normals (P, 3)."""

    @property
    def v(self) -> Array:
        """Full velocity v = v_c + v_p (P, 3) [L/T], in the frame of the solver."""

    @property
    def v_c(self) -> Array:
        """Velocity of the cortex (P, 3) [L/T]."""

    @property
    def v_p(self) -> Array:
        """Polymerization velocity (P, 3), along the normal [L/T]."""

    @property
    def zeta0(self) -> float:
        """Membrane tension [M/T^2]."""

    @property
    def area(self) -> float:
        """Area of the surface that the tension keeps constant [L^2]."""

    @property
    def radius(self) -> float:
        """Radius of the sphere of the area of the smooth surface through the points [L]."""

    @property
    def volume(self) -> float:
        """Enclosed volume [L^3]."""

    def integral(self, field: Array) -> Any:
        """Integral over the surface of a field: a number of (P,), a vector (3,) of (P, 3)."""

    def maximum(self, field: Array) -> float:
        """Maximum of a field (P,) over the surface, between the points too; in its unit."""

    def minimum(self, field: Array) -> float:
        """Minimum of a field (P,) over the surface, between the points too; in its unit."""

    def max_length(self, field: Array) -> float:
        """Maximum over the surface of the length of a vector field (P, 3), in its unit.

        Where the vectors vanish their length is not smooth: it is found from the squares.
        """


@dataclass(frozen=True, repr=False)
class Observable:
    """A function of a cell, its dimension such as "L/T" ("1": none, None: not stated).

    `vector`: it gives three numbers instead of one, the columns name_x, name_y and name_z;
    `on_meshes`: it needs the `faces` of a triangulated surface and exists for 3D cells alone.
    """

    function: Callable[[Any], Any]
    dimension: str | None = None
    vector: bool = False
    on_meshes: bool = False

    def __repr__(self) -> str:
        name = getattr(self.function, "__name__", type(self.function).__name__)
        kinds = {"vector": self.vector, "on meshes": self.on_meshes}
        marks = "".join(f", {kind}" for kind, holds in kinds.items() if holds)
        return f"Observable({name} [{self.dimension or '?'}]{marks})"

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise InvalidInput(
                f"an observable must be a function of a cell, got {self.function!r}; "
                "register one with @amoeboid.observable(dimension)"
            )

    def columns(self, name: str) -> list[str]:
        """Names of its columns in a table, three for the vector `name`."""
        return [f"{name}_{axis}" for axis in "xyz"] if self.vector else [name]

    def values(self, name: str, cell: Cell) -> list[float]:
        """The numbers of the observable `name` for a cell, one or three.

        Raises InvalidInput, naming it, if it fails or gives anything else than finite numbers.
        """
        count = 3 if self.vector else 1
        wanted = "3 finite numbers" if self.vector else "a finite number"
        try:
            found = np.asarray(self.function(cell), dtype=float)
        except Exception as error:  # a user's function may raise anything
            raise InvalidInput(
                f"the observable {name!r} must return {wanted}; it raised {type(error).__name__}: "
                f"{error}"
            ) from error
        if found.size != count or not np.isfinite(found).all():
            raise InvalidInput(f"the observable {name!r} must return {wanted}, got {found}")
        return [float(value) for value in found.ravel()]

    def value(self, name: str, cell: Cell) -> Any:
        """The observable `name` of a cell: a number, or a vector (3,), in its dimension."""
        found = self.values(name, cell)
        return np.array(found) if self.vector else found[0]


class Observables(UserDict[str, Observable]):
    """The observables by name; a function that is put in is made an `Observable`."""

    def __setitem__(self, name: str, value: Observable | Callable[[Any], Any]) -> None:
        if not isinstance(name, str) or not name.isidentifier() or name.startswith("_"):
            raise InvalidInput(
                f"an observable must have a name of letters, digits and _, got {name!r}; rename it"
            )
        super().__setitem__(name, value if isinstance(value, Observable) else Observable(value))

    def __repr__(self) -> str:
        names = ", ".join(list(self)[:20]) + (", ..." if len(self) > 20 else "")
        return f"Observables({names})"


OBSERVABLES = Observables()
"""All observables by name, those of the package first; `observable` adds to it."""


def observable(
    dimension: str | None = None, *, vector: bool = False, on_meshes: bool = False
) -> Callable[[Callable[[Any], Any]], Callable[[Any], Any]]:
    """Register a function of a cell as an observable, under its own name.

    `dimension` of the number, such as "L/T"; `vector`: it gives a vector (3,); `on_meshes`: it
    needs a cell with a mesh, and is left out for others. Raises InvalidInput where
    the brackets are left out, and for a name that is none.
    """
    if callable(dimension):
        raise InvalidInput(
            f"@observable takes the dimension, such as @observable('L/T') or @observable(), got "
            f"{dimension!r}; add the brackets"
        )

    def register(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
        OBSERVABLES[getattr(function, "__name__", "")] = Observable(
            function, dimension, vector, on_meshes
        )
        return function

    return register


class Measured:
    """Gives a dataclass that has a `cell` every observable as an attribute.

    What it has cached stays out of its pickle.
    """

    cell: Any

    def __getattr__(self, name: str) -> Any:
        known = None if name.startswith("_") else OBSERVABLES.get(name)
        if known is None:
            raise AttributeError(f"{type(self).__name__} has no attribute or observable {name!r}")
        cell = self.cell
        if known.on_meshes and not hasattr(cell, "faces"):
            raise AttributeError(f"{name!r} is an observable of triangulated surfaces only")
        return known.value(name, cell)

    def __getstate__(self) -> dict[str, Any]:
        names = [f.name for f in fields(self)]  # type: ignore[arg-type]  # of a dataclass
        return {name: self.__dict__[name] for name in names}


class CellOnMesh(Cell, Protocol):
    """A 3D cell, whose points are the nodes of a triangulated surface."""

    @property
    def r(self) -> Array:
        """Nodes (P, 3) [L]."""

    @property
    def faces(self) -> Index:
        """Node numbers of the triangles (F, 3)."""

    @property
    def rate(self) -> float:
        """The unit in which slow is measured, also where all parameters of speed are 0 [1/T]."""


def selected(names: Iterable[str] | None = None) -> Mapping[str, Observable]:
    """The observables of these names, in the order of `OBSERVABLES`; all of them for None.

    Raises InvalidInput for an unknown name.
    """
    if names is None:
        return OBSERVABLES
    wanted = [names] if isinstance(names, str) else list(names)
    for name in wanted:
        if name not in OBSERVABLES:
            raise InvalidInput(
                f"unknown observable {name!r}; allowed: {', '.join(OBSERVABLES)}; register your "
                "own with @amoeboid.observable(dimension)"
            )
    return {name: known for name, known in OBSERVABLES.items() if name in wanted}


def observed(cell: Cell, names: Iterable[str] | None = None) -> dict[str, float]:
    """The observables `names` of one cell by columns, three for a vector; all for None.

    Those that need a mesh are left out for a cell without one. Raises InvalidInput, naming it, for
    an observable that fails or is no finite number.

    >>> import amoeboid as am
    >>> state = am.steady_states(am.Parameters(D=0.4, v_p0=6.0)).fastest_stable
    >>> {k: round(v, 3) for k, v in am.observed(state.solution.cell, ["c_front", "c_rear"]).items()}
    {'c_front': 0.775, 'c_rear': 13.138}
    """
    found: dict[str, float] = {}
    for name, known in selected(names).items():
        if not known.on_meshes or hasattr(cell, "faces"):
            found |= dict(zip(known.columns(name), known.values(name, cell), strict=True))
    return found


def units(names: Iterable[str] | None = None) -> dict[str, str | None]:
    """Dimension of every column of the observables, None where none is stated."""
    return {
        column: known.dimension
        for name, known in selected(names).items()
        for column in known.columns(name)
    }


def center_velocity(cell: Cell) -> Array:
    """Velocity (3,) of the center of the enclosed volume in the frame of the velocities [L/T]."""
    return center_velocity_of(cell, cell.v)


def center_velocity_of(cell: Cell, v: Array) -> Array:
    """Velocity (3,) of the center of volume of a surface that moves with v (P, 3) [L/T]."""
    v_n = np.einsum("pi,pi->p", v, cell.normals)
    return np.asarray(cell.integral(v_n[:, None] * cell.x) / cell.volume)


def retrograde_flow(cell: Cell) -> Array:
    """Tangential full velocity (P, 3) in the frame in which the cell rests [L/T].

    That frame follows the center of the enclosed volume.
    """
    relative = cell.v - center_velocity(cell)
    return relative - geometry.normal_part(relative, cell.normals)


def cortex_drag_velocity(cell: Cell) -> Array:
    """Velocity (3,) of the center of volume if all drag is on the cortex, uniformly [L/T].

    Surroundings that hold the cortex back with a force -k v_c per area, and nothing else, let the
    cell go where the area mean of v_c vanishes. The paper leaves open how a cell pushes itself off;
    other surroundings give other velocities.
    """
    return np.asarray(center_velocity(cell) - cell.integral(cell.v_c) / cell.area)


def polarization(cell: Cell) -> Array:
    """The vector of `polarity` (3,): from front to rear; zero for a cell without filaments."""
    filaments = cell.integral(cell.c) * cell.parameters.R0
    moment = np.asarray(cell.integral(cell.c[:, None] * cell.x))
    return moment / filaments if filaments > 0 else np.zeros(3)


@observable("L/T")
def max_retrograde_speed(cell: Cell) -> float:
    """Maximum over the surface of the retrograde speed, the paper's v_0 [L/T]."""
    return cell.max_length(retrograde_flow(cell))


@observable("N/L^2")
def c_front(cell: Cell) -> float:
    """Concentration at the front, its minimum over the surface [N/L^2]."""
    return cell.minimum(cell.c)


@observable("N/L^2")
def c_rear(cell: Cell) -> float:
    """Concentration at the rear, its maximum over the surface [N/L^2]."""
    return cell.maximum(cell.c)


@observable("M/T^2")
def zeta0(cell: Cell) -> float:
    """Membrane tension [M/T^2]."""
    return cell.zeta0


@observable("1")
def area_error(cell: Cell) -> float:
    """|A/A0 - 1|."""
    return abs(cell.area / (4.0 * np.pi * cell.parameters.R0**2) - 1.0)


@observable("1")
def polarity(cell: Cell) -> float:
    """|integral of c r dA| / (R0 integral of c dA), about the volume center; 0 if homogeneous."""
    return float(np.linalg.norm(polarization(cell)))


@observable("1")
def deformation(cell: Cell) -> float:
    """Largest deviation of the distance from the center of volume from R0, over R0 [1].

    R0 is the radius of the sphere that has the area of the surface. A polyhedron of that area has
    its nodes outside, so that the area of the smooth surface through the nodes is taken.
    """
    change = np.linalg.norm(cell.x, axis=1) / cell.radius - 1.0
    return max(abs(cell.maximum(change)), abs(cell.minimum(change)))


@observable("1")
def reduced_volume(cell: Cell) -> float:
    """Volume over that of the sphere of radius R0: 1 for a sphere, up to the mesh error."""
    return cell.volume / (4.0 * np.pi / 3.0 * cell.parameters.R0**3)


@observable("N")
def filament_number(cell: Cell) -> float:
    """Total number of filaments, the integral of c over the surface [N]."""
    return float(cell.integral(cell.c))


@observable("1", on_meshes=True)
def mesh_quality(cell: CellOnMesh) -> float:
    """Quality of the worst triangle: 1 is equilateral, 0 is degenerate."""
    return geometry.mesh_quality(cell.r, cell.faces)


@observable("L/T")
def cortex_drag_speed(cell: Cell) -> float:
    """Magnitude of `cortex_drag_velocity` [L/T]."""
    return float(np.linalg.norm(cortex_drag_velocity(cell)))


@observable("1", vector=True, on_meshes=True)
def cortex_drag_heading(cell: CellOnMesh) -> Array:
    """Unit vector (3,) along `cortex_drag_velocity`; zero for a cell that rests."""
    velocity = cortex_drag_velocity(cell)
    speed = np.linalg.norm(velocity)
    moves = speed > MIN_SPEED_WITH_HEADING * cell.rate * cell.parameters.R0
    return np.asarray(velocity / speed if moves else np.zeros(3))

"""What is measured on the cells of a run: c along the polarity axis, and power by degree."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from amoeboid.arrays import Array, axis_across
from amoeboid.display import html_picture, html_table, plotted, shown
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.spherical_harmonics import real_harmonic
from amoeboid.observables import polarization, retrograde_flow
from amoeboid.runs.snapshot import Snapshot
from amoeboid.studies.columns import column, dataset, quantity
from amoeboid.surface.cell import SurfaceCell
from amoeboid.validation import InvalidInput

MIN_POLARITY = 1e-6  # below it a cell has no axis of its own
AROUND = 24  # directions on each circle around the axis
L_MAX = 4  # degrees of a spectrum, unless another number is given
NODES_PER_HARMONIC = 2.0  # nodes that a coefficient of a spectrum needs


def axis(cell: SurfaceCell, instead: Array) -> Array:
    """Unit vector (3,) from the front to the rear; `instead` for a cell without polarity."""
    vector = polarization(cell)
    size = float(np.linalg.norm(vector))
    return np.asarray(vector / size if size > MIN_POLARITY else instead)


def towards(cell: SurfaceCell, direction: Array) -> Array:
    """Component (V,) of the retrograde flow along the surface towards where an axis points [L/T].

    That is along the part of the axis which is tangential to the surface; 0 where there is none.
    """
    along = direction - (cell.normals @ direction)[:, None] * cell.normals
    size = np.linalg.norm(along, axis=1)
    flow = np.einsum("vi,vi->v", retrograde_flow(cell), along)
    return np.divide(flow, size, out=np.zeros_like(flow), where=size > 0.0)


def along_axis(
    cell: SurfaceCell, direction: Array, theta: Array, field: Array | None = None
) -> Array:
    """Mean (K,) of a field (V,), by default c, on circles around an axis through the center.

    theta (K,) are their angles from the axis; fields are linear on the triangles. Raises
    InvalidInput for a cell that some ray from its center leaves more than once: there an angle is
    no place on the surface.
    """
    side = np.cross(direction, axis_across(direction))
    side /= np.linalg.norm(side)
    across = np.cross(direction, side)
    phi = (np.arange(AROUND) + 0.5) * (2.0 * np.pi / AROUND)
    circle = np.cos(phi)[:, None] * side + np.sin(phi)[:, None] * across
    corners = _corners(cell)
    inverse = np.linalg.inv(np.swapaxes(corners, 1, 2))  # columns are the corners
    values = (cell.c if field is None else field)[cell.faces]
    found = []
    for angle in theta:
        rays = np.cos(angle) * direction + np.sin(angle) * circle
        shares = np.einsum("fij,kj->kfi", inverse, rays)
        hit = np.argmax(shares.min(axis=2), axis=1)
        share = np.take_along_axis(shares, hit[:, None, None], axis=1)[:, 0]
        share /= share.sum(axis=1, keepdims=True)
        found.append(np.einsum("ki,ki->k", share, values[hit]).mean())
    return np.array(found)


def _corners(cell: SurfaceCell) -> Array:
    """Corners of the triangles (F, 3, 3) about the center. Raises InvalidInput, see above."""
    corners = cell.x[cell.faces]
    if not np.all(np.linalg.det(corners) > 0.0):
        raise InvalidInput(
            f"each ray from the center must cross the surface once, at t = {cell.t:g} some cross "
            "it more often; use the frames instead"
        )
    return corners


@dataclass(frozen=True, eq=False, repr=False)
class Kymograph:
    """c (T, K) [N/L^2] at times t (T,) [T] and angles theta (K,) from the rear of the cell.

    theta = 0 is the rear, pi the front, along the axis of polarity of each time; c is the mean
    around that axis, `values` (T, K) are its plain numbers. Until the cell has polarity the axis is
    that of the last time.
    """

    parameters: Parameters
    times: Array
    theta: Array
    values: Array

    @property
    def t(self) -> Any:
        """The times (T,) [T]."""
        return quantity(self.parameters, self.times, "T")

    @property
    def c(self) -> Any:
        """The concentration (T, K) [N/L^2]."""
        return quantity(self.parameters, self.values, "N/L^2")

    def plot(self, ax: Any = None) -> Any:
        """Draw c as color over time and angle. Takes and returns axes."""
        return plotted(self, "runs.draw_kymograph", ax)

    def to_xarray(self) -> Any:
        """An xarray.Dataset with c over the dimensions t and theta."""
        p = self.parameters
        found = dataset({"t": column(p, self.times, "T")}, "t", ["t"])
        c = column(p, self.values, "N/L^2")
        found = found.assign_coords(theta=("theta", self.theta, {"units": "rad"}))
        return found.assign(c=(("t", "theta"), c.values, {"units": c.unit}))

    def __repr__(self) -> str:
        return f"Kymograph({len(self.times)} times, {len(self.theta)} angles)"

    def _repr_html_(self) -> str:
        return html_picture(self, "runs.draw_kymograph")


def kymograph(frames: Iterable[Snapshot], last: Snapshot, angles: int = 45) -> Kymograph:
    """The kymograph of the frames of a run; `last` gives the axis of cells without polarity."""
    if isinstance(angles, bool) or not isinstance(angles, int) or angles < 2:
        raise InvalidInput(f"angles must be a whole number >= 2, got {angles!r}")
    theta = (np.arange(angles) + 0.5) * (np.pi / angles)
    instead = axis(last.cell, np.array([0.0, 0.0, 1.0]))
    times, values = [], []
    for frame in frames:
        cell = frame.cell
        times.append(cell.t)
        values.append(along_axis(cell, axis(cell, instead), theta))
    return Kymograph(last.parameters, np.array(times), theta, np.array(values))


@dataclass(frozen=True, eq=False, repr=False)
class Spectrum:
    """Power of a `field`, c or the shape, by degree l of spherical harmonics, at times t (T,).

    `power` (T, l_max + 1): the mean square over all directions of the part of degree l, of c in
    N^2/L^4, of the shape (the distance from the center of volume over R0) without unit; the sum
    over l is the mean square of the whole. `values` are its plain numbers. Fitted to the nodes by
    least squares, weighted by their solid angles.
    """

    parameters: Parameters
    field: str
    times: Array
    values: Array

    @property
    def t(self) -> Any:
        """The times (T,) [T]."""
        return quantity(self.parameters, self.times, "T")

    @property
    def l(self) -> Array:  # noqa: E743
        """The degrees, 0 to l_max: (l_max + 1,)."""
        return np.arange(self.values.shape[1])

    @property
    def power(self) -> Any:
        """The power (T, l_max + 1)."""
        return quantity(self.parameters, self.values, POWER[self.field])

    def plot(self, ax: Any = None) -> Any:
        """Draw the power of each degree over time. Takes and returns axes."""
        return plotted(self, "runs.draw_spectrum", ax)

    def to_xarray(self) -> Any:
        """An xarray.Dataset with power over the dimensions t and l."""
        p = self.parameters
        found = dataset({"t": column(p, self.times, "T")}, "t", ["t"])
        power = column(p, self.values, POWER[self.field])
        found = found.assign_coords(l=("l", self.l))
        return found.assign(power=(("t", "l"), power.values, {"units": power.unit}))

    def __repr__(self) -> str:
        return f"Spectrum(of {self.field}, {len(self.times)} times, l = 0 to {self.l[-1]})"

    def _repr_html_(self) -> str:
        last = column(self.parameters, self.values[-1], POWER[self.field])
        rows = list(enumerate(last.texts))
        heading = f"Power of {self.field} at t = {shown(self.t[-1])}"
        return html_table(heading, rows, ["l", "power"]) + html_picture(self, "runs.draw_spectrum")


POWER = {"c": "N^2/L^4", "shape": "1"}
"""Dimensions of the power of the fields that have a spectrum."""


def spectrum(frames: Iterable[Snapshot], p: Parameters, field: str, l_max: int | None) -> Spectrum:
    """The spectra of the frames of a run. Raises InvalidInput for what has none."""
    if field not in POWER:
        raise InvalidInput(f"a spectrum must be of {' or '.join(POWER)}, got {field!r}")
    frames = list(frames)
    if l_max is None:
        l_max = min(L_MAX, *(largest_degree(frame.cell) for frame in frames))
    if isinstance(l_max, bool) or not isinstance(l_max, int) or l_max < 1:
        raise InvalidInput(f"l_max must be a whole number >= 1, got {l_max!r}")
    times, values = [], []
    for frame in frames:
        times.append(frame.cell.t)
        values.append(power_by_degree(frame.cell, field, l_max))
    return Spectrum(p, field, np.array(times), np.array(values))


def largest_degree(cell: SurfaceCell) -> int:
    """The largest degree l_max whose (l_max + 1)^2 coefficients the nodes of a mesh determine."""
    return int(np.sqrt(len(cell.c) / NODES_PER_HARMONIC)) - 1


def power_by_degree(cell: SurfaceCell, field: str, l_max: int) -> Array:
    """Mean square (l_max + 1,) over all directions of each degree of c, or of |x|/R0."""
    largest = largest_degree(cell)
    if l_max > largest:
        raise InvalidInput(
            f"l_max must be at most {largest} on a mesh of {len(cell.c)} nodes, got {l_max}"
        )
    distance = np.linalg.norm(cell.x, axis=1)
    values = cell.c if field == "c" else distance / cell.parameters.R0
    degrees = np.array([l for l in range(l_max + 1) for _ in range(2 * l + 1)])  # noqa: E741
    orders = [m for l in range(l_max + 1) for m in range(-l, l + 1)]  # noqa: E741
    basis = np.column_stack(
        [real_harmonic(int(l), m, cell.x) for l, m in zip(degrees, orders, strict=True)]  # noqa: E741
    )
    weights = np.sqrt(_solid_angles(cell))
    fitted = np.linalg.lstsq(weights[:, None] * basis, weights * values, rcond=None)[0]
    squares = fitted**2 / (2 * degrees + 1)  # the mean square of a harmonic, see real_harmonic
    return np.bincount(degrees, squares)


def _solid_angles(cell: SurfaceCell) -> Array:
    """Solid angle of each node (V,), a third of those of its triangles (van Oosterom, Strackee)."""
    corners = _corners(cell)
    a, b, c = np.moveaxis(corners, 1, 0)
    sizes = np.linalg.norm(corners, axis=2)
    la, lb, lc = sizes.T
    below = la * lb * lc + _dot(a, b) * lc + _dot(b, c) * la + _dot(c, a) * lb
    angles = 2.0 * np.arctan2(np.linalg.det(corners), below)
    return np.bincount(cell.faces.ravel(), np.repeat(angles / 3.0, 3), len(cell.c))


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("fi,fi->f", a, b))

"""Where branches of 3D cells gain or lose stability: the place, the mode, and what leaves there.

A straight cell that becomes unstable to bending has modes cos(phi) and sin(phi) about its axis, and
cells that bend in any direction leave it. On a mesh with mirror planes through the axis the one is
followed that bends within such a plane: its circles lie in it exactly, and what leads out of the
plane is a mode of its own. On another mesh a circle climbs by the error of the mesh. There the
bifurcation to helices is imperfect: the branch of circles is joined to one of helices, and the
growth rate jumps where the branch is left for the other half of the circles.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from amoeboid.arrays import Array, Index
from amoeboid.meshes.geometry import volume_centroid
from amoeboid.numerics.spherical_harmonics import real_harmonic
from amoeboid.observables import polarization
from amoeboid.runs.cell_branch import CellBifurcation
from amoeboid.runs.steady_cell import SteadyCell
from amoeboid.studies.branch import BIFURCATION, HOPF
from amoeboid.surface.stability import Growth
from amoeboid.surface.steady import NotSteady

# The growth rate is found to this error, in units of the rate, and q to this share of its scale.
MAX_ERROR, EXACT, MAX_TRIALS = 1e-4, 1e-6, 12
# A growth rate jumps if it is this many times as large as its error at both ends of a bracket that
# is shorter than this share of the first one.
JUMP, NARROW = 3.0, 0.01
# Azimuthal numbers that are told apart, in this many bands along the axis.
ORDERS, BANDS = 4, 8
# A mesh has a mirror plane if all nodes have an image within this distance, in units of R0.
IMAGE = 1e-6
# Modes are even or odd in the plane of a circle by their harmonics up to this degree.
DEGREE = 6


@dataclass(frozen=True)
class Neutral:
    """A cell whose fastest perturbation is neutral, at the value q of the parameter.

    `jumps`: no zero of the growth rate was found, it jumps; q is interpolated.
    """

    q: float
    cell: SteadyCell
    growth: Growth
    mode: NDArray[np.complex128]
    jumps: bool = False


def neutral_between(
    at: Callable[[float, SteadyCell], SteadyCell],
    first: tuple[float, SteadyCell],
    last: tuple[float, SteadyCell],
    scale: float,
) -> Neutral:
    """Where the largest growth rate is zero, to its error, between two values of the parameter.

    By secants within a bracket, and its halves in turn. `at(q, beside)`: the cell at q, near
    another one. Raises NotSteady.
    """
    whole = [_rated(q, cell) for q, cell in (first, last)]
    ends = [*whole]
    for count in range(MAX_TRIALS):
        (p, f), (q, g) = ((end.q, end.growth.rate or 0.0) for end in ends)
        if f * g > 0.0:
            break
        share = 0.5 if count % 3 == 2 else float(np.clip(f / (f - g), 0.05, 0.95))
        between = p + share * (q - p)
        found = _rated(between, at(between, ends[0].cell))
        rate, error = found.growth.rate or 0.0, found.growth.error
        jumps = all(abs(end.growth.rate or 0.0) > JUMP * end.growth.error for end in ends)
        narrow = abs(q - p) < NARROW * abs(last[0] - first[0])
        if abs(rate) <= error or (abs(q - p) < EXACT * scale and not jumps):
            return found
        if jumps and narrow:
            return _interpolated(at, whole)
        ends[0 if rate * f > 0.0 else 1] = found
    raise NotSteady(
        f"no zero of the growth rate was found between {first[0]:.6g} and {last[0]:.6g}"
    )


def _rated(q: float, cell: SteadyCell) -> Neutral:
    growth, mode = cell.growth(MAX_ERROR)
    if growth.rate is None or mode is None:
        raise NotSteady(f"the growth rate at {q:.6g} could not be determined: {growth.problem}")
    return Neutral(q, cell, growth, mode)


def _interpolated(at: Callable[[float, SteadyCell], SteadyCell], ends: list[Neutral]) -> Neutral:
    """Where the growth rate would vanish if it did not jump, with the mode that grows beyond."""
    (p, f), (q, g) = ((end.q, end.growth.rate or 0.0) for end in ends)
    beyond = ends[0] if f > 0.0 else ends[1]
    here = p + f / (f - g) * (q - p)
    return Neutral(here, at(here, beyond.cell), beyond.growth, beyond.mode, jumps=True)


def bifurcation(name: str, found: Neutral, length: float) -> CellBifurcation:
    """The bifurcation at a neutral cell of a branch in the parameter `name`."""
    cell, mode = found.cell, found.mode
    oscillates = _oscillates(mode)
    real = mode.real if np.abs(mode.real).max() >= np.abs(mode.imag).max() else mode.imag
    m = azimuthal_number(cell, real) if cell.path == "straight" else None
    if m and not oscillates:
        real = mirror_symmetric(cell, real)
    in_plane = is_even(cell, mode) if cell.path == "circle" else None
    if oscillates:
        leads_to = "wobble"
    elif m is not None:
        leads_to = "circle" if m == 1 else "straight"
    else:
        leads_to = "circle" if in_plane else "helix"
    return CellBifurcation(
        kind=HOPF if oscillates else BIFURCATION,
        name=name,
        m=m,
        state=cell,
        piece=0,
        length=length,
        mode=real,
        leads_to=leads_to,
        in_plane=in_plane,
        plain_frequency=found.growth.frequency if oscillates else 0.0,
    )


def _oscillates(mode: NDArray[np.complex128]) -> bool:
    """Whether a mode is more than a real vector times a number."""
    a, b = mode.real, mode.imag
    return bool((a @ a) * (b @ b) - (a @ b) ** 2 > 1e-6 * (a @ a + b @ b) ** 2)


def azimuthal_number(cell: SteadyCell, mode: Array) -> int:
    """The number m of a mode exp(i m phi) about the axis of a straight cell, up to 3."""
    seen = cell.cell
    axis, x = _axis(cell), _about_center(cell)
    across = np.linalg.svd(axis[None, :])[2][1:]
    height = x @ axis
    angle = np.arctan2(x @ across[1], x @ across[0])
    band = np.digitize(height, np.quantile(height, np.linspace(0, 1, BANDS + 1)[1:-1]))
    weighted = seen.node_areas * mode[: len(height)]
    sizes = [
        sum(abs(np.sum((weighted * np.exp(1j * m * angle))[band == k])) ** 2 for k in range(BANDS))
        * (1 if m == 0 else 2)
        for m in range(ORDERS)
    ]
    return int(np.argmax(sizes))


def mirror_symmetric(cell: SteadyCell, mode: Array) -> Array:
    """The part of a mode (2V,) of a straight cell that a mirror plane through its axis keeps.

    Of all such planes of the mesh that which keeps most; the mode itself if there is none.
    """
    parts = [0.5 * (mode + mode.reshape(2, -1)[:, image].ravel()) for image in mirrors(cell)]
    if not parts:
        return mode
    sizes = [float(np.linalg.norm(part)) for part in parts]
    kept = parts[int(np.argmax(sizes))]
    return np.asarray(kept / np.linalg.norm(kept))


def mirrors(cell: SteadyCell) -> list[Index]:
    """The images (V,) of the nodes in all mirror planes of the mesh through the axis of a cell."""
    from scipy.spatial import cKDTree  # not for every branch

    axis, x = _axis(cell), _about_center(cell)
    height = x @ axis
    across = x - np.outer(height, axis)
    distance = np.linalg.norm(across, axis=1)
    within = IMAGE * cell.model.parameters.R0
    # a mirror plane takes the node that is farthest from the axis to one of these
    far = int(np.argmax(distance))
    same = (np.abs(height - height[far]) < within) & (np.abs(distance - distance[far]) < within)
    tree, found = cKDTree(x), list[Index]()
    for node in np.flatnonzero(same):
        normal = np.cross(axis, across[far]) if node == far else across[far] - across[node]
        normal = normal / np.linalg.norm(normal)
        off, image = tree.query(x - 2.0 * np.outer(x @ normal, normal))
        if off.max() < within:
            found.append(np.asarray(image, dtype=np.int64))
    return found


def is_even(cell: SteadyCell, mode: NDArray[np.complex128]) -> bool:
    """Whether a mode (2V,) of a cell on a circle is rather even than odd in its plane."""
    normal, ahead = cell.plain_angular_velocity, cell.plain_velocity
    normal = normal / np.linalg.norm(normal)
    ahead = ahead - (ahead @ normal) * normal
    ahead = ahead / np.linalg.norm(ahead)
    x = _about_center(cell) @ np.stack([ahead, np.cross(normal, ahead), normal], axis=1)
    orders = [(n, m) for n in range(DEGREE + 1) for m in range(-n, n + 1)]
    even = np.array([(degree + m) % 2 == 0 for degree, m in orders])
    weights = np.sqrt(cell.cell.node_areas)[:, None]
    patterns = weights * np.stack([real_harmonic(degree, m, x) for degree, m in orders], axis=1)
    parts = weights * mode.reshape(2, -1).T
    shares = np.linalg.lstsq(patterns, np.hstack([parts.real, parts.imag]), rcond=None)[0]
    sizes = [np.linalg.norm(patterns[:, kept] @ shares[kept]) for kept in (even, ~even)]
    return bool(sizes[0] > sizes[1])


def _axis(cell: SteadyCell) -> Array:
    axis = polarization(cell.cell)
    return axis / np.linalg.norm(axis)


def _about_center(cell: SteadyCell) -> Array:
    return np.asarray(cell.cell.r - volume_centroid(cell.cell.r, cell.cell.faces))

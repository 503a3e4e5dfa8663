"""A cell on a triangulated surface as its surroundings feel it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from amoeboid.arrays import Array, Index, axis_across
from amoeboid.meshes.geometry import geometry, normal_part, smooth_area
from amoeboid.motility.single_layer import StokesSurface
from amoeboid.motility.surfaces import (
    CORTEX,
    RIGID,
    WAYS,
    Points,
    SurfaceInFluid,
    ways_of,
)

SIDES = 12  # axes across the polarity whose caps stand for those of all sides


@dataclass(frozen=True, eq=False, repr=False)
class TriangulatedSurface(SurfaceInFluid):
    """See `surfaces.Surroundable`; nodes x (V, 3) about the center of volume, `faces` (F, 3).

    `velocity` (V, 3): the full one in the frame in which the shape rests; `cortex` (V, 3) that of
    the cortex and `c` (V,), or None; `front`: unit vector (3,).
    """

    x: Array
    faces: Index
    velocity: Array
    front: Array
    cortex: Array | None = None
    c: Array | None = None

    def __repr__(self) -> str:
        return f"TriangulatedSurface({len(self.x)} nodes, {len(self.faces)} faces)"

    @property
    def has_cortex(self) -> bool:
        """Whether the flow of the cortex is known."""
        return self.cortex is not None

    @property
    def has_concentration(self) -> bool:
        """Whether the concentration of filaments is known."""
        return self.c is not None

    @cached_property
    def mesh_error(self) -> float:
        """The share by which triangles have less area than the smooth surface through the nodes."""
        smooth = smooth_area(self.x, self.faces)
        return abs(smooth / geometry(self.x, self.faces).area - 1.0)

    @cached_property
    def everywhere(self) -> Points:
        """The nodes, with the areas around them."""
        g = geometry(self.x, self.faces)
        normal = normal_part(self.velocity, g.normals)
        cortex = np.zeros_like(self.x) if self.cortex is None else self.cortex
        c = np.ones(len(self.x)) if self.c is None else self.c
        ways = ways_of(self.x, self.velocity - normal, normal, cortex)
        return Points(self.x, g.normals, g.node_areas, c, ways)

    @cached_property
    def drag(self) -> tuple[Array, Array]:
        """See `SurfaceInFluid`."""
        points = self.everywhere
        ways, body = points.ways[:CORTEX], StokesSurface(self.x, self.faces)
        forces = -np.concatenate(
            [body.tractions(ways[:RIGID]), body.outside_tractions(ways[RIGID:])]
        )
        weighted = (ways * points.weights[:, None]).reshape(CORTEX, -1)
        found = forces.reshape(CORTEX, -1) @ weighted.T
        # the force on a flow is more exact than the flow against the force on the rigid body
        error = found[:RIGID, RIGID:] - found[RIGID:, :RIGID].T
        found[:RIGID, RIGID:] = found[RIGID:, :RIGID].T
        matrix = np.zeros((WAYS, WAYS))
        matrix[:CORTEX, :CORTEX] = 0.5 * (found + found.T)
        return matrix, error

    def cap(self, half_angle: float, axis: Array | None) -> list[tuple[Points, Array]]:
        """Parts of the triangles within an angle [rad] of an axis (3,) across the polarity."""
        if axis is not None:
            return [(self._within([(axis, np.cos(half_angle))]), axis)]
        side = np.cross(self.front, axis_across(self.front))
        side /= np.linalg.norm(side)
        across = np.cross(self.front, side)
        angles = np.arange(SIDES) * (2.0 * np.pi / SIDES)
        axes = [np.cos(a) * side + np.sin(a) * across for a in angles]
        return [(self._within([(one, np.cos(half_angle))]), one) for one in axes]

    def band(self, half_width: float) -> Points:
        """Parts of the triangles within an angle [rad] of the equator."""
        most = -np.sin(half_width)
        return self._within([(self.front, most), (-self.front, most)])

    def _within(self, cones: list[tuple[Array, float]]) -> Points:
        """The surface where the direction from the center has at least these cosines to axes.

        The triangles at the border are cut into parts, those where it is linear.
        """
        faces, parts = self._parts(cones)
        for cone in cones:
            faces, parts = _clipped(faces, parts, _levels(self.x[self.faces[faces]], parts, cone))
        areas = np.abs(np.linalg.det(parts)) * geometry(self.x, self.faces).face_areas[faces]
        nodes = np.repeat(self.faces[faces], 3, axis=0)
        mixed = (MIDDLES @ parts).reshape(-1, 3)
        whole = self.everywhere

        def at(field: Array) -> Array:
            return np.asarray(np.einsum("qa,qa...->q...", mixed, field[nodes]))

        normals = at(whole.normals)
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        ways = np.stack([at(way) for way in whole.ways])
        return Points(at(self.x), normals, np.repeat(areas / 3.0, 3), at(whole.c), ways)

    def _parts(self, cones: list[tuple[Array, float]]) -> tuple[Index, Array]:
        """Faces (T,) and corners (T, 3, 3) in them of triangles: whole inside, else divided."""
        corners = self.x[self.faces]
        fine = np.stack(
            [_levels(corners, np.broadcast_to(FINE[k], (len(corners), 3, 3)), cone)
             for cone in cones for k in range(len(FINE))]
        ).reshape(len(cones), len(FINE), len(corners), 3)  # fmt: skip
        levels = fine > 0.0
        inside = np.all(levels, axis=(0, 1, 3))
        reached = np.any(np.all(levels, axis=0), axis=(0, 2)) & ~inside
        whole, border = np.flatnonzero(inside), np.flatnonzero(reached)
        faces = np.concatenate([whole, np.repeat(border, len(FINE))])
        parts = [np.broadcast_to(np.eye(3), (len(whole), 3, 3)), np.tile(FINE, (len(border), 1, 1))]
        return faces, np.concatenate(parts)


MIDDLES = np.array([[4.0, 1.0, 1.0], [1.0, 4.0, 1.0], [1.0, 1.0, 4.0]]) / 6.0
"""Points of a rule of degree 2 on a triangle."""


def _divided(count: int) -> Array:
    """Corners (count^2, 3, 3) of equal parts of a triangle."""
    found = []
    for i in range(count):
        for j in range(count - i):
            a, b = np.array([i, j]), np.array([[1, 0], [0, 1], [1, 1]])
            found.append([a, a + b[0], a + b[1]])
            if i + j < count - 1:
                found.append([a + b[0], a + b[2], a + b[1]])
    place = np.array(found, dtype=float) / count
    return np.concatenate([1.0 - place.sum(axis=2, keepdims=True), place], axis=2)


FINE = _divided(4)
"""Parts of a triangle at the border of a region."""


def _levels(corners: Array, parts: Array, cone: tuple[Array, float]) -> Array:
    """How far inside a cone (T, 3) the corners of parts of triangles lie, as an angle [rad]."""
    axis, least = cone
    x = parts @ corners
    cosines = np.einsum("tai,i->ta", x, axis) / np.linalg.norm(x, axis=2)
    return np.asarray(np.arccos(least) - np.arccos(np.clip(cosines, -1.0, 1.0)))


def _clipped(faces: Index, parts: Array, levels: Array) -> tuple[Index, Array]:
    """The parts of triangles where a function that is linear on each of them is positive."""
    inside = levels > 0.0
    count = inside.sum(axis=1)
    kept_faces, kept = [faces[count == 3]], [parts[count == 3]]
    for number in (1, 2):
        some = count == number
        # the corner that is alone on its side comes first
        alone = np.argmax(inside[some] == (number == 1), axis=1)
        order = (alone[:, None] + np.arange(3)) % 3
        p = np.take_along_axis(parts[some], order[:, :, None], axis=1)
        f = np.take_along_axis(levels[some], order, axis=1)
        share = (f[:, :1] / (f[:, :1] - f[:, 1:]))[..., None]
        cut = p[:, :1] + share * (p[:, 1:] - p[:, :1])
        if number == 1:
            kept.append(np.concatenate([p[:, :1], cut], axis=1))
            kept_faces.append(faces[some])
        else:
            kept.append(np.stack([cut[:, 0], p[:, 1], p[:, 2]], axis=1))
            kept.append(np.stack([cut[:, 0], p[:, 2], cut[:, 1]], axis=1))
            kept_faces += [faces[some]] * 2
    return np.concatenate(kept_faces), np.concatenate(kept)

"""A cell on a triangulated surface as its surroundings feel it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.meshes.geometry import geometry, normal_part, smooth_area
from amoeboid.motility.single_layer import StokesSurface
from amoeboid.motility.surfaces import (
    CORTEX,
    RIGID,
    WAYS,
    Points,
    ways_of,
)

SIDES = 24  # axes across the polarity whose caps stand for those of all sides


@dataclass(frozen=True, eq=False, repr=False)
class TriangulatedSurface:
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
    def fluid(self) -> Array:
        """The matrix (9, 9) of a fluid of viscosity 1; see `surfaces`."""
        return self._fluid[0]

    @cached_property
    def fluid_error(self) -> Array:
        """Difference (6, 2) of the couplings to the flow by the reciprocal theorem and directly."""
        return self._fluid[1]

    @cached_property
    def _fluid(self) -> tuple[Array, Array]:
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
        side = np.cross(self.front, np.eye(3)[np.argmin(np.abs(self.front))])
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

        Fields and cosines are linear on the triangles, of which the parts are cut out.
        """
        directions = self.x / np.linalg.norm(self.x, axis=1)[:, None]
        corners = [np.eye(3)[k] for k in range(3)]
        levels = [(directions @ axis - least)[self.faces] for axis, least in cones]
        reached = np.all([level.max(axis=1) > 0.0 for level in levels], axis=0)
        rows, shares, areas = [], [], []
        face_areas = geometry(self.x, self.faces).face_areas
        for f in np.flatnonzero(reached):
            polygon = corners
            for level in levels:
                polygon = _clipped(polygon, level[f])
            for k in range(1, len(polygon) - 1):
                triangle = np.stack([polygon[0], polygon[k], polygon[k + 1]])
                rows.append(f)
                areas.append(abs(np.linalg.det(triangle)) * face_areas[f])
                # points of a rule of degree 2, from the corners
                shares.append(MIDDLES @ triangle)
        whole = self.everywhere
        count = 3 * len(rows)
        nodes = np.repeat(self.faces[np.array(rows, dtype=int)], 3, axis=0).reshape(count, 3)
        mixed = np.array(shares).reshape(count, 3)
        weights = np.repeat(np.array(areas) / 3.0, 3)

        def at(field: Array) -> Array:
            return np.asarray(np.einsum("qa,qa...->q...", mixed, field[nodes]))

        normals = at(whole.normals)
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        ways = np.stack([at(way) for way in whole.ways])
        return Points(at(self.x), normals, weights, at(whole.c), ways)


MIDDLES = np.array([[4.0, 1.0, 1.0], [1.0, 4.0, 1.0], [1.0, 1.0, 4.0]]) / 6.0


def _clipped(polygon: list[Array], level: Array) -> list[Array]:
    """The part of a polygon, in barycentric coordinates, where a linear function is positive."""
    found: list[Array] = []
    values = [float(corner @ level) for corner in polygon]
    for k, corner in enumerate(polygon):
        before, value = values[k - 1], values[k]
        if (before > 0.0) != (value > 0.0):
            share = before / (before - value)
            found.append(polygon[k - 1] + share * (corner - polygon[k - 1]))
        if value > 0.0:
            found.append(corner)
    return found

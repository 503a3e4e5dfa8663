"""An axisymmetric cell as its surroundings feel it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.motility.meridian import Meridian, StokesBody, gauss
from amoeboid.motility.surfaces import (
    CORTEX,
    NORMAL,
    TANGENTIAL,
    WAYS,
    Points,
    SurfaceInFluid,
    front_of,
    ways_of,
)
from amoeboid.numerics.bracketed import bracketed_root
from amoeboid.observables import center_velocity, polarization

AROUND = 8  # meridians: integrals of products of what varies with cos phi and sin phi are exact
MIN_MODES = 32  # of the tractions
MIN_MODE = 1e-10  # of the largest mode of a series: smaller ones are rounding
CAP_POINTS, CAP_ANGLES = 60, 16  # Gauss points of a cap along the meridian, and around the axis


@dataclass(frozen=True, eq=False, repr=False)
class RevolvedSurface(SurfaceInFluid):
    """See `surfaces.Surroundable`. `cell` is an `AxisymmetricCell`, its axis is z."""

    cell: Any

    def __repr__(self) -> str:
        return f"RevolvedSurface({len(self.cell.c)} points of the meridian)"

    has_cortex = has_concentration = True
    mesh_error = 0.0  # points are as exact as the state

    @cached_property
    def front(self) -> Array:
        """Unit vector (3,) to the front, along the axis; (0, 0, 1) for a cell without one."""
        found = front_of(polarization(self.cell))
        return np.array([0.0, 0.0, 1.0]) if found is None else found

    @cached_property
    def meridian(self) -> Meridian:
        """The meridian as series, about the center of volume."""
        grid = self.cell.shape.grid
        return Meridian(grid.to_odd @ self.cell.x[:, 0], grid.to_even @ self.cell.x[:, 2])

    @cached_property
    def _given(self) -> tuple[Array, Array, Array]:
        """Coefficients of u (sines), of the normal velocity and of that of polymerization."""
        cell, grid = self.cell, self.cell.shape.grid
        v = cell.v - center_velocity(cell)
        along = np.einsum("pi,pi->p", v, cell.tangents)
        across = np.einsum("pi,pi->p", v, cell.normals)
        pushed = np.einsum("pi,pi->p", cell.v_p, cell.normals)
        return grid.to_odd @ along, grid.to_even @ across, grid.to_even @ pushed

    def _on_meridian(self, x: Array) -> tuple[Array, ...]:
        """r, z, ds/dx, normal r and z, u, normal velocity, polymerization speed and c at x."""
        r, z = self.meridian.position(x)
        r_x, z_x = self.meridian.slope(x)
        size = np.hypot(r_x, z_x)
        k = np.arange(self.meridian.modes)
        sines, cosines = np.sin(x[..., None] * (k + 1)), np.cos(x[..., None] * k)
        u, w, pushed = self._given
        c = cosines @ (self.cell.shape.grid.to_even @ self.cell.c)
        return r, z, size, -z_x / size, r_x / size, sines @ u, cosines @ w, cosines @ pushed, c

    def _points(self, x: Array, phi: Array, weights: Array) -> Points:
        """Points at x and phi (Q,) with weights of dx dphi."""
        r, z, size, n_r, n_z, u, w, pushed, c = self._on_meridian(x)
        cos, sin = np.cos(phi), np.sin(phi)

        def placed(radial: Array, axial: Array) -> Array:
            return np.stack([radial * cos, radial * sin, axial], axis=1)

        place, normals = placed(r, z), placed(n_r, n_z)
        tangential, normal = u[:, None] * placed(n_z, -n_r), w[:, None] * normals
        cortex = tangential + normal - pushed[:, None] * normals
        ways = ways_of(place, tangential, normal, cortex)
        return Points(place, normals, weights * r * size, c, ways)

    @cached_property
    def _body(self) -> StokesBody:
        """The surface in a fluid, with the modes that its shape and its flow have."""
        shape = np.abs([self.meridian.r_sines, self.meridian.z_cosines]).max(axis=0)
        flow = np.abs(self._given[:2]).max(axis=0)
        present = (shape > MIN_MODE * shape.max()) | (flow > MIN_MODE * flow.max())
        highest = int(np.flatnonzero(present)[-1]) + 1
        return StokesBody(self.meridian, max(highest, MIN_MODES))

    @cached_property
    def everywhere(self) -> Points:
        """Points of the whole surface."""
        body = self._body
        phi = np.arange(AROUND) * (2.0 * np.pi / AROUND)
        r, _, size, *_ = self._on_meridian(body.x)
        weights = body.weights / (r * size) * (2.0 * np.pi / AROUND)
        x, phi = (a.ravel() for a in np.meshgrid(body.x, phi, indexing="ij"))
        return self._points(x, phi, np.repeat(weights, AROUND))

    def band(self, half_width: float) -> Points:
        """Points within an angle [rad] of the equator."""
        begin, end = (self._at_angle(0.5 * np.pi + a) for a in (-half_width, half_width))
        s, w = gauss(CAP_POINTS)
        x, weights = begin + (end - begin) * s, (end - begin) * w
        phi = np.arange(AROUND) * (2.0 * np.pi / AROUND)
        x, phi = (a.ravel() for a in np.meshgrid(x, phi, indexing="ij"))
        return self._points(x, phi, np.repeat(weights, AROUND) * (2.0 * np.pi / AROUND))

    def cap(self, half_angle: float, axis: Array | None) -> list[tuple[Points, Array]]:
        """Points within an angle [rad] of an axis across the polarity; all sides are alike."""
        turn = 0.0 if axis is None else float(np.arctan2(axis[1], axis[0]))
        begin, end = (self._at_angle(0.5 * np.pi + a) for a in (-half_angle, half_angle))
        # as a sine, since the width of the cap has the slope of a square root at its ends
        s, w = gauss(CAP_POINTS)
        phase = np.pi * (s - 0.5)
        x = 0.5 * (begin + end) + 0.5 * (end - begin) * np.sin(phase)
        weights = 0.5 * (end - begin) * np.cos(phase) * np.pi * w
        r, z, *_ = self._on_meridian(x)
        ratio = np.cos(half_angle) * np.hypot(r, z) / r
        width = np.arccos(np.clip(ratio, -1.0, 1.0))
        a, wa = gauss(CAP_ANGLES)
        phi = width[:, None] * (2.0 * a - 1.0) + turn
        both = weights[:, None] * (2.0 * width)[:, None] * wa
        x = np.repeat(x, CAP_ANGLES)
        middle = np.array([np.cos(turn), np.sin(turn), 0.0])
        return [(self._points(x, phi.ravel(), both.ravel()), middle)]

    def _at_angle(self, theta: float) -> float:
        """The x at which the direction from the center has an angle theta [rad] to the axis."""

        def excess(x: float) -> float:
            r, z = self.meridian.position(np.array([x]))
            return float(np.arctan2(r[0], z[0]) - theta)

        if theta <= 0.0 or theta >= np.pi:
            return min(max(theta, 0.0), np.pi)
        return bracketed_root(excess, 0.0, np.pi, xtol=1e-15, rtol=1e-14)

    @cached_property
    def drag(self) -> tuple[Array, Array]:
        """See `SurfaceInFluid`."""
        body = self._body
        r, z, _, n_r, n_z, u, w, *_ = self._on_meridian(body.x)
        one, zero = np.ones_like(r), np.zeros_like(r)
        # axisymmetric: along the axis, around it, the flow, the normal motion
        shared = np.stack(
            [
                np.stack([zero, zero, one]),
                np.stack([zero, r, zero]),
                np.stack([u * n_z, zero, -u * n_r]),
                np.stack([w * n_r, zero, w * n_z]),
            ]
        )
        forces = -np.concatenate(
            [body.tractions(shared[:2], 0), body.outside_tractions(shared[2:])]
        )
        rule = body.weights
        found = 2.0 * np.pi * np.einsum("kin,lin,n->kl", forces, shared, rule)
        matrix = np.zeros((WAYS, WAYS))
        places = np.array([2, 5, TANGENTIAL, NORMAL])
        error = np.zeros((6, 2))
        error[[2, 5]] = found[:2, 2:] - found[2:, :2].T
        found[:2, 2:] = found[2:, :2].T
        matrix[np.ix_(places, places)] = 0.5 * (found + found.T)
        # translation along x, and rotation around y, which goes with it
        across = np.stack([np.stack([one, -one, zero]), np.stack([z, -z, -r])])
        sides = np.pi * np.einsum("kin,lin,n->kl", -body.tractions(across, 1), across, rule)
        sides = 0.5 * (sides + sides.T)
        for translation, rotation, sign in ((0, 4, 1.0), (1, 3, -1.0)):
            matrix[translation, translation] = sides[0, 0]
            matrix[rotation, rotation] = sides[1, 1]
            matrix[translation, rotation] = matrix[rotation, translation] = sign * sides[0, 1]
        matrix[CORTEX] = matrix[:, CORTEX] = 0.0
        return matrix, error

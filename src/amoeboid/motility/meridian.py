"""Bodies of revolution in a Stokes fluid: single-layer equations for each azimuthal order.

The meridian is r = sum r_k sin kx, z = sum z_k cos kx, 0 <= x <= pi, around the axis z. Densities
are sine and cosine series too, collocated at midpoints of x. The integrals towards the singular
point use Gauss points that crowd there as a power of their distance.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from amoeboid.arrays import Array
from amoeboid.motility.ring_kernels import RingIntegrals, double_layer, single_layer

# Gauss points on each side of the singular point for each mode, beside a number of them, and the
# power in which they crowd there: the logarithm of the kernel is as good as smooth then.
POINTS_PER_MODE, MORE_POINTS, CROWDING = 1.0, 28, 5


@lru_cache(maxsize=16)
def gauss(count: int) -> tuple[Array, Array]:
    """Points and weights of the Gauss rule on (0, 1)."""
    x, w = np.polynomial.legendre.leggauss(count)
    return 0.5 * (x + 1.0), 0.5 * w


@dataclass(frozen=True, eq=False)
class Meridian:
    """The curve that a body is made from by revolution around z, from z > 0 to z < 0.

    `r_sines` (n,): those of sin x ... sin nx; `z_cosines` (n,): those of 1 ... cos (n - 1)x [L].
    """

    r_sines: Array
    z_cosines: Array

    @property
    def modes(self) -> int:
        """Number of modes."""
        return len(self.r_sines)

    def position(self, x: Array) -> tuple[Array, Array]:
        """r and z at x [L]."""
        k = np.arange(1, self.modes + 1)
        return np.sin(x[..., None] * k) @ self.r_sines, np.cos(
            x[..., None] * (k - 1)
        ) @ self.z_cosines

    def slope(self, x: Array) -> tuple[Array, Array]:
        """dr/dx and dz/dx [L]; (-dz/dx, dr/dx) points outward."""
        k = np.arange(1, self.modes + 1)
        return np.cos(x[..., None] * k) @ (k * self.r_sines), -np.sin(x[..., None] * (k - 1)) @ (
            (k - 1) * self.z_cosines
        )

    def separation(self, x0: Array, h: Array) -> tuple[Array, Array]:
        """r(x0) - r(x0 + h) and z(x0) - z(x0 + h), exact for small h too [L]."""
        k = np.arange(1, self.modes + 1)
        middle, half = x0 + 0.5 * h, 0.5 * h
        radial = -2.0 * (np.cos(middle[..., None] * k) * np.sin(half[..., None] * k))
        axial = 2.0 * (np.sin(middle[..., None] * (k - 1)) * np.sin(half[..., None] * (k - 1)))
        return radial @ self.r_sines, axial @ self.z_cosines


class StokesBody:
    """Tractions on a body of revolution that moves through a fluid of viscosity 1.

    Velocities and tractions have the cylindrical components r, phi, z (3, n) at `x`, the midpoints.
    """

    def __init__(self, meridian: Meridian, modes: int) -> None:
        self.meridian, self.n = meridian, modes
        self.x = (np.arange(modes) + 0.5) * (np.pi / modes)

    @cached_property
    def _sources(self) -> tuple[Array, Array, Array]:
        """Points x0 + h (n, q) for each target: h, x0 + h, and weights."""
        count = int(POINTS_PER_MODE * self.n) + MORE_POINTS
        s, w = gauss(count)
        crowded, weights = s**CROWDING, CROWDING * s ** (CROWDING - 1) * w
        left, right = self.x[:, None], np.pi - self.x[:, None]
        h = np.concatenate([-left * crowded, right * crowded], axis=1)
        return h, self.x[:, None] + h, np.concatenate([left * weights, right * weights], axis=1)

    @cached_property
    def _rings(self) -> RingIntegrals:
        h, x, _ = self._sources
        x0 = np.broadcast_to(self.x[:, None], h.shape)
        radial, axial = self.meridian.separation(x0, h)
        r0 = np.broadcast_to(self.meridian.position(self.x)[0][:, None], h.shape)
        return RingIntegrals(r0, self.meridian.position(x)[0], radial, axial)

    @cached_property
    def _elements(self) -> Array:
        """Weights times r ds/dx (n, q)."""
        _, x, weights = self._sources
        r_x, z_x = self.meridian.slope(x)
        return weights * self._rings.r * np.hypot(r_x, z_x)

    @cached_property
    def weights(self) -> Array:
        """Areas (n,) over 2 pi of the midpoints: integrals of smooth even fields [L^2]."""
        r_x, z_x = self.meridian.slope(self.x)
        k = np.arange(1, self.n + 1)
        to_odd = (2.0 / self.n) * np.sin(np.outer(k, self.x))
        to_odd[-1] *= 0.5
        rule = ((1.0 - (-1.0) ** k) / k) @ to_odd
        return np.asarray(rule * self.meridian.position(self.x)[0] * np.hypot(r_x, z_x))

    @cached_property
    def normals(self) -> tuple[Array, Array]:
        """Components r and z (n,) of the outward normals at the midpoints."""
        r_x, z_x = self.meridian.slope(self.x)
        size = np.hypot(r_x, z_x)
        return -z_x / size, r_x / size

    def tractions(self, velocities: Array, m: int) -> Array:
        """Those of velocities (k, 3, n) of order m with no flow inside, or of rigid motions."""
        from scipy.linalg import lu_solve  # not for every run that imports this

        lu, bases, weight = self._factored(m)
        rows = np.swapaxes(velocities, 0, 2)  # (n, 3, k)
        if m == 0:
            meridional = rows[:, [0, 2]].reshape(2 * self.n, -1)
            found = lu_solve(lu[0], meridional)
            azimuthal = lu_solve(lu[1], rows[:, 1])
            parts = [found[: self.n], azimuthal, found[self.n :]]
        else:
            found = lu_solve(lu[0], rows.reshape(3 * self.n, -1))
            parts = np.split(found, 3)
        values = [basis @ part for basis, part in zip(bases, parts, strict=True)]
        return -weight * np.swapaxes(np.stack(values), 0, 2).swapaxes(1, 2)

    def outside_tractions(self, velocities: Array) -> Array:
        """Those of any velocities (k, 3, n) of order 0 without swirl, by the fluid outside."""
        return self.tractions(self._outside_sources(velocities), 0)

    def _outside_sources(self, velocities: Array) -> Array:
        """v/2 - (double layer of v)/(8 pi): its single-layer density is the traction outside."""
        _, x, _ = self._sources
        r_x, z_x = self.meridian.slope(x)
        size = np.hypot(r_x, z_x)
        kernel = double_layer(self._rings, -z_x / size, r_x / size) * self._elements
        sines, cosines = self._modes(x)
        k = np.arange(1, self.n + 1)
        to_odd = (2.0 / self.n) * np.sin(np.outer(k, self.x))
        to_odd[-1] *= 0.5
        to_even = (2.0 / self.n) * np.cos(np.outer(k - 1, self.x))
        to_even[0] *= 0.5
        u_r = np.einsum("iqk,kj->ijq", sines, to_odd)
        u_z = np.einsum("iqk,kj->ijq", cosines, to_even)
        found = 0.5 * velocities
        for place, i in ((0, 0), (2, 1)):
            matrix = np.einsum("iq,ijq->ij", kernel[i, 0], u_r)
            found[:, place] -= velocities[:, 0] @ matrix.T / (8.0 * np.pi)
            matrix = np.einsum("iq,ijq->ij", kernel[i, 1], u_z)
            found[:, place] -= velocities[:, 2] @ matrix.T / (8.0 * np.pi)
        return found

    def _modes(self, x: Array) -> tuple[Array, Array]:
        k = np.arange(1, self.n + 1)
        return np.sin(x[..., None] * k), np.cos(x[..., None] * (k - 1))

    def _factored(self, m: int) -> tuple[list, list[Array], Array]:
        """Factorized equations, the basis at the midpoints for r, phi, z, and a scale."""
        if m not in self._known:
            self._known[m] = self._assembled(m)
        return self._known[m]

    @cached_property
    def _known(self) -> dict[int, tuple[list, list[Array], Array]]:
        return {}

    def _assembled(self, m: int) -> tuple[list, list[Array], Array]:
        from scipy.linalg import lu_factor

        kernel = single_layer(self._rings, m) * (self._elements / (8.0 * np.pi))
        sines, cosines = self._modes(self._sources[1])
        fields = [sines, sines, cosines] if m == 0 else [cosines, cosines, sines]
        sine, cosine = self._modes(self.x)
        bases = [sine, sine, cosine] if m == 0 else [cosine, cosine, sine]
        block = {
            (i, j): np.einsum("pq,pqk->pk", kernel[i, j], fields[j])
            for i in range(3)
            for j in range(3)
            if m == 1 or (i == 1) == (j == 1)
        }
        if m == 1:
            rows = [np.concatenate([block[i, j] for j in range(3)], axis=1) for i in range(3)]
            return [lu_factor(np.stack(rows, axis=1).reshape(3 * self.n, -1))], bases, np.ones(1)
        n_r, n_z = self.normals
        # without this a pressure, which drives no flow, would be free
        pressure = np.concatenate([(self.weights * n_r) @ sine, (self.weights * n_z) @ cosine])
        pressure /= self.meridian.r_sines[0]
        rows = [
            np.concatenate([block[i, 0], block[i, 2]], axis=1) + np.outer(normal, pressure)
            for i, normal in ((0, n_r), (2, n_z))
        ]
        meridional = lu_factor(np.stack(rows, axis=1).reshape(2 * self.n, -1))
        return [meridional, lu_factor(block[1, 1])], bases, np.ones(1)

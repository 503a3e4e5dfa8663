"""Stokes flow driven by forces on rings: the free-space kernels integrated over the azimuth.

With d from the source (r cos psi, r sin psi, z) to the target (r0, 0, z0) the Oseen tensor is
I/|d| + d d/|d|^3. Fields of azimuthal order m are (f_r cos m phi, f_phi sin m phi, f_z cos m phi),
in cylindrical components; for m = 0 the azimuthal component is one around the axis of its own.
Source: Pozrikidis, *Boundary integral and singularity methods* (1992), sections 2.1 and 2.4.
"""

from __future__ import annotations

import numpy as np

from amoeboid.arrays import Array

# Where the kernel varies little around the ring, b/a below this, the trapezoidal rule of so many
# points is exact to rounding; elliptic integrals would lose digits there.
MAX_RATIO, RING_POINTS = 0.5, 40


class RingIntegrals:
    """Integrals over psi of t^n/|d|^k, where t = 1 - cos psi: `of(k, n)`, k = 1, 3, 5, n to 3.

    `r0`, `r`: distances of target and source from the axis; `radial` = r0 - r and `axial` = z0 - z,
    exact where both are small; all of one shape.
    """

    def __init__(self, r0: Array, r: Array, radial: Array, axial: Array) -> None:
        self.r0, self.r, self.radial, self.axial = r0, r, radial, axial
        self._gap = radial**2 + axial**2
        self._twice = 2.0 * r0 * r
        a = self._gap + self._twice
        self._weak = self._twice < MAX_RATIO * a
        self._known = self._elliptic(a)
        self._by_rule = self._trapezoidal()

    def of(self, k: int, n: int) -> Array:
        """The integral over the whole ring."""
        found = np.array(self._recurrence(k, n))
        found[self._weak] = self._by_rule[k, n]
        return found

    def _elliptic(self, a: Array) -> dict[tuple[int, int], Array]:
        """Integrals (k, 0) of |d|^-k for k = -3, -1, 1, 3, 5."""
        from scipy.special import ellipe, ellipkm1  # not for every run that imports this

        b, gap = self._twice, self._gap
        root = np.sqrt(a + b)
        complement = gap / (a + b)
        K, E = ellipkm1(complement), ellipe(1.0 - complement)
        product = gap * (a + b)  # a^2 - b^2
        one, three, minus = 4.0 * K / root, 4.0 * E / (gap * root), 4.0 * E * root
        return {
            (1, 0): one,
            (3, 0): three,
            (5, 0): (4.0 * a * three - one) / (3.0 * product),
            (-1, 0): minus,
            (-3, 0): (4.0 * a * minus - product * one) / 3.0,
        }

    def _recurrence(self, k: int, n: int) -> Array:
        """From |d|^2 = gap + 2 r r0 t; without meaning where the kernel varies little."""
        if (k, n) not in self._known:
            lower = self._recurrence(k - 2, n - 1) - self._gap * self._recurrence(k, n - 1)
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                self._known[k, n] = np.asarray(lower / self._twice)
        return self._known[k, n]

    def _trapezoidal(self) -> dict[tuple[int, int], Array]:
        psi = np.linspace(0.0, np.pi, RING_POINTS // 2 + 1)
        weights = np.full(psi.size, 2.0 * np.pi / (RING_POINTS // 2))
        weights[[0, -1]] *= 0.5
        t = 1.0 - np.cos(psi)
        squares = self._gap[self._weak][:, None] + self._twice[self._weak][:, None] * t
        inverse = 1.0 / np.sqrt(squares)
        powers = np.stack([weights * t**n for n in range(4)], axis=1)
        found: dict[tuple[int, int], Array] = {}
        for k in (1, 3, 5):
            sums = inverse**k @ powers
            found |= {(k, n): sums[:, n] for n in range(4)}
        return found


def single_layer(rings: RingIntegrals, m: int) -> Array:
    """Kernel (3, 3, ...) from densities to velocities of order m = 0 or 1: r, phi, z.

    Velocities are 1/(8 pi viscosity) times its integral over the meridian with r ds.
    """
    r0, r, x, z = rings.r0, rings.r, rings.radial, rings.axial
    # each numerator is a polynomial in t, given by its coefficients
    toward = [x, r]  # d.e_r of the target: r0 - r cos psi
    along = [x, -r0]  # d.e_r of the source
    cosine, one = [1.0, -1.0], [1.0]
    even = one if m == 0 else cosine  # cos m psi
    sine = [0.0] if m == 0 else [0.0, 2.0, -1.0]  # sin psi sin m psi
    terms = {  # of |d|^-1 and of |d|^-3
        (0, 0): (_times(cosine, even), _times(toward, along, even)),
        (0, 1): (_scaled(sine, -1.0), _times(toward, _scaled(sine, -r0))),
        (0, 2): ([0.0], _times(_scaled(toward, z), even)),
        (1, 0): (_scaled(sine, -1.0), _times(along, _scaled(sine, r))),
        (1, 1): (_times(cosine, even), _times([0.0, 2.0, -1.0], _scaled(even, r * r0))),
        (1, 2): ([0.0], _scaled(sine, r * z)),
        (2, 0): ([0.0], _times(_scaled(along, z), even)),
        (2, 1): ([0.0], _scaled(sine, -r0 * z)),
        (2, 2): (even, _scaled(even, z * z)),
    }
    integrals = {(k, n): rings.of(k, n) for k in (1, 3) for n in range(2 if k == 1 else 4)}
    if m == 1:
        integrals[1, 2] = rings.of(1, 2)
    kernel = np.zeros((3, 3, *r.shape))
    for (i, j), parts in terms.items():
        for k, polynomial in zip((1, 3), parts, strict=True):
            for n, factor in enumerate(polynomial):
                if np.any(factor):
                    kernel[i, j] += factor * integrals[k, n]
    return kernel


def double_layer(rings: RingIntegrals, normal_r: Array, normal_z: Array) -> Array:
    """Kernel (2, 2, ...), r and z, from velocities of order 0 to their double layer there.

    It is u_i T_ijk n_k with the stress T = -6 d d d/|d|^5 of a point force, d from target to
    source here, and the normal n of the source; a constant u gives -4 pi u over the whole surface.
    """
    r0, r, x, z = rings.r0, rings.r, rings.radial, rings.axial
    along, toward = [x, -r0], [x, r]
    across = [normal_r * x + normal_z * z, -normal_r * r0]  # d.n
    moments = [rings.of(5, n) for n in range(4)]
    kernel = np.zeros((2, 2, *r.shape))
    for i, target in enumerate((toward, [z])):
        for j, source in enumerate((along, [z])):
            for n, factor in enumerate(_times(target, source, across)):
                kernel[i, j] += 6.0 * factor * moments[n]
    return kernel


def _times(*polynomials: list) -> list:
    product: list = [1.0]
    for factors in polynomials:
        longer: list = [0.0] * (len(product) + len(factors) - 1)
        for i, a in enumerate(product):
            for j, b in enumerate(factors):
                longer[i + j] = longer[i + j] + a * b
        product = longer
    return product


def _scaled(polynomial: list, factor: float | Array) -> list:
    return [factor * value for value in polynomial]

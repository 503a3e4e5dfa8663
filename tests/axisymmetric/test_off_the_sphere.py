"""Deformed polarized states against formulas written afresh, in Cartesian vectors or from r and z.

Nothing here calls the solver's own equations: the fields of a state are sampled and differentiated
numerically, and the balance laws are those of any surface in space.
"""

import numpy as np
import pytest
from scipy.interpolate import BarycentricInterpolator

from amoeboid.axisymmetric.harmonics import harmonics
from amoeboid.axisymmetric.perturbations import (
    base_fields,
    normals,
    rigid_motions,
    tangents,
    velocity_response,
)
from amoeboid.axisymmetric.search import steady_solutions
from amoeboid.axisymmetric.stability import (
    growth_rates,
)
from amoeboid.axisymmetric.steady import homogeneous
from amoeboid.model.parameters import Parameters

STENCIL = np.arange(-4, 5)
FIRST = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])

SOFT = Parameters(D=0.4, v_p0=6.0, alpha=0.02, delta_P=11.0, eta_b=0.5)


def slope(values, step, axis):
    """Central difference of order 8; entries nearer than 4 to the edge are wrapped and wrong."""
    return sum(w * np.roll(values, -k, axis) for k, w in zip(STENCIL, FIRST, strict=True)) / step


def turn(values):
    """d/dphi by Fourier series along axis 1."""
    modes = 1j * np.fft.fftfreq(values.shape[1], 1.0 / values.shape[1])
    shape = (1, -1) + (1,) * (values.ndim - 2)
    return np.fft.ifft(modes.reshape(shape) * np.fft.fft(values, axis=1), axis=1).real


def dot(a, b):
    return np.sum(a * b, axis=-1)


def force_density(X, v, c, zeta0, p, step):
    """(1/sqrt g) d_i(sqrt g sigma^ij X_j) + delta_P n for a surface X (x, phi, 3) in space."""
    tangents = slope(X, step, 0), turn(X)
    rates = slope(v, step, 0), turn(v)
    g = np.array([[dot(a, b) for b in tangents] for a in tangents])
    inverse = np.moveaxis(np.linalg.inv(np.moveaxis(g, (0, 1), (-2, -1))), (-2, -1), (0, 1))
    root = np.sqrt(g[0, 0] * g[1, 1] - g[0, 1] ** 2)
    strain = np.array(
        [[(dot(tangents[i], rates[j]) + dot(tangents[j], rates[i])) / 2 for j in (0, 1)]
         for i in (0, 1)]
    )  # fmt: skip
    raised = np.einsum("ik...,kl...,lj...->ij...", inverse, strain, inverse)
    dilation = np.einsum("ij...,ij...->...", inverse, strain)
    sigma = (p.eta_b * dilation - p.alpha * c + zeta0) * inverse + 2 * p.eta_s * raised
    normal = np.cross(tangents[0], tangents[1]) / root[..., None]
    force = p.delta_P * normal
    along, around = (
        sum((root * sigma[i, j])[..., None] * tangents[j] for j in (0, 1)) for i in (0, 1)
    )
    return force + (slope(along, step, 0) + turn(around)) / root[..., None]


def polarized(p):
    return steady_solutions(p, degrees=(1,))[-1]


@pytest.fixture(scope="module")
def soft():
    return polarized(SOFT)


@pytest.mark.parametrize("m", [1, 2, 3])
@pytest.mark.parametrize("column", ["h", "c"])
@pytest.mark.parametrize("extra", [0, 1, 2])
def test_a_perturbed_deformed_cell_is_in_force_balance(soft, m, column, extra):
    """First variation of the force on a surface that is deformed and not axisymmetric.

    Shape and concentration are perturbed by one harmonic, the cortex moves as the linearization
    says: the force on the surface must stay zero to first order.
    """
    degree = 40
    p, basis = soft.parameters, harmonics(m, degree, 72)
    base = base_fields([soft], p, basis)
    along, across = tangents(base, basis), normals(base, basis)
    response = velocity_response(p, base, along, across, rigid_motions(base, m))
    k = extra + (0 if column == "h" else basis.degrees.size)

    x = np.linspace(0.5, 2.6, 169)
    phi = np.linspace(0.0, 2 * np.pi, 48, endpoint=False)
    nodes, sine = np.cos(basis.x), np.sin(basis.x)

    def sampled(field, odd):
        """A field at x: a polynomial in cos(x), times sin(x) if it is odd at the poles."""
        smooth = BarycentricInterpolator(nodes, field / sine if odd else field)(np.cos(x))
        return (smooth * np.sin(x) if odd else smooth)[:, None]

    a, b, w = (f[0, :, k] for f in response)
    harmonic = across.values[:, extra]
    h, dc = (harmonic, 0 * harmonic) if column == "h" else (0 * harmonic, harmonic)
    odd = m % 2 == 1  # the harmonics are sin(x)^m times polynomials, a and b have one sine less
    a, b = sampled(a, not odd), sampled(b, not odd)
    w, h, dc = (sampled(f, odd) for f in (w, h, dc))
    r, sin_psi, U = (sampled(f[0, :, 0], True) for f in (base.r, base.sin_psi, base.U))
    z, cos_psi, W, c = (
        sampled(f[0, :, 0], False) for f in (base.z, base.cos_psi, base.W, base.c)
    )  # fmt: skip
    wave, swing, none = np.cos(m * phi), np.sin(m * phi), 0 * phi

    def vector(radial, azimuthal, axial):
        return np.stack(
            [radial * np.cos(phi) - azimuthal * np.sin(phi),
             radial * np.sin(phi) + azimuthal * np.cos(phi), axial + none], axis=-1
        )  # fmt: skip

    def force(size):
        X = vector(r + size * h * wave * sin_psi, none, z + size * h * wave * cos_psi)
        along, out = U + size * a * wave, W + size * w * wave
        v = vector(
            along * cos_psi + out * sin_psi, -size * b * swing, out * cos_psi - along * sin_psi
        )
        found = force_density(X, v, c + size * dc * wave, soft.zeta0, p, x[1] - x[0])
        return found[16:-16]

    assert np.abs(force(0.0)).max() < 1e-7
    coarse, fine = ((force(s) - force(-s)) / (2 * s) for s in (1e-3, 5e-4))
    variation = (4 * fine - coarse) / 3
    assert np.abs(variation).max() < 1e-5


@pytest.mark.parametrize(
    "p", [SOFT, Parameters(D=0.4, v_p0=6.0, delta_P=1.0), Parameters(v_p0=0.18, beta=0.0)]
)
def test_force_balance_and_transport_written_afresh(p):
    """From r, z, c and u on a fine grid, by finite differences, none of the solver's operators."""
    state = polarized(p)
    assert state.max_retrograde_speed > 0.05
    x = np.linspace(0.4, 2.7, 1151)
    step = x[1] - x[0]

    def d(field):
        return slope(field, step, 0)

    def inner(field):
        return field[20:-20]

    r, z = state.position(x)
    c, u = state.concentration(x), state.flow(x)
    ds = np.hypot(d(r), d(z))
    r_s, z_s = d(r) / ds, d(z) / ds
    meridian = d(r_s) / ds * z_s - d(z_s) / ds * r_s
    parallel = -z_s / r
    w = -p.v_p(c)
    e1, e2 = d(u) / ds + meridian * w, u * r_s / r + parallel * w
    isotropic = p.eta_b * (e1 + e2) - p.alpha * c + state.zeta0
    s1, s2 = isotropic + 2 * p.eta_s * e1, isotropic + 2 * p.eta_s * e2
    tangential = d(r * s1) / ds - s2 * r_s
    normal = p.delta_P - meridian * s1 - parallel * s2
    flux = r * (p.D * d(c) / ds - c * u)
    rate = d(flux) / ds / r + p.beta * (p.c0 - c)
    units = p.delta_P + np.abs(s1).max(), np.abs(c).max() * np.abs(u).max()
    assert np.abs(inner(tangential)).max() < 1e-9 * units[0]
    assert np.abs(inner(normal)).max() < 1e-9 * units[0]
    assert np.abs(inner(rate)).max() < 1e-9 * units[1]


def test_without_turnover_the_filament_number_is_no_mode():
    """beta = 0, m = 0: area, translation and filament number leave 2 (L + 1) - 3 rates, none 0."""
    rest = Parameters(D=0.03, beta=0.0, v_p0=0.15)
    for state in (homogeneous(rest), polarized(rest.replace(v_p0=0.18))):
        p = state.parameters
        for degree in (16, 30):
            rates = growth_rates(state, 0, degree)
            assert rates.size == 2 * (degree + 1) - 3
            assert np.abs(rates).min() > 1e-3 * p.D
        assert growth_rates(homogeneous(p.replace(beta=1.0)), 0, 16).size == 2 * 17 - 2

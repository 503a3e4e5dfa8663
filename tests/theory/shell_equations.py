"""The thin-shell model itself, symbolically: what the derivations of the tests start from.

An axisymmetric surface near the sphere is (w, z) = (s W, Z) with x = cos(theta), s^2 = 1 - x^2 and
polynomials W, Z of x. Everything follows from its metric, its area and its volume: the dissipation
function (SI `dissipation`, with the metric rate as the derivative of the metric along the flow),
the energy zeta_0 A - delta_P V, and the power of the elastic stress -alpha c I.
"""

import sympy as sp

x, flow, test, eps = sp.symbols("x flow test epsilon")
R0, delta_P, eta_s, eta_b, c0, beta, D, alpha, zeta_0 = sp.symbols(
    "R0 delta_P eta_s eta_b c0 beta D alpha zeta_0", positive=True
)
f = sp.symbols("f0:6", real=True)
S = eta_s + eta_b
s2 = 1 - x**2


def legendre(l):
    return sp.legendre(l, x)


def integral(expression):
    """Integral over x; over the sphere it is this times 2 pi."""
    powers = sp.Poly(expression, x).terms()
    return sum(coefficient * sp.Rational(2, k + 1) for (k,), coefficient in powers if k % 2 == 0)


class Vectors:
    """A field (V e_r + T e_theta) with T = -s * slope, as increments of the embedding (W, Z)."""

    def __init__(self, radial, slope):
        # e_r = (s, x), e_theta = (x, -s): s W gains s (V - x slope), Z gains x V + s^2 slope.
        self.W = radial - x * slope
        self.Z = x * radial + s2 * slope


def embedding(shape, *moves):
    """(W, Z) of r = shape(x) e_r displaced by fields times their parameters."""
    W, Z = shape, x * shape
    for parameter, field in moves:
        W, Z = W + parameter * field.W, Z + parameter * field.Z
    return W, Z


def meridian_metric(W, Z):
    """s^2 (w_x^2 + z_x^2), free of square roots."""
    return (s2 * sp.diff(W, x) - x * W) ** 2 + s2 * sp.diff(Z, x) ** 2


def strain_rates(shape, field):
    """(g^{alpha beta} dg_{alpha beta}/dt)/2, meridian and azimuthal part, at a flow `field`."""
    W, Z = embedding(shape, (flow, field))
    m = meridian_metric(W, Z)
    meridian = sp.diff(m, flow).subs(flow, 0) / (2 * sp.expand(m.subs(flow, 0)))
    azimuth = (sp.diff(W, flow) / W).subs(flow, 0)
    return meridian, azimuth


def area_density(shape):
    """dA = 2 pi (this) dx."""
    W, Z = embedding(shape)
    return W * sp.sqrt(sp.expand(meridian_metric(W, Z)))


def dissipation_variation(shape, field, variation):
    """Integrand (over 2 pi dx) of the variation of the dissipation function."""
    m, a = strain_rates(shape, field)
    dm, da = strain_rates(shape, variation)
    k = test
    trace, squares = (m + k * dm) + (a + k * da), (m + k * dm) ** 2 + (a + k * da) ** 2
    density = (eta_b * (2 * trace) ** 2 / 8 + eta_s * 4 * squares / 4) * area_density(shape)
    return sp.diff(density, k).subs(k, 0)


def energy_variation(shape, variation):
    """Integrand of the variation of zeta_0 A - delta_P V."""
    W, Z = embedding(shape, (test, variation))
    area = W * sp.sqrt(sp.expand(meridian_metric(W, Z)))
    volume = s2 * W**2 * sp.diff(Z, x) / 2
    return sp.diff(zeta_0 * area - delta_P * volume, test).subs(test, 0)


def elastic_variation(shape, c, variation):
    """Integrand of the virtual power of the stress -alpha c I."""
    m, a = strain_rates(shape, variation)
    return -alpha * c * (m + a) * area_density(shape)


def weak_form(shape, field, c, variation):
    """Virtual power of all forces, zero for every variation when forces balance."""
    return (
        dissipation_variation(shape, field, variation)
        + elastic_variation(shape, c, variation)
        + energy_variation(shape, variation)
    )


def at_order(expression, order):
    """Coefficient of eps^order of an integrand, integrated."""
    coefficient = sp.diff(expression, eps, order).subs(eps, 0) / sp.factorial(order)
    return integral(sp.expand(coefficient))


def radial(P):
    return Vectors(P, 0)


def tangential(P):
    """The surface gradient of P on the unit sphere: e_theta dP/dtheta = -s P' e_theta."""
    return Vectors(0, sp.diff(P, x))


def plus(first, second):
    total = Vectors(0, 0)
    total.W, total.Z = first.W + second.W, first.Z + second.Z
    return total


def tension_of_the_sphere():
    """zeta_0 for which the resting sphere is in balance."""
    balance = weak_form(R0 + 0 * x, radial(-f[0]), c0, radial(sp.Integer(1)))
    (found,) = sp.solve(integral(sp.expand(balance)), zeta_0)
    return sp.simplify(found)


def linear_dynamics(l):
    """The matrix of d(c_l, rho_l)/dt, from the weak form on the deformed sphere."""
    P = legendre(l)
    rho, q, n, t = sp.symbols("rho q n t")
    shape = R0 * (1 + eps * rho * P)
    cortex = plus(radial(-f[0] + eps * n * P), _scaled(tangential(P), eps * t))
    c = c0 + eps * q * P
    equations = [
        at_order(weak_form(shape, cortex, c, variation), 1).subs(zeta_0, tension_of_the_sphere())
        for variation in (radial(P), tangential(P))
    ]
    solution = sp.solve(equations, [n, t], dict=True)[0]
    # v = v_c + v_p n with n = e_r - eps rho grad P: the first-order part, on the sphere.
    normal, slope = solution[n] + f[1] * q, solution[t] - f[0] * rho
    m, a = strain_rates(R0 + 0 * x, plus(_scaled(radial(P), normal), _scaled(tangential(P), slope)))
    dilatation = integral(sp.expand((m + a) * P)) / integral(P**2)
    L = l * (l + 1)
    rates = [-c0 * dilatation - (L * D / R0**2 + beta) * q, normal / R0]
    return sp.Matrix([[sp.diff(sp.expand(rate), v) for v in (q, rho)] for rate in rates])


def flow_potential_of_mode(l):
    """psi_l of v = grad_s psi on a rigid sphere, per v_p mode (w) and concentration mode (q)."""
    P = legendre(l)
    w, q, t = sp.symbols("w q t")
    cortex = plus(radial(-w * P), _scaled(tangential(P), t))
    sphere = R0 + 0 * x
    # Only tangential variations: the pressure keeps the shape, so normal forces balance anyway.
    balance = dissipation_variation(sphere, cortex, tangential(P)) + elastic_variation(
        sphere, q * P, tangential(P)
    )
    (found,) = sp.solve(integral(sp.expand(balance)), t)
    return sp.expand(found * R0), w, q


def _scaled(field, factor):
    scaled = Vectors(0, 0)
    scaled.W, scaled.Z = factor * field.W, factor * field.Z
    return scaled


def amplitude_rates(orders):
    """{l: d c_l/dt} of the rigid sphere in a ~ eps, b ~ eps^2, d ~ eps^3, l-th to orders[l].

    Also the amplitudes, and the symbols of the responses (per w, per q) of the modes.
    """
    amplitudes = sp.symbols("a b d")
    highest = max(orders.values())
    perturbation = sum(
        eps**k * amplitude * legendre(k) for k, amplitude in enumerate(amplitudes, start=1)
    )
    powers = [sp.Integer(1)]
    for _ in range(5):
        powers.append(_truncated(powers[-1] * perturbation, highest))
    speed = sum(f[k] * powers[k] / sp.factorial(k) for k in range(1, 6))
    responses = {l: sp.symbols(f"w_{l} q_{l}") for l in range(1, highest + 1)}
    potential_slope = sum(
        (per_w * _mode(speed, l) + per_q * _mode(perturbation, l)) * sp.diff(legendre(l), x)
        for l, (per_w, per_q) in responses.items()
    )
    flux = _truncated((c0 + perturbation) * potential_slope * s2, highest)
    rates = {}
    for l, order in orders.items():
        # -(div(c v))_l by parts, plus diffusion and turnover of the mode itself.
        advected = _mode_of_slope(flux, l) / R0**2
        linear = -(l * (l + 1) * D / R0**2 + beta) * eps**l * amplitudes[l - 1]
        rates[l] = _truncated(advected + linear, order).subs(eps, 1)
    return rates, amplitudes, responses


def _mode_of_slope(flux, l):
    return sp.Rational(2 * l + 1, 2) * integral(flux * sp.diff(legendre(l), x))


def _mode(expression, l):
    return sp.expand(sp.Rational(2 * l + 1, 2) * integral(expression * legendre(l)))


def _truncated(expression, order):
    expanded = sp.expand(expression)
    return sum(expanded.coeff(eps, k) * eps**k for k in range(order + 1))

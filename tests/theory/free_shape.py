"""The steady amplitude equations of the cell with a free shape, derived in a polynomial ring.

The meridian is r = R0 h(theta) with h = 1 + e^2 rho P_2 + e^3 sigma P_3 + ..., x = cos(theta), and
the flow is given by theta' = -sin(theta) q(x). All fields are series in e (lists of polynomials);
the equations are the strong form of the shell: tangential and normal force balance with
v_c = u t - v_p n, transport of c on a resting surface, area and filament number. Independent of
`shell_equations`, which goes through the dissipation function and the energy.

Units: R0 = 1 and S = eta_s + eta_b = 1, so f_k stands for f_k/R0, D for D/R0^2, K_k for K_k/R0
with K_k = -R0 tau_k/(2S), tau_k the k-th derivative of the isotropic stress, and P for
delta_P R0/S; eta_s = y. G_2 = 1/(3 + 2 y) and G_3 = 1/(6 + 5 y) are variables of their own.
"""

from functools import cache
from functools import reduce as fold
from math import factorial

import sympy as sp
from sympy import QQ
from sympy.polys.rings import ring

ORDER = 5
RING, *_GENERATORS = ring("x a b d rho sigma f0:6 c0 D beta K1:6 P y G2 G3", QQ)
x, a, b, d, rho, sigma, *_REST = _GENERATORS
f, (c0, D, beta), K, (P, y, G2, G3) = _REST[:6], _REST[6:9], (0, *_REST[9:14]), _REST[14:]
SQUARED_SINE = 1 - x**2
AMPLITUDES = (a, b, d, rho, sigma)
HALF = QQ(1, 2)
X = sp.Symbol("x")


@cache
def legendre(l):
    """P_l as an element of the ring."""
    terms = sp.Poly(sp.legendre(l, X), X).terms()
    return sum((QQ(int(c.p), int(c.q)) * x**k for (k,), c in terms), RING(0))


def constant(value):
    return [RING(value)] + [RING(0)] * ORDER


def plus(*series):
    return [sum(terms, RING(0)) for terms in zip(*series, strict=True)]


def times(*factors):
    """Product of series and of scalars (elements of the ring or numbers)."""
    return fold(_product, (s if isinstance(s, list) else constant(s) for s in factors))


def _product(s, t):
    return [
        sum((s[i] * t[k - i] for i in range(k + 1) if s[i] and t[k - i]), RING(0))
        for k in range(ORDER + 1)
    ]


def slope(series):
    """d/dx."""
    return [s.diff(x) for s in series]


def inverse(s):
    """1/s of a series that starts with 1."""
    found = [RING(1)]
    for k in range(1, ORDER + 1):
        found.append(-sum((s[i] * found[k - i] for i in range(1, k + 1)), RING(0)))
    return found


def root(s):
    """sqrt(s) of a series that starts with 1."""
    found = [RING(1)]
    for k in range(1, ORDER + 1):
        found.append(HALF * (s[k] - sum((found[i] * found[k - i] for i in range(1, k)), RING(0))))
    return found


def integral(element):
    """Integral over x from -1 to 1."""
    found = RING(0)
    for (power, *others), coefficient in element.terms():
        if power % 2 == 0:
            found += RING({(0, *others): coefficient * QQ(2, power + 1)})
    return found


def mode(element, l):
    """Coefficient of P_l."""
    return integral(element * legendre(l)) * QQ(2 * l + 1, 2)


def slope_mode(element, l):
    """Coefficient of P_l'."""
    test = SQUARED_SINE * legendre(l).diff(x)
    return integral(element * test) * QQ(2 * l + 1, 2 * l * (l + 1))


def simplified(element):
    """Partial fractions in y: no products of two of y, G2 and G3."""
    rules = {
        (y, G2): HALF - 3 * HALF * G2,
        (y, G3): QQ(1, 5) - QQ(6, 5) * G3,
        (G2, G3): QQ(5, 3) * G3 - QQ(2, 3) * G2,
    }
    for pair, instead in rules.items():
        places = [RING.gens.index(g) for g in pair]
        with_both = {m: c for m, c in element.terms() if all(m[k] for k in places)}
        if with_both:
            kept = element - RING(with_both)
            replaced = RING(0)
            for powers, coefficient in with_both.items():
                fewer = tuple(n - (k in places) for k, n in enumerate(powers))
                replaced += RING({fewer: coefficient}) * instead
            return simplified(kept + replaced)
    return element


class Steady:
    """All equations of a resting shape in e; `flow` is q, from the tangential force balance."""

    def __init__(self):
        self._set_shape(RING(0))
        radius = -HALF * HALF * integral(self.area[4])  # keeps the area
        self._set_shape(radius)
        self._set_concentration(RING(0))
        mean = -HALF * integral(times(self.c, self.area)[4])  # keeps the filament number
        self._set_concentration(mean)
        self._set_stress_of_polymerization()
        self.flow = constant(0)
        # what the tangential force of t P_l' is on the sphere, inverted
        response = {1: HALF, 2: HALF * G2, 3: HALF * G3}
        for k in range(1, ORDER + 1):
            force = self.tangential_force()[k]
            for l in (1, 2, 3):
                change = simplified(slope_mode(force, l) * response[l])
                self.flow[k] -= change * legendre(l).diff(x)

    def _set_shape(self, radius):
        zero = RING(0)
        self.h = h = [RING(1), zero, rho * legendre(2), sigma * legendre(3), radius, zero]
        h_x = slope(h)
        h_theta_theta = plus(times(SQUARED_SINE, slope(h_x)), times(-x, h_x))
        squared = times(SQUARED_SINE, h_x, h_x)
        metric = plus(times(h, h), squared)
        self.g = root(metric)  # ds/dtheta
        self.one_over_g = inverse(self.g)
        self.log_h_x = times(h_x, inverse(h))
        self.log_g_x = times(HALF, slope(metric), self.one_over_g, self.one_over_g)
        self.area = times(h, self.g)  # dA = 2 pi (this) dx
        cubed = times(self.one_over_g, self.one_over_g, self.one_over_g)
        bend = plus(times(h, h), times(2, squared), times(-1, h, h_theta_theta))
        self.kappa_1 = times(bend, cubed)
        self.kappa_2 = times(plus(h, times(x, h_x)), inverse(h), self.one_over_g)

    def _set_concentration(self, mean):
        zero = RING(0)
        self.c = [zero, a * legendre(1), b * legendre(2), d * legendre(3), mean, zero]
        powers = [constant(1)]
        for _ in range(5):
            powers.append(times(powers[-1], self.c))
        terms = (times(QQ(1, factorial(k)), f[k], powers[k]) for k in range(6))
        self.speed = plus(*terms)
        terms = (times(-2 * QQ(1, factorial(k)), K[k], powers[k]) for k in range(1, 6))
        self.isotropic = plus(*terms)  # tau(c) - tau(c0)

    def _set_stress_of_polymerization(self):
        normal = times(-1, self.speed)
        self.stretch_1, self.stretch_2 = times(self.kappa_1, normal), times(self.kappa_2, normal)
        difference = plus(self.kappa_1, times(-1, self.kappa_2))
        # exact division: the two curvatures are equal at the poles
        over_sine = [term.exquo(RING(SQUARED_SINE)) for term in difference]
        self.shear_over_sine = times(over_sine, normal)

    def _stresses(self):
        """(sigma_1, (sigma_1 - sigma_2)/sin^2) without the tension."""
        q = self.flow
        along = plus(slope(q), times(q, self.log_g_x))
        stretch_1 = plus(times(-x, q), times(SQUARED_SINE, along), self.stretch_1)
        around = plus(times(-x, q), times(SQUARED_SINE, q, self.log_h_x), self.stretch_2)
        shear = plus(along, times(-1, q, self.log_h_x), self.shear_over_sine)
        isotropic = plus(times(1 - y, plus(stretch_1, around)), self.isotropic)
        return plus(isotropic, times(2 * y, stretch_1)), times(2 * y, shear)

    def tangential_force(self):
        """Tangential force per sin(theta), times g."""
        first, shear = self._stresses()
        cosine = plus(constant(x), times(-SQUARED_SINE, self.log_h_x))
        return plus(times(-1, slope(first)), times(cosine, shear))

    def normal_force(self, l):
        """Mode P_l of delta_P - kappa_1 sigma_1 - kappa_2 sigma_2, with the tension of mode 0."""
        first, shear = self._stresses()
        second = plus(first, times(-SQUARED_SINE, shear))
        tension = constant(P * HALF + 2 * f[0])

        def force():
            one = times(self.kappa_1, plus(first, tension))
            other = times(self.kappa_2, plus(second, tension))
            return plus(constant(P), times(-1, one), times(-1, other))

        tension[2] = HALF * mode(force()[2], 0)
        return [simplified(mode(k, l)) for k in force()]

    def transport(self, l):
        """Rate of mode l of c: the weak form with P_l, over the square of P_l on the shape."""
        test, test_x = legendre(l), SQUARED_SINE * legendre(l).diff(x)
        carried = times(test_x, self.area, plus(constant(c0), self.c), self.flow)
        spread = times(-D * test_x, slope(self.c), self.h, self.one_over_g)
        renewed = times(-beta * test, self.c, self.area)
        mass = times(test**2, self.area)
        ratio = inverse([integral(k) * QQ(2 * l + 1, 2) for k in mass])
        rate = [integral(k) * QQ(2 * l + 1, 2) for k in plus(carried, spread, renewed)]
        return [simplified(k) for k in times(rate, ratio)]

    def flow_speed(self):
        """u/sin(theta), positive towards the front, in e: -g q."""
        return [simplified(k) for k in times(-1, self.g, self.flow)]


def coefficients(element):
    """{powers of (a, b, d, rho, sigma): coefficient}."""
    found = {}
    for powers, number in element.terms():
        names = powers[1:6]
        rest = RING({(powers[0], 0, 0, 0, 0, 0, *powers[6:]): number})
        found[names] = found.get(names, RING(0)) + rest
    return found


def function(element):
    """The element as a function of {generator: number}."""
    names = [str(g) for g in RING.gens]

    def value(numbers):
        total = 0.0
        for powers, coefficient in element.terms():
            term = float(coefficient)
            for name, power in zip(names, powers, strict=True):
                term *= numbers[name] ** power if power else 1.0
            total += term
        return total

    return value

"""Arithmetic of truncated Taylor series: exact derivatives of any expression, to any order.

A series sum_k a_k h^k is kept as its coefficients; every elementary function is the classical
recurrence that its differential equation gives (Griewank & Walther, *Evaluating Derivatives*,
2nd ed. 2008, chapter 13). Coefficients are arrays of equal shape, real or complex.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

Coefficients = list[Any]


class Taylor:
    """A truncated series; `coefficients[k]` is the k-th derivative divided by k!."""

    __slots__ = ("coefficients",)

    def __init__(self, coefficients: Coefficients) -> None:
        self.coefficients = coefficients

    @classmethod
    def variable(cls, value: Any, order: int) -> Taylor:
        """The identity c -> c about `value`."""
        one, zero = np.ones_like(value), np.zeros_like(value)
        return cls([value, one, *[zero] * order][: order + 1])

    @classmethod
    def constant(cls, value: Any, order: int) -> Taylor:
        """A number that does not depend on the variable."""
        return cls([value, *[np.zeros_like(value)] * order])

    def derivatives(self) -> list[Any]:
        """Value and derivatives, in order."""
        return [a * math.factorial(k) for k, a in enumerate(self.coefficients)]

    def __neg__(self) -> Taylor:
        return Taylor([-a for a in self.coefficients])

    def __add__(self, other: Taylor) -> Taylor:
        pairs = zip(self.coefficients, other.coefficients, strict=True)
        return Taylor([a + b for a, b in pairs])

    def __sub__(self, other: Taylor) -> Taylor:
        return self + (-other)

    def __mul__(self, other: Taylor) -> Taylor:
        a, b = self.coefficients, other.coefficients
        return Taylor([sum(a[j] * b[k - j] for j in range(k + 1)) for k in range(len(a))])

    def __truediv__(self, other: Taylor) -> Taylor:
        a, b = self.coefficients, other.coefficients
        q: Coefficients = []
        for k in range(len(a)):
            q.append((a[k] - sum(q[j] * b[k - j] for j in range(k))) / b[0])
        return Taylor(q)

    def __pow__(self, other: Taylor) -> Taylor:
        if _is_constant(other):
            exponent = other.coefficients[0]
            if (
                exponent.ndim == 0
                and exponent.real == exponent
                and float(exponent.real).is_integer()
            ):
                return _integer_power(self, int(exponent.real))
            return _constant_power(self, exponent)
        return exp(other * log(self))


def _is_constant(s: Taylor) -> bool:
    return not any(np.any(a) for a in s.coefficients[1:])


def _integer_power(s: Taylor, n: int) -> Taylor:
    one = Taylor.constant(np.ones_like(s.coefficients[0]), len(s.coefficients) - 1)
    if n < 0:
        return one / _integer_power(s, -n)
    result, square = one, s
    while n:
        if n & 1:
            result = result * square
        square, n = square * square, n >> 1
    return result


def _constant_power(s: Taylor, p: Any) -> Taylor:
    a = s.coefficients
    b: Coefficients = [a[0] ** p]
    for k in range(1, len(a)):
        b.append(sum((p * j - (k - j)) * a[j] * b[k - j] for j in range(1, k + 1)) / (k * a[0]))
    return Taylor(b)


def exp(s: Taylor) -> Taylor:
    """Exponential: e' = s' e."""
    a = s.coefficients
    e: Coefficients = [np.exp(a[0])]
    for k in range(1, len(a)):
        e.append(sum(j * a[j] * e[k - j] for j in range(1, k + 1)) / k)
    return Taylor(e)


def log(s: Taylor) -> Taylor:
    """Natural logarithm: s l' = s'."""
    a = s.coefficients
    out: Coefficients = [np.log(a[0])]
    for k in range(1, len(a)):
        out.append((a[k] - sum(j * out[j] * a[k - j] for j in range(1, k)) / k) / a[0])
    return Taylor(out)


def sqrt(s: Taylor) -> Taylor:
    """Square root."""
    return _constant_power(s, np.asarray(0.5))


def _coupled(s: Taylor, first: Any, second: Any, sign: int) -> tuple[Taylor, Taylor]:
    """p' = s' q, q' = sign s' p: (sin, cos) for sign = -1, (sinh, cosh) for sign = +1."""
    a = s.coefficients
    p: Coefficients = [first]
    q: Coefficients = [second]
    for k in range(1, len(a)):
        terms = range(1, k + 1)
        new_p = sum(j * a[j] * q[k - j] for j in terms) / k
        new_q = sign * sum(j * a[j] * p[k - j] for j in terms) / k
        p.append(new_p)
        q.append(new_q)
    return Taylor(p), Taylor(q)


def sin(s: Taylor) -> Taylor:
    """Sine."""
    return _coupled(s, np.sin(s.coefficients[0]), np.cos(s.coefficients[0]), -1)[0]


def cos(s: Taylor) -> Taylor:
    """Cosine."""
    return _coupled(s, np.sin(s.coefficients[0]), np.cos(s.coefficients[0]), -1)[1]


def sinh(s: Taylor) -> Taylor:
    """Hyperbolic sine."""
    return _coupled(s, np.sinh(s.coefficients[0]), np.cosh(s.coefficients[0]), 1)[0]


def cosh(s: Taylor) -> Taylor:
    """Hyperbolic cosine."""
    return _coupled(s, np.sinh(s.coefficients[0]), np.cosh(s.coefficients[0]), 1)[1]


def tan(s: Taylor) -> Taylor:
    """Tangent: t' = (1 + t^2) s'."""
    return _riccati(s, np.tan(s.coefficients[0]), 1)


def tanh(s: Taylor) -> Taylor:
    """Hyperbolic tangent: t' = (1 - t^2) s'."""
    return _riccati(s, np.tanh(s.coefficients[0]), -1)


def _riccati(s: Taylor, first: Any, sign: int) -> Taylor:
    a = s.coefficients
    t: Coefficients = [first]
    u: Coefficients = [1 + sign * first * first]
    for k in range(1, len(a)):
        t.append(sum(j * a[j] * u[k - j] for j in range(1, k + 1)) / k)
        u.append(sign * sum(t[j] * t[k - j] for j in range(k + 1)))
    return Taylor(t)


FUNCTIONS: dict[str, Callable[[Taylor], Taylor]] = {
    "exp": exp,
    "log": log,
    "sqrt": sqrt,
    "sin": sin,
    "cos": cos,
    "tan": tan,
    "sinh": sinh,
    "cosh": cosh,
    "tanh": tanh,
}

"""Arithmetic of truncated Taylor series: exact derivatives of any expression, to any order.

A series sum_k a_k h^k is kept as its coefficients; every elementary function is the classical
recurrence that its differential equation gives (Griewank & Walther, *Evaluating Derivatives*,
2nd ed. 2008, chapter 13). Coefficients are numbers or arrays that broadcast, real or complex.

A series takes part in arithmetic with numbers and arrays, and in the functions of NumPy: a Python
function made of these may be called with a `Taylor` in place of an array.

>>> import numpy as np
>>> t = Taylor.variable(np.array([0.0, 1.0]), 2)
>>> [float(d[1]) for d in (2.0 * np.exp(-t)).derivatives()] == [2 / np.e, -2 / np.e, 2 / np.e]
True
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

Coefficients = list[Any]


class Taylor:
    """A truncated series; `coefficients[k]` is the k-th derivative divided by k!.

    Coefficients that are left out at the end, up to `order`, are 0.
    """

    __slots__ = ("coefficients", "order")

    def __init__(self, coefficients: Coefficients, order: int) -> None:
        self.coefficients = coefficients[: order + 1]
        self.order = order

    @classmethod
    def variable(cls, value: Any, order: int) -> Taylor:
        """The identity c -> c about `value`."""
        return cls([value, 1.0], order)

    def derivatives(self) -> list[Any]:
        """Value and derivatives, in order."""
        missing = self.order + 1 - len(self.coefficients)
        found = self.coefficients[:2] + [
            a * math.factorial(k) for k, a in enumerate(self.coefficients[2:], start=2)
        ]
        return found + [0.0] * missing

    def _like(self, coefficients: Coefficients) -> Taylor:
        return Taylor(coefficients, self.order)

    def _series(self, other: Any) -> Taylor:
        return other if isinstance(other, Taylor) else self._like([other])

    def __neg__(self) -> Taylor:
        return self._like([-a for a in self.coefficients])

    def __pos__(self) -> Taylor:
        return self

    def __add__(self, other: Any) -> Taylor:
        a, b = self.coefficients, self._series(other).coefficients
        longer = a if len(a) >= len(b) else b
        both = [x + y for x, y in zip(a, b, strict=False)]
        return self._like(both + longer[len(both) :])

    __radd__ = __add__

    def __sub__(self, other: Any) -> Taylor:
        return self + (-other)

    def __rsub__(self, other: Any) -> Taylor:
        return -self + other

    def __mul__(self, other: Any) -> Taylor:
        if not isinstance(other, Taylor):
            return self._like([a * other for a in self.coefficients])
        a, b = self.coefficients, other.coefficients
        last = min(self.order, len(a) + len(b) - 2)
        return self._like([_convolved(a, b, k) for k in range(last + 1)])

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Taylor:
        if not isinstance(other, Taylor):
            return self._like([a / other for a in self.coefficients])
        a, b = self.coefficients, other.coefficients
        q: Coefficients = []
        for k in range(self.order + 1):
            known = _sum(q[j] * b[k - j] for j in range(max(0, k - len(b) + 1), k))
            q.append(((a[k] if k < len(a) else 0.0) - known) / b[0])
        return self._like(q)

    def __rtruediv__(self, other: Any) -> Taylor:
        return self._series(other) / self

    def __pow__(self, other: Any) -> Taylor:
        if isinstance(other, Taylor):
            if len(other.coefficients) > 1:
                return exp(other * log(self))
            other = other.coefficients[0]
        exponent = np.asarray(other)
        if exponent.ndim == 0 and exponent.imag == 0 and float(exponent.real).is_integer():
            return _integer_power(self, int(exponent.real))
        return _constant_power(self, exponent[()])

    def __rpow__(self, other: Any) -> Taylor:
        return exp(self * np.log(other))

    def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
        """Raises TypeError: an array would lose the derivatives."""
        raise TypeError("a Taylor series is no array; use arithmetic and functions of NumPy on it")

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        """What a function of NumPy makes of series, and arithmetic with an array on the left."""
        function = _UFUNCS.get(ufunc)
        if function is None or method != "__call__" or options:
            return NotImplemented
        first, *others = inputs
        return function(self._series(first), *others)


def _convolved(a: Coefficients, b: Coefficients, k: int) -> Any:
    """Coefficient k of a product."""
    first, last = max(0, k - len(b) + 1), min(k, len(a) - 1)
    return _sum(a[j] * b[k - j] for j in range(first, last + 1))


def _sum(terms: Iterable[Any]) -> Any:
    """The sum, without adding an array to 0 first."""
    rest = iter(terms)
    return sum(rest, next(rest, 0.0))


def _integer_power(s: Taylor, n: int) -> Taylor:
    if n < 0:
        return 1.0 / _integer_power(s, -n)
    result = Taylor([np.ones_like(s.coefficients[0])], s.order)
    square = s
    while n:
        if n & 1:
            result = result * square
        n >>= 1
        if n:
            square = square * square
    return result


def _constant_power(s: Taylor, p: Any) -> Taylor:
    a = s.coefficients
    b: Coefficients = [a[0] ** p]
    for k in range(1, s.order + 1):
        terms = range(1, min(k, len(a) - 1) + 1)
        b.append(_sum((p * j - (k - j)) * a[j] * b[k - j] for j in terms) / (k * a[0]))
    return Taylor(b, s.order)


def _primitive(first: Any, s: Taylor, factor: Coefficients) -> Taylor:
    """f with f' = s' factor and the value `first`; `factor` may grow with the result."""
    a = s.coefficients
    f: Coefficients = [first]
    for k in range(1, s.order + 1):
        lowest = max(1, k - len(factor) + 1)
        terms = range(lowest, min(k, len(a) - 1) + 1)
        f.append(_sum(j / k * a[j] * factor[k - j] for j in terms))
    return Taylor(f, s.order)


def exp(s: Taylor) -> Taylor:
    """Exponential: e' = s' e."""
    a = s.coefficients
    e: Coefficients = [np.exp(a[0])]
    for k in range(1, s.order + 1):
        e.append(_sum(j / k * a[j] * e[k - j] for j in range(1, min(k, len(a) - 1) + 1)))
    return Taylor(e, s.order)


def log(s: Taylor) -> Taylor:
    """Natural logarithm: l' = s'/s."""
    return _primitive(np.log(s.coefficients[0]), s, (1.0 / s).coefficients)


def _coupled(s: Taylor, first: Any, second: Any, sign: int) -> tuple[Taylor, Taylor]:
    """p' = s' q, q' = sign s' p: (sin, cos) for sign = -1, (sinh, cosh) for sign = +1."""
    a = s.coefficients
    p: Coefficients = [first]
    q: Coefficients = [second]
    for k in range(1, s.order + 1):
        terms = range(1, min(k, len(a) - 1) + 1)
        new_p = _sum(j / k * a[j] * q[k - j] for j in terms)
        new_q = _sum(sign * j / k * a[j] * p[k - j] for j in terms)
        p.append(new_p)
        q.append(new_q)
    return Taylor(p, s.order), Taylor(q, s.order)


def _circular(s: Taylor) -> tuple[Taylor, Taylor]:
    return _coupled(s, np.sin(s.coefficients[0]), np.cos(s.coefficients[0]), -1)


def _hyperbolic(s: Taylor) -> tuple[Taylor, Taylor]:
    return _coupled(s, np.sinh(s.coefficients[0]), np.cosh(s.coefficients[0]), 1)


def _riccati(s: Taylor, first: Any, sign: int) -> Taylor:
    """t' = (1 + sign t^2) s': tan for sign = +1, tanh for sign = -1."""
    a = s.coefficients
    t: Coefficients = [first]
    u: Coefficients = [1 + sign * first * first]
    for k in range(1, s.order + 1):
        t.append(_sum(j / k * a[j] * u[k - j] for j in range(1, min(k, len(a) - 1) + 1)))
        u.append(sign * _sum(t[j] * t[k - j] for j in range(k + 1)))
    return Taylor(t, s.order)


def _arctan(s: Taylor) -> Taylor:
    return _primitive(np.arctan(s.coefficients[0]), s, (1.0 / (1.0 + s * s)).coefficients)


def _arcsinh(s: Taylor) -> Taylor:
    return _primitive(np.arcsinh(s.coefficients[0]), s, ((1.0 + s * s) ** -0.5).coefficients)


def _expm1(s: Taylor) -> Taylor:
    e = exp(s)
    return Taylor([np.expm1(s.coefficients[0]), *e.coefficients[1:]], s.order)


def _log1p(s: Taylor) -> Taylor:
    return _primitive(np.log1p(s.coefficients[0]), s, (1.0 / (1.0 + s)).coefficients)


_UFUNCS: dict[Any, Callable[..., Taylor]] = {
    np.add: lambda a, b: a + b,
    np.subtract: lambda a, b: a - b,
    np.multiply: lambda a, b: a * b,
    np.true_divide: lambda a, b: a / b,
    np.power: lambda a, b: a**b,
    np.float_power: lambda a, b: a**b,
    np.negative: lambda s: -s,
    np.positive: lambda s: s,
    np.square: lambda s: s * s,
    np.reciprocal: lambda s: 1.0 / s,
    np.exp: exp,
    np.exp2: lambda s: exp(s * math.log(2.0)),
    np.expm1: _expm1,
    np.log: log,
    np.log2: lambda s: log(s) / math.log(2.0),
    np.log10: lambda s: log(s) / math.log(10.0),
    np.log1p: _log1p,
    np.sqrt: lambda s: _constant_power(s, 0.5),
    np.sin: lambda s: _circular(s)[0],
    np.cos: lambda s: _circular(s)[1],
    np.tan: lambda s: _riccati(s, np.tan(s.coefficients[0]), 1),
    np.arctan: _arctan,
    np.sinh: lambda s: _hyperbolic(s)[0],
    np.cosh: lambda s: _hyperbolic(s)[1],
    np.tanh: lambda s: _riccati(s, np.tanh(s.coefficients[0]), -1),
    np.arcsinh: _arcsinh,
}
"""What functions of NumPy make of a series; others refuse it with a TypeError."""

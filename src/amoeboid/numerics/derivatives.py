"""Forward-mode derivatives: an equation is written once and yields its exact Jacobian too.

A `Dual` carries the values of a field at n points and their derivatives with respect to k
unknowns. Every function of this project that takes "arrays or Duals" may be called with plain
arrays (real or complex) for values only. Source: Griewank & Walther, *Evaluating Derivatives*,
2nd ed. 2008, chapter 3.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.numerics.programs import Symbol


class Dual:
    """Values (n,) with derivatives (n, k); n = 1 broadcasts, as in NumPy."""

    __slots__ = ("derivatives", "values")
    __array_ufunc__ = None  # an array on the left of an operator leaves the work to this class

    def __init__(self, values: Array, derivatives: Array) -> None:
        self.values = values
        self.derivatives = derivatives

    def map(self, values: Array, slope: Array) -> Dual:
        """f(self), given f and f' at the points."""
        return Dual(values, slope[:, None] * self.derivatives)

    def __neg__(self) -> Dual:
        return Dual(-self.values, -self.derivatives)

    def __add__(self, other: Any) -> Dual:
        if isinstance(other, Dual):
            return Dual(self.values + other.values, self.derivatives + other.derivatives)
        return Dual(self.values + other, self.derivatives)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Dual:
        if isinstance(other, Dual):
            return Dual(self.values - other.values, self.derivatives - other.derivatives)
        return Dual(self.values - other, self.derivatives)

    def __rsub__(self, other: Any) -> Dual:
        return Dual(other - self.values, -self.derivatives)

    def __mul__(self, other: Any) -> Dual:
        if isinstance(other, Dual):
            return Dual(
                self.values * other.values,
                other.values[:, None] * self.derivatives + self.values[:, None] * other.derivatives,
            )
        return Dual(self.values * other, _column(other) * self.derivatives)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Dual:
        if isinstance(other, Dual):
            return self * other.reciprocal()
        return self * (1.0 / other)

    def __rtruediv__(self, other: Any) -> Dual:
        return self.reciprocal() * other

    def __rmatmul__(self, matrix: Array) -> Dual:
        return Dual(matrix @ self.values, matrix @ self.derivatives)

    def reciprocal(self) -> Dual:
        """1 / self."""
        inverse = 1.0 / self.values
        return self.map(inverse, -inverse * inverse)


Field = Array | Dual


def _column(factor: Any) -> Any:
    return factor[:, None] if isinstance(factor, np.ndarray) and factor.ndim else factor


def sin(field: Any) -> Any:
    """Sine of an array or a Dual."""
    if isinstance(field, Dual):
        return field.map(np.sin(field.values), np.cos(field.values))
    if isinstance(field, Symbol):
        return field.elementary("sin")
    return np.sin(field)


def cos(field: Any) -> Any:
    """Cosine of an array or a Dual."""
    if isinstance(field, Dual):
        return field.map(np.cos(field.values), -np.sin(field.values))
    if isinstance(field, Symbol):
        return field.elementary("cos")
    return np.cos(field)


def sqrt(field: Any) -> Any:
    """Square root of an array or a Dual."""
    if isinstance(field, Dual):
        root = np.sqrt(field.values)
        return field.map(root, 0.5 / root)
    if isinstance(field, Symbol):
        return field.elementary("sqrt")
    return np.sqrt(field)


def values(field: Any) -> Array:
    """The values of an array or a Dual."""
    return field.values if isinstance(field, Dual) else field


def stacked(fields: list[Any]) -> Any:
    """Fields one below the other: one long array, or one long Dual."""
    if any(isinstance(f, Dual) for f in fields):
        return Dual(
            np.concatenate([f.values for f in fields]),
            np.concatenate([f.derivatives for f in fields]),
        )
    return np.concatenate(fields)

"""Types of arrays: C order, float64 unless a docstring says otherwise; vector products."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
"""Numbers, float64; complex where a derivative is taken by a complex step."""

Index = NDArray[np.int64]
"""Numbers of nodes, faces, rows."""


def all_finite(x: Any) -> bool:
    """Whether all numbers are finite; of a single one in a fraction of the time of `numpy.all`."""
    good = np.isfinite(x)
    return bool(good.all() if good.ndim else good)


def cross(a: Array, b: Array) -> Array:
    """Vector products (..., 3) of vectors (..., 3), of one shape or one each.

    Those of NumPy, which take ten times as long for a few vectors as the products.
    """
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    u, v, w = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def axis_across(direction: Array) -> Array:
    """The coordinate axis (..., 3) most across unit vectors (..., 3).

    The first of those that are equally so but for rounding: what is drawn or integrated around a
    direction does not turn with the last digits.

    >>> axis_across(np.array([1e-16, -1e-17, 1.0]))
    array([1., 0., 0.])
    """
    return np.asarray(np.eye(3)[np.argmin(np.round(np.abs(direction), 9), axis=-1)])

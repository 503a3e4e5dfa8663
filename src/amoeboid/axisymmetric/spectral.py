"""Sine and cosine series on (0, pi), collocated at midpoints, never at the poles.

A smooth field on a closed axisymmetric surface, continued through a pole along its meridian, is
even (scalars: concentration, normal velocity, curvatures) or odd (r, tangential velocity), so a
cosine or a sine series of the scaled arclength converges geometrically and is regular at the poles
by construction. Source: Boyd, *Chebyshev and Fourier Spectral Methods*, 2nd ed. 2001, chapter 18.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from amoeboid.arrays import Array


@dataclass(frozen=True, eq=False)
class Grid:
    """Midpoints x (n,) of (0, pi) and the dense (n, n) operators between values and coefficients.

    Coefficients of odd fields belong to sin(k x), k = 1..n; those of even fields to cos(k x),
    k = 0..n-1. `*_slopes` gives d/dx at the points from coefficients, `*_derivative` from values.
    """

    n: int
    x: Array
    odd_values: Array
    even_values: Array
    odd_slopes: Array
    even_slopes: Array
    to_odd: Array
    to_even: Array
    odd_derivative: Array
    even_derivative: Array
    integral: Array
    """Values of an even field without its mean -> values of its integral from 0."""
    odd_weights: Array
    """Quadrature weights (n,) over (0, pi) for odd fields, exact for every sine of the grid."""


@lru_cache(maxsize=32)
def grid(n: int) -> Grid:
    """The grid of n points; the same object each time."""
    x = midpoints(n)
    k_odd, k_even = np.arange(1, n + 1), np.arange(n)
    sines, cosines = odd_basis(x, n), even_basis(x, n)
    to_odd = (2 / n) * sines.T
    to_odd[-1] /= 2
    to_even = (2 / n) * cosines.T
    to_even[0] /= 2
    odd_slopes = k_odd * np.cos(np.outer(x, k_odd))
    even_slopes = -k_even * np.sin(np.outer(x, k_even))
    integral = (np.sin(np.outer(x, k_even[1:])) / k_even[1:]) @ to_even[1:]
    return Grid(
        n=n,
        x=x,
        odd_values=sines,
        even_values=cosines,
        odd_slopes=odd_slopes,
        even_slopes=even_slopes,
        to_odd=to_odd,
        to_even=to_even,
        odd_derivative=odd_slopes @ to_odd,
        even_derivative=even_slopes @ to_even,
        integral=integral,
        odd_weights=((1 - (-1.0) ** k_odd) / k_odd) @ to_odd,
    )


def midpoints(n: int) -> Array:
    """x_j = (j + 1/2) pi / n."""
    return (np.arange(n) + 0.5) * (np.pi / n)


def odd_basis(x: Array, count: int) -> Array:
    """sin(k x), k = 1..count, one column each."""
    return np.sin(np.outer(x, np.arange(1, count + 1)))


def even_basis(x: Array, count: int) -> Array:
    """cos(k x), k = 0..count-1, one column each."""
    return np.cos(np.outer(x, np.arange(count)))


def resized(coefficients: Array, count: int) -> Array:
    """The series (..., terms) with `count` terms: zeros appended or the highest dropped."""
    kept = coefficients[..., :count]
    missing = (*kept.shape[:-1], count - kept.shape[-1])
    return np.concatenate([kept, np.zeros(missing, dtype=kept.dtype)], axis=-1)

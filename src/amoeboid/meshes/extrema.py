"""Extrema of a field between the nodes of a mesh: polynomials fitted around the extreme nodes."""

from __future__ import annotations

import numpy as np

from amoeboid.arrays import Array, Index
from amoeboid.numerics.compiled import compiled, nested

# Number of nodes, fastest first, whose neighborhood is searched for the maximal speed.
SEARCHED = 12
# There the squared speed is fitted by a polynomial of this degree, to so many rings of neighbors.
DEGREE, RINGS = 4, 3
# How far from a node its maximum is sought, in units of the farthest neighbor, and in how many
# steps; the share of the larger curvature that the smaller one counts for at least.
REACH, MAX_CLIMBS, MIN_CURVATURE = 0.5, 5, 1e-3
# Share of a power that must be left when lower ones are taken off, squared, to be fitted.
UNDETERMINED = 1e-10


def largest(values: Array, count: int) -> Index:
    """Nodes of the `count` largest values, largest first, equal ones in their order."""
    least = np.partition(values, -count)[-count] if count < len(values) else -np.inf
    nodes = np.flatnonzero(values >= least)
    return nodes[np.argsort(-values[nodes], kind="stable")][:count]


@nested
def _patch(rings, row_start, columns, found):  # type: ignore[no-untyped-def]
    """Append to the node found[0] `rings` rings of neighbors, nearest first; how many nodes."""
    begin, end = 0, 1
    for _ in range(rings):
        length = end
        for i in range(begin, end):
            for k in range(row_start[found[i]], row_start[found[i] + 1]):
                known = 0
                while known < length and found[known] != columns[k]:
                    known += 1
                if known == length:
                    found[length] = columns[k]
                    length += 1
        begin, end = end, length
    return end


@nested
def _plane(patch, size, r, normals, plane):  # type: ignore[no-untyped-def]
    """Coordinates (n, 2) of a patch in the tangent plane of its node, the farthest 1 away."""
    node, least = patch[0], 0
    for d in range(3):
        if abs(normals[node, d]) < abs(normals[node, least]):
            least = d
    # along the product of the normal and the axis that is farthest from it, and across
    up, p, q = normals[node, least], (least + 1) % 3, (least + 2) % 3
    length = np.sqrt(normals[node, p] ** 2 + normals[node, q] ** 2)
    first_p, first_q = normals[node, q] / length, -normals[node, p] / length
    second_p, second_q = -up * first_q, up * first_p
    second = normals[node, p] * first_q - normals[node, q] * first_p
    farthest = 0.0
    for i in range(size):
        a, b = r[patch[i], p] - r[node, p], r[patch[i], q] - r[node, q]
        c = r[patch[i], least] - r[node, least]
        plane[i, 0] = first_p * a + first_q * b
        plane[i, 1] = second * c + second_p * a + second_q * b
        farthest = max(farthest, plane[i, 0] ** 2 + plane[i, 1] ** 2)
    farthest = np.sqrt(farthest)
    for i in range(size):
        plane[i, 0], plane[i, 1] = plane[i, 0] / farthest, plane[i, 1] / farthest


@nested
def _polynomial(patch, n, plane, values):  # type: ignore[no-untyped-def]
    """Coefficients k[p, q] of sum k[p, q] x^p y^q of degree DEGREE, fitted with weights.

    Gram-Schmidt from low powers up; a power that the nodes do not tell from the lower ones is left
    out, so that few nodes give a fit of lower degree.
    """
    terms = (DEGREE + 1) * (DEGREE + 2) // 2
    basis, upper, share = np.zeros((terms, n)), np.zeros((terms, terms)), np.zeros(terms)
    powers = np.empty((terms, 2), np.int64)
    weights, rest, column = np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        weights[i] = np.exp(-(plane[i, 0] ** 2) - plane[i, 1] ** 2)
        rest[i] = weights[i] * values[patch[i]]
    t = 0
    for degree in range(DEGREE + 1):
        for q in range(degree + 1):
            powers[t, 0], powers[t, 1] = degree - q, q
            size, left = 0.0, 0.0
            for i in range(n):
                column[i] = weights[i]
                for _ in range(degree - q):
                    column[i] *= plane[i, 0]
                for _ in range(q):
                    column[i] *= plane[i, 1]
                size += column[i] ** 2
            for s in range(t):
                for i in range(n):
                    upper[s, t] += basis[s, i] * column[i]
                for i in range(n):
                    column[i] -= upper[s, t] * basis[s, i]
            for i in range(n):
                left += column[i] ** 2
            if left > UNDETERMINED * size:
                upper[t, t] = np.sqrt(left)
                for i in range(n):
                    basis[t, i] = column[i] / upper[t, t]
                    share[t] += basis[t, i] * rest[i]
                for i in range(n):
                    rest[i] -= share[t] * basis[t, i]
            t += 1
    k = np.zeros((DEGREE + 1, DEGREE + 1))
    for t in range(terms - 1, -1, -1):
        if upper[t, t] > 0.0:
            coefficient = share[t] / upper[t, t]
            k[powers[t, 0], powers[t, 1]] = coefficient
            for s in range(t):
                share[s] -= upper[s, t] * coefficient
    return k


@nested
def _value_and_slopes(k, x, y):  # type: ignore[no-untyped-def]
    """Value, first and second derivatives of a polynomial of degree DEGREE."""
    f, fx, fy, fxx, fxy, fyy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for p in range(DEGREE, -1, -1):
        g, gy, gyy = 0.0, 0.0, 0.0
        for q in range(DEGREE - p, -1, -1):
            gyy = gyy * y + 2.0 * gy
            gy = gy * y + g
            g = g * y + k[p, q]
        fxx = fxx * x + 2.0 * fx
        fxy = fxy * x + fy
        fx = fx * x + f
        f, fy, fyy = f * x + g, fy * x + gy, fyy * x + gyy
    return f, fx, fy, fxx, fxy, fyy


@nested
def _climbed(k):  # type: ignore[no-untyped-def]
    """Largest value within REACH of the origin that Newton's method finds from there."""
    x, y = 0.0, 0.0
    best, fx, fy, fxx, fxy, fyy = _value_and_slopes(k, x, y)
    for _ in range(MAX_CLIMBS):
        # with curvatures of the sign of a maximum and not too small: a ring of maxima has one of 0
        mean, half = 0.5 * (fxx + fyy), 0.5 * (fxx - fyy)
        radius = np.sqrt(half * half + fxy * fxy)
        one, two = abs(mean + radius), abs(mean - radius)
        one, two = max(one, MIN_CURVATURE * two), max(two, MIN_CURVATURE * one)
        angle = 0.5 * np.arctan2(fxy, half)
        cos, sin = np.cos(angle), np.sin(angle)
        along, across = (cos * fx + sin * fy) / one, (cos * fy - sin * fx) / two
        to_x, to_y = x + cos * along - sin * across, y + sin * along + cos * across
        distance = np.sqrt(to_x * to_x + to_y * to_y)
        if distance > REACH:
            to_x, to_y = REACH / distance * to_x, REACH / distance * to_y
        f, gx, gy, gxx, gxy, gyy = _value_and_slopes(k, to_x, to_y)
        if not f > best:  # also without any curvature, where f is not a number
            break
        x, y, best, fx, fy, fxx, fxy, fyy = to_x, to_y, f, gx, gy, gxx, gxy, gyy
    return best


@compiled
def fitted_maxima(nodes, row_start, columns, r, normals, values):  # type: ignore[no-untyped-def]
    """Maxima near `nodes` of the polynomials fitted to each and the rings around it.

    None is farther above all values of its patch than these differ from the node to its neighbors:
    on a rim that the mesh does not resolve a polynomial may swing beyond all measure.
    """
    maxima = np.empty(len(nodes))
    patch, plane = np.empty(len(values), np.int64), np.empty((len(values), 2))
    for n in range(len(nodes)):
        patch[0] = nodes[n]
        size = _patch(RINGS, row_start, columns, patch)
        _plane(patch, size, r, normals, plane)
        top, high, low = values[nodes[n]], values[nodes[n]], values[nodes[n]]
        for i in range(row_start[nodes[n]], row_start[nodes[n] + 1]):
            high, low = max(high, values[columns[i]]), min(low, values[columns[i]])
        for i in range(size):
            top = max(top, values[patch[i]])
        maxima[n] = min(_climbed(_polynomial(patch, size, plane, values)), top + high - low)
    return maxima


@nested
def _least_squares(a, b):  # type: ignore[no-untyped-def]
    """The shortest x that minimizes |a x - b|, from orthogonal columns or, if fewer, rows of a.

    0 where these are not independent.
    """
    wide = a.shape[0] < a.shape[1]
    length, count = max(a.shape), min(a.shape)
    q, upper = np.empty((length, count)), np.zeros((count, count))
    x, y, left = np.zeros(a.shape[1]), np.zeros(count), b.copy()
    for t in range(count):
        size, rest = 0.0, 0.0
        for i in range(length):
            q[i, t] = a[t, i] if wide else a[i, t]
            size += q[i, t] ** 2
        for s in range(t):
            for i in range(length):
                upper[s, t] += q[i, s] * q[i, t]
            for i in range(length):
                q[i, t] -= upper[s, t] * q[i, s]
        for i in range(length):
            rest += q[i, t] ** 2
        if not rest > UNDETERMINED * size:
            return x
        upper[t, t] = np.sqrt(rest)
        for i in range(length):
            q[i, t] /= upper[t, t]
        if wide:
            y[t] = b[t]
            for s in range(t):
                y[t] -= upper[s, t] * y[s]
            y[t] /= upper[t, t]
        else:
            for i in range(length):
                y[t] += q[i, t] * left[i]
            for i in range(length):
                left[i] -= y[t] * q[i, t]
    for t in range(count - 1, -1, -1):
        if wide:
            for i in range(length):
                x[i] += q[i, t] * y[t]
        else:
            x[t] = y[t] / upper[t, t]
            for s in range(t):
                y[s] -= upper[s, t] * x[t]
    return x


@compiled
def refined_extremum(node, sign, row_start, columns, r, normals, values):  # type: ignore[no-untyped-def]
    """Extremum near a node of the quadratic through it, fitted to its neighbors; sign 1: a maximum.

    Taken only within reach of the neighbors, else the value at the node.
    """
    here, most = values[node], row_start[node + 1] - row_start[node] + 1
    patch, plane = np.empty(most, np.int64), np.empty((most, 2))
    patch[0] = node
    n = _patch(1, row_start, columns, patch) - 1
    _plane(patch, n + 1, r, normals, plane)
    basis, rise, reach = np.empty((n, 5)), np.empty(n), 0.0
    for i in range(n):
        x, y = plane[i + 1, 0], plane[i + 1, 1]
        basis[i, 0], basis[i, 1] = x, y
        basis[i, 2], basis[i, 3], basis[i, 4] = 0.5 * x * x, x * y, 0.5 * y * y
        rise[i] = values[patch[i + 1]] - here
        reach = max(reach, abs(x), abs(y))
    if rise.min() == rise.max():
        return here
    k = _least_squares(basis, rise)
    gx, gy, xx, xy, yy = k[0], k[1], k[2], k[3], k[4]
    half = 0.5 * (xx - yy)
    if 0.5 * sign * (xx + yy) + np.sqrt(half * half + xy * xy) >= 0.0:
        return here
    determinant = xx * yy - xy * xy
    step_x, step_y = (xy * gy - yy * gx) / determinant, (xy * gx - xx * gy) / determinant
    if np.sqrt(step_x * step_x + step_y * step_y) > reach:
        return here
    return here + 0.5 * (gx * step_x + gy * step_y)

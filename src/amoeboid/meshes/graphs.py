"""Graphs of nodes: which hang together, and an order of nodes in which neighbors lie close.

In NumPy, for every run asks for both once: SciPy would take longer to import than to use.
"""

from __future__ import annotations

import numpy as np

from amoeboid.arrays import Index


def components(n: int, begin: Index, end: Index) -> tuple[int, Index]:
    """How many pieces n nodes form by links between `begin` and `end` (L,), and of which each is.

    Pieces are numbered from 0 in the order of their first nodes.

    >>> components(5, np.array([0, 3]), np.array([2, 4]))
    (3, array([0, 1, 0, 2, 2]))
    """
    root = np.arange(n)
    while True:
        a, b = root[begin], root[end]
        low = np.minimum(a, b)
        lower = root.copy()
        np.minimum.at(lower, a, low)
        np.minimum.at(lower, b, low)
        while not np.array_equal(lower, lower[lower]):
            lower = lower[lower]
        if np.array_equal(lower, root):
            firsts, piece = np.unique(root, return_inverse=True)
            return len(firsts), piece
        root = lower


def reverse_cuthill_mckee(row_start: Index, columns: Index) -> Index:
    """Old numbers of the nodes (n,) in an order that gives matrices over them a narrow band.

    The neighbors of node i, itself included, are `columns[row_start[i]:row_start[i + 1]]`. The
    order goes from a node of least degree through its neighbors, those of lower degree first,
    then through theirs, and is reversed at last; equal ones stay in the order of their numbers.

    Of a path 0 - 2 - 1:

    >>> reverse_cuthill_mckee(np.array([0, 2, 4, 7]), np.array([0, 2, 1, 2, 0, 1, 2]))
    array([1, 2, 0])
    """
    degree = np.diff(row_start)
    seen = np.zeros(len(degree), dtype=bool)
    levels = []
    for seed in np.argsort(degree, kind="stable"):
        if seen[seed]:
            continue
        level = np.array([seed])
        while len(level):
            seen[level] = True
            levels.append(level)
            level = _beyond(level, row_start, columns, degree, seen)
    return np.concatenate(levels)[::-1]


def _beyond(level: Index, row_start: Index, columns: Index, degree: Index, seen: Index) -> Index:
    """The neighbors of the nodes of a level that are not seen yet, in order; each once."""
    counts = degree[level]
    parent = np.repeat(np.arange(len(level)), counts)
    within = np.arange(len(parent)) - np.repeat(np.cumsum(counts) - counts, counts)
    node = columns[row_start[level][parent] + within]
    parent, node = parent[~seen[node]], node[~seen[node]]
    node, first = np.unique(node, return_index=True)  # with the first node that it is next to
    return node[np.lexsort((node, degree[node], parent[first]))]

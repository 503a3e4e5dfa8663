"""Solvers of tests, in a file, so that other processes can import them."""

import json
import os
import time
import warnings
from pathlib import Path

import numpy as np

import amoeboid as am


def square(p):
    """A number, an array, a text."""
    return {"square": p.v_p0**2, "third": p.v_p0 / 3.0, "powers": p.v_p0 ** np.arange(3), "w": "a"}


def slow(p):
    """The same a little later."""
    time.sleep(0.02)
    return square(p)


def deadly(p):
    """Ends its process where v_p0 = 5."""
    if p.v_p0 == 5.0:
        os._exit(3)
    return p.v_p0**2


def deadly_once(p):
    """Ends its process the first time that it is at v_p0 = 5."""
    mark = Path(os.environ["AMOEBOID_TEST_MARK"])
    if p.v_p0 == 5.0 and not mark.exists():
        mark.touch()
        os._exit(3)
    return p.v_p0**2


def growth(p):
    """Growth rate of l = 1."""
    return float(am.growth_rate(p, l=1))


def picky(p):
    """Fails, warns or gives too little."""
    if p.v_p0 == 4.0:
        raise ZeroDivisionError("nothing to divide")
    if p.v_p0 == 5.0:
        warnings.warn("a guess", stacklevel=2)
    return {"x": p.v_p0, "y": None if p.v_p0 == 6.0 else np.inf}


def threads(p):
    """Threads of the libraries for linear algebra, at most."""
    from threadpoolctl import threadpool_info

    found = [one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"]
    return max(found, default=1)


def many(cells):
    """Many cells at once; one that is not possible is an exception."""
    return [
        ValueError("too fast") if p.v_p0 > 5.5 else square(p) | {"n": len(cells)} for p in cells
    ]


def batched(p):
    """The same, one at a time."""
    raise AssertionError(p)


batched.batch, batched.batch_size = many, 4


def sums(cells):
    """Answers that depend on all cells side by side."""
    total = sum(p.v_p0 for p in cells)
    return [p.v_p0 / total for p in cells]


def summed(p):
    """The same for one cell."""
    return sums([p])[0]


summed.batch, summed.batch_size = sums, 4


def whole(folder):
    """All that a test compares of a sweep's folder: its table, and what was computed, in order."""
    found = am.load_sweep(folder)
    return [json.loads(row) for row in found.rows], (Path(folder) / "sweep.nc").read_bytes()

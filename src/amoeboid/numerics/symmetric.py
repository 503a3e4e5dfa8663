"""Which solver takes a symmetric positive definite system: decided here, by size and presence.

The figures are in docs/decisions/0009-sparse-solvers.md.
"""

from __future__ import annotations

from amoeboid.numerics.banded import Index, SymmetricBand
from amoeboid.numerics.cholmod import SparseCholesky, installed

# Unknowns from which CHOLMOD takes half the time of the band or less. Below about 2000 there is
# nothing to gain, and the default mesh gives the same numbers with and without the package.
FASTER_FROM = 5000


def symmetric_solver(rows: Index, columns: Index, n: int) -> SymmetricBand | SparseCholesky:
    """The fastest solver at hand for (n, n) matrices of a pattern with a narrow band."""
    if n >= FASTER_FROM and installed():
        return SparseCholesky(rows, columns, n)
    return SymmetricBand(rows, columns, n)


def advice(n: int) -> str | None:
    """What would make systems of n unknowns faster to solve; None if nothing known does."""
    if n < FASTER_FROM or installed():
        return None
    return (
        f"the {n} equations of the force balance are solved in less than half the time with the "
        "optional package cvxopt (GPL): pip install 'amoeboid[fast]'"
    )

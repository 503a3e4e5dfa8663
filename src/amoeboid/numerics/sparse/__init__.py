"""Sparse direct solvers on the pattern of a mesh.

`SparseCholesky` factorizes symmetric positive definite matrices of 3 x 3 blocks, `MMatrixLU` solves
with M-matrices. `SingularMatrix` is what both raise, `Factor` a factorized matrix. The solvers are
imported at their first use: their kernels emit instructions through Numba, which may be missing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from amoeboid.numerics.sparse.banded import Factor, SingularMatrix

if TYPE_CHECKING:
    from amoeboid.numerics.sparse.cholesky import SparseCholesky
    from amoeboid.numerics.sparse.m_matrix_lu import MMatrixFactor, MMatrixLU

__all__ = ["Factor", "MMatrixFactor", "MMatrixLU", "SingularMatrix", "SparseCholesky"]

_HOMES = {"SparseCholesky": "cholesky", "MMatrixFactor": "m_matrix_lu", "MMatrixLU": "m_matrix_lu"}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)

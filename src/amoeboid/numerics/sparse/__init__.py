"""Sparse direct solvers on the pattern of a mesh.

`SparseCholesky` factorizes symmetric positive definite matrices of 3 x 3 blocks, `MMatrixLU` solves
with M-matrices. `SingularMatrix` is what both raise, `Factor` a factorized matrix.
"""

from amoeboid.numerics.sparse.banded import Factor, SingularMatrix
from amoeboid.numerics.sparse.cholesky import SparseCholesky
from amoeboid.numerics.sparse.m_matrix_lu import MMatrixFactor, MMatrixLU

__all__ = ["Factor", "MMatrixFactor", "MMatrixLU", "SingularMatrix", "SparseCholesky"]

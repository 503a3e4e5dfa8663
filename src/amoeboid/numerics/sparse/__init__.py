"""Sparse direct solvers on the pattern of a mesh."""

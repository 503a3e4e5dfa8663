"""Triangulated surfaces: connectivity, geometry, operators, remeshing, files."""

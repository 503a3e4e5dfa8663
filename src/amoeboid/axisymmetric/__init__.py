"""The free-shape axisymmetric cell at spectral accuracy: steady states, branches, evolution."""

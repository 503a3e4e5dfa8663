"""Questions about a cell that need no run: steady states, branches, phase diagrams, theory.

The solvers below give plain numbers. The results here know the units of the cell, show themselves,
draw themselves and become tables of pandas and xarray.
"""

"""Numerical methods that know nothing of cells."""

"""Timings of the 3D solver, as ratios that mean something on any machine."""

"""Runs of the 3D cell: the time loop, events, and their result."""

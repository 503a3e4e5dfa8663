"""Pictures: the only place that imports matplotlib and PyVista."""

COLOR_MAP = "YlGnBu"
"""The colors of concentrations, and of all else that is a number on a picture; arrows are dark."""

"""The colors of all pictures: those of Okabe and Ito, told apart by color-blind readers too."""

BLUE, ORANGE, GREEN = "#0072b2", "#d55e00", "#009e73"
PURPLE, SKY, YELLOW = "#8a5aa8", "#56b4e9", "#e69f00"
INK, GRAY, PALE = "#1b1b1b", "#7a7a7a", "#d9d9d9"

STABLE, UNSTABLE = BLUE, ORANGE
"""States that last, and those that do not."""

COLOR_MAP = "YlGnBu"
"""The colors of concentrations, and of all else that is a number on a picture; arrows are dark."""

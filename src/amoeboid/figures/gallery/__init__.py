"""One module for each figure: its parameters, the numbers that it shows, and the drawing."""

"""Forces on the cell beside those of the paper, one file each, for both solvers."""

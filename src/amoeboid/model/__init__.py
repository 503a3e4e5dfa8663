"""The physics of the paper: parameters, polymerization, stresses, units."""

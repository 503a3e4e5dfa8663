"""One module for each format; each defines `FORMAT`."""

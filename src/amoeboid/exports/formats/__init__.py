"""One format a module; each defines `FORMAT`."""

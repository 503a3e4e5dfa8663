"""amoeboid."""

"""Runs as objects: `simulate`, its `Solution`, stored runs, and what is measured on them."""

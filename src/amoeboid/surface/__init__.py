"""The triangulated 3D shell: one module an operator, `model` puts them together."""

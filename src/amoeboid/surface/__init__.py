"""The triangulated 3D shell: one module for each operator; `model` combines them."""

"""Test shapes and the paths to them that tests of the surface share."""

import numpy as np

from amoeboid.surface.mesh import connectivity
from amoeboid.surface.relaxation import even_icosphere


def sphere(subdivisions):
    """Even icosphere on the unit sphere: nodes, connectivity."""
    r, faces = even_icosphere(subdivisions)
    return r, connectivity(faces)


def lumpy(subdivisions=2, seed=0):
    """A smooth shape without any symmetry, away from the origin."""
    r, mesh = sphere(subdivisions)
    a, b, c = np.random.default_rng(seed).normal(size=(3, 3))
    radius = 1 + 0.1 * np.sin(r @ a) + 0.08 * (r @ b) ** 2 - 0.05 * np.cos(2 * r @ c)
    return r * radius[:, None] + [0.3, -0.2, 0.5], mesh


def observed_orders(sizes, errors):
    """Exponents p of error ~ h^p between successive meshes, h ~ size**-0.5."""
    sizes, errors = np.asarray(sizes, float), np.abs(errors)
    return -2 * np.diff(np.log(errors)) / np.diff(np.log(sizes))

"""Test shapes and the paths to them that tests of the surface share."""

from functools import cache

import numpy as np

from amoeboid.meshes.connectivity import connectivity
from amoeboid.meshes.geometry import area, face_vectors
from amoeboid.meshes.relaxation import uniform_icosphere
from amoeboid.model.parameters import Parameters
from amoeboid.surface.model import Model
from amoeboid.surface.remeshing import remeshed
from amoeboid.surface.state import State

TETRAHEDRON = [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)]
OCTAHEDRON = [
    (0, 2, 4),
    (2, 1, 4),
    (1, 3, 4),
    (3, 0, 4),
    (2, 0, 5),
    (1, 2, 5),
    (3, 1, 5),
    (0, 3, 5),
]


@cache
def _uniform(subdivisions):
    r, faces = uniform_icosphere(subdivisions)
    return r, connectivity(faces)


def sphere(subdivisions):
    """Uniform icosphere on the unit sphere: nodes, connectivity."""
    r, mesh = _uniform(subdivisions)
    return r.copy(), mesh


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


def sausage(subdivisions, angle, length=3.0, radius=0.45):
    """A uniform icosphere drawn out to a rod of half `length` and bent by `angle` along a circle.

    A small angle leaves it straight; bent by the whole circle its ends run into each other.
    """
    r, mesh = sphere(subdivisions)
    x, y, z = (r * [radius, radius, length]).T
    bend = angle / (2 * length)
    around, out = bend * z, 1 / bend + x
    return np.column_stack([out * np.cos(around) - 1 / bend, y, out * np.sin(around)]), mesh


def dumbbell(subdivisions, neck=0.35):
    """A smooth surface of revolution about z, of area 4 pi, with a neck of negative curvature.

    r(theta) = a + (1 - a) cos(theta)^2 up to scale: the neck has the radius a = `neck` of the half
    length.
    """
    return _radial(subdivisions, lambda n: neck + (1 - neck) * n[:, 2] ** 2)


def three_lobed(subdivisions, depth=0.45):
    """A smooth cell of area 4 pi with three lobes around z, saddles between them.

    r = 1 + depth sin(theta)^3 cos(3 phi) up to scale.
    """

    def radius(n):
        x, y, _ = n.T
        return 1 + depth * (x**3 - 3 * x * y**2)

    return _radial(subdivisions, radius)


def _radial(subdivisions, radius):
    n, mesh = sphere(subdivisions)
    r = radius(n)[:, None] * n
    return r * np.sqrt(4 * np.pi / area(r, mesh.faces)), mesh


def tetrahedron():
    r = np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], dtype=float)
    return r, connectivity(np.array(TETRAHEDRON)[:, ::-1])


def octahedron():
    r = np.vstack([s * np.eye(3)[i] for i in range(3) for s in (1, -1)])
    return r, connectivity(np.array(OCTAHEDRON))


def irregular():
    """A stretched sphere, remeshed: valences from 4 to 8, nodes numbered without a pattern."""
    r, mesh = _irregular()
    return r.copy(), mesh


@cache
def _irregular():
    r, mesh = sausage(3, 2.0)
    r = r * np.sqrt(4 * np.pi / area(r, mesh.faces))
    state = State(0.0, r, np.ones(len(r)), 1.0, np.zeros(3))
    model, state = remeshed(Model(Parameters(), mesh), state)
    assert model.mesh is not mesh
    assert len(set(model.mesh.valence)) >= 4
    return state.r, model.mesh


def shuffled():
    """A mesh whose nodes are numbered at random."""
    r, mesh = lumpy(2)
    new = np.random.default_rng(5).permutation(len(r))
    return r[np.argsort(new)], connectivity(new[mesh.faces])


def volume_gradient(r, faces):
    """Derivative of the volume with respect to the nodes: a third of the area vectors around."""
    gradient = np.zeros(r.shape)
    np.add.at(gradient, faces, face_vectors(r, faces)[:, None] / 3.0)
    return gradient

"""Initial states: the homogeneous cell at rest, and perturbations of its concentration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from amoeboid.config import Initial
from amoeboid.parameters import Parameters
from amoeboid.surface.geometry import area, volume_centroid
from amoeboid.surface.mesh import connectivity
from amoeboid.surface.model import Model, State
from amoeboid.surface.relaxation import even_icosphere
from amoeboid.surface.stepping import relaxed
from amoeboid.theory.linear import base_tension
from amoeboid.validation import InvalidInput

Array = NDArray[np.float64]

ROUNDING = 1e-12


def sphere(p: Parameters, subdivisions: int) -> tuple[Model, State]:
    """The homogeneous cell (c = c0) at rest, in the discrete equilibrium of its mesh.

    The polyhedron has the area 4 pi R0^2 exactly. Raises InvalidInput where the law is not
    defined at c0.
    """
    r, faces = even_icosphere(subdivisions)
    model = Model(p, connectivity(faces))
    r = r * np.sqrt(model.A0 / area(r, faces))
    state = State(0.0, r, np.full(len(r), p.c0), float(base_tension(p)), np.zeros(3))
    return model, relaxed(model, state)


def perturbed(model: Model, state: State, initial: Initial) -> State:
    """`state` with c + perturbation cos(theta) + noise, theta the angle to the direction.

    On the sphere this is c + perturbation (r - r_cm).direction/R0 (SI, numerical procedure).
    Raises InvalidInput if the sum is negative somewhere.
    """
    p = model.parameters
    axis = np.array(initial.direction) / np.linalg.norm(initial.direction)
    x = state.r - volume_centroid(state.r, model.mesh.faces)
    noise = np.random.default_rng(initial.seed).standard_normal(len(state.c))
    change = initial.perturbation * (x @ axis) / np.linalg.norm(x, axis=1) + initial.noise * noise
    c = state.c + change
    if c.min() < -ROUNDING * np.abs(change).max():
        raise InvalidInput(
            f"the initial concentration must be >= 0 everywhere, got {c.min():.4g}; keep "
            f"initial.perturbation = {initial.perturbation:g} and "
            f"initial.noise = {initial.noise:g} well below c0 = {p.c0:g}"
        )
    return replace(state, c=np.maximum(c, 0.0))

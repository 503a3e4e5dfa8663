"""Shot noise of turnover and diffusion: random increments of the numbers of filaments at the nodes.

Filaments appear with beta c0, vanish with beta c and diffuse with D, each for itself. In a short
time dt a triangle of area A and mean concentration c contributes to its corners a, b increments of
zero mean and of covariance (k: filaments in a unit of number N)

    [beta (c0 + c) M_ab + 2 D c L_ab] dt/k,  M_ab = A (1 + delta_ab)/12,
                                             L_ab = A grad phi_a . grad phi_b,

with M and L those of the filament balance (surface/transport.py). Fluctuation and dissipation then
balance exactly on any mesh: without flow the numbers m_i c of a homogeneous cell have the
stationary covariance c0 m_i delta_ij/k, that of independent filaments. As a random flux in each
triangle, not along its edges, the noise of diffusion exists for obtuse triangles too, and it moves
filaments without making any. Advection moves each filament as the flow does and adds no noise; nor
does the diffusion that the transport adds where the mesh is too coarse.

c stays >= 0: see `increments`. Random numbers are a function of seed and number of the step:
nothing is kept between steps.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from amoeboid.arrays import Array
from amoeboid.meshes.geometry import Geometry, geometry, node_areas
from amoeboid.surface.model import Model
from amoeboid.surface.state import State
from amoeboid.surface.transport import filaments

PER_TRIANGLE = 7  # random numbers: three of a flux, three of the corners, one of all corners


def increments(
    model: Model, c: Array, g: Geometry, dt: float, normals: Array
) -> tuple[Array, float]:
    """What each node gains (V,) [N] in a time dt from noise, and the share of the noise kept.

    `normals` (F, 7): standard normal random numbers. No node loses more than it has: where it
    would, as can happen where a node has few filaments, the contributions of its triangles are
    scaled down. The share is that of the squares, 1 where nothing is.
    """
    stock = filaments(c, g)
    wanted = contributions(model, c, g, dt, normals)
    faces = model.mesh.faces
    lost = np.bincount(faces.ravel(), np.maximum(-wanted, 0.0).ravel(), len(c))
    allowed = np.divide(stock, lost, out=np.ones_like(c), where=lost > stock)
    scale = np.where(wanted < 0.0, allowed[faces], 1.0).min(axis=1)
    given = scale[:, None] * wanted
    gained = np.bincount(faces.ravel(), given.ravel(), len(c))
    total = float((wanted**2).sum())
    return gained, float((given**2).sum()) / total if total > 0.0 else 1.0


def contributions(model: Model, c: Array, g: Geometry, dt: float, normals: Array) -> Array:
    """What the triangles give to their corners (F, 3) [N], see the top of this file."""
    p, per_number = model.parameters, model.filaments_per_number
    mean = c[model.mesh.faces].mean(axis=1)
    flux = np.sqrt(2.0 * p.D * mean * g.face_areas * (dt / per_number))
    turnover = np.sqrt(p.beta * (p.c0 + mean) * g.face_areas * (dt / (12.0 * per_number)))
    moved = np.einsum("fai,fi->fa", g.gradients, normals[:, :3])
    made = normals[:, 3:6] + normals[:, 6:]
    return np.asarray(flux[:, None] * moved + turnover[:, None] * made)


def random_numbers(seed: int, step: int, n_faces: int) -> Array:
    """Standard normal random numbers (F, 7) of a step: the same for the same seed and step."""
    generator = np.random.Generator(np.random.Philox(key=[seed, step]))
    return generator.standard_normal((n_faces, PER_TRIANGLE))


def with_increments(model: Model, states: tuple[State, ...], gained: Array) -> tuple[State, ...]:
    """The past `states`, newest first, as if the present noise had been there all along.

    All get the same increments (V,) of numbers. What multistep formula and extrapolation see is
    then smooth but for how the noise decays. Earlier states in which c would become negative are
    left out, and with them those before.
    """
    shifted: list[State] = []
    for state in states:
        areas = node_areas(state.r, model.mesh.faces)
        c = state.c + gained / areas
        if shifted and c.min() < 0.0:
            break
        shifted.append(replace(state, c=np.maximum(c, 0.0)))
    return tuple(shifted)


def noisy_past(
    model: Model, states: tuple[State, ...], dt: float, step: int
) -> tuple[tuple[State, ...], float]:
    """The past of a step of length dt with its noise, and the share of the noise that was kept.

    Random numbers are those of `step`, whatever its length.
    """
    assert model.noise is not None  # noqa: S101
    now = states[0]
    normals = random_numbers(model.noise.seed, step, len(model.mesh.faces))
    at = model.at(now.t + dt, since=now.t)
    gained, kept = increments(at, now.c, geometry(now.r, model.mesh.faces), dt, normals)
    return with_increments(model, states, gained), kept

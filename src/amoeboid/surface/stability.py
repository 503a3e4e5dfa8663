"""How fast small disturbances of a steady cell grow, from the time step itself.

An implicit Euler step of length dt multiplies a disturbance that grows at lambda by
mu = 1/(1 - lambda dt). Arnoldi's iteration finds the outlying mu of the step, linearized by the
difference of two steps: those of the slowest modes, whose mu is not near 0 (L. S. Tuckerman and
D. Barkley, in IMA Volumes 119, 453, 2000).

A disturbance is what changes at the nodes: c'/(c0 + c) and h/R0, h along the normals. Nodes that
slide within the surface are none, so that the many slow modes of the mesh play no part. Rigid
motions of the cell are neutral; the map is restricted to what is orthogonal to them, which leaves
the other eigenvalues as they are. Without turnover the number of filaments is kept, and a
disturbance that changes it is none of this cell.

The cell may turn while it is disturbed, but slowly: as much as `dt` turns it is neglected.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from amoeboid.numerics.arnoldi import ritz_values
from amoeboid.numerics.banded import SingularMatrix
from amoeboid.surface.geometry import Geometry, geometry, volume_centroid, weighted_area_gradient
from amoeboid.surface.harmonics import real_harmonic
from amoeboid.surface.model import Flow, Model, State
from amoeboid.surface.rigid import changes, gradient, rotations, translations
from amoeboid.surface.stepping import StepFailed, semi_implicit_step
from amoeboid.validation import InvalidInput

Array = NDArray[np.float64]

# Largest disturbance: small against what is not linear, large against what the passes leave.
AMPLITUDE = 1e-4
# Tolerance of the steps, which sets how far their passes go: to 3e-8, or a share of the change,
# so that a neutral mode is neutral.
TOLERANCE = 1e-6
# Length of the steps in units of 1/model.rate. Passes of longer ones converge slowly; modes of
# shorter ones lie closer together.
STEP, SHORTENED, MOST_LENGTHS = 0.1, 0.3, 4
# Smaller factors are modes that die out within a step, and noise.
LEAST_FACTOR = 0.1
# The rate is found when its residual is below this, in units of model.rate.
SETTLED = 0.02
FEWEST, MOST = 8, 40
# The start has a part in every harmonic up to this degree.
DEGREE = 3
# Rigid motions that change the cell by less than this share of the largest are none: rotations of
# a sphere or around an axis of symmetry.
NO_MOTION = 0.02


def leading_growth_rate(
    model: Model,
    state: State,
    flow: Flow,
    step: float = STEP,
    tolerance: float = TOLERANCE,
    settled: float = SETTLED,
) -> float:
    """Growth rate of the fastest growing disturbance of a steady state [1/T].

    Negative if all decay. That of an oscillating one is the real part. `flow`: that in `state`;
    `step` and `settled` in units of 1/model.rate and model.rate. Raises StepFailed,
    SingularMatrix, InvalidInput if not even short steps from the disturbed states can be made.
    """
    for _ in range(MOST_LENGTHS - 1):
        try:
            return _with_steps(model, state, flow, step, tolerance, settled)
        except (StepFailed, SingularMatrix, InvalidInput):
            step *= SHORTENED
    return _with_steps(model, state, flow, step, tolerance, settled)


def _with_steps(
    model: Model, state: State, flow: Flow, step: float, tolerance: float, settled: float
) -> float:
    p, dt = model.parameters, step / model.rate
    g = geometry(state.r, model.mesh.faces)
    slope = gradient(state.c, g, model.mesh) / (p.c0 + state.c)[:, None]
    left_out = _left_out(model, state, g, slope)
    image = linearized_step(model, state, flow, g, slope, dt, tolerance)

    def remaining(y: Array) -> Array:
        return np.asarray(y - left_out @ (left_out.T @ y))

    growth, count = 0.0, 0
    start = remaining(_start(state, model))
    for values, residuals in ritz_values(lambda y: remaining(image(y)), start):
        count += 1
        seen = np.abs(values) > LEAST_FACTOR
        if not seen.any():
            continue
        mu, residual = values[seen], residuals[seen]
        rates = (1.0 - 1.0 / mu) / dt
        first = int(np.argmax(rates.real))
        growth = float(rates[first].real)
        error = residual[first] / (np.abs(mu[first]) ** 2 * dt)
        if (count >= FEWEST and error < settled * model.rate) or count >= MOST:
            break
    return growth


def linearized_step(
    model: Model, state: State, flow: Flow, g: Geometry, slope: Array, dt: float, tolerance: float
) -> Callable[[Array], Array]:
    """What a step of length dt makes of a disturbance (2V,) of `state`: c'/(c0 + c), h/R0.

    `slope` (V, 3): the gradient of c over c0 + c.
    """
    p = model.parameters
    scale = p.c0 + state.c
    undisturbed, *_ = semi_implicit_step(model, (state,), dt, flow, tolerance)

    def image(y: Array) -> Array:
        amplitude = AMPLITUDE / np.abs(y).max()
        c, h = np.split(amplitude * y, 2)
        disturbed = replace(state, r=state.r + p.R0 * h[:, None] * g.normals, c=state.c + scale * c)
        new, *_ = semi_implicit_step(model, (disturbed,), dt, flow, tolerance)
        moved = new.r - undisturbed.r
        along = np.einsum("vi,vi->v", moved, g.normals)
        aside = moved - along[:, None] * g.normals
        # c where the node was, had it not moved aside
        c = (new.c - undisturbed.c) / scale - np.einsum("vi,vi->v", aside, slope)
        return np.concatenate([c, along / p.R0]) / amplitude

    return image


def _left_out(model: Model, state: State, g: Geometry, slope: Array) -> Array:
    """Orthonormal disturbances (2V, k) that the map is restricted from; see the module."""
    p, faces = model.parameters, model.mesh.faces
    x = (state.r - volume_centroid(state.r, faces)) / p.R0
    motions = [p.R0 * motion for motion in (*translations(x), *rotations(x))]
    rigid, sizes, _ = np.linalg.svd(changes(motions, slope, g.normals, p.R0), full_matrices=False)
    columns = [rigid[:, sizes > NO_MOTION * sizes[0]]]
    if p.beta == 0.0:
        of_shape = weighted_area_gradient(g, faces, state.c[faces].mean(axis=1))
        number = np.concatenate(
            [
                g.node_areas * (p.c0 + state.c),
                p.R0 * np.einsum("vi,vi->v", of_shape, g.normals),
            ]
        )
        columns.append(number[:, None] / np.linalg.norm(number))
    return np.linalg.qr(np.hstack(columns))[0]


def _start(state: State, model: Model) -> Array:
    """A smooth disturbance of no symmetry, the same for the same cell."""
    x = state.r - volume_centroid(state.r, model.mesh.faces)
    patterns = np.stack(
        [
            real_harmonic(degree, order, x)
            for degree in range(DEGREE + 1)
            for order in range(-degree, degree + 1)
        ]
    )
    shares = np.random.default_rng(0).standard_normal((2, len(patterns)))
    return np.asarray((shares @ patterns).ravel())

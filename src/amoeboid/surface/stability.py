"""How fast small disturbances of a steady cell grow, from the time step itself.

An implicit Euler step of length dt multiplies a disturbance that grows at lambda by
mu = 1/(1 - lambda dt). Arnoldi's iteration finds the outlying mu of the step, linearized by the
difference of two steps: those of the slowest modes, whose mu is not near 0 (L. S. Tuckerman and
D. Barkley, in IMA Volumes 119, 453, 2000). Where filaments are swept to the rear the map is far
from normal, and small errors of the steps make larger ones of lambda: a rate is only given where
they are small, as far as can be estimated.

A disturbance is what changes at the nodes: c'/(c0 + c) and h/R0, h along the normals. Nodes that
slide within the surface are none, so that the many slow modes of the mesh play no part. Rigid
motions of the cell are neutral, but on a mesh they seem to grow or decay a little, and would hide
slow modes; the map is restricted to what is orthogonal to them. That leaves the other eigenvalues
as they are where the mesh resolves the cell; where it does not, growth may appear that the steps
themselves do not show. Without turnover the number of filaments is kept, and a disturbance that
changes it is none of this cell. Where there are next to no filaments none can be taken away, the
map is not linear, and no rate is found.

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
from amoeboid.surface.rigid import changes, gradient, rotations, translations, turned
from amoeboid.surface.stepping import SHARE_OF_TOLERANCE, StepFailed, semi_implicit_step
from amoeboid.validation import InvalidInput

Array = NDArray[np.float64]

# Largest disturbance: small against what is not linear, large against what the passes leave.
AMPLITUDE = 1e-4
# Tolerance of the steps, of which the passes leave a share.
TOLERANCE = 3e-8
# Length of the steps in units of 1/model.rate, and the shares of it that are tried in turn where
# passes do not converge. Modes of shorter steps lie closer together.
STEP, SHARES = 0.1, (1.0, 0.5, 0.2)
# Smaller factors are modes that die out within a step, and noise.
LEAST_FACTOR = 0.1
# Estimated error of the rate allowed, in units of model.rate.
SETTLED = 0.02
FEWEST, MOST = 8, 60
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
) -> float | None:
    """Growth rate of the fastest growing disturbance of a steady state [1/T], None if not found.

    Negative if all decay; that of an oscillating one is the real part. `flow`: that in `state`;
    `step` and `settled`, the error allowed, in units of 1/model.rate and model.rate.
    """
    for share in SHARES:
        try:
            return _with_steps(model, state, flow, share * step, tolerance, settled)
        except (StepFailed, SingularMatrix, InvalidInput, np.linalg.LinAlgError):
            continue
    return None


def _with_steps(
    model: Model, state: State, flow: Flow, step: float, tolerance: float, settled: float
) -> float | None:
    dt = step / model.rate
    image, start = restricted_step(model, state, flow, dt, tolerance)
    noise = SHARE_OF_TOLERANCE * tolerance / AMPLITUDE
    found = ritz_values(image, start)
    for count, (values, residuals, conditions) in enumerate(found, 1):
        seen = np.abs(values) > LEAST_FACTOR
        if count >= FEWEST and seen.any():
            mu = values[seen]
            rates = (1.0 - 1.0 / mu) / dt
            first = int(np.argmax(rates.real))
            error = conditions[seen][first] * (residuals[seen][first] + noise)
            if error / (np.abs(mu[first]) ** 2 * dt) < settled * model.rate:
                return float(rates[first].real)
        if count >= MOST:
            break
    return None


def restricted_step(
    model: Model, state: State, flow: Flow, dt: float, tolerance: float
) -> tuple[Callable[[Array], Array], Array]:
    """`linearized_step` without what is left out, and a disturbance (2V,) to start from."""
    g = geometry(state.r, model.mesh.faces)
    slope = gradient(state.c, g, model.mesh) / (model.parameters.c0 + state.c)[:, None]
    left_out = _left_out(model, state, g, slope)
    image = linearized_step(model, state, flow, g, slope, dt, tolerance)

    def remaining(y: Array) -> Array:
        return np.asarray(y - left_out @ (left_out.T @ y))

    return lambda y: remaining(image(y)), remaining(_start(state, model))


def linearized_step(
    model: Model, state: State, flow: Flow, g: Geometry, slope: Array, dt: float, tolerance: float
) -> Callable[[Array], Array]:
    """What a step of length dt makes of a disturbance (2V,) of `state`: c'/(c0 + c), h/R0.

    `slope` (V, 3): the gradient of c over c0 + c.
    """
    p = model.parameters
    scale = p.c0 + state.c

    def after(disturbed: State) -> State:
        # in the axes of the nodes, which turn with the cell: rotations are left out in any case
        new, flow_then, _ = semi_implicit_step(model, (disturbed,), dt, flow, tolerance)
        center = volume_centroid(new.r, model.mesh.faces)
        return replace(new, r=center + turned(new.r - center, flow_then.turning, -dt))

    undisturbed = after(state)

    def image(y: Array) -> Array:
        amplitude = AMPLITUDE / np.abs(y).max()
        c, h = np.split(amplitude * y, 2)
        r = state.r + p.R0 * h[:, None] * g.normals
        disturbed = replace(state, r=r, c=state.c + scale * c)
        new = after(disturbed)
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
        along = p.R0 * np.einsum("vi,vi->v", of_shape, g.normals)
        columns.append(np.concatenate([g.node_areas * (p.c0 + state.c), along])[:, None])
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

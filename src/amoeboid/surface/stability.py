"""How fast small disturbances of a steady cell grow.

An implicit Euler step of length dt multiplies a disturbance that grows at lambda by
mu = 1/(1 - lambda dt). Arnoldi's iteration finds the outlying mu of the linearized step: those of
the slowest modes, whose mu is not near 0 (L. S. Tuckerman and D. Barkley, in IMA Volumes 119, 453,
2000). With dt = 1/rate few of them are: the step (`linearized.py`) need not be one that a run could
make. Where filaments are swept to the rear the map is far from normal, and small errors of it make
larger ones of lambda: the error of a rate is estimated and belongs to it.

Rigid motions of the cell are neutral, but on a mesh they seem to grow or decay a little, and would
hide slow modes: the equations of motion are restricted to what is orthogonal to them. That leaves
the other rates as they are where the mesh resolves the cell; where it does not, growth may appear
that the steps themselves do not show. Without turnover the number of filaments is kept, and a
disturbance that changes it is none of this cell. A cue makes rotations about other axes than its
own decay or grow for good: they are no neutral motions then.

The cell may turn while it is disturbed, but slowly: as much as `dt` turns it is neglected.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from amoeboid.arrays import Array
from amoeboid.meshes.geometry import Geometry, volume_centroid, weighted_area_gradient
from amoeboid.numerics.arnoldi import ritz_values
from amoeboid.numerics.recycling import NoConvergence
from amoeboid.numerics.sparse.banded import SingularMatrix
from amoeboid.numerics.spherical_harmonics import real_harmonic
from amoeboid.surface.linearized import LinearizedStep
from amoeboid.surface.model import Model
from amoeboid.surface.rigid import changes, free_axes, gradient, rotations, translations
from amoeboid.surface.state import Flow, State
from amoeboid.validation import InvalidInput

# Length of the step in units of 1/model.rate, and the shares of it that are tried in turn where
# its equations cannot be solved. Modes of shorter steps lie closer together.
STEP, SHARES = 1.0, (1.0, 0.3, 0.1)
# Tolerance of the linear equations of a step.
TOLERANCE = 1e-5
# Smaller factors are modes that die out within a step, and noise.
LEAST_FACTOR = 0.1
# Estimated error of a rate at which it counts as found, in units of model.rate.
SETTLED = 0.02
# A rate whose sign is still open goes on down to this error.
SHARPEST = 1e-3
# Condition numbers of the compressed map are below those of the map itself, by up to so much.
SAFETY = 3.0
# Share of the error that counts for little.
LITTLE = 0.3
MIN_APPLICATIONS, MAX_APPLICATIONS = 8, 100
# The start has a part in every harmonic up to this degree.
DEGREE = 3
# Rigid motions that change the cell by less than this share of the largest are none: rotations of
# a sphere or around an axis of symmetry.
NO_MOTION = 0.02


@dataclass(frozen=True)
class Growth:
    """Growth rate of the fastest growing disturbance of a steady state, and its error [1/T].

    Negative if all decay; that of an oscillating one is the real part. The error is that of the
    rate of this discrete cell; that of the mesh comes on top. `rate` is None and `error` infinite
    where no rate was found; `problem` then says why.
    """

    rate: float | None
    error: float = math.inf
    problem: str = ""


def leading_growth_rate(
    model: Model,
    state: State,
    flow: Flow,
    step: float = STEP,
    tolerance: float = TOLERANCE,
    settled: float = SETTLED,
) -> Growth:
    """How fast the fastest growing disturbance of a steady state grows.

    `flow`: that in `state`; `step` and `settled`, the error to aim at, in units of 1/model.rate and
    model.rate.
    """
    problem = ""
    for share in SHARES:
        try:
            found = _with_steps(model, state, flow, share * step, tolerance, settled)
        except (NoConvergence, SingularMatrix, InvalidInput, np.linalg.LinAlgError) as error:
            problem = problem or f"the cell could not be disturbed: {error}"
            continue
        if found.rate is not None:
            return found
        problem = found.problem
    return Growth(None, problem=problem)


def _with_steps(
    model: Model, state: State, flow: Flow, step: float, tolerance: float, settled: float
) -> Growth:
    restricted = RestrictedStep(model, state, flow, step / model.rate, tolerance)
    wanted, sharpest = settled * model.rate, min(SHARPEST, settled) * model.rate
    best = Growth(None, problem="no disturbance was found that decays slowly enough to be seen")
    for count, found in enumerate(ritz_values(restricted.image, restricted.start()), 1):
        if count > MAX_APPLICATIONS:
            break
        seen = np.flatnonzero(np.abs(found.values) > LEAST_FACTOR)
        if count < MIN_APPLICATIONS or not len(seen):
            continue
        mu = found.values[seen]
        rates = ((1.0 - 1.0 / mu) / restricted.dt).real
        residuals = found.residuals[seen] / (np.abs(mu) ** 2 * restricted.dt)
        first = int(np.argmax(rates))
        rate, weight = float(rates[first]), SAFETY * float(found.conditions[seen[first]])
        # that of the first, or what another may become
        left = max(weight * residuals[first], float((rates + residuals).max()) - rate)
        error = left
        if left < wanted:
            tested = restricted.residual(found.vector(int(seen[first])), mu[first])
            error = max(left, weight * tested / (abs(mu[first]) ** 2 * restricted.dt))
        if not np.isfinite(error):
            continue
        best = Growth(rate, float(error))
        found_out = error < wanted and (abs(rate) > error or error < sharpest)
        # or it does not become less by further applications
        if found_out or (left < wanted and left < LITTLE * error):
            break
    return best


class RestrictedStep:
    """A linearized step of length dt [T] without rigid motions of the cell; see the module."""

    def __init__(self, model: Model, state: State, flow: Flow, dt: float, tolerance: float) -> None:
        self.model, self.state, self.dt, self._tolerance = model, state, dt, tolerance
        self._step = LinearizedStep(model, state, flow, dt)
        slope = gradient(state.c, self._step.g, model.mesh)
        slope /= (model.parameters.c0 + state.c)[:, None]
        self._left_out = _left_out(model, state, self._step.g, slope)
        images = [self._step.image(y, tolerance) for y in self._left_out.T]
        self._of_left_out = np.reshape(images, self._left_out.T.shape).T
        self._inverse = np.linalg.inv(self._left_out.T @ self._of_left_out)

    def image(self, y: Array) -> Array:
        """What the step makes of a disturbance y (2V,). Raises NoConvergence."""
        return self._restricted(self._step.image(y, self._tolerance))

    def residual(self, mode: NDArray[np.complex128], mu: complex) -> float:
        """How far `mode` (2V,), of length 1, is from being multiplied by mu."""
        parts = []
        for y, x in ((mode.real, (mu * mode).real), (mode.imag, (mu * mode).imag)):
            if np.abs(y).max() > 0.0:
                left = self._step.remainder(x, y, self._tolerance)
                parts.append(self._restricted(left))
        return float(np.linalg.norm(parts))

    def start(self) -> Array:
        """A disturbance (2V,) to start from."""
        y = _start(self.state, self.model)
        return np.asarray(y - self._left_out @ (self._left_out.T @ y))

    def _restricted(self, x: Array) -> Array:
        """The solution x (2V,) of a step with the motions left out kept at zero by their forces."""
        kept = self._left_out.T @ x
        x = x - self._of_left_out @ (self._inverse @ kept)
        return np.asarray(x - self._left_out @ (self._left_out.T @ x))


def _left_out(model: Model, state: State, g: Geometry, slope: Array) -> Array:
    """Orthonormal disturbances (2V, k) that the map is restricted from; see the module.

    `slope` (V, 3): the gradient of c over c0 + c.
    """
    p, faces = model.parameters, model.mesh.faces
    x = (state.r - volume_centroid(state.r, faces)) / p.R0
    turns = rotations(x, free_axes(model, state.r))
    motions = [p.R0 * motion for motion in (*translations(x), *turns)]
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

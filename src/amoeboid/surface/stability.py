"""Growth rates of small perturbations of a steady cell.

An implicit Euler step of length dt multiplies a perturbation of growth rate lambda by the factor
mu = 1/(1 - lambda dt). Arnoldi's iteration finds the outlying eigenvalues mu of the linearized
step. They belong to the slowest modes; mu is near 0 for all others (L. S. Tuckerman and D. Barkley,
in IMA Volumes 119, 453, 2000). With dt = 2/rate only few mu are outlying. The linearized step
(`linearized.py`) may be longer than any step of a run. Where filaments are swept to the rear the
map is far from normal, and small errors of the map cause larger errors of lambda. Every growth rate
therefore comes with an estimate of its error.

Rigid motions of the cell are neutral, but on a mesh they seem to grow or decay slightly, and would
hide slow modes. The equations of motion are therefore restricted to perturbations orthogonal to
rigid motions. This does not affect the other growth rates where the mesh resolves the cell. Where
it does not, growth may be found that does not appear in a run. Without turnover the number of
filaments is conserved, and perturbations that change it are excluded as well. Under a cue,
rotations about other axes than its own are not neutral and are included.

The cell may rotate slowly; the rotation during `dt` is neglected.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from amoeboid.arrays import Array
from amoeboid.meshes.geometry import Geometry, volume_centroid, weighted_area_gradient
from amoeboid.numerics.arnoldi import Ritz, largest_residual, ritz_values
from amoeboid.numerics.recycling import NoConvergence, Recycling, SolvedImages
from amoeboid.numerics.sparse import SingularMatrix
from amoeboid.numerics.spherical_harmonics import real_harmonics
from amoeboid.surface.linearized import LinearizedStep
from amoeboid.surface.model import Model
from amoeboid.surface.rigid import rigid_changes
from amoeboid.surface.state import Flow, State
from amoeboid.validation import InvalidInput

# Length of the step in units of 1/model.rate, and the shares of it that are tried in turn if the
# equations of the step cannot be solved. The shorter the step, the closer the eigenvalues mu.
STEP, SHARES = 2.0, (1.0, 0.3, 0.1)
# Tolerance of the linear equations of a step, and of those that only tell the size of an error.
TOLERANCE, ROUGH = 3e-5, 0.03
# All steps are solved for to this tolerance at first, and further where the error asks for it. If
# that is not enough after so many applications, or the error is above so many rates after
# MIN_APPLICATIONS, the map is far from normal: all steps are solved for to TOLERANCE, from the
# start on.
ROUGH_IMAGE, ROUGH_APPLICATIONS, MAX_ROUGH = 1e-3, 16, 2.0
# Factors mu below this belong to modes that decay within a step, or are noise.
MIN_FACTOR = 0.05
# A growth rate is accepted if its estimated error is below this, in units of model.rate.
MAX_ERROR = 0.02
# If the sign of the growth rate is not certain, the error is reduced further, down to this.
MIN_ERROR = 1e-3
# The condition numbers of the projected map underestimate those of the map by up to this factor.
SAFETY = 3.0
# A contribution below this share of the error is unimportant.
SMALL_SHARE = 0.3
MIN_APPLICATIONS, MAX_APPLICATIONS = 8, 100
# The iteration starts from a sum of all spherical harmonics up to this degree.
DEGREE = 3


@dataclass(frozen=True)
class Growth:
    """Growth rate of the fastest growing perturbation of a steady state, and its error [1/T].

    The rate is negative if all perturbations decay; for an oscillating one it is the real part, and
    `frequency` the imaginary one, an angular frequency, otherwise 0. The error is that of both,
    relative to the discrete cell, without the error of the mesh. If no growth rate was found,
    `rate` is None, `error` is infinite, and `problem` says why.
    """

    rate: float | None
    error: float = math.inf
    problem: str = ""
    frequency: float = 0.0


NONE_FOUND = Growth(None, problem="no perturbation was found that decays slowly enough")


def leading_growth_rate(
    model: Model,
    state: State,
    flow: Flow,
    step: float = STEP,
    tolerance: float = TOLERANCE,
    max_error: float = MAX_ERROR,
    turning: Array | None = None,
) -> Growth:
    """The growth rate of the fastest growing perturbation of a steady state.

    `flow`: the flow in `state`, relative to axes with the angular velocity `turning` (3,), in which
    it is steady. `step`: the length of the linearized step in units of 1/model.rate; `max_error`:
    the error to aim at in units of model.rate.
    """
    return leading_mode(model, state, flow, step, tolerance, max_error, turning)[0]


def leading_mode(
    model: Model,
    state: State,
    flow: Flow,
    step: float = STEP,
    tolerance: float = TOLERANCE,
    max_error: float = MAX_ERROR,
    turning: Array | None = None,
) -> tuple[Growth, NDArray[np.complex128] | None]:
    """What `leading_growth_rate` gives, and that perturbation (2V,), if one was found."""
    problem = ""
    for share in SHARES:
        try:
            found, mode = _with_steps(
                model, state, flow, share * step, tolerance, max_error, turning
            )
        except (NoConvergence, SingularMatrix, InvalidInput, np.linalg.LinAlgError) as error:
            problem = problem or f"the cell could not be perturbed: {error}"
            continue
        if found.rate is not None:
            return found, mode
        problem = found.problem
    return Growth(None, problem=problem), None


def _with_steps(
    model: Model,
    state: State,
    flow: Flow,
    step: float,
    tolerance: float,
    max_error: float,
    turning: Array | None,
) -> tuple[Growth, NDArray[np.complex128] | None]:
    restricted = RestrictedStep(model, state, flow, step / model.rate, tolerance, turning)
    wanted = _Wanted(max_error * model.rate, min(MIN_ERROR, max_error) * model.rate)
    best: tuple[Growth, NDArray[np.complex128] | None] = NONE_FOUND, None
    for rough, applications in ((ROUGH_IMAGE, ROUGH_APPLICATIONS), (tolerance, MAX_APPLICATIONS)):
        if rough < tolerance:
            continue
        found, mode, enough = _iterated(
            restricted, rough, min(applications, MAX_APPLICATIONS), wanted
        )
        if found.rate is not None:
            best = found, mode
        if enough:
            break
    return best


@dataclass(frozen=True)
class _Wanted:
    """The error of a growth rate that is wanted, and that if its sign is not certain [1/T]."""

    error: float
    of_sign: float

    def has(self, rate: float, error: float) -> bool:
        """Whether a rate is known well enough."""
        return error < self.error and (abs(rate) > error or error < self.of_sign)


def _iterated(
    restricted: RestrictedStep, rough: float, applications: int, wanted: _Wanted
) -> tuple[Growth, NDArray[np.complex128] | None, bool]:
    """The growth rate after some `applications` of the step, the perturbation, and if that is all.

    The equations of the step are solved to the tolerance `rough`, and then as the error asks for.
    """

    def choose(found: Ritz) -> tuple[int, bool]:
        leading = _leading(found, restricted.dt)
        if leading is None:
            return largest_residual(found)
        unsolved = leading.unsolved(wanted)
        if unsolved or rough > restricted.tolerance:
            return leading.worst, unsolved
        return largest_residual(found)

    best, mode = NONE_FOUND, None
    values = ritz_values(restricted.images(rough), restricted.start(), choose)
    for count, found in enumerate(islice(values, applications), 1):
        leading = _leading(found, restricted.dt)
        if count < MIN_APPLICATIONS or leading is None:
            continue
        far = leading.iteration_error > MAX_ROUGH * restricted.model.rate
        if far and count == MIN_APPLICATIONS and rough > restricted.tolerance:
            break
        error, mu, vector = leading.bound, leading.mu, found.vector(leading.first)
        tested = leading.iteration_error < wanted.error
        if tested:
            residual = restricted.residual(vector, mu) / (abs(mu) ** 2 * restricted.dt)
            error = max(leading.error, leading.weight * residual)
        if not np.isfinite(error):
            continue
        best, mode = Growth(leading.rate, float(error), "", leading.frequency), vector
        # or further applications would not reduce the error
        enough = tested and leading.iteration_error < SMALL_SHARE * error
        if enough or wanted.has(leading.rate, error):
            return best, mode, True
    return best, mode, False


@dataclass(frozen=True)
class _Leading:
    """The largest growth rate among Ritz values, number `first`, whose factor is `mu`.

    `iteration_error`: its error if the equations of the steps were solved exactly: the rate itself
    is wrong, with a `weight`, or another rate may turn out to be larger. `error`: with what is
    unsolved of the equations of others; `bound`: of its own as well. Most of it is due to `worst`.
    """

    first: int
    mu: complex
    rate: float
    frequency: float
    weight: float
    iteration_error: float
    error: float
    bound: float
    worst: int

    def unsolved(self, wanted: _Wanted) -> bool:
        """Whether the equations must be solved to more digits, not the step be applied again."""
        if wanted.has(self.rate, self.bound) or not self.iteration_error < wanted.error:
            return False
        small = self.iteration_error < SMALL_SHARE * self.bound
        return small or wanted.has(self.rate, self.iteration_error)


def _leading(found: Ritz, dt: float) -> _Leading | None:
    """None if there are only factors of modes that decay within a step."""
    seen = np.flatnonzero(np.abs(found.values) > MIN_FACTOR)
    if not len(seen):
        return None
    mu = found.values[seen]
    exponents, scale = (1.0 - 1.0 / mu) / dt, np.abs(mu) ** 2 * dt
    rates, residuals = exponents.real, found.residuals[seen] / scale
    first = int(np.argmax(rates))
    rate, weight = float(rates[first]), SAFETY * float(found.conditions[seen[first]])

    def errors(own: Array, others: Array) -> Array:
        amounts = rates - rate + others
        amounts[first] = weight * own[first]
        return amounts

    uncertain = residuals + found.errors[seen] / scale
    bounds = errors(uncertain, uncertain)
    return _Leading(
        first=int(seen[first]),
        mu=complex(mu[first]),
        rate=rate,
        frequency=abs(float(exponents[first].imag)),
        weight=weight,
        iteration_error=float(errors(residuals, residuals).max()),
        error=float(errors(residuals, uncertain).max()),
        bound=float(bounds.max()),
        worst=int(seen[np.argmax(bounds)]),
    )


class RestrictedStep:
    """A linearized step of length dt [T] without rigid motions of the cell; see the module.

    Its image x of y is that of y + E a, with the excluded motions E (2V, k) by such amounts a (k,)
    that x has none of them. One iteration x = T x + S y of the step then becomes
    x = P (T x + S y), P the projection along S E on what has none of them.
    """

    def __init__(
        self,
        model: Model,
        state: State,
        flow: Flow,
        dt: float,
        tolerance: float,
        turning: Array | None = None,
    ) -> None:
        self.model, self.state, self.dt, self.tolerance = model, state, dt, tolerance
        self._step = LinearizedStep(model, state, flow, dt, turning)
        self._excluded = _excluded(model, state, self._step.g)
        self._zero = np.zeros(2 * len(state.c))
        moved = [self._step.before(y) for y in self._excluded.T]
        self._moved = np.reshape(moved, (self._excluded.shape[1], self._step.n)).T
        kept = [self._kept(column) for column in self._moved.T]
        self._inverse = np.linalg.inv(np.reshape(kept, (len(kept), len(kept))).T)
        self._equations = Recycling(self._defect, self._step.n)

    def images(self, rough: float) -> SolvedImages:
        """The perturbations (2V,) after the step, of those that are added: to a tolerance."""
        return SolvedImages(self._equations, self._right, self._shown, rough, self.tolerance)

    def residual(self, mode: NDArray[np.complex128], mu: complex) -> float:
        """Residual norm of `mode` (2V,), of length 1, as an eigenvector with eigenvalue mu.

        The equations of the step are evaluated with the opposite sign of the perturbation, so that
        the residual includes deviations of the map from a linear one.
        """
        parts = []
        for y, x in ((mode.real, (mu * mode).real), (mode.imag, (mu * mode).imag)):
            if np.abs(y).max() > 0.0:
                parts.append(self._solved(self._step.defect(x, y), ROUGH))
        return float(np.linalg.norm(parts))

    def start(self) -> Array:
        """The perturbation (2V,) that the iteration starts from."""
        y = _start(self.state, self.model)
        return np.asarray(y - self._excluded @ (self._excluded.T @ y))

    def _solved(self, right: Array, tolerance: float) -> Array:
        """The solution x (2V,) of (1 - P T) x = P `right` in fixed axes. Raises NoConvergence."""
        return self._shown(self._equations.solve(self._projected(right), tolerance))

    def _right(self, y: Array) -> Array:
        return self._projected(self._step.before(y))

    def _shown(self, unknowns: Array) -> Array:
        x = self._step.in_fixed_axes(unknowns)
        return np.asarray(x - self._excluded @ (self._excluded.T @ x))

    def _defect(self, unknowns: Array) -> Array:
        return unknowns - self._projected(self._step.iterate(unknowns, self._zero))

    def _projected(self, unknowns: Array) -> Array:
        return unknowns - self._moved @ (self._inverse @ self._kept(unknowns))

    def _kept(self, unknowns: Array) -> Array:
        """The excluded motions (k,) in unknowns of a step."""
        return np.asarray(self._excluded.T @ self._step.in_fixed_axes(unknowns))


def _excluded(model: Model, state: State, g: Geometry) -> Array:
    """Orthonormal perturbations (2V, k) that are excluded; see the module."""
    p, faces = model.parameters, model.mesh.faces
    columns = [rigid_changes(model, state.r, state.c, g)[0]]
    if p.beta == 0.0:
        of_shape = weighted_area_gradient(g, faces, state.c[faces].mean(axis=1))
        along = p.R0 * np.einsum("vi,vi->v", of_shape, g.normals)
        columns.append(np.concatenate([g.node_areas * (p.c0 + state.c), along])[:, None])
    return np.linalg.qr(np.hstack(columns))[0]


def _start(state: State, model: Model) -> Array:
    """A smooth perturbation without symmetry, the same for the same cell."""
    x = state.r - volume_centroid(state.r, model.mesh.faces)
    patterns = real_harmonics(DEGREE, x)
    shares = np.random.default_rng(0).standard_normal((2, len(patterns)))
    return np.asarray((shares @ patterns).ravel())

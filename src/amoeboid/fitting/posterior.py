"""The posterior probability of the unknowns of a fit, by an ensemble sampler (emcee).

The prior is flat in the logarithms of the unknowns within their bounds, on cells that have a
polarized state. Source: Foreman-Mackey et al., PASP 125, 306 (2013).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.axisymmetric.progress import Progress, Watch, unwatched
from amoeboid.extras import needed
from amoeboid.fitting.determination import Sensitivity
from amoeboid.fitting.problem import Point, Problem
from amoeboid.model.parameters import Parameters
from amoeboid.studies.columns import Column, column, frame, quantity, text
from amoeboid.threads import one_thread
from amoeboid.validation import InvalidInput, refuse_unknown

BURNED = 0.25
"""Share of the steps that are left out from the beginning."""

CORRELATION_TIMES = 20
"""Autocorrelation times that a chain must last for its quantiles to be trusted."""

SPREAD, MAX_SPREAD = 0.5, 0.3
"""The walkers begin around the best fit with this share of its standard errors, and at the most
this far in the logarithms."""

MAX_DRAWS = 100


@dataclass(frozen=True, eq=False, repr=False)
class Posterior:
    """Samples (n, k) of the logarithms of the unknowns over their values at the start.

    `samples(name)` gives an unknown; `autocorrelation` is the largest autocorrelation time in
    steps, None where the chain is too short to know; `problems` says what may be wrong.
    """

    start: Parameters
    names: tuple[str, ...]
    y: Array
    acceptance: float
    autocorrelation: float | None
    problems: tuple[str, ...]

    def _number(self, name: str) -> tuple[Array, str | None]:
        refuse_unknown([name], self.names, "parameter", "of this fit")
        known = name in self.start.names
        first = self.start.value(name) if known else 1.0
        dimension = self.start.dimension(name) if known else None
        return first * np.exp(self.y[:, self.names.index(name)]), dimension

    def samples(self, name: str) -> Any:
        """The samples of an unknown (n,). Raises InvalidInput for an unknown name."""
        return quantity(self.start, *self._number(name))

    def quantiles(self, name: str, shares: Any = (0.025, 0.5, 0.975)) -> Any:
        """Quantiles of an unknown."""
        values, dimension = self._number(name)
        return quantity(self.start, np.quantile(values, shares), dimension)

    @property
    def covariance(self) -> Array:
        """Covariance of the logarithms of the unknowns (k, k)."""
        return np.atleast_2d(np.cov(self.y.T))

    @property
    def columns(self) -> dict[str, Column]:
        """One row a sample."""
        return {name: column(self.start, *self._number(name)) for name in self.names}

    def to_pandas(self) -> Any:
        """A pandas.DataFrame with one row a sample."""
        return frame(self.columns, "sample")

    def __repr__(self) -> str:
        lines = [f"Posterior: {self.y.shape[0]} samples, acceptance {self.acceptance:.2f}"]
        for name in self.names[:6]:
            values, dimension = self._number(name)
            low, middle, high = np.quantile(values, (0.025, 0.5, 0.975))
            shown = [text(self.start, v, dimension, ".4g") for v in (low, middle, high)]
            lines.append(f"{name}: {shown[1]}, 95 % within {shown[0]} to {shown[2]}")
        return "\n".join([*lines, *(f"- {problem[:150]}" for problem in self.problems)])


@one_thread
def sampled(
    problem: Problem,
    best: Point,
    unknowns: tuple[str, ...],
    steps: int,
    walkers: int | None = None,
    seed: int = 0,
    watch: Watch = unwatched,
) -> Posterior:
    """`steps` steps of `walkers` (4 for each unknown if left out), seeded.

    Raises InvalidInput where emcee is missing, for numbers that are not whole or too small, and
    for unknowns that the data leave open altogether.
    """
    emcee = _emcee()
    count, sensitivity = best.y.size, Sensitivity.of(best.jacobian)
    walkers = 4 * count if walkers is None else walkers
    for name, value, least in (("steps", steps, 10), ("walkers", walkers, 2 * count + 2)):
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            raise InvalidInput(f"{name} must be a whole number >= {least}, got {value!r}")
    lost = [n for n, e in zip(unknowns, sensitivity.errors, strict=True) if np.isinf(e)]
    if lost:
        raise InvalidInput(
            f"every free parameter must affect the data, {' and '.join(lost)} can change without "
            "effect (see undetermined); fix one of them"
        )
    generator = np.random.default_rng(seed)
    evaluations = 0

    def log_probability(y: Array) -> float:
        nonlocal evaluations
        evaluations += 1
        watch(Progress("posterior", "step", float(evaluations // walkers), 0, evaluations))
        if np.any(y < problem.lower) or np.any(y > problem.upper):
            return -np.inf
        point = problem.evaluated(y, best)
        return -np.inf if point is None else -0.5 * point.chi2

    begin = _first_walkers(problem, best, sensitivity, walkers, generator)
    sampler = emcee.EnsembleSampler(walkers, count, log_probability)
    sampler.random_state = np.random.RandomState(seed).get_state()
    sampler.run_mcmc(begin, steps)
    times = sampler.get_autocorr_time(discard=int(BURNED * steps), tol=0)
    longest = float(np.max(times)) if np.isfinite(times).all() else None
    problems = []
    if longest is None or steps < CORRELATION_TIMES * longest:
        known = "unknown" if longest is None else f"{longest:.0f} steps"
        problems.append(
            f"the chain is short: its autocorrelation time is {known}; take at least "
            f"{steps * 2 if longest is None else int(CORRELATION_TIMES * longest) + 1} steps"
        )
    chain = sampler.get_chain(discard=int(BURNED * steps), flat=True)
    acceptance = float(np.mean(sampler.acceptance_fraction))
    return Posterior(problem.start, unknowns, chain, acceptance, longest, tuple(problems))


def _first_walkers(
    problem: Problem,
    best: Point,
    sensitivity: Sensitivity,
    walkers: int,
    generator: np.random.Generator,
) -> Array:
    """Points around the best fit that have a polarized state. Raises InvalidInput."""
    sizes = np.minimum(SPREAD * sensitivity.deviations, MAX_SPREAD)
    begin: list[Array] = []
    for _ in range(MAX_DRAWS * walkers):
        y = best.y + (sizes * generator.standard_normal(sizes.size)) @ (sensitivity.directions)
        inside = np.all(y >= problem.lower) and np.all(y <= problem.upper)
        if inside and problem.evaluated(y, best) is not None:
            begin.append(y)
        if len(begin) == walkers:
            return np.array(begin)
    raise InvalidInput(
        "cells near the best fit must have a polarized state, almost none has; free fewer "
        "parameters"
    )


def _emcee() -> Any:
    return needed("emcee", "the posterior needs")

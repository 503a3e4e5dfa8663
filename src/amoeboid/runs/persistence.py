"""How long a cell keeps its heading, and how it turns, from the headings of one run or of several.

For a heading that performs a random walk on the sphere, <u(t).u(t + s)> = exp(-2 D_r s): D_r is the
rotational diffusion coefficient, 1/(2 D_r) the persistence time.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.display import html_table, shown
from amoeboid.model.parameters import Parameters
from amoeboid.simulation.events import time_of
from amoeboid.studies.columns import quantity
from amoeboid.validation import InvalidInput

# The heading in the environment of a run, or that with all drag on the cortex.
HEADINGS = ("migration_heading", "cortex_drag_heading")
MIN_PAIRS = 4  # headings a lag apart that an error can be estimated from
MAX_LAGS = 20  # of the autocorrelation
LEFT_OUT = 0.25  # share of a run before which headings do not count, unless told
PER_LAG = 0.05  # the lag as a share of what counts, unless told
SIGNIFICANT = 3.0  # standard errors


@dataclass(frozen=True, eq=False, repr=False)
class Persistence:
    """Persistence of the heading of a cell, from `pairs` of headings one lag apart.

    Errors are standard errors for independent steps of the heading, as a random walk has: the lag
    must be longer than what the heading remembers of its last step. Whether it is, shows a second
    lag: D_r must stay.

    In plain numbers: `lag_number` is the lag, `correlations` (K,) is `autocorrelation`,
    `first_error` the error of its second entry, `mean_turning` (3,) the mean rotation of the
    heading in a lag, with its error `mean_turning_error` (3,).
    """

    parameters: Parameters
    lag_number: float
    pairs: int
    correlations: Array
    first_error: float
    mean_turning: Array
    mean_turning_error: Array

    @property
    def lag(self) -> Any:
        """The time between two headings [T]."""
        return quantity(self.parameters, self.lag_number, "T")

    @property
    def lags(self) -> Any:
        """The times (K,) of `autocorrelation`: multiples of the lag, from 0 [T]."""
        times = self.lag_number * np.arange(len(self.correlations))
        return quantity(self.parameters, times, "T")

    @property
    def autocorrelation(self) -> Array:
        """<u(t).u(t + s)> (K,) of the unit vector u along the heading, at `lags`."""
        return self.correlations

    @property
    def _diffusion(self) -> tuple[float, float]:
        first = float(self.correlations[1])
        scale = 1.0 / (2.0 * self.lag_number)
        # the scalar product cannot exceed 1 but by rounding
        return max(0.0, -math.log(first)) * scale, self.first_error / first * scale

    @property
    def rotational_diffusion(self) -> Any:
        """D_r = -ln <u(t).u(t + lag)>/(2 lag) [1/T]."""
        return quantity(self.parameters, self._diffusion[0], "1/T")

    @property
    def rotational_diffusion_error(self) -> Any:
        """Standard error of `rotational_diffusion` [1/T]."""
        return quantity(self.parameters, self._diffusion[1], "1/T")

    @property
    def time(self) -> Any:
        """The persistence time 1/(2 D_r) [T]; infinite for a heading that does not change."""
        d, _ = self._diffusion
        return quantity(self.parameters, 0.5 / d if d > 0.0 else math.inf, "T")

    @property
    def time_error(self) -> Any:
        """Standard error of `time` [T], to first order: D_r must be known well."""
        d, error = self._diffusion
        return quantity(self.parameters, 0.5 * error / d**2 if d > 0.0 else math.inf, "T")

    @property
    def turning(self) -> Any:
        """Mean of u(t) x u(t + lag)/lag (3,), the mean turning rate [1/T], in fixed axes."""
        return quantity(self.parameters, self.mean_turning, "1/T")

    @property
    def turning_error(self) -> Any:
        """Standard error of `turning` (3,) [1/T]."""
        return quantity(self.parameters, self.mean_turning_error, "1/T")

    @property
    def turns(self) -> bool:
        """Whether the mean turning rate is significant: a circle or a helix, no random walk.

        Then D_r and the persistence time contain the steady turn.
        """
        return bool(np.any(np.abs(self.mean_turning) > SIGNIFICANT * self.mean_turning_error))

    def _rows(self) -> list[tuple[str, str]]:
        return [
            ("persistence time", f"{shown(self.time)} +- {shown(self.time_error)}"),
            (
                "rotational diffusion",
                f"{shown(self.rotational_diffusion)} +- {shown(self.rotational_diffusion_error)}",
            ),
            ("turns steadily", "yes" if self.turns else "not significantly"),
            ("lag", shown(self.lag)),
            ("pairs", str(self.pairs)),
        ]

    def __repr__(self) -> str:
        return f"Persistence({', '.join(f'{name}: {value}' for name, value in self._rows())})"

    def _repr_html_(self) -> str:
        return html_table("Persistence of the heading", self._rows())


def persistence(runs: Any, lag: Any = None, after: Any = None) -> Persistence:
    """Persistence and turning of the heading of `runs`: one, or several of the same cell.

    `lag`: the time between two headings, by default a twentieth of what counts; `after`: headings
    count from this time on, by default from a quarter of each run on; both [T], for cells with
    units also quantities. The heading is that in the environment of the run, otherwise that with
    all drag on the cortex. Raises InvalidInput where headings are missing, or too few.
    """
    several = list(runs) if isinstance(runs, list | tuple) else [runs]
    if not several:
        raise InvalidInput("persistence needs at least one run, got none")
    p = several[0].parameters
    if any(run.parameters != p for run in several[1:]):
        raise InvalidInput(
            "all runs must have the same parameters, these differ; compute their persistence "
            "separately"
        )
    begin = None if after is None else time_of(after, p, "after")
    histories = [_headings(run, begin) for run in several]
    if lag is None:
        step = PER_LAG * min(float(t[-1] - t[0]) for t, _ in histories)
    else:
        step = time_of(lag, p, "lag")
    if not step > 0.0:
        raise InvalidInput(f"lag must be > 0, got {step:g}")
    return of_headings(p, [sampled(t, u, step) for t, u in histories], step)


def _headings(run: Any, begin: float | None) -> tuple[Array, Array]:
    """Times (T,) and headings (T, 3) of a run that count."""
    columns, names = run.columns, list(run.keys())
    known = [name for name in HEADINGS if f"{name}_x" in names]
    if not known:
        raise InvalidInput(
            "persistence needs the column cortex_drag_heading or migration_heading of a run; "
            "observe it, or simulate in an environment"
        )
    p = run.parameters
    t = np.array([row["t"] for row in run.rows])
    u = np.stack([columns[f"{known[0]}_{axis}"].values for axis in "xyz"], axis=1)
    counts = t >= (LEFT_OUT * t[-1] if begin is None else begin)
    t, u = t[counts], u[counts]
    if len(t) < 2 or not np.all(np.linalg.norm(u, axis=1) > 0.5):
        last = 0.0 if len(t) == 0 else float(t[~(np.linalg.norm(u, axis=1) > 0.5)].max(initial=0))
        raise InvalidInput(
            "a cell must have a heading at all times used, this one has none at t = "
            f"{shown(quantity(p, last, 'T'))}; give a later time: after=..."
        )
    return t, u


def sampled(t: Array, u: Array, lag: float) -> Array:
    """Headings (K, 3) every `lag` from the first time on, on the chord between two rows."""
    at = t[0] + lag * np.arange(math.floor((t[-1] - t[0]) / lag * (1.0 + 1e-12)) + 1)
    found = np.stack([np.interp(at, t, u[:, k]) for k in range(3)], axis=1)
    return np.asarray(found / np.linalg.norm(found, axis=1)[:, None])


def of_headings(p: Parameters, several: Sequence[Array], lag: float) -> Persistence:
    """The persistence of headings (K, 3) every `lag`, of one run or several."""
    products = np.concatenate([np.einsum("ti,ti->t", u[1:], u[:-1]) for u in several])
    pairs = len(products)
    if pairs < MIN_PAIRS:
        raise InvalidInput(
            f"persistence needs at least {MIN_PAIRS} pairs of headings one lag apart, got {pairs}; "
            "give a shorter lag, or more or longer runs"
        )
    first = float(products.mean())
    if not first > 0.0:
        raise InvalidInput(
            f"the heading must stay correlated over one lag, its autocorrelation at {lag:g} is "
            f"{first:.3g}; give a shorter lag"
        )
    turns = np.concatenate([np.cross(u[:-1], u[1:]) for u in several]) / lag
    root = math.sqrt(pairs)
    return Persistence(
        p,
        lag,
        pairs,
        _autocorrelation(several),
        float(products.std(ddof=1)) / root,
        turns.mean(axis=0),
        turns.std(axis=0, ddof=1) / root,
    )


def _autocorrelation(several: Iterable[Array]) -> Array:
    """<u(t).u(t + k lag)> for k = 0, 1, ... up to half of the shortest run."""
    several = list(several)
    longest = max(1, min(MAX_LAGS, *(len(u) // 2 for u in several)))
    found = [1.0]
    for k in range(1, longest + 1):
        products = [np.einsum("ti,ti->t", u[k:], u[:-k]) for u in several]
        found.append(float(np.concatenate(products).mean()))
    return np.array(found)

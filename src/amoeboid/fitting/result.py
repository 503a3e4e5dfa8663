"""What a fit found: estimates, errors, intervals, and what may be wrong with them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import gammaincc, ndtri, stdtrit

from amoeboid.arrays import Array
from amoeboid.axisymmetric.progress import Progress, Watch, unwatched
from amoeboid.display import html_picture, html_table, plotted, shown, text_table
from amoeboid.fitting import likelihood
from amoeboid.fitting.determination import UNDETERMINED, Combination, Sensitivity
from amoeboid.fitting.measurements import Measurements, Quantity
from amoeboid.fitting.posterior import Posterior, sampled
from amoeboid.fitting.problem import Point, Problem
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.least_squares import Minimum
from amoeboid.studies.columns import (
    Column,
    frame,
    magnitude,
    physical_number,
    quantity,
    shortened,
    text,
    unit,
)
from amoeboid.studies.states import SteadyState
from amoeboid.threads import one_thread
from amoeboid.validation import InvalidInput, refuse_unknown

ANGLES = np.deg2rad(np.linspace(0.0, 180.0, 91))
"""Where predicted profiles are given if nothing else is asked for."""


@dataclass(frozen=True, repr=False)
class Interval:
    """A confidence interval by profile likelihood; an end is None where the data set none.

    `quadratic` says whether both ends lie where the standard error puts them; `notes` why an end
    is missing.
    """

    low: Any
    high: Any
    level: float
    quadratic: bool
    notes: tuple[str, ...] = ()

    def holds(self, value: Any) -> bool:
        """Whether a value lies inside."""
        above = self.low is None or bool(value >= self.low)
        return above and (self.high is None or bool(value <= self.high))

    def __repr__(self) -> str:
        ends = ["none" if end is None else shown(end) for end in (self.low, self.high)]
        notes = "".join(f"; {note}" for note in self.notes)
        return f"{ends[0]} to {ends[1]} ({100 * self.level:g} %){notes}"


@dataclass(frozen=True, eq=False, repr=False)
class Fit:
    """The parameters of a polarized cell that describe measurements best.

    `parameters` and `state` are those of the best fit; `estimates`, `standard_errors` and
    `intervals()` the free parameters and factors by name, quantities where the cell has units;
    `undetermined` the combinations that the data leave open, `problems` what may be wrong.
    `unknowns` are the names of what was free; `found` is the minimum of the least-squares
    `problem`, `other_minima` the chi2 of others that the search met; `orientation`, where the data
    do not tell: the pole that theta counts from, and by how much chi2 is larger from the other.
    """

    data: Measurements
    problem: Problem
    found: Minimum[Point]
    unknowns: tuple[str, ...]
    other_minima: tuple[float, ...] = ()
    orientation: tuple[str, float] | None = None
    undetermined: tuple[Combination, ...] = ()
    problems: tuple[str, ...] = ()

    @property
    def point(self) -> Point:
        """The best point of the least-squares problem."""
        return self.found.point

    @property
    def parameters(self) -> Parameters:
        """The cell of the best fit."""
        return self.point.state.solution.parameters

    @cached_property
    def state(self) -> SteadyState:
        """Its polarized steady state."""
        return SteadyState(self.point.state.solution)

    @property
    def converged(self) -> bool:
        """Whether the search ended at a minimum."""
        return self.found.converged

    @property
    def chi2(self) -> float:
        """Sum of squares of (prediction - value)/error [1]."""
        return self.point.chi2

    @property
    def dof(self) -> int:
        """Number of values less number of determined unknowns."""
        return self.point.residuals.size - int(self.sensitivity.determined.sum())

    @property
    def errors_estimated(self) -> tuple[str, ...]:
        """Quantities whose errors were estimated from their residuals."""
        return tuple(t.name for t in self.problem.targets if t.estimated)

    @property
    def p_value(self) -> float | None:
        """Probability [1] of a chi2 as large by chance; None with estimated errors, or dof 0."""
        if self.errors_estimated or self.dof <= 0:
            return None
        return float(gammaincc(0.5 * self.dof, 0.5 * self.chi2))

    @cached_property
    def sensitivity(self) -> Sensitivity:
        """How the residuals depend on the unknowns, and what follows for their errors."""
        return Sensitivity.of(self.point.jacobian)

    @property
    def estimates(self) -> dict[str, Any]:
        """The free parameters and the factors of profiles in arbitrary units."""
        return {name: self._quantity(k, self.point.y[k]) for k, name in enumerate(self.unknowns)}

    @property
    def relative_errors(self) -> dict[str, float]:
        """Standard errors of the logarithms, from the sensitivities; inf for what is left open."""
        return dict(zip(self.unknowns, self.sensitivity.errors.tolist(), strict=True))

    @property
    def standard_errors(self) -> dict[str, Any]:
        """The same times the estimates."""
        errors = self.relative_errors
        return {name: abs(value) * errors[name] for name, value in self.estimates.items()}

    @property
    def correlation(self) -> Array:
        """Correlation matrix of the logarithms of the unknowns, in their order (k, k) [1]."""
        return self.sensitivity.correlation

    @property
    def residuals(self) -> dict[str, Array]:
        """(prediction - value)/error by quantity [1], (n,) in the order of its n values."""
        return {t.name: self.point.residuals_of(k) for k, t in enumerate(self.problem.targets)}

    def interval(self, name: str, level: float = 0.95, watch: Watch = unwatched) -> Interval:
        """The confidence interval of an unknown, by profile likelihood.

        `watch` is called with every value that is tried. Raises InvalidInput for an unknown name
        and a level that is not between 0 and 1.
        """
        refuse_unknown([name], self.unknowns, "parameter", "of this fit")
        if not isinstance(level, float) or not 0 < level < 1:
            raise InvalidInput(f"level must be a number between 0 and 1, got {level!r}")
        if (name, level) not in self._known_intervals:
            k = self.unknowns.index(name)
            self._known_intervals[name, level] = self._interval(k, level, watch)
        return self._known_intervals[name, level]

    def intervals(self, level: float = 0.95, watch: Watch = unwatched) -> dict[str, Interval]:
        """The confidence intervals of all unknowns, by name, at a `level` of confidence."""
        return {name: self.interval(name, level, watch) for name in self.unknowns}

    @cached_property
    def _known_intervals(self) -> dict[tuple[str, float], Interval]:
        return {}

    @one_thread
    def _interval(self, k: int, level: float, watch: Watch) -> Interval:
        rise = self._quantile(level)
        deviation = self.sensitivity.errors[k]
        signs = (-1.0, 1.0)

        def tried(trial: int) -> None:
            value = self.plain(self.unknowns[k])[0]
            watch(Progress("interval", self.unknowns[k], value, self.point.state.solution.n, trial))

        if deviation > UNDETERMINED:
            ends = [likelihood.End(None, "the data do not determine it")] * 2
        else:
            edge = self.found.edge
            ends = [
                likelihood.end(self.problem, self.point, k, rise, s, tried, edge) for s in signs
            ]
        values = [None if e.value is None else self._quantity(k, e.value) for e in ends]
        if abs(self._value(k, 0.0)) != self._value(k, 0.0):  # of a negative parameter
            values.reverse()
        quadratic = all(
            e.value is not None
            and abs(s * (e.value - self.point.y[k]) - rise * deviation)
            <= likelihood.QUADRATIC * rise * deviation
            for s, e in zip(signs, ends, strict=True)
        )
        notes = tuple(dict.fromkeys(e.why for e in ends if e.why))
        return Interval(values[0], values[1], level, quadratic, notes)

    def _quantile(self, level: float) -> float:
        """Standard deviations from the middle to an end of an interval."""
        if self.errors_estimated and self.dof > 0:
            return float(stdtrit(self.dof, 0.5 + 0.5 * level))
        return float(ndtri(0.5 + 0.5 * level))

    def _value(self, k: int, y: float) -> float:
        """Unknown k at y, in the units of the solver."""
        names = self.problem.names
        start = self.problem.start.value(names[k]) if k < len(names) else 1.0
        return start * float(np.exp(y))

    def _dimension(self, k: int) -> str | None:
        names = self.problem.names
        return self.problem.start.dimension(names[k]) if k < len(names) else None

    def _quantity(self, k: int, y: float) -> Any:
        return quantity(self.problem.start, self._value(k, y), self._dimension(k))

    @property
    def at_bounds(self) -> tuple[str, ...]:
        """The unknowns that ended at their bounds."""
        return tuple(
            name for name, held in zip(self.unknowns, self.found.at_bound, strict=True) if held
        )

    def profile(self, name: str, theta: Any = None) -> dict[str, Column]:
        """The predicted profile `name`, "u" or "c", with its standard error, by columns.

        `theta` in degrees from the front, or where the pole was unknown as in the data; every 2
        degrees if left out. In the unit of the data. Raises InvalidInput for a profile that was not
        measured.
        """
        k = self._profile_place(name)
        angles = ANGLES if theta is None else np.deg2rad(np.atleast_1d(np.asarray(theta, float)))
        if not (np.isfinite(angles).all() and angles.min() >= 0 and angles.max() <= np.pi + 1e-9):
            raise InvalidInput(f"theta must be angles from 0 to 180 deg, got {theta!r:.100}")
        target, q = self.problem.targets[k], self.data[k]
        seen = np.pi - angles if self.mirrored else angles
        found = target.predicted(self.point.state, self.point.y, seen)
        spread = np.sqrt(
            np.einsum("mi,ij,mj->m", found.slopes, self.sensitivity.covariance, found.slopes)
        )
        size = q.size(self.parameters)
        return {
            "theta": Column(np.rad2deg(angles), "deg"),
            name: Column(found.values / size, q.unit),
            f"{name}_error": Column(spread / size, q.unit),
        }

    def quantity(self, name: str) -> Quantity:
        """The measurements of the profile `name`. Raises InvalidInput for one not measured."""
        found: Quantity = self.data[self._profile_place(name)]
        return found

    def errors_used(self, name: str) -> Array:
        """The errors of the n values of a quantity `name` (n,), in the unit of the data.

        Also where they were estimated. Raises InvalidInput for a quantity that was not measured.
        """
        k = self._profile_place(name)
        return self.problem.targets[k].errors / self.data[k].size(self.parameters)

    @property
    def mirrored(self) -> bool:
        """Whether theta of the data was found to count from the rear."""
        return self.orientation is not None and self.orientation[0] == "rear"

    def _profile_place(self, name: str) -> int:
        names = tuple(t.name if t.theta is not None else "" for t in self.problem.targets)
        refuse_unknown([name], [n for n in names if n], "measured profile")
        return names.index(name)

    @property
    def profiles(self) -> tuple[str, ...]:
        """Names of the measured profiles."""
        return tuple(t.name for t in self.problem.targets if t.theta is not None)

    @property
    def columns(self) -> dict[str, Column]:
        """One row an unknown: estimate, standard error and relative error in its unit."""
        start = self.problem.start
        units = [unit(start, self._dimension(k)) for k in range(len(self.unknowns))]
        values = [
            float(magnitude(start, self._value(k, y), self._dimension(k)))
            for k, y in enumerate(self.point.y)
        ]
        relative = list(self.relative_errors.values())
        return {
            "unknown": Column(np.array(self.unknowns, dtype=object), ""),
            "estimate": Column(np.array(values), ""),
            "standard_error": Column(np.abs(values) * np.array(relative), ""),
            "relative_error": Column(np.array(relative), ""),
            "unit": Column(np.array(units, dtype=object), ""),
        }

    def to_pandas(self) -> Any:
        """A pandas.DataFrame with one row an unknown."""
        return frame(self.columns).set_index("unknown")

    def plot(self, ax: Any = None, name: str | None = None) -> Any:
        """Draw a measured profile, the fit and its standard error. Takes and returns axes.

        `name`: "u" or "c", the first one if left out. Raises InvalidInput without a profile.
        """
        if not self.profiles:
            raise InvalidInput("only profiles can be drawn, and this fit has none; use to_pandas()")
        drawn = self.profiles[0] if name is None else name
        self._profile_place(drawn)
        return plotted(self, "fits.draw_profile", ax, name=drawn)

    def posterior(
        self,
        steps: int = 1000,
        *,
        walkers: int | None = None,
        seed: int = 0,
        watch: Watch = unwatched,
    ) -> Posterior:
        """Samples of the posterior probability of the unknowns, by emcee.

        `steps` of each walker; `walkers`: their number, 4 for each unknown if left out; `seed` of
        the random numbers. Raises InvalidInput where emcee is missing.
        """
        return sampled(self.problem, self.point, self.unknowns, steps, walkers, seed, watch)

    def text(self, name: str) -> str:
        """The estimate of the unknown `name` with its standard error and unit."""
        k = self.unknowns.index(name)
        start, y, dimension = self.problem.start, float(self.point.y[k]), self._dimension(k)
        value, error = self._value(k, y), self.relative_errors[name]
        if np.isinf(error):
            return f"{text(start, value, dimension, '.4g')} (not determined)"
        if error > UNDETERMINED:
            lower, upper = self.problem.lower[k], self.problem.upper[k]  # it is not sought beyond
            ends = (max(y - error, lower), min(y + error, upper))
            return " to ".join(text(start, self._value(k, e), dimension, ".2g") for e in ends)
        size = magnitude(start, abs(value) * error, dimension)
        both = f"{magnitude(start, value, dimension):.4g} +- {size:.2g}"
        ending = unit(start, dimension) if start.units is not None else ""
        return f"{both} {ending}".rstrip()

    def plain(self, name: str) -> tuple[float, float | None]:
        """Estimate and standard error of an unknown `name` in its unit; None without an error."""
        k = self.unknowns.index(name)
        start, dimension = self.problem.start, self._dimension(k)
        value = self._value(k, float(self.point.y[k]))
        error = abs(value) * self.relative_errors[name]
        plain_error = None if np.isinf(error) else physical_number(start, error, dimension)
        return physical_number(start, value, dimension), plain_error

    @property
    def heading(self) -> str:
        """chi2 and what it means, in a line."""
        quantities = ", ".join(t.name for t in self.problem.targets)
        p_value = self.p_value
        chance = "" if p_value is None else f" (p = {p_value:.2g})"
        return f"Fit to {quantities}: chi2 = {self.chi2:.4g}, {self.dof} dof{chance}"

    def __repr__(self) -> str:
        rows = [
            [name, self.text(name), f"{100 * self.relative_errors[name]:.2g} %"]
            for name in self.unknowns[:6]
        ]
        more = len(self.unknowns) - 6
        notes = [*(c.text for c in self.undetermined), *self.problems]
        return "\n".join(
            [
                *shortened([self.heading], 1, "", 120),
                *text_table(("unknown", "estimate", "relative error"), rows, "<<"),
                *([f"... and {more} more"] if more > 0 else []),
                *(f"- {note}" for note in shortened(notes, 3, "notes", 150)),
            ]
        )

    def _repr_html_(self) -> str:
        rows = [
            (name, self.text(name), f"{100 * self.relative_errors[name]:.2g} %")
            for name in self.unknowns
        ]
        notes = [*(c.text for c in self.undetermined), *self.problems]
        titles = ("unknown", "estimate", "relative error")
        table = html_table(self.heading, rows, titles, shortened(notes, 20, "notes", 500))
        pictures = [html_picture(self, "fits.draw_profile", name=name) for name in self.profiles]
        return table + "".join(pictures)

    def __getstate__(self) -> dict[str, Any]:
        return {f.name: self.__dict__[f.name] for f in fields(self)}

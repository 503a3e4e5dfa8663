"""What a fit leaves open, and what may be wrong with it, in words and numbers."""

from __future__ import annotations

import numpy as np
from scipy.special import gammaincc

from amoeboid.arrays import Array
from amoeboid.fitting.determination import (
    UNDETERMINED,
    Combination,
    changes_nothing,
    in_words,
    scalings,
)
from amoeboid.fitting.likelihood import profile_point, rises
from amoeboid.fitting.result import Fit

UNLIKELY = 0.01
"""Probability below which a sum of squares is too large to be chance."""

TOO_GOOD = 0.999
"""Probability above which it is too small."""

HARDLY = 6.0
"""Difference of chi2 up to which front and rear are hardly told apart."""

LARGE = 0.3
"""Relative standard error from which it is rough: chi2 is no parabola over such a range."""

ROUGH = (0.6, 1.6)
"""Rises of chi2 outside of which a standard error, for which it is 1, is rough."""

FAR = 5.0
"""Errors between a value and the best fit that are no chance in any table of measurements."""

WITHIN = 1e-3
"""Singular values of one cell that are smaller than this share of its largest are not counted."""


def undetermined(found: Fit) -> tuple[Combination, ...]:
    """The combinations that the data leave open: by units, and within the errors."""
    jacobian, unknowns = found.point.jacobian, found.unknowns
    dimensions = {q.name: q.dimension or "" for q in found.data}
    exact = [
        direction
        for direction in scalings(found.problem, unknowns, dimensions)
        if changes_nothing(jacobian, direction)
    ]
    combinations = [_exact(unknowns, direction) for direction in exact]
    known = found.sensitivity
    open_ = known.deviations > UNDETERMINED
    for direction, deviation in zip(known.directions[open_], known.deviations[open_], strict=True):
        rest = direction - _projection(exact, direction)
        if np.linalg.norm(rest) > 0.5:
            combinations.append(_weak(found, direction, float(deviation)))
    return tuple(combinations)


def _exact(unknowns: tuple[str, ...], direction: Array) -> Combination:
    return Combination(
        {name: float(v) for name, v in zip(unknowns, direction, strict=True) if v != 0},
        None,
        True,
        f"{in_words(unknowns, direction)} changes no predicted value, because it is a change of "
        "units; take one of these parameters from another source",
    )


def _projection(rows: list[Array], direction: Array) -> Array:
    """The part of a direction within the span of others."""
    if not rows:
        return np.zeros_like(direction)
    basis = np.linalg.qr(np.array(rows).T)[0]
    return np.asarray(basis @ (basis.T @ direction))


def _weak(found: Fit, direction: Array, deviation: float) -> Combination:
    """A combination that the data leave open within their errors, with what it changes."""
    k = int(np.argmax(np.abs(direction)))
    unknowns, y = found.unknowns, found.point.y
    powers = direction / direction[k]
    relative = None if np.isinf(deviation) else deviation * abs(float(direction[k]))
    size = "infinite" if relative is None else f"{relative:.2g}"
    opening = f"{unknowns[k]} is not determined by these data (relative s.d. {size})"
    words = f"{in_words(unknowns, powers)} changes them by less than the errors"
    for factor in (2.0, 0.5):
        step = float(np.log(factor))
        there = profile_point(found.problem, found.point, k, y[k] + step)
        if there is not None:
            rise = there.chi2 - found.chi2
            words = f"{in_words(unknowns, (there.y - y) / step, factor)} changes chi2 by {rise:.2g}"
            break
    named = {name: float(v) for name, v in zip(unknowns, powers, strict=True)}
    return Combination(named, relative, False, f"{opening}: {words}")


def problems(found: Fit) -> tuple[str, ...]:
    """What may be wrong with the estimates or their errors."""
    return (*_of_the_search(found), *_of_the_data(found), *_of_the_errors(found))


def _of_the_search(found: Fit) -> list[str]:
    texts = []
    if found.found.edge:
        texts.append(
            "the best fit lies where the polarized state ends (a fold or the threshold), and the "
            "data pull it further; standard errors are not valid there"
        )
    elif not found.converged:
        texts.append(
            "the search did not converge; start closer to the solution, or free fewer parameters"
        )
    texts += [f"{name} ended at its bound; widen it or set {name}" for name in found.at_bounds]
    if found.other_minima:
        values = ", ".join(f"{v:.4g}" for v in sorted(set(found.other_minima))[:3])
        texts.append(
            f"another start found a different minimum (chi2 = {values}); more starts may find a "
            "better one"
        )
    if not found.state.stable:
        texts.append("the steady state of the best fit is unstable; a cell would leave it")
    return texts


def _of_the_data(found: Fit) -> list[str]:
    texts = []
    if any(q.name == "u" and q.values.mean() < 0 for q in found.data):
        texts.append(
            "u is negative on average; retrograde flow, from front to rear, must be positive"
        )
    if found.errors_estimated:
        texts.append(
            f"errors of {', '.join(found.errors_estimated)} were estimated from the residuals: "
            "chi2 cannot test whether the model describes these data"
        )
    p_value = found.p_value
    if p_value is not None and p_value < UNLIKELY:
        texts.append(
            f"the model does not describe the data within their errors (p = {p_value:.1g}): "
            "standard errors and intervals are too narrow"
        )
    if p_value is not None and p_value > TOO_GOOD:
        texts.append(
            f"chi2 is too small for errors of this size (p = {p_value:.5f}): are they standard "
            "deviations of single values?"
        )
    if p_value is None and not found.errors_estimated:
        texts.append(
            "there are as many unknowns as values: chi2 cannot test whether the model describes "
            "these data"
        )
    texts += _far_values(found)
    differ = _probability_of_cells(found)
    if differ is not None and differ < UNLIKELY:
        texts.append(
            f"the cells differ from one another by more than their errors (p = {differ:.1g}): fit "
            "them one by one"
        )
    if found.orientation is not None and found.orientation[1] < HARDLY:
        texts.append(
            "the data hardly distinguish front and rear: chi2 is larger by "
            f"{found.orientation[1]:.2g} with the poles exchanged"
        )
    return texts


def _far_values(found: Fit) -> list[str]:
    """The value that is farthest from the fit, if that is no chance."""
    target, residuals = max(
        ((t, found.residuals[t.name]) for t in found.problem.targets),
        key=lambda one: float(np.abs(one[1]).max()),
    )
    k = int(np.abs(residuals).argmax())
    if abs(residuals[k]) < FAR:
        return []
    q = next(q for q in found.data if q.name == target.name)
    pole = "" if found.orientation else " from the front"
    theta = "" if q.theta is None else f" at theta = {np.rad2deg(q.theta[k]):.4g} deg{pole}"
    more = int(np.sum(np.abs(np.concatenate(list(found.residuals.values()))) >= FAR)) - 1
    others = f" ({more} more by {FAR:g} or more)" if more else ""
    value = f"{q.name} = {q.values[k]:.4g} {q.unit}".rstrip()
    return [
        f"{value}{theta} is {abs(residuals[k]):.3g} errors from the best fit{others}; look for "
        "outliers"
    ]


def _probability_of_cells(found: Fit) -> float | None:
    """Probability that cells of the same parameters differ as these do; None for one cell.

    From what chi2 would gain, to first order, if each cell had unknowns of its own.
    """
    names = found.data.cells
    if len(names) < 2:
        return None
    labels = np.array([cell for q in found.data for cell in q.cells])
    gain, freedom = 0.0, -int(found.sensitivity.determined.sum())
    for name in names:
        here = labels == name
        left, s, _ = np.linalg.svd(found.point.jacobian[here], full_matrices=False)
        counts = s > WITHIN * s[0]
        gain += float(np.sum((left.T @ found.point.residuals[here])[counts] ** 2))
        freedom += int(counts.sum())
    return float(gammaincc(0.5 * freedom, 0.5 * gain)) if freedom > 0 else None


def _of_the_errors(found: Fit) -> list[str]:
    """Whether chi2 is a parabola within one standard error of each unknown."""
    if found.found.edge or not found.converged:
        return []
    texts = []
    large = [name for name, error in found.relative_errors.items() if LARGE < error < np.inf]
    if large:
        texts.append(
            f"standard errors of {', '.join(large)} are approximate, because they exceed "
            f"{100 * LARGE:g} %; use intervals()"
        )
    for k, (name, error) in enumerate(found.relative_errors.items()):
        if error > LARGE:
            continue
        around = rises(found.problem, found.point, k)
        if None in around:
            texts.append(
                f"the polarized state ends within one standard error of {name}, so this error is "
                "not valid; use intervals()"
            )
        elif any(not ROUGH[0] < rise < ROUGH[1] for rise in around if rise is not None):
            shown = " and ".join(f"{rise:.2g}" for rise in around)
            texts.append(
                f"the standard error of {name} is approximate: chi2 rises by {shown} there "
                "instead of 1; use intervals()"
            )
    return texts

"""Many parameter points at once: what lets every closed form broadcast over parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import Field, dataclass, fields, is_dataclass, replace
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.model.parameters import Parameters
from amoeboid.model.polymerization import Law
from amoeboid.model.polymerization import law as law_from
from amoeboid.validation import InvalidInput, refuse_unknown, rule

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


@dataclass(frozen=True, kw_only=True)
class Points:
    """Parameter points as arrays that broadcast against each other; made by `points`.

    Symbols, units and ranges are those of `Parameters`; the law is the same at every point.
    """

    R0: Array
    delta_P: Array
    eta_s: Array
    eta_b: Array
    c0: Array
    c_r: Array
    beta: Array
    D: Array
    v_p0: Array
    alpha: Array
    law: Law

    @property
    def shape(self) -> tuple[int, ...]:
        """The common shape of all parameters."""
        return np.broadcast_shapes(*(np.shape(getattr(self, f.name)) for f in _NUMBERS))

    def v_p_derivatives(self, c: ArrayLike, order: int = 3) -> tuple[Array, ...]:
        """(v_p, v_p', v_p'', ...) at c, to `order`."""
        return self.law.derivatives(c, self.v_p0, self.c_r, order)

    def at_speed(self, v_p0: ArrayLike) -> Points:
        """The same points with another polymerization speed scale [L/T]."""
        return replace(self, v_p0=np.asarray(v_p0, dtype=float))

    def at_pressure(self, delta_P: ArrayLike) -> Points:
        """The same points at another pressure [M/(L T^2)]; `numpy.inf` is the rigid sphere."""
        return replace(self, delta_P=np.asarray(delta_P, dtype=float))

    def flat(self) -> list[Points]:
        """The points one by one, in C order."""
        columns = {f.name: np.broadcast_to(getattr(self, f.name), self.shape) for f in _NUMBERS}
        return [
            Points(**{name: column[index] for name, column in columns.items()}, law=self.law)
            for index in np.ndindex(self.shape)
        ]


AnyPoints = Parameters | Points

_NUMBERS = tuple(f for f in fields(Parameters) if "kind" in f.metadata)


def points(base: AnyPoints, **changes: Any) -> Points:
    """`base` with parameters replaced by arrays; the arrays must broadcast.

    Raises InvalidInput for an unknown name, a value outside its range, or shapes that clash.

    >>> points(Parameters(), D=[0.03, 0.4]).shape
    (2,)
    """
    values: dict[str, Any] = {f.name: np.asarray(getattr(base, f.name)) for f in _NUMBERS}
    law = law_from(changes.pop("law", base.law))
    by_name = {f.name: f for f in _NUMBERS}
    refuse_unknown(changes, (*by_name, "law"), "parameter")
    for name, value in changes.items():
        values[name] = _checked(by_name[name], value)
    found = Points(**values, law=law)
    try:
        _ = found.shape
    except ValueError:
        shapes = ", ".join(f"{n}: {v.shape}" for n, v in values.items() if v.ndim)
        raise InvalidInput(f"parameter arrays must broadcast, got shapes {shapes}") from None
    return found


def infinite_pressure(p: AnyPoints) -> Points:
    """The same points in the limit delta_P -> infinity, in which the cell stays a sphere.

    The closed forms of the paper's supplement belong to it: its nu is
    `cubic_coefficient(infinite_pressure(p))`.
    """
    return points(p).at_pressure(np.inf)


def finite_result(
    function: Callable[Concatenate[Points, Arguments], Result],
) -> Callable[Concatenate[AnyPoints, Arguments], Result]:
    """Let a formula written for Points take Parameters too; refuse an overflow as its answer.

    The answer is an array, or a dataclass of arrays.
    """

    @wraps(function)
    def evaluated(p: AnyPoints, /, *args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        with np.errstate(all="ignore"):
            result: Any = function(points(p), *args, **kwargs)
        if not is_dataclass(result):
            result = np.asarray(result)
        _refuse_overflow(function.__name__.lstrip("_"), result)
        return result

    return evaluated


def _refuse_overflow(name: str, result: Any) -> None:
    if is_dataclass(result):
        for f in fields(result):
            _refuse_overflow(f"{name}: {f.name}", getattr(result, f.name))
    elif not np.all(np.isfinite(result)):
        raise InvalidInput(
            f"{name} is beyond double precision at these parameters; "
            "use units in which they are nearer to 1"
        )


def _checked(f: Field[Any], value: Any) -> Array:
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "iuf":
            raise TypeError
        array = array.astype(float)
    except (TypeError, ValueError):
        raise InvalidInput(f"{f.name} must be {rule(f)}, got {value!r}") from None
    bounds = f.metadata["bounds"]
    good = np.isfinite(array)
    if bounds[">"] is not None:
        good &= array > bounds[">"]
    if bounds[">="] is not None:
        good &= array >= bounds[">="]
    if not np.all(good):
        raise InvalidInput(f"{f.name} must be {rule(f)}, got {array[~good].flat[0]:.6g}")
    return array

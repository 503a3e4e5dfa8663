"""Many parameter points at once: what lets every closed form broadcast over parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import Field, dataclass, fields, is_dataclass, replace
from functools import cached_property, wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array, all_finite
from amoeboid.model.material import Material
from amoeboid.model.parameters import DIMENSIONS, RELATIONS, Parameters
from amoeboid.model.polymerization import Law
from amoeboid.model.stress import Stress
from amoeboid.validation import InvalidInput, refuse_unknown, rule

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


@dataclass(frozen=True, kw_only=True, repr=False)
class Points(Material):
    """Parameter points as arrays that broadcast against each other; made by `points`.

    Symbols, units and ranges are those of `Parameters`. Law and stress are the same at every point,
    their own parameters may be arrays.
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
    chi: Array
    kappa: Array
    gamma_t: Array
    gamma_n: Array
    gamma_c: Array
    gamma_share: Array
    law: Law
    stress: Stress

    def __repr__(self) -> str:
        parts = (_range(name, np.asarray(value)) for name, value in self.columns().items())
        relations = f"law = {self.law.name}, stress = {self.stress.name}"
        return f"Points(shape {self.shape}: {', '.join(parts)}, {relations})"

    @property
    def shape(self) -> tuple[int, ...]:
        """The common shape of all parameters."""
        return np.broadcast_shapes(*map(np.shape, self.columns().values()))

    @cached_property
    def _speeds(self) -> dict[int, tuple[Array, ...]]:
        return {}

    def v_p_derivatives(self, c: ArrayLike, order: int = 3) -> tuple[Array, ...]:
        """See Material; at c0 of a single point they are kept: every closed form asks for them."""
        if c is not self.c0 or np.ndim(c) or np.ndim(self.v_p0):
            return super().v_p_derivatives(c, order)
        if order not in self._speeds:
            self._speeds[order] = super().v_p_derivatives(c, order)
        return self._speeds[order]

    def at_speed(self, v_p0: ArrayLike) -> Points:
        """The same points with another polymerization speed scale [L/T]."""
        return replace(self, v_p0=np.asarray(v_p0, dtype=float))

    def at_pressure(self, delta_P: ArrayLike) -> Points:
        """The same points at another pressure [M/(L T^2)]; `numpy.inf` is the rigid sphere."""
        return replace(self, delta_P=np.asarray(delta_P, dtype=float))

    def flat(self) -> list[Points]:
        """The points one by one, in C order."""
        columns = {k: np.broadcast_to(v, self.shape) for k, v in self.columns().items()}
        return [
            _with_numbers(self, {name: column[index] for name, column in columns.items()})
            for index in np.ndindex(self.shape)
        ]

    def parameters(self, number: int) -> Parameters:
        """The parameters of one point, counted in C order."""
        columns = self.columns()
        shape = np.broadcast_shapes(*map(np.shape, columns.values()))
        index = np.unravel_index(number, shape) if shape else ()
        numbers = {name: float(_at(value, index)) for name, value in columns.items()}
        one = _with_numbers(self, numbers)
        plain: dict[str, Any] = {k: value for k, value in numbers.items() if "." not in k}
        return Parameters(**plain, law=one.law, stress=one.stress)

    def columns(self) -> dict[str, Any]:
        """All numbers by name, those of law and stress with a dot."""
        own = {
            f"{kind}.{name}": value
            for kind in RELATIONS
            for name, value in getattr(self, kind).own.items()
        }
        return {name: getattr(self, name) for name in DIMENSIONS} | own


def _at(value: Any, index: tuple[Any, ...]) -> Any:
    """The entry of an array that broadcasts to more axes or longer ones."""
    value = np.asarray(value)
    own = index[len(index) - value.ndim :]
    return value[tuple(0 if size == 1 else k for k, size in zip(own, value.shape, strict=True))]


def _range(name: str, values: Array) -> str:
    if values.size == 0:
        return f"no {name}"
    low, high = values.min(), values.max()
    return f"{name} = {low:.6g}" if low == high else f"{name} = {low:.6g} to {high:.6g}"


AnyPoints = Parameters | Points

_NUMBERS = tuple(f for f in fields(Parameters) if "kind" in f.metadata)


def _with_numbers(base: Points, numbers: dict[str, Any]) -> Points:
    relations = {}
    for kind in RELATIONS:
        own = {k.partition(".")[2]: v for k, v in numbers.items() if k.startswith(f"{kind}.")}
        relations[kind] = getattr(base, kind).with_values(own)
    return replace(base, **{k: v for k, v in numbers.items() if "." not in k}, **relations)


def points(base: AnyPoints, **changes: Any) -> Points:
    """`base` with the `changes`, arrays by name of a parameter; they must broadcast.

    Raises InvalidInput for an unknown name, a value outside its range, or shapes that clash.

    >>> points(Parameters(), D=[0.03, 0.4]).shape
    (2,)
    """
    if isinstance(base, Points) and not changes:
        return base
    relations = {
        kind: make(changes.pop(kind, getattr(base, kind))) for kind, (make, _) in RELATIONS.items()
    }
    values: dict[str, Any] = {f.name: np.asarray(getattr(base, f.name)) for f in _NUMBERS}
    found = Points(**values, **relations)
    if not changes:
        return found
    by_name = {f.name: f for f in _NUMBERS}
    refuse_unknown(changes, (*found.columns(), *RELATIONS), "parameter")
    checked = {name: _checked(name, by_name.get(name), value) for name, value in changes.items()}
    found = _with_numbers(found, checked)
    try:
        _ = found.shape
    except ValueError:
        columns = {n: np.shape(v) for n, v in found.columns().items()}
        shapes = ", ".join(f"{n}: {shape}" for n, shape in columns.items() if shape)
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
    elif not all_finite(result):
        raise InvalidInput(
            f"{name} exceeds double precision at these parameters; use units in which the "
            "parameters are nearer to 1"
        )


def _checked(name: str, f: Field[Any] | None, value: Any) -> Array:
    allowed = rule(f) if f else "a finite number"
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "iuf":
            raise TypeError
        array = array.astype(float)
    except (TypeError, ValueError):
        raise InvalidInput(f"{name} must be {allowed}, got {value!r}") from None
    bounds = f.metadata["bounds"] if f else {">": None, ">=": None, "<=": None}
    good = np.isfinite(array)
    if bounds[">"] is not None:
        good &= array > bounds[">"]
    if bounds[">="] is not None:
        good &= array >= bounds[">="]
    if bounds["<="] is not None:
        good &= array <= bounds["<="]
    if not np.all(good):
        raise InvalidInput(f"{name} must be {allowed}, got {array[~good].flat[0]:.6g}")
    return array

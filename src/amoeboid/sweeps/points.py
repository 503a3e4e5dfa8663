"""What a sweep varies: grids, lists and random points of parameters, as `am.grid` makes them.

The values of a name are a list, an array, or `{"linspace": [first, last, count]}` and
`{"logspace": [first, last, count]}`; of cells with physical units they are quantities. Names are
those of parameters, also of law and stress (`law.n`), and those of any other field of the
configuration of a run (`mesh.subdivisions`, `initial.perturbation`, `cue.strength`). What a
parameter cannot be is no mistake here: it is a point that fails, and says why.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from numbers import Integral
from typing import Any

import numpy as np

from amoeboid.assignments import SECTIONS
from amoeboid.config import Config, configured
from amoeboid.display import shown
from amoeboid.model.parameters import DIMENSIONS, RELATIONS, Parameters, refuse_no_parameters
from amoeboid.model.units import NO_DIMENSION
from amoeboid.studies.columns import number_of
from amoeboid.sweeps.evaluation import POINT
from amoeboid.validation import InvalidInput, refuse_unknown

MAX_POINTS = 10_000_000
SPACINGS = ("linspace", "logspace")
MAX_SHOWN = 6
ROUNDING = 1e-13
"""Numbers of cells that differ relatively by less are the same in other units."""

Base = Parameters | Config


@dataclass(frozen=True, eq=False, repr=False)
class Points:
    """Points of parameters: `base` with other values of some names.

    `columns`: the values of each name (points,), in the units of the base. `dims` and `shape`: the
    dimensions of the table, one for each name of a grid, else `point`. `cells` are given instead of
    a base where the points are a list of parameters. `seed`: of random points. `axes` are the
    values of each dimension of a grid, `spacings` how they are spaced, "linear" or "log".
    """

    base: Base
    columns: Mapping[str, tuple[Any, ...]]
    dims: tuple[str, ...]
    shape: tuple[int, ...]
    cells: tuple[Base, ...] = ()
    seed: int | None = None
    axes: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    spacings: Mapping[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return math.prod(self.shape)

    @property
    def names(self) -> tuple[str, ...]:
        """The names that vary."""
        return tuple(self.columns)

    @cached_property
    def parameters(self) -> Parameters:
        """The parameters of the base."""
        return parameters_of(self.base)

    def changes(self, k: int) -> dict[str, Any]:
        """What the point number k changes."""
        return {name: values[k] for name, values in self.columns.items()}

    def cell(self, k: int) -> Base:
        """The parameters, or the configuration, of point k. Raises InvalidInput."""
        return self.cells[k] if self.cells else changed(self.base, self.changes(k))

    def dimension(self, name: str) -> str | None:
        """The dimension of a name such as "L/T"; None where none is known."""
        return dimension_of(self.base, name)

    def __repr__(self) -> str:
        spans = [f"{name} {_span(self._axis(name))}" for name in self.names[:MAX_SHOWN]]
        more = [f"and {len(self.names) - MAX_SHOWN} more"] if len(self.names) > MAX_SHOWN else []
        size = " x ".join(map(str, self.shape)) if len(self.shape) > 1 else ""
        count = f"{len(self)} points{f' ({size})' if size else ''}"
        told = self.parameters.description
        told = told if len(told) <= 200 else f"{told[:196]} ..."
        return f"Points({', '.join([count, *spans, *more])}; base {told})"

    def _axis(self, name: str) -> tuple[Any, ...]:
        return tuple(self.axes.get(name, self.columns[name]))


def _span(values: Sequence[Any]) -> str:
    if not values:
        return "of no values"
    if all(isinstance(v, float) for v in values):
        return f"{min(values):.6g} to {max(values):.6g}"
    return f"of {len(set(map(str, values)))} values"


def parameters_of(base: Base) -> Parameters:
    """The parameters of a base."""
    return base.parameters if isinstance(base, Config) else base


def grid(base: Base | None = None, **vary: Any) -> Points:
    """All combinations of values: a table with one dimension for each name.

    `base` gives all that does not vary, the paper's table if left out; with a `Config`, or a field
    such as `mesh.subdivisions`, points are configurations of runs. For values see the head of
    `amoeboid.sweeps.points`. Raises InvalidInput.

    >>> import amoeboid as am
    >>> points = am.grid(am.Parameters(D=0.4), v_p0=[4, 5, 6], delta_P={"logspace": [10, 1000, 3]})
    >>> points.dims, points.shape, points.cell(8)
    (('v_p0', 'delta_P'), (3, 3), Parameters(delta_P=1000.0, D=0.4, v_p0=6.0))
    """
    start = _base(base, vary)
    axes = {name: axis(start, name, values) for name, values in vary.items()}
    for name, values in axes.items():
        if len(set(labels(start, name, values))) < len(values):
            raise InvalidInput(f"the values of {name} must differ in a grid, got {values!r:.200}")
    shape = tuple(len(values) for values in axes.values())
    _check_count(math.prod(shape))
    places = np.indices(shape).reshape(len(shape), -1)
    columns = {
        name: tuple(values[k] for k in place)
        for (name, values), place in zip(axes.items(), places.tolist(), strict=True)
    }
    spacings = {name: _spacing(values) for name, values in vary.items()}
    return Points(start, columns, tuple(axes), shape, axes=axes, spacings=spacings)


def labels(base: Base, name: str, values: Sequence[Any]) -> tuple[Any, ...]:
    """Values as a table has them: numbers, and texts of all others.

    A law is told by its name; where two have the same one, also by their own numbers.
    """
    if all(isinstance(value, float) for value in values):
        return tuple(values)
    if name not in RELATIONS:
        return tuple(map(str, values))
    told = [_relation(parameters_of(base), name, value) for value in values]
    names = [first for first, _ in told]
    if len(set(names)) == len(names):
        return tuple(names)
    return tuple(f"{first} ({own})" if own else first for first, own in told)


def _relation(p: Parameters, kind: str, value: Any) -> tuple[str, str]:
    """The name of a law or a stress, and its own numbers; what a point refuses is told as it is."""
    try:
        found = p.replace(**{kind: value}).as_dict()
    except InvalidInput:
        return str(value), ""
    own = {n.partition(".")[2]: v for n, v in found.items() if n.startswith(f"{kind}.")}
    return str(found[kind]), ", ".join(f"{n} = {shown(v)}" for n, v in own.items())


def paired(base: Base | None = None, **vary: Any) -> Points:
    """Points in a row: the first values together, then the second ones, and so on.

    `vary`: lists of values by parameter. Raises InvalidInput for lists of different length. For the
    rest see `grid`.

    >>> import amoeboid as am
    >>> am.paired(D=[0.03, 0.4], v_p0=[3.8, 6]).changes(1)
    {'D': 0.4, 'v_p0': 6.0}
    """
    start = _base(base, vary)
    columns = {name: axis(start, name, values) for name, values in vary.items()}
    counts = {name: len(values) for name, values in columns.items()}
    if len(set(counts.values())) > 1:
        told = ", ".join(f"{name}: {n}" for name, n in counts.items())
        raise InvalidInput(f"names that vary together must have equally many values, got {told}")
    count = next(iter(counts.values()))
    _check_count(count)
    return Points(start, columns, (POINT,), (count,))


def sobol(count: int, base: Base | None = None, *, seed: int = 0, **vary: Any) -> Points:
    """Random points that fill ranges evenly: the first `count` of a scrambled Sobol sequence.

    `vary`: ranges by parameter. A range is `(low, high)`, or `{"logspace": [low, high]}` for one
    that is even in the logarithm. The first points of a longer sequence with the same seed are the
    same. Raises InvalidInput.

    >>> import amoeboid as am
    >>> points = am.sobol(100, seed=1, D=(0.1, 0.6), v_p0=(4, 8))
    >>> len(points), 0.1 < points.cell(99).D < 0.6
    (100, True)
    """
    from scipy.stats import qmc

    checked_drawing(count, seed)
    start = _base(base, vary)
    ranges = {name: _range(start, name, given) for name, given in vary.items()}
    powers = math.ceil(math.log2(count)) if count > 1 else 0
    drawn = qmc.Sobol(len(ranges), scramble=True, rng=int(seed)).random_base2(powers)[:count]
    columns = {}
    for k, (name, (low, high)) in enumerate(ranges.items()):
        if _spacing(vary[name]) == "logspace":
            values = low * (high / low) ** drawn[:, k]
        else:
            values = low + (high - low) * drawn[:, k]
        columns[name] = tuple(values.tolist())
    return Points(start, columns, (POINT,), (int(count),), seed=int(seed))


def checked_drawing(count: Any, seed: Any) -> None:
    """Raise InvalidInput for a number of random points, or a seed, that cannot be."""
    if isinstance(count, bool) or not isinstance(count, Integral) or count < 1:
        raise InvalidInput(f"count must be a whole number >= 1, got {count!r:.100}")
    if isinstance(seed, bool) or not isinstance(seed, Integral) or seed < 0:
        raise InvalidInput(f"seed must be a whole number >= 0, got {seed!r:.100}")
    _check_count(int(count))


def listed(cells: Iterable[Any]) -> Points:
    """Points from a list of parameters, or of configurations. Raises InvalidInput."""
    if isinstance(cells, Base) or not isinstance(cells, Iterable):
        remedy = "; give [p] for a single one" if isinstance(cells, Base) else ""
        raise InvalidInput(
            "the points of a sweep must be what amoeboid.grid, paired, sobol or refine make, or a "
            f"list of parameters, got {cells!r:.100}{remedy}"
        )
    found = tuple(cells)
    if not found:
        raise InvalidInput("a sweep must have at least one point, got none")
    _check_count(len(found))
    for cell in found:
        if not isinstance(cell, Config):
            refuse_no_parameters(cell)
    all_parameters = [parameters_of(cell) for cell in found]
    if len({p.units is None for p in all_parameters}) > 1:
        raise InvalidInput(
            "either all points of a sweep or none must have physical units, got both; make all "
            "with Parameters.physical, or none"
        )
    columns: dict[str, tuple[Any, ...]] = {}
    dicts = [p.as_dict() for p in all_parameters]
    for name in dict.fromkeys(name for values in dicts for name in values):
        values = tuple(
            p.value_in(name, all_parameters[0].units) if name in p.names else own.get(name)
            for p, own in zip(all_parameters, dicts, strict=True)
        )
        if _differ(values):
            columns[name] = values
    if not columns:
        columns = {"number": tuple(float(k) for k in range(len(found)))}
    return Points(found[0], columns, (POINT,), (len(found),), cells=found)


def _differ(values: Sequence[Any]) -> bool:
    """Whether values are not all the same but for what conversion of units rounds."""
    if all(isinstance(v, float) for v in values):
        return max(values) - min(values) > ROUNDING * max(map(abs, values))
    return len(set(values)) > 1


def changed(base: Base, changes: Mapping[str, Any]) -> Base:
    """A base with other values of some names. Raises InvalidInput."""
    if isinstance(base, Parameters):
        return base.replace(**changes)
    sections: dict[str, dict[str, Any]] = {}
    for name, value in changes.items():
        section, key = _place(name)
        whole = section == "mesh" or key == "seed"
        integral = whole and isinstance(value, float) and value.is_integer()
        sections.setdefault(section, {})[key] = int(value) if integral else value
    return configured(base, sections)


def dimension_of(base: Base, name: str) -> str | None:
    """The dimension of a name such as "L/T"; None where none is known."""
    section, key = _place(name)
    if section == "parameters":
        p = parameters_of(base)
        return p.dimension(name) if name in p.names else None
    home = getattr(base, section, None)
    known = getattr(type(home), "__dataclass_fields__", {}).get(key)
    return None if known is None else known.metadata.get("unit")


def axis(base: Base, name: str, values: Any) -> tuple[Any, ...]:
    """The values of a name as numbers in the units of the base; texts where they are words.

    Raises InvalidInput.
    """
    if isinstance(values, Mapping):
        return _spaced(base, name, values)
    if isinstance(values, str) or not hasattr(values, "__len__"):
        raise InvalidInput(
            f"the values of {name} must be a list, or {{'linspace': [first, last, count]}}, got "
            f"{values!r:.100}; a single value belongs in the base"
        )
    found = tuple(_value(base, name, value) for value in values)
    if not found:
        raise InvalidInput(f"{name} must have at least one value, got none")
    if len({isinstance(value, float) for value in found}) > 1:
        raise InvalidInput(
            f"the values of {name} must all be numbers or all be texts, got {found!r:.200}"
        )
    return found


def _value(base: Base, name: str, given: Any) -> Any:
    section, _ = _place(name)
    if name in RELATIONS:
        return given
    if section != "parameters" and isinstance(given, tuple | list):
        return tuple(given)
    dimension = dimension_of(base, name)
    measured = parameters_of(base).units is not None and dimension not in NO_DIMENSION
    word = isinstance(given, str) and not measured
    if section != "parameters" and (word or isinstance(given, bool) or given is None):
        return given
    if isinstance(given, bool):
        raise InvalidInput(f"{name} must be a number, got {given!r}")
    return number_of(parameters_of(base), given, dimension, name)


def _spaced(base: Base, name: str, given: Mapping[str, Any]) -> tuple[float, ...]:
    kind = _spacing(given)
    entry = given[kind]
    whole = isinstance(entry, list | tuple) and len(entry) == 3
    count = entry[2] if whole else None
    if not isinstance(count, Integral) or isinstance(count, bool) or count < 2:
        raise InvalidInput(
            f"{kind} of {name} must be [first, last, count] with a whole count >= 2, got {entry!r}"
        )
    _check_count(int(count))
    first, last = _ends(base, name, kind, entry[:2])
    spaced = np.geomspace if kind == "logspace" else np.linspace
    return tuple(spaced(first, last, int(count)).tolist())


def _range(base: Base, name: str, given: Any) -> tuple[float, float]:
    kind = _spacing(given)
    entry = given[kind] if isinstance(given, Mapping) else given
    if not isinstance(entry, list | tuple) or len(entry) != 2:
        raise InvalidInput(f"the range of {name} must be (low, high), got {given!r}")
    return _ends(base, name, kind, entry)


def _ends(base: Base, name: str, kind: str, entry: Sequence[Any]) -> tuple[float, float]:
    first, last = (_value(base, name, value) for value in entry)
    if not (isinstance(first, float) and isinstance(last, float)) or first == last:
        raise InvalidInput(f"the ends of {name} must be two numbers that differ, got {entry!r}")
    if kind == "logspace" and not (first > 0 and last > 0):
        raise InvalidInput(f"the ends of a logspace of {name} must be > 0, got {entry!r}")
    return first, last


def _spacing(values: Any) -> str:
    """The kind of a range: linspace unless it says otherwise. Raises InvalidInput."""
    if not isinstance(values, Mapping):
        return "linspace"
    if len(values) != 1 or not values.keys() <= set(SPACINGS):
        raise InvalidInput(
            f"a range must be {{'linspace': [first, last, count]}} or the same with 'logspace', "
            f"got {dict(values)!r:.100}"
        )
    return str(next(iter(values)))


def _place(name: str) -> tuple[str, str]:
    """The section and the key of a name: ("parameters", "law.n"), ("mesh", "subdivisions")."""
    section, dot, key = name.partition(".")
    return (section, key) if dot and section not in RELATIONS else ("parameters", name)


def _base(base: Any, vary: Mapping[str, Any]) -> Base:
    """The base of points that vary these names. Raises InvalidInput."""
    start = Parameters() if base is None else base
    if not isinstance(start, Config):
        refuse_no_parameters(start)
    if not vary:
        raise InvalidInput("a sweep must vary something: give a name with values, as D=[0.1, 0.2]")
    for name in vary:
        section, key = _place(name)
        kind, dot, own = name.partition(".")
        if section == "parameters" and not dot:
            refuse_unknown([name], (*DIMENSIONS, *RELATIONS), "parameter")
        if section == "parameters" and dot and kind not in vary:
            getattr(parameters_of(start), kind).refuse_unknown_own({own: 0.0})
        if section != "parameters":
            refuse_unknown([section], SECTIONS, "section")
            refuse_unknown([key], SECTIONS[section], "field", f"in [{section}]")
            start = start if isinstance(start, Config) else Config(parameters=start)
    return start


def _check_count(count: int) -> None:
    if not 1 <= count <= MAX_POINTS:
        raise InvalidInput(f"a sweep must have 1 to {MAX_POINTS} points, got {count}")

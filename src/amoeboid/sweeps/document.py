"""The file of `amoeboid sweep`: SWEEP.toml, read and never executed.

Tables: [base] parameters that stay, [vary] those that vary, [sobol] or [refine] how, [solver] what
is computed, [record] what is kept of it; `physical = true` for quantities with units. See
docs/sweeps.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from amoeboid.assignments import SECTIONS
from amoeboid.axisymmetric.lanes import jax
from amoeboid.axisymmetric.system import MODES
from amoeboid.config import Config, anchored, configured
from amoeboid.model.parameters import RELATIONS, Parameters
from amoeboid.motility.words import environment
from amoeboid.runs.branches import branch
from amoeboid.runs.meshes import Icosphere
from amoeboid.runs.solution import simulate
from amoeboid.studies.branch import MAX_POINTS, MAX_STEP, checked_options, checked_window
from amoeboid.studies.many import MANY_MODES, checked_lengths, many_steady_states
from amoeboid.studies.migration import Migration, migrate
from amoeboid.studies.states import steady_states
from amoeboid.studies.theory import theory
from amoeboid.sweeps.points import Base, Points, checked_drawing, grid, paired, sobol
from amoeboid.sweeps.refinement import Refinement, refine
from amoeboid.validation import InvalidInput, refuse_unknown, toml_document

TABLES = ("base", "vary", "sobol", "refine", "solver", "record")


@dataclass(frozen=True)
class SweepDocument:
    """What a SWEEP.toml asks for."""

    points: Points | Refinement
    solver: Callable[..., Any]
    record: tuple[str, ...] | None


def sweep_document(text: str, name: str, folder: Path) -> SweepDocument:
    """A SWEEP.toml, in `folder`, from its text. Raises InvalidInput, naming table and key."""
    tables = toml_document(text, name)
    refuse_unknown(tables, (*TABLES, "physical"), "table", "of a sweep")
    for table in ("base", "sobol", "refine", "solver", "record"):
        if not isinstance(tables.get(table, {}), Mapping):
            raise InvalidInput(f"[{table}] must be a table, got {tables[table]!r:.100}")
    if "solver" not in tables:
        raise InvalidInput(
            f"a sweep needs a table [solver] with a name ({', '.join(SOLVERS)}), got none"
        )
    given = dict(tables["solver"])
    kind = _text(given.pop("name", None), "[solver] name", SOLVERS)
    base = _in_table("base", _base, tables.get("base", {}), tables.get("physical", False))
    make = SOLVERS[kind]
    solver, start = _in_table("solver", make, base, given, folder)
    points = _points(tables, start)
    grid = points.grid if isinstance(points, Refinement) else points
    if isinstance(grid.base, Config) and not isinstance(start, Config):
        fields = ", ".join(name for name in grid.names if name not in start.names)
        raise InvalidInput(
            f"[vary]: fields of a run must be varied with [solver] name = 'simulate', {fields} "
            f"with {kind!r}; leave them out, or choose that solver"
        )
    return SweepDocument(points, solver, _record(tables.get("record", {})))


def _in_table(table: str, function: Callable[..., Any], *arguments: Any) -> Any:
    """`function(*arguments)`; the message of what it refuses names the table."""
    try:
        return function(*arguments)
    except InvalidInput as problem:
        told = str(problem)
        raise InvalidInput(told if told.startswith("[") else f"[{table}]: {told}") from None


def _text(value: Any, label: str, allowed: Mapping[str, Any]) -> str:
    if not isinstance(value, str) or value not in allowed:
        raise InvalidInput(f"{label} must be one of {', '.join(allowed)}, got {value!r:.100}")
    return value


def _base(given: Mapping[str, Any], physical: Any) -> Parameters:
    if not isinstance(physical, bool):
        raise InvalidInput(f"physical must be true or false, got {physical!r:.100}")
    values = _flat(given)
    return Parameters.physical(**values) if physical else Parameters().replace(**values)


def _flat(given: Mapping[str, Any]) -> dict[str, Any]:
    """Names with dots of a table: TOML reads `law.n = 3` as a table in a table."""
    flat: dict[str, Any] = {}
    for name, value in given.items():
        nested = isinstance(value, Mapping) and (name in RELATIONS or name in SECTIONS)
        flat |= {f"{name}.{k}": v for k, v in value.items()} if nested else {name: value}
    return flat


def _points(tables: Mapping[str, Any], base: Base) -> Points | Refinement:
    if "vary" not in tables:
        raise InvalidInput("a sweep needs a table [vary] with names and values, got none")
    vary = tables["vary"]
    if "sobol" in tables and "refine" in tables:
        raise InvalidInput("a sweep must have [sobol] or [refine], not both; leave one out")
    if isinstance(vary, list):
        if "sobol" in tables or "refine" in tables:
            raise InvalidInput("[[vary]] lists the points; leave out [sobol] and [refine]")
        return _in_table("vary", _pairs, vary, base)
    if not isinstance(vary, Mapping):
        raise InvalidInput(f"[vary] must be a table of names and values, got {vary!r:.100}")
    names = _flat(vary)
    if "sobol" in tables:
        given = _known("sobol", tables["sobol"], ("count", "seed"), ("count",))
        count, seed = given["count"], given.get("seed", 0)
        _in_table("sobol", checked_drawing, count, seed)
        return _in_table("vary", partial(sobol, count, base, **names, seed=seed))
    found = _in_table("vary", partial(grid, base, **names))
    if "refine" not in tables:
        return found
    given = _known("refine", tables["refine"], ("label", "depth"), ("label",))
    return _in_table("refine", partial(refine, found, **given))


def _known(
    table: str, given: Mapping[str, Any], names: Sequence[str], needed: Sequence[str]
) -> dict[str, Any]:
    refuse_unknown(given, names, "key", f"in [{table}]")
    for name in needed:
        if name not in given:
            raise InvalidInput(f"[{table}] needs {name}, got {', '.join(given) or 'none'}")
    return dict(given)


def _pairs(tables: Sequence[Any], base: Base) -> Points:
    rows = [_flat(row) if isinstance(row, Mapping) else {} for row in tables]
    if not rows or not rows[0]:
        raise InvalidInput(f"[[vary]] must be tables of names and values, got {tables!r:.100}")
    names = list(rows[0])
    for number, row in enumerate(rows, 1):
        if not row or set(row) != set(names):
            raise InvalidInput(
                f"[[vary]] must have the same names each time, {', '.join(names)}; number {number} "
                f"has {', '.join(row) or 'none'}"
            )
    return paired(base, **{name: [row[name] for row in rows] for name in names})


def _record(given: Mapping[str, Any]) -> tuple[str, ...] | None:
    refuse_unknown(given, ("names",), "key", "in [record]")
    names = given.get("names")
    if names is None:
        return None
    if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
        raise InvalidInput(f"[record] names must be a list of names, got {names!r:.100}")
    return tuple(names)


Made = tuple[Callable[..., Any], Base]
"""A solver with its arguments, and the base that it starts from."""


def _theory(base: Parameters, given: Mapping[str, Any], _: Path) -> Made:
    refuse_unknown(given, ("name",), "key", "in [solver] theory")
    return theory, base


def _steady(base: Parameters, given: Mapping[str, Any], _: Path) -> Made:
    refuse_unknown(given, ("name", "degrees", "many", "max_modes"), "key", "in [solver] steady")
    many = given.get("many", False)
    if not isinstance(many, bool):
        raise InvalidInput(f"[solver] many must be true or false, got {many!r:.100}")
    wrong = "degrees" if many else "max_modes"
    if wrong in given:
        word = "false" if many else "true"
        raise InvalidInput(f"[solver] {wrong} needs many = {word}; leave one of them out")
    if many:
        jax()
        max_modes = given.get("max_modes", MANY_MODES)
        checked_lengths(MODES, max_modes)
        return partial(many_steady_states, max_modes=max_modes), base
    degrees = given.get("degrees", [1, 2, 3])
    whole = isinstance(degrees, list) and degrees and all(type(n) is int and n > 0 for n in degrees)
    if not whole:
        raise InvalidInput(
            f"[solver] degrees must be whole numbers >= 1 in a list, got {degrees!r:.100}"
        )
    return partial(steady_states, degrees=tuple(degrees)), base


def _branch(base: Parameters, given: Mapping[str, Any], _: Path) -> Made:
    names = ("name", "vary", "from", "to", "mesh", "max_step", "max_points")
    refuse_unknown(given, names, "key", "in [solver] branch")
    name, start, end = given.get("vary", "v_p0"), given.get("from"), given.get("to")
    checked_window(base, name, start, end, ("[solver] vary", "[solver] from", "[solver] to"))
    options: dict[str, Any] = {k: given[k] for k in ("max_step", "max_points") if k in given}
    checked_options(given.get("max_step", MAX_STEP), given.get("max_points", MAX_POINTS))
    if "mesh" in given:
        options["mesh"] = Icosphere(given["mesh"])
    return partial(branch, name=name, start=start, end=end, **options), base


def _simulate(base: Parameters, given: Mapping[str, Any], folder: Path) -> Made:
    sections = [name for name in SECTIONS if name != "parameters"]
    refuse_unknown(given, ("name", *sections), "key", "in [solver] simulate")
    config = configured(Config(parameters=base), given, plain=base.units is None)
    return simulate, anchored(config, folder)


def _motility(base: Parameters, given: Mapping[str, Any], _: Path) -> Made:
    refuse_unknown(given, ("name", "in"), "key", "in [solver] motility")
    word = given.get("in", "fluid")
    if not isinstance(word, str):
        raise InvalidInput(f"[solver] in must be an environment such as 'fluid', got {word!r:.100}")
    environment(word)
    return partial(migration, word=word), base


def migration(p: Parameters, word: str) -> Migration:
    """Where the fastest stable axisymmetric state goes in an environment. Raises InvalidInput."""
    return migrate(steady_states(p, (1,)).fastest_stable, word)


SOLVERS: dict[str, Callable[[Parameters, Mapping[str, Any], Path], Made]] = {
    "theory": _theory,
    "steady": _steady,
    "branch": _branch,
    "simulate": _simulate,
    "motility": _motility,
}
"""What [solver] may name: what makes a solver, and its base, of the other keys."""

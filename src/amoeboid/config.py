"""The configuration of a run: every field that CONFIG.toml and `--set` can change."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path, PurePath
from typing import Any

from amoeboid.assignments import MEDIUM, SECTIONS, assignments
from amoeboid.conditions import check_condition
from amoeboid.display import short_repr
from amoeboid.model.changes import Changes
from amoeboid.model.cues import Cue, written_cue
from amoeboid.model.inputs import Inputs, inputs_of
from amoeboid.model.parameters import (
    DIMENSIONS,
    RELATIONS,
    Parameters,
    refuse_unwritable_relations,
)
from amoeboid.model.units import Units
from amoeboid.motility.environments import CortexDrag, Environment
from amoeboid.motility.words import environment, written
from amoeboid.quantities import in_numbers
from amoeboid.sections import Initial, Mesh, Noise, Output, Time, checked_noise
from amoeboid.toml import toml_text
from amoeboid.validation import InvalidInput, refuse_unknown, toml_document

# The step of the explicit scheme in the paper, in units of 1/rate.
EXPLICIT_STEP = 1e-5
# Shortest steps that are made, in units of 1/rate. In explicit ones what they put right of the
# rounding of the area is divided by the step and drives a flow.
SHORTEST_STEP = 1e-7
SHORTEST_EXPLICIT_STEP = 1e-10
# The step of a run with shot noise, in units of 1/rate.
NOISY_STEP = 0.05
# Initial polarization of figure 3D and of the upper branch of figure 3B of the paper, in units of
# c0; the front is empty then. Laws that are not defined there start from less.
POLARIZATION, POLARIZATION_WITHOUT_EMPTY_FRONT = 1.0, 0.2
# Fields of [initial] that name a file.
FILES = ("surface", "from_frame")


def figure_3d() -> Parameters:
    """The parameter point of figure 3D of the paper, the default run."""
    return Parameters(D=0.4, v_p0=6.0)


@dataclass(frozen=True, kw_only=True)
class Config:
    """Everything that determines a run; the defaults are figure 3D of the paper.

    `changes`: of parameters in time, by name. `cue`: a `Cue`, or any object with its `factor`.
    `environment`: an `Environment`, or its text, such as "patch:30"; its path is recorded. The
    other sections are classes of their own.
    """

    __repr__ = short_repr

    parameters: Parameters = field(default_factory=figure_3d)
    mesh: Mesh = field(default_factory=Mesh)
    initial: Initial = field(default_factory=Initial)
    time: Time = field(default_factory=Time)
    output: Output = field(default_factory=Output)
    noise: Noise = field(default_factory=Noise)
    changes: Changes = field(default_factory=Changes)  # or a mapping of names to what makes one
    cue: Any = field(default_factory=Cue)  # a Cue, or any object with its `factor`
    environment: Any = field(default_factory=CortexDrag)  # an Environment, or its text

    def __post_init__(self) -> None:
        if not isinstance(self.changes, Changes):
            object.__setattr__(self, "changes", Changes(self.changes))
        if isinstance(self.environment, str):
            object.__setattr__(self, "environment", environment(self.environment))
        if not isinstance(self.environment, Environment):
            raise InvalidInput(
                "environment must be an environment such as amoeboid.Fluid() or a text such as "
                f"'patch:30', got {self.environment!r}"
            )
        for text in self.time.until:
            check_condition(text, self.parameters)
        checked_noise(self.noise)
        if self.cue is None:
            object.__setattr__(self, "cue", Cue())

    @property
    def inputs(self) -> Inputs | None:
        """Parameters that change, and the cue; None if nothing does. Raises InvalidInput."""
        return inputs_of(self.parameters, self.changes, self.cue)

    def section(self, name: str) -> dict[str, Any]:
        """What the section `name` holds, as a TOML file or JSON does; None is left open.

        Raises InvalidInput for what no file can hold.
        """
        values = getattr(self, name)
        if name == "parameters":
            refuse_unwritable_relations(values)
            return values.as_dict()
        if name == "changes":
            return values.written()
        if name == "environment":
            return {MEDIUM: written(values)}
        return written_cue(values) if name == "cue" else asdict(values)


def resolved(config: Config) -> Config:
    """`config` with every automatic value in its place; rate is that of the parameters as given.

    Where parameters change, the default end is that long after the last of the known changes.
    Raises InvalidInput for times that are shorter than the shortest step, and for inputs out of
    range.
    """
    initial, time, output = config.initial, config.time, config.output
    if initial.perturbation is None:
        amplitude = polarization(config.parameters) if initial.from_frame is None else 0.0
        initial = replace(initial, perturbation=amplitude)
    inputs, unit = config.inputs, 1.0 / config.parameters.rate
    changed = max((0.0, *inputs.breaks)) if inputs is not None else 0.0
    longest = EXPLICIT_STEP if time.scheme == "explicit" else 0.5
    if config.noise.acts:
        _check_noise(config)
        longest = NOISY_STEP
    time = replace(
        time,
        end=changed + 200 * unit if time.end is None else time.end,
        max_step=longest * unit if time.max_step is None else time.max_step,
    )
    interval = 0.5 * unit if output.interval is None else output.interval
    config = replace(config, initial=initial, time=time, output=replace(output, interval=interval))
    _check_times(config)
    return config


def _check_noise(config: Config) -> None:
    """Raise InvalidInput for what shot noise does not go with."""
    if config.time.scheme == "explicit":
        raise InvalidInput(
            'time.scheme must be "semi-implicit" with shot noise (noise.filaments > 0), got '
            '"explicit"; omit it'
        )
    if config.time.finish == "solve":
        raise InvalidInput(
            'time.finish must be "wait" with shot noise (noise.filaments > 0), because the '
            'cell never becomes steady, got "solve"; omit it'
        )
    if not config.parameters.c0 > 0.0:
        raise InvalidInput(
            "c0 must be > 0 with shot noise, because noise.filaments is the filament number of "
            f"the homogeneous cell, got {config.parameters.c0:g}; raise it"
        )


def polarization(p: Parameters) -> float:
    """Amplitude of the initial polarization of a run that is given none [N/L^2]."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            defined = math.isfinite(float(p.v_p(0.0)))
        except Exception:  # a user's law may raise anything where it is not defined
            defined = False
    return (POLARIZATION if defined else POLARIZATION_WITHOUT_EMPTY_FRONT) * p.c0


def shortest_step(config: Config) -> float:
    """The shortest step that the scheme of `config` makes [T]."""
    explicit = config.time.scheme == "explicit"
    return (SHORTEST_EXPLICIT_STEP if explicit else SHORTEST_STEP) / config.parameters.rate


def _check_times(config: Config) -> None:
    shortest, p = shortest_step(config), config.parameters
    times = {f"time.{name}": getattr(config.time, name) for name in ("end", "max_step")}
    for name, value in (times | {"output.interval": config.output.interval}).items():
        if not value > shortest:
            raise InvalidInput(
                f"{name} must be > {p.quantity(shortest, 'T'):g}, the shortest "
                f"{config.time.scheme} step, got {p.quantity(value, 'T'):g}; raise it "
                "or leave it out"
            )


def anchored(config: Config, folder: Path) -> Config:
    """`config`, read from a file in `folder`, with the paths it names led from there.

    Raises InvalidInput for a path that leaves the folder, through a symbolic link too.
    """
    named = {f: path for f in FILES if (path := getattr(config.initial, f)) is not None}
    places: dict[str, Any] = {
        f: str(_inside(f"initial.{f}", folder, path)) for f, path in named.items()
    }
    return replace(config, initial=replace(config.initial, **places))


def _inside(name: str, folder: Path, path: str) -> Path:
    try:
        is_inside = not PurePath(path).anchor and (folder / path).resolve().is_relative_to(
            folder.resolve()
        )
    except (OSError, RuntimeError) as error:  # a loop of symbolic links
        raise InvalidInput(f"{name} must be the path of a file, got {path!r}: {error}") from None
    if not is_inside:
        raise InvalidInput(
            f"{name} in a configuration file must be a file in the folder of that configuration "
            f"or below it, got {path!r}; copy the file there, or give its path with --set "
            f"{name}=PATH"
        )
    return folder / path


def configured(
    base: Config, changes: Mapping[str, Mapping[str, Any]], plain: bool = True
) -> Config:
    """`base` with {section: {name: value}} changed; unknown sections and names are refused.

    For a cell with units values may be quantities such as "15 min". Numbers without a unit are in
    the units of the cell if `plain`, and refused otherwise. Raises InvalidInput.
    """
    sections: dict[str, Any] = {}
    p = base.parameters
    # the parameters first: their units are those of the rest
    for section in sorted(changes, key=lambda name: name != "parameters"):
        values = changes[section]
        refuse_unknown([section], SECTIONS, "section")
        if not isinstance(values, Mapping):
            raise InvalidInput(f"[{section}] must be a section of names and values, got {values!r}")
        if section not in ("parameters", "changes"):  # which know their names themselves
            refuse_unknown(values, SECTIONS[section], "field", f"in [{section}]")
        if section == "environment":
            sections[section] = _medium(values.get(MEDIUM), p, plain)
            continue
        numbers = in_numbers(section, values, p, plain)
        sections[section] = _changed(getattr(base, section), section, numbers)
        p = sections.get("parameters", p)
    return replace(base, **sections)


def _changed(before: Any, section: str, values: Mapping[str, Any]) -> Any:
    if isinstance(before, Changes):
        return Changes({**before, **values})
    if isinstance(before, Parameters):
        return before.replace(**values)
    if section == "cue" and not isinstance(before, Cue):
        raise InvalidInput(
            f"[cue] changes the fields of a Cue, got {type(before).__name__}; leave it out"
        )
    return replace(before, **values)


def _medium(text: Any, p: Parameters, plain: bool) -> Environment:
    if not isinstance(text, str):
        raise InvalidInput(
            f"environment.{MEDIUM} must be a text such as 'fluid' or 'patch:30', got {text!r}"
        )
    found = environment(text)
    # refuses quantities for a cell without units, and numbers for one with units unless `plain`
    _ = found.settled(p.units) if plain else found.of(p.units)
    return found


def config_of(
    document: Mapping[str, Any],
    settings: Iterable[str] = (),
    physical: bool = False,
    folder: Path | None = None,
) -> Config:
    """The configuration of the tables of a file, changed by `settings`.

    With `physical`, or `physical = true` in the file, values have units, and what is left out is
    as in the paper's cell. A table [units] tells the size of the units of plain numbers, in SI; a
    run writes it. `folder`: that of the file, from which the paths in it lead. For `settings` see
    `with_settings`. Raises InvalidInput.
    """
    given, changes = dict(document), assignments(settings)
    physical = _is_physical(given.pop("physical", physical), physical)
    units = _units(given.pop("units", None), physical)
    if physical:
        own = _together(given.pop("parameters", {}), changes.pop("parameters", {}))
        base = Config(parameters=Parameters.physical(**own))
    else:
        base = Config(parameters=replace(figure_3d(), units=units))
    config = configured(base, given, plain=not physical)
    if folder is not None:
        config = anchored(config, folder)
    return configured(config, changes, plain=base.parameters.units is None)


def _is_physical(stated: Any, asked: bool) -> bool:
    """Whether values have units, by the file and by the command. Raises InvalidInput."""
    if not isinstance(stated, bool):
        raise InvalidInput(f"physical must be true or false, got {stated!r:.100}")
    if asked and not stated:
        raise InvalidInput(
            "--physical and `physical = false` in the file contradict each other; leave one out"
        )
    return stated


def _units(given: Any, physical: bool) -> Units | None:
    """The sizes of the units of plain numbers that a file states. Raises InvalidInput."""
    if given is None:
        return None
    names = tuple(f.name for f in fields(Units))
    known = isinstance(given, Mapping) and set(given) == set(names)
    if not known or not all(isinstance(x, float) and 0 < x < math.inf for x in given.values()):
        raise InvalidInput(
            f"[units] must have {', '.join(names)}, each a number > 0 with a point, got "
            f"{given!r:.200}; a run writes this table, for your own values use physical = true"
        )
    if physical:
        raise InvalidInput(
            "a file must have either [units], for plain numbers, or physical = true, got both; "
            "leave one out"
        )
    units = Units(**given)
    for dimension in DIMENSIONS.values():
        units.of(dimension)  # refuses sizes beyond double precision
    return units


def _together(file: Any, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters of a file and of settings; a law or stress that is set replaces the file's."""
    if not isinstance(file, Mapping):
        raise InvalidInput(f"[parameters] must be a section of names and values, got {file!r}")
    replaced = tuple(f"{kind}." for kind in RELATIONS if kind in settings)
    kept = {k: v for k, v in file.items() if not (replaced and k.startswith(replaced))}
    return {**kept, **settings}


def with_settings(base: Config, settings: Iterable[str]) -> Config:
    """`base` changed by texts `name=value` (a parameter) or `section.key=value`.

    `law.n=3` and `stress.k=0.3` are parameters of law and stress, in any order. Values are
    written as in TOML; a bare word is a string. For a cell with units they have units. Raises
    InvalidInput.
    """
    return configured(base, assignments(settings), plain=base.parameters.units is None)


def config_to_toml(config: Config) -> str:
    """The configuration as TOML text; `config_from_toml` reads it back equal.

    Raises InvalidInput for a law, a stress, a change and a cue that a text cannot hold.
    """
    document: dict[str, Any] = {
        section: {k: v for k, v in config.section(section).items() if v is not None}
        for section in SECTIONS
    }
    units = config.parameters.units
    return toml_text(({} if units is None else {"units": asdict(units)}) | document)


def config_from_toml(text: str, name: str = "the configuration") -> Config:
    """A configuration from TOML text; what it leaves out keeps the default run's value.

    With `physical = true` at its head values have units, such as R0 = "8 um" and end = "15 min",
    and what it leaves out is as in the paper's cell. Raises InvalidInput; if the text is not TOML
    at all, under `name`.
    """
    return config_of(toml_document(text, name))

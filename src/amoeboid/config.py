"""The configuration of a run: every field that CONFIG.toml and `--set` can change."""

from __future__ import annotations

import math
import re
import tomllib
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path, PurePath
from typing import Any

from amoeboid.conditions import refuse_unknown_parameters
from amoeboid.display import short_repr
from amoeboid.model.changes import CHANGEABLE, Changes
from amoeboid.model.cues import Cue, written_cue
from amoeboid.model.inputs import Inputs, inputs_of
from amoeboid.model.parameters import (
    PARAMETER_NAMES,
    RELATIONS,
    Parameters,
    refuse_unwritable_relations,
)
from amoeboid.motility.environments import CortexDrag, Environment
from amoeboid.motility.words import environment, written
from amoeboid.sections import Initial, Mesh, Noise, Output, Time, checked_noise
from amoeboid.toml import toml_text
from amoeboid.validation import InvalidInput, refuse_unknown, toml_document

POINT_AT_AN_END = re.compile(r"[+-]?(?:\d+\.|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
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
# The field of [environment]: the text of one, such as "patch:30".
MEDIUM = "medium"
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
            refuse_unknown_parameters(text, self.parameters)
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


SECTIONS: dict[str, tuple[str, ...]] = {
    "parameters": PARAMETER_NAMES,
    **{
        section.__name__.lower(): tuple(f.name for f in fields(section))
        for section in (Mesh, Initial, Time, Output, Noise)
    },
    "changes": CHANGEABLE,
    "cue": tuple(f.name for f in fields(Cue)),
    "environment": (MEDIUM,),
}


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
    shortest = shortest_step(config)
    times = {f"time.{name}": getattr(config.time, name) for name in ("end", "max_step")}
    for name, value in (times | {"output.interval": config.output.interval}).items():
        if not value > shortest:
            raise InvalidInput(
                f"{name} must be > {shortest:g}, the shortest {config.time.scheme} step, got "
                f"{value:g}; raise it or leave it out"
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


def configured(base: Config, changes: Mapping[str, Mapping[str, Any]]) -> Config:
    """`base` with {section: {name: value}} changed; unknown sections and names are refused."""
    sections: dict[str, Any] = {}
    for section, values in changes.items():
        refuse_unknown([section], SECTIONS, "section")
        if not isinstance(values, Mapping):
            raise InvalidInput(f"[{section}] must be a section of names and values, got {values!r}")
        if section not in ("parameters", "changes"):  # which know their names themselves
            refuse_unknown(values, SECTIONS[section], "field", f"in [{section}]")
        sections[section] = _changed(getattr(base, section), section, values)
    return replace(base, **sections)


def _changed(before: Any, section: str, values: Mapping[str, Any]) -> Any:
    if isinstance(before, Changes):
        return Changes({**before, **values})
    if isinstance(before, Parameters):
        return before.replace(**values)
    if section == "environment":
        return _medium(values.get(MEDIUM))
    if section == "cue" and not isinstance(before, Cue):
        raise InvalidInput(
            f"[cue] changes the fields of a Cue, got {type(before).__name__}; leave it out"
        )
    return replace(before, **values)


def _medium(text: Any) -> Environment:
    if not isinstance(text, str):
        raise InvalidInput(
            f"environment.{MEDIUM} must be a text such as 'fluid' or 'patch:30', got {text!r}"
        )
    found = environment(text)
    found.settled(None)  # refuses quantities, which a configuration has no units for
    return found


def with_settings(base: Config, settings: Iterable[str]) -> Config:
    """`base` changed by texts `name=value` (a parameter) or `section.key=value`.

    `law.n=3` and `stress.k=0.3` are parameters of law and stress, in any order. Values are
    written as in TOML; a bare word is a string. Raises InvalidInput.
    """
    changes: dict[str, dict[str, Any]] = {}
    for setting in settings:
        path, equals, text = setting.partition("=")
        path = path.strip()
        if not equals or not path or not text.strip():
            raise InvalidInput(f"--set takes name=value or section.key=value, got {setting!r}")
        section, dot, name = path.partition(".")
        if dot and not (section and name):
            raise InvalidInput(f"--set takes name=value or section.key=value, got {setting!r}")
        if section in RELATIONS:
            section, name = "parameters", path
        elif not dot:
            section, name = "parameters", path
            refuse_unknown([name], (*PARAMETER_NAMES, *_dotted_names()), "parameter or field")
        value = text.strip() if name in RELATIONS else _value(text.strip())
        changes.setdefault(section, {})[name] = value
    return configured(base, changes)


def _value(text: str) -> Any:
    try:
        document = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        # .5 and 5. are numbers too, though not in TOML
        return float(text) if POINT_AT_AN_END.fullmatch(text) else text
    return document["value"] if document.keys() == {"value"} else text


def _dotted_names() -> list[str]:
    return [f"{s}.{n}" for s, names in SECTIONS.items() if s != "parameters" for n in names]


def config_to_toml(config: Config) -> str:
    """The configuration as TOML text; `config_from_toml` reads it back equal.

    Raises InvalidInput for a law, a stress, a change and a cue that a text cannot hold.
    """
    document = {
        section: {k: v for k, v in config.section(section).items() if v is not None}
        for section in SECTIONS
    }
    return toml_text(document)


def config_from_toml(text: str, name: str = "the configuration") -> Config:
    """A configuration from TOML text; what it leaves out keeps the default run's value.

    Raises InvalidInput; if the text is not TOML at all, under `name`.
    """
    return configured(Config(), toml_document(text, name))

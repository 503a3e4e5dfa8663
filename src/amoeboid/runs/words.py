"""How a run ended, in words: for the command that makes it and those that look at it later."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from amoeboid.config import Config
from amoeboid.model.parameters import Parameters
from amoeboid.motility.environments import Environment
from amoeboid.motility.words import FIRST_FIELD
from amoeboid.simulation.step import Step
from amoeboid.simulation.timeseries import environment_of
from amoeboid.studies.columns import text, unit

ASSUMED = "all drag on the cortex, uniformly"


def environment(config: Config) -> str:
    """In what a run records its path, such as "patch, half_angle 30"; empty if in nothing.

    A viscosity or friction is left out where nothing else resists: the path does not depend on it.
    """
    found = environment_of(config)
    if found is None:
        return ""
    alone = len(found.parts) == 1
    return " + ".join(_resisting(part, config.parameters, alone) for part in found.parts)


def _resisting(part: Environment, p: Parameters, alone: bool) -> str:
    dimensions = {f.name: f.metadata.get("dimension") for f in fields(part)}
    scale_alone = alone and sum(d is not None for d in dimensions.values()) == 1
    words = [part.name or type(part).__name__]
    for f in fields(part):
        value, dimension = getattr(part, f.name), dimensions[f.name]
        usual = value == f.default and f.name != FIRST_FIELD.get(part.name)
        if value is None or usual or (dimension and scale_alone):
            continue
        words.append(f"{f.name} {_said(p, value, dimension)}")
    return ", ".join(words)


def _said(p: Parameters, value: Any, dimension: str | None) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return f"({', '.join(f'{x:.4g}' for x in value)})"
    return text(p, value, dimension, ".4g") if isinstance(value, int | float) else str(value)


def number(value: float, digits: int) -> str:
    """A number with `digits` significant digits; zero without a sign."""
    return f"{value + 0.0:.{digits}g}"


def stability(last: Step, per_time: str = "per unit time", size: float = 1.0) -> str:
    """Whether the state is steady, and what becomes of small perturbations of it.

    `size`: a rate of 1 [1/T] in the unit that `per_time` names.
    """
    if last.rest is None:
        return "the state is not steady: it still changes, or still grows from rest"
    if last.stability == "unknown":
        return f"the state is steady, but its stability is unknown: {last.stability_problem}"
    growth, error = (size * (x or 0.0) for x in (last.growth, last.growth_error))
    rate = f"{number(abs(growth), 3)} +- {number(error, 1)} {per_time}"
    if last.stability == "stable":
        return f"the state is steady and stable: its slowest perturbation decays at {rate}"
    if last.steady:
        return f"the state is steady but unstable: a perturbation grows slowly, at {rate}"
    return f"the state is unstable: its fastest perturbation grows at {rate}"


def per_time(p: Parameters) -> str:
    """The unit of a rate in words."""
    return "per unit time" if p.units is None else unit(p, "1/T")


def change(summary: dict[str, Any], per_time: str = "per unit time") -> str:
    """How fast a cell that is not steady changes, from the summary of its run."""
    changes = number(summary["rate_of_change"], 3)
    text = f"shape or concentration changes at a relative rate of {changes}"
    growth = summary["speed_growth"]
    if growth is not None:
        word = "grows" if growth > 0 else "falls"
        text += f", max_retrograde_speed {word} at {number(abs(growth), 3)}"
    return f"{text} {per_time}"

"""How a run ended, in words: for the command that makes it and those that look at it later."""

from __future__ import annotations

from typing import Any

from amoeboid.simulation.step import Step


def number(value: float, digits: int) -> str:
    """A number with `digits` significant digits; zero without a sign."""
    return f"{value + 0.0:.{digits}g}"


def stability(last: Step, per_time: str = "per unit time", size: float = 1.0) -> str:
    """Whether the state is steady, and what becomes of small perturbations of it.

    `size`: a rate of 1 [1/T] in the unit that `per_time` names.
    """
    if last.rest is None:
        return "the state is not steady: it still changes, or grows slowly from rest"
    if last.stability == "unknown":
        return f"the state is steady, but its stability is unknown: {last.stability_problem}"
    growth, error = (size * (x or 0.0) for x in (last.growth, last.growth_error))
    rate = f"{number(abs(growth), 3)} +- {number(error, 1)} {per_time}"
    if last.stability == "stable":
        return f"the state is steady and stable: its slowest perturbation decays at {rate}"
    if last.steady:
        return f"the state is steady but unstable: a perturbation grows, slowly, at {rate}"
    return f"the state is unstable: its fastest perturbation grows at {rate}"


def change(summary: dict[str, Any]) -> str:
    """How fast a cell that is not steady changes, from the summary of its run."""
    changes = number(summary["rate_of_change"], 3)
    text = f"shape or concentration changes at a relative rate of {changes}"
    growth = summary["speed_growth"]
    if growth is not None:
        word = "grows" if growth > 0 else "falls"
        text += f", max_retrograde_speed {word} at {number(abs(growth), 3)}"
    return f"{text} per unit time"

"""What sweeps record of results: numbers by name, with units, titles and dimensions.

A result takes part in sweeps by a method `recorded`, which gives a mapping of names to `Recorded`;
`complete` and `problems` of it are recorded besides, if it has them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from amoeboid.model.parameters import MEANINGS, Parameters
from amoeboid.observables import OBSERVABLES
from amoeboid.studies.columns import Column, column


@dataclass(frozen=True, eq=False)
class Recorded:
    """What is recorded of one answer under one name: a number, a text, or an array of them.

    `values` are in the unit `unit`; None where there is no such number. `dims` names the dimensions
    of an array, `labels` the labels along those that have some; `title` says what it is. What is
    not of `default` is recorded only where it is asked for.
    """

    values: Any
    unit: str = ""
    title: str = ""
    dims: tuple[str, ...] = ()
    labels: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    default: bool = True


def along(dim: str, columns: Mapping[str, Column], prefix: str = "") -> dict[str, Recorded]:
    """Columns along a dimension that is as long as there are states, points or steps."""
    return {
        f"{prefix}{name}": Recorded(c.values.tolist(), c.unit, title(name), (dim,))
        for name, c in columns.items()
    }


def single(p: Parameters, values: Mapping[str, tuple[Any, str | None]]) -> dict[str, Recorded]:
    """Numbers with their dimensions, by name, in the units of p."""
    found = {}
    for name, (value, dimension) in values.items():
        shown = column(p, np.nan if value is None else value, dimension)
        found[name] = Recorded(shown.values.item(), shown.unit, title(name))
    return found


def optional(entries: Mapping[str, Recorded]) -> dict[str, Recorded]:
    """The same, recorded only where they are asked for."""
    return {name: replace(entry, default=False) for name, entry in entries.items()}


def title(name: str) -> str:
    """What a name of an observable, of a parameter or of `TITLES` means, in a few words."""
    known = OBSERVABLES.get(name) or OBSERVABLES.get(name.rpartition("_")[0])
    if name in TITLES or known is None:
        return TITLES.get(name) or parameter_title(name)
    return _first_sentence(getattr(known.function, "__doc__", None) or name)


def parameter_title(name: str) -> str:
    """What a parameter is, in a few words; its own name where that is not known."""
    declared = getattr(Parameters, "__dataclass_fields__", {}).get(name)
    kind, dot, own = name.partition(".")
    if dot and kind in MEANINGS:
        return f"{own} of the {MEANINGS[kind]}"
    return MEANINGS.get(name) or str(declared.metadata.get("doc", name) if declared else name)


TITLES = {
    "t": "time",
    "stable": "every perturbation with m = 0, 1, 2, 3 decays: 1, else 0",
    **{f"unstable_m{m}": f"number of growing modes with m = {m}" for m in range(4)},
    "n_states": "number of steady states",
    "n_stable": "number of stable steady states",
    "piece": "number of the piece of the branch",
    "n_folds": "number of folds",
    "steps": "number of steps",
    "steady": "the cell does not change, and no perturbation is known to grow: 1, else 0",
    "growth_rate": "growth rate of the fastest perturbation of the cell at the end",
    "growth_rate_error": "its error",
    "stability": "stable, unstable or unknown",
    "ended": "why the run ended",
    "path": "straight, circle or helix",
    "turning": "how fast the direction of motion changes",
    "radius_of_curvature": "radius of curvature of the path",
    "torsion": "torsion of the path",
    "residual": "remaining rate of change, in units of rate",
}


def _first_sentence(text: str) -> str:
    """The first sentence of a docstring, without the unit at its end."""
    first = " ".join(text.split("\n\n")[0].split())
    return first.partition(" [")[0].rstrip(".")


def texts(values: Iterable[str]) -> str:
    """Several messages as one."""
    return "; ".join(values)

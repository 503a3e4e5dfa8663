"""What several figures compute, as functions whose results are kept; see `results`.

Numbers in and out are in the units of the solver.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby, pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.closed_forms.branch import prediction
from amoeboid.closed_forms.points import infinite_pressure, points
from amoeboid.config import Initial
from amoeboid.figures.results import Results
from amoeboid.figures.tables import Table, column_of
from amoeboid.model.parameters import Parameters
from amoeboid.observables import OBSERVABLES
from amoeboid.runs.meshes import Icosphere
from amoeboid.runs.solution import simulate
from amoeboid.studies.branch import branch
from amoeboid.studies.columns import quantity

SHOWN = ("max_retrograde_speed", "c_front", "c_rear", "zeta0", "deformation")
STATE, FOLD = "state", "fold"


def branch_points(
    p: Parameters, name: str, start: float, end: float, max_step: float = 0.1
) -> dict[str, Any]:
    """The branch of polarized states, its folds and bifurcations among its points, in order.

    A dict of lists of equal length, `points`, and what the branch says of itself.
    """
    ends = [quantity(p, value, p.dimension(name)) for value in (start, end)]
    found = branch(p, name, *ends, max_step=max_step)
    entries: list[tuple[int, float, str, Any]] = [
        (number, length, STATE, state)
        for number, piece in enumerate(found.pieces)
        for length, state in zip(found.lengths[number], piece, strict=True)
    ]
    entries += [(s.piece, s.length, s.kind, s.state) for s in (*found.folds, *found.bifurcations)]
    entries.sort(key=lambda entry: entry[:2])
    states = [entry[3] for entry in entries]
    along = {
        "piece": [entry[0] for entry in entries],
        "kind": [entry[2] for entry in entries],
        name: [s.parameters.value(name) for s in states],
        **{key: [s.number(key) for s in states] for key in SHOWN},
        "stable": [bool(s.stable) for s in states],
    }
    return {
        "points": along,
        "thresholds": list(found.origins),
        "folds": [fold.number for fold in found.folds],
        "complete": found.complete,
        "problems": list(found.problems),
    }


def steady_run(p: Parameters, subdivisions: int, perturbation: float) -> dict[str, Any]:
    """How a 3D run from the sphere ends that starts polarized by `perturbation` [N/L^2]."""
    run = simulate(
        p,
        mesh=Icosphere(subdivisions),
        initial=Initial(perturbation=perturbation),
        progress=False,
    )
    last = run.rows[-1]
    return {
        **{name: float(last[name]) for name in SHOWN},
        "steady": run.status == "steady",
        "stability": run.stability,
        "t": float(last["t"]),
        "ended": run.ended,
    }


def branch_table(p: Parameters, name: str, found: dict[str, Any]) -> Table:
    """The points of `branch_points` as a table."""
    along = found["points"]
    columns = {name: column_of(p, along[name], p.dimension(name))}
    columns |= {key: column_of(p, along[key], OBSERVABLES[key].dimension) for key in SHOWN}
    columns |= {key: column_of(p, along[key]) for key in ("stable", "kind", "piece")}
    return Table("steady states by the axisymmetric solver", columns)


def runs_table(p: Parameters, name: str, values: ArrayLike, rows: Sequence[Any]) -> Table:
    """The ends of 3D runs at values of a parameter as a table."""
    columns = {name: column_of(p, values, p.dimension(name))}
    columns |= {
        key: column_of(p, [row[key] for row in rows], OBSERVABLES[key].dimension) for key in SHOWN
    }
    columns |= {key: column_of(p, [row[key] for row in rows]) for key in ("steady", "stability")}
    return Table("the ends of 3D runs", columns)


def theory_table(p: Parameters, speeds: Array) -> Table:
    """The weakly nonlinear retrograde speed at `speeds` (v_p0), at delta_P and at infinity.

    Main text `WNLA`, with the prefactor at v_p0 as in the paper's figure 3; empty where the theory
    has no polarized state.
    """
    columns = {"v_p0": column_of(p, speeds, "L/T")}
    for key, base in (("at_delta_P", p), ("at_infinite_pressure", infinite_pressure(p))):
        found = prediction(points(base, v_p0=speeds))
        speed = np.where(found.state.exists, found.max_retrograde_speed_at_v_p0, np.nan)
        columns[key] = column_of(p, speed, "L/T")
    return Table("weakly nonlinear theory, max_retrograde_speed", columns)


def pieces(table: Table) -> list[tuple[slice, bool]]:
    """The stretches of a branch that are stable, or unstable: rows, and which of the two.

    They meet at folds and bifurcations, which belong to both.
    """
    found: list[tuple[slice, bool]] = []
    states = np.asarray(table["kind"]) == STATE
    for _, group in groupby(range(len(table)), key=lambda k: table["piece"][k]):
        rows = list(group)
        first = len(found)
        for a, b in pairwise(rows):
            stable = bool(table["stable"][a if states[a] else b])
            if len(found) > first and found[-1][1] == stable:
                found[-1] = (slice(found[-1][0].start, b + 1), stable)
            else:
                found.append((slice(a, b + 1), stable))
    return found


def mesh_runs(
    p: Parameters, results: Results, values: ArrayLike, subdivisions: int, start: float
) -> list[dict[str, Any]]:
    """3D runs at values of v_p0 from one start [N/L^2], with progress."""
    speeds = np.asarray(values, dtype=float).tolist()
    return [
        results.of(
            steady_run,
            p.replace(v_p0=speed),
            subdivisions,
            start,
            task=f"3D runs: {k} of {len(speeds)}",
        )
        for k, speed in enumerate(speeds, 1)
    ]

"""What several figures compute, as functions whose results are kept; see `results`.

Numbers in and out are in the units of the solver.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.axisymmetric.onset import onset_speed
from amoeboid.closed_forms.branch import prediction
from amoeboid.closed_forms.linear import critical_speed, growth_rate
from amoeboid.closed_forms.points import infinite_pressure, points
from amoeboid.figures.results import Results
from amoeboid.figures.tables import FigureData, Table, column_of
from amoeboid.model.parameters import Parameters
from amoeboid.observables import OBSERVABLES
from amoeboid.runs.meshes import Icosphere
from amoeboid.runs.solution import simulate
from amoeboid.sections import Initial, Time
from amoeboid.studies.branch import branch
from amoeboid.studies.columns import quantity, text

SHOWN = (
    "max_retrograde_speed",
    "c_front",
    "c_rear",
    "zeta0",
    "deformation",
    "filament_number",
)
STATE, FOLD = "state", "fold"

# Latest end and longest step of a run in units of 1/rate: near a threshold and a fold a cell
# changes slowly, and the steps grow with the time that it takes.
END, MAX_STEP = 1e4, 1e3
# A cell with less retrograde flow, in units of R0 rate, is at rest.
AT_REST = 0.01
# Factor of safety of Richardson's error estimate from two meshes: the grid convergence index.
SAFETY = 1.25


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


def steady_run(p: Parameters, subdivisions: int, perturbation: float | None) -> dict[str, Any]:
    """How a 3D run from the sphere ends that starts polarized by `perturbation` [N/L^2].

    None is the strong polarization that a run starts from by default. `polarized` is false for a
    cell at rest; `growth_rate` [1/T] is that of its fastest growing perturbation.
    """
    run = simulate(
        p,
        mesh=Icosphere(subdivisions),
        initial=Initial() if perturbation is None else Initial(perturbation=perturbation),
        time=Time(end=END / p.rate, max_step=MAX_STEP / p.rate),
        progress=False,
    )
    last = run.rows[-1]
    return {
        **{name: float(last[name]) for name in SHOWN},
        "polarized": float(last["max_retrograde_speed"]) > AT_REST * p.R0 * p.rate,
        "steady": run.steady,
        "stability": run.stability,
        "growth_rate": run.last.growth,
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


def nodes(subdivisions: int) -> str:
    """How many nodes a mesh has, in words."""
    return f"{Icosphere(subdivisions).n_nodes} nodes"


def runs_table(
    p: Parameters, name: str, values: ArrayLike, rows: Sequence[Any], subdivisions: int
) -> Table:
    """The ends of 3D runs at values of a parameter as a table; see `mesh_runs`."""
    columns = {name: column_of(p, values, p.dimension(name))}
    columns |= {
        key: column_of(p, [row[key] for row in rows], OBSERVABLES[key].dimension) for key in SHOWN
    }
    errors = [[_number(row[key]) for row in rows] for key in ERRORS]
    columns |= {key: column_of(p, found, "L/T") for key, found in zip(ERRORS, errors, strict=True)}
    columns |= {key: column_of(p, [row[key] for row in rows]) for key in ("polarized", "steady")}
    fine, coarse = (nodes(n) for n in (subdivisions, subdivisions - 1))
    about = f"the ends of 3D runs on {fine}; mesh errors from runs on {coarse}"
    return Table(about, columns)


def _number(value: float | None) -> float:
    return np.nan if value is None else float(value)


AT_THRESHOLD_PREFACTOR = "_prefactor_at_threshold"
"""How the columns of the theory end whose speeds have the prefactor at the threshold."""


def threshold_table(p: Parameters, threshold: float) -> Table:
    """The threshold of the sphere as a table of one row."""
    columns = {"v_p0": column_of(p, [threshold], "L/T")}
    return Table("where the homogeneous sphere loses stability", columns)


def spread(low: float, threshold: float, high: float) -> Array:
    """Speeds from `low` to `high`, densest at the threshold, where the flow has a vertical slope.

    The threshold itself is not among them: the speeds beside it are 1e-9 of the way off.
    """
    shares = np.concatenate([[1e-9], np.linspace(0.0, 1.0, 81)[1:] ** 2])
    below, above = threshold - low, high - threshold
    return np.concatenate([(threshold - below * shares)[::-1], threshold + above * shares])


def theory_table(p: Parameters, speeds: Array) -> Table:
    """The weakly nonlinear retrograde speed at `speeds` (v_p0), at delta_P and at infinity.

    Main text `WNLA`, with the prefactor at v_p0 as in the paper's figure 3, and with the one at the
    threshold as in `eq_vMig_inv`; empty where the theory has no polarized state.
    """
    columns = {"v_p0": column_of(p, speeds, "L/T")}
    for key, base in (("at_delta_P", p), ("at_infinite_pressure", infinite_pressure(p))):
        found = prediction(points(base, v_p0=speeds))
        for name, speed in (
            (key, found.max_retrograde_speed_at_v_p0),
            (f"{key}{AT_THRESHOLD_PREFACTOR}", found.max_retrograde_speed),
        ):
            columns[name] = column_of(p, np.where(found.state.exists, speed, np.nan), "L/T")
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


ERRORS = ("mesh_error_of_max_retrograde_speed", "mesh_error_of_threshold")


def mesh_runs(
    p: Parameters, results: Results, values: ArrayLike, subdivisions: int, start: float
) -> list[dict[str, Any]]:
    """3D runs at values of v_p0 from one start [N/L^2], each with its mesh error, with progress.

    The mesh error is Richardson's, of second order in the length of the edges, from the same cell
    on the next coarser mesh, times SAFETY. Of a polarized cell it is that of the retrograde speed
    (None where the coarser mesh does not have the state), of a cell at rest that of the threshold:
    the one of its growth rate, over d lambda_1/d v_p0. All flow that a cell at rest has on a mesh
    is an error, as a sphere has none.
    """
    speeds = np.asarray(values, dtype=float).tolist()
    rows = []
    for k, speed in enumerate(speeds, 1):
        q, task = p.replace(v_p0=speed), f"3D runs: {k} of {len(speeds)}"
        fine = results.of(steady_run, q, subdivisions, start, task=task)
        strong = None if fine["polarized"] else 0.0
        coarse = results.of(steady_run, q, subdivisions - 1, strong, task=task)
        rows.append(fine | dict(zip(ERRORS, mesh_errors(q, fine, coarse), strict=True)))
    return rows


def mesh_errors(
    p: Parameters, fine: dict[str, Any], coarse: dict[str, Any]
) -> tuple[float | None, float | None]:
    """The ERRORS of a run from its end on a mesh and on the next coarser one [L/T]."""
    if fine["polarized"] != coarse["polarized"]:
        return None, None
    if fine["polarized"]:
        return _richardson(fine["max_retrograde_speed"], coarse["max_retrograde_speed"]), None
    at_rest = fine["max_retrograde_speed"]
    if fine["growth_rate"] is None or coarse["growth_rate"] is None:
        return at_rest, None
    step = 1e-3 * p.v_p0
    ahead, behind = (growth_rate(p.replace(v_p0=p.v_p0 + s), 1) for s in (step, -step))
    slope = abs(float(ahead - behind)) / (2 * step)
    return at_rest, _richardson(fine["growth_rate"], coarse["growth_rate"]) / slope


def _richardson(fine: float, coarse: float) -> float:
    return SAFETY * abs(fine - coarse) / 3.0


@dataclass(frozen=True)
class Window:
    """A window of v_p0 around a threshold and the fold below it, if there is one [L/T]."""

    threshold: float
    fold: float | None
    low: float
    high: float
    speeds: tuple[float, ...]


# Places of 3D runs: in units of the fold, in shares of the way from fold to threshold, and in units
# of the threshold.
AT_FOLD = (0.985, 0.999, 1.002, 1.012)
BETWEEN = (0.15, 0.35, 0.6, 0.85)
AT_THRESHOLD = (0.998, 1.002, 1.015, 1.04)
BEYOND = 0.3
"""What of the way from fold to threshold the window shows beyond each of the two."""


def bistable_window(p: Parameters, folds: Sequence[float]) -> Window:
    """The window of a figure with hysteresis, with runs close to where the cell jumps."""
    threshold = float(critical_speed(p))
    fold = min((f for f in folds if f < threshold), default=None)
    gap = 0.1 * threshold if fold is None else threshold - fold
    low, high = threshold - (1 + BEYOND) * gap, threshold + BEYOND * gap
    first = threshold - gap if fold is None else fold
    at_fold = () if fold is None else tuple(share * fold for share in AT_FOLD)
    places = [
        *at_fold,
        *(first + share * (threshold - first) for share in BETWEEN),
        *(share * threshold for share in AT_THRESHOLD),
    ]
    speeds = tuple(sorted(v for v in places if low < v < high))
    return Window(threshold, fold, low, high, speeds)


def hysteresis(p: Parameters, results: Results, subdivisions: int) -> FigureData:
    """Threshold and fold with the branch between them, and 3D runs from a weak and a strong start.

    The starts are the paper's delta c_1 = 0.03 and 3, as shares of c0.
    """
    end = (1 + BEYOND) * float(critical_speed(p))
    branch = results.of(branch_points, p, "v_p0", 0.0, end, 0.05, task="axisymmetric branch")
    window = bistable_window(p, branch["folds"])
    tables = {
        "theory": theory_table(p, spread(window.low, window.threshold, window.high)),
        "branch": branch_table(p, "v_p0", branch),
        "threshold": threshold_table(p, window.threshold),
    }
    notes = [f"threshold v_p^c = {text(p, window.threshold, 'L/T', '#.8g')}"]
    if window.fold is not None:
        notes.append(f"fold at v_p0 = {text(p, window.fold, 'L/T', '#.8g')}")
    problems = list(branch["problems"])
    for key, share in (("weak", WEAK), ("strong", STRONG)):
        rows = mesh_runs(p, results, window.speeds, subdivisions, share * p.c0)
        tables[f"runs-{key}"] = runs_table(p, "v_p0", window.speeds, rows, subdivisions)
        at_fold = key == "strong" and window.fold is not None
        notes += jumps(p, window.speeds, rows, f"from the {key} start", at_fold)
        if at_fold:
            notes += lost(p, window, rows)
        problems += not_steady(p, window.speeds, rows)
    return FigureData(p, tables, tuple(notes), tuple(problems))


WEAK, STRONG = 0.01, 1.0
"""The paper's starts of 3D runs, delta c_1 = 0.03 and 3, as shares of c0."""


def not_steady(p: Parameters, speeds: Sequence[float], rows: Sequence[Any]) -> list[str]:
    """What to say of runs that did not become steady."""
    return [
        f"the 3D run at v_p0 = {text(p, v, 'L/T')} is not steady at t = {text(p, row['t'], 'T')}: "
        f"{row['ended']}"
        for v, row in zip(speeds, rows, strict=True)
        if not row["steady"]
    ]


def jumps(
    p: Parameters, speeds: Sequence[float], rows: Sequence[Any], words: str, at_fold: bool = False
) -> list[str]:
    """Between which runs the cell jumps from rest to polarized, with the mesh error in v_p0.

    `at_fold`: the polarized state ends there in a fold; else the sphere loses stability.
    """
    found = []
    for k in range(len(rows) - 1):
        if rows[k]["polarized"] or not rows[k + 1]["polarized"]:
            continue
        error = error_of_fold(speeds[k + 1 :], rows[k + 1 :]) if at_fold else rows[k][ERRORS[1]]
        stated = "" if error is None else f", mesh error {text(p, error, 'L/T', '.2g')}"
        ends = [text(p, v, "L/T", "#.5g") for v in speeds[k : k + 2]]
        found.append(f"3D runs {words}: jump between v_p0 = {' and '.join(ends)}{stated}")
    return found


def lost(p: Parameters, window: Window, rows: Sequence[Any]) -> list[str]:
    """What to say of runs from the strong start at rest above the fold and its mesh error."""
    polarized = [k for k, row in enumerate(rows) if row["polarized"]]
    if window.fold is None or not polarized:
        return []
    first = polarized[0]
    error = error_of_fold(window.speeds[first:], rows[first:]) or 0.0
    at = [text(p, v, "L/T", "#.5g") for v in window.speeds[:first] if v > window.fold + error]
    if not at:
        return []
    return [
        f"above the fold, at v_p0 = {', '.join(at)}, runs from the strong start end at rest: the "
        "start is outside the basin of attraction of the polarized state"
    ]


def error_of_fold(speeds: Sequence[float], rows: Sequence[Any]) -> float | None:
    """The mesh error of a fold [L/T]: that of the speeds of states above it, over their slope.

    Of the two nearest that the coarser mesh has, the slope is that of the line through both.
    """
    known = [k for k, row in enumerate(rows) if row[ERRORS[0]] is not None][:2]
    if len(known) < 2:
        return None
    a, b = known
    rise = rows[b]["max_retrograde_speed"] - rows[a]["max_retrograde_speed"]
    return float(rows[a][ERRORS[0]]) * (speeds[b] - speeds[a]) / abs(rise)


def mesh_threshold(p: Parameters, subdivisions: int) -> float | None:
    """The threshold of the sphere on a mesh [L/T]: where its measured growth rate vanishes.

    On the line through two growth rates below the threshold. None where one is not known.
    """
    speeds = [share * float(critical_speed(p)) for share in BELOW_THRESHOLD]
    rates = [steady_run(p.replace(v_p0=v), subdivisions, 0.0)["growth_rate"] for v in speeds]
    if None in rates:
        return None
    a, b = rates
    return float(speeds[1] - b * (speeds[1] - speeds[0]) / (b - a))


BELOW_THRESHOLD = (0.95, 0.99)
"""Where the growth rates of `mesh_threshold` are measured, in thresholds."""


def solver_threshold(p: Parameters) -> float | None:
    """The threshold of the axisymmetric solver [L/T], from its linearization on the sphere."""
    return onset_speed(p)

"""Large deformations: what becomes of a cell at low pressure and high activity.

    python benchmarks/regimes.py [--nodes N] [--tolerance T] [--seed K] [--end T] [--wall S]
                                 [--keep DIR] [CASE ...]

Prints one row of a Markdown table a case; without names all cases of `CASES`. --wall ends a case
after so many seconds of wall time and says so; --keep writes the run folders. The outcome
is in docs/large-deformation.md.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from amoeboid.config import Config, Initial, Mesh, Time
from amoeboid.meshes.geometry import volume_centroid
from amoeboid.model.parameters import Parameters
from amoeboid.observables import mesh_quality, observed
from amoeboid.output.folder import new_folder, new_run
from amoeboid.simulation.loop import evolve, start
from amoeboid.simulation.step import Step
from amoeboid.simulation.step_length import Diverged

SUBDIVISIONS = {162: 2, 642: 3, 2562: 4, 10242: 5}
POLARIZED = Initial()
NOISE = Initial(perturbation=0.0, noise=0.03, seed=1)
LOUD = Initial(perturbation=0.0, noise=0.3, seed=1)
# Stretches of the way that `turned` compares, and the speed below which it does not count.
STRETCH, MOVES = 0.25, 0.01


@dataclass(frozen=True)
class Case:
    """Parameters beside the paper's table, and the start."""

    parameters: Parameters
    initial: Initial


def _cases() -> dict[str, Case]:
    cases = {}
    for delta_P in (11.0, 3.0, 1.0):
        for v_p0 in (5.0, 5.5, 6.0, 7.0, 8.0):
            p = Parameters(D=0.4, delta_P=delta_P, v_p0=v_p0)
            cases[f"P{delta_P:g}-v{v_p0:g}"] = Case(p, POLARIZED)
            if v_p0 >= 7:  # above threshold, v_p0 = 6.03: noise grows
                cases[f"P{delta_P:g}-v{v_p0:g}-noise"] = Case(p, NOISE)
    for delta_P, v_p0 in (
        (11, 6.5),
        (11, 7),
        (11, 7.25),
        (11, 7.5),
        (20, 8),
        (20, 9),
        (30, 9),
        (30, 10),
        (30, 12),
    ):
        p = Parameters(D=0.4, delta_P=float(delta_P), v_p0=float(v_p0))
        cases[f"P{delta_P:g}-v{v_p0:g}-loud"] = Case(p, LOUD)
    for v_p0 in (5.85, 6.026):
        p = Parameters(D=0.1, delta_P=11.0, v_p0=v_p0)
        cases[f"D0.1-P11-v{v_p0:g}-loud"] = Case(p, LOUD)
    for D in (0.03, 0.1, 1.0):
        critical = (D + 0.5) / 3.0 * np.exp(3.0)
        for delta_P in (0.5, 1.0, 3.0, 11.0):
            for above in (1.1, 1.5):
                p = Parameters(D=D, delta_P=delta_P, v_p0=round(above * critical, 3))
                cases[f"D{D:g}-P{delta_P:g}-x{above:g}-noise"] = Case(p, NOISE)
    for eta_b in (0.1, 10.0):
        for delta_P in (1.0, 11.0):
            p = Parameters(D=0.4, delta_P=delta_P, v_p0=7.0, eta_b=eta_b)
            cases[f"P{delta_P:g}-v7-etab{eta_b:g}-noise"] = Case(p, NOISE)
    return cases


CASES = _cases()


@dataclass
class Record:
    """What is kept of a run."""

    why: str
    step: Step
    worst_quality: float
    shortest_dt: float
    path: np.ndarray
    times: np.ndarray
    wall: float


def lobes(step: Step) -> int:
    """Nodes that lie farther from the center than all others within R0/2 along the surface or not,
    and farther than the mean: 1 or 2 for an egg, 0 for a sphere within 1 %."""
    r, faces = step.state.r, step.model.mesh.faces
    x = r - volume_centroid(r, faces)
    distance = np.linalg.norm(x, axis=1)
    if np.ptp(distance) < 0.02 * distance.mean():
        return 0
    near = KDTree(x).query_ball_point(x, 0.5 * step.model.parameters.R0)
    highest = np.array([distance[nodes].max() for nodes in near]) <= distance
    return int(np.sum(highest & (distance > distance.mean())))


def followed(case: Case, nodes: int, control: Time, wall: float, keep: Path | None) -> Record:
    """Run one case and keep what the table needs."""
    config = Config(
        parameters=case.parameters,
        mesh=Mesh(subdivisions=SUBDIVISIONS[nodes]),
        initial=case.initial,
        time=control,
    )
    began = time.perf_counter()
    step = first = start(config)
    run = None if keep is None else new_run(new_folder(keep), config)
    worst, shortest = 1.0, np.inf
    path, times = [step.state.position], [0.0]
    why = ""
    if run is not None:
        run.take(step)
    try:
        for step in evolve(first, config.time):
            worst = min(worst, mesh_quality(step.cell))
            shortest = min(shortest, step.dt)
            path.append(step.state.position)
            times.append(step.state.t)
            if run is not None:
                run.take(step)
            why = step.ended or ""
            if not why and time.perf_counter() - began > wall:
                why = "wall time"
                break
    except Diverged as error:
        why = str(error).split(": ", 1)[1]
    if run is not None:
        run.save(step)
        run.write_manifest("finished", ended=why, t=step.state.t)
    wall = time.perf_counter() - began
    return Record(why, step, worst, shortest, np.array(path), np.array(times), wall)


def turned(record: Record) -> float:
    """Angle in degrees by which the way has turned, in stretches of equal time, while it moves."""
    times = np.arange(0.0, record.times[-1], STRETCH)
    x = np.column_stack([np.interp(times, record.times, along) for along in record.path.T])
    u = np.diff(x, axis=0)
    length = np.linalg.norm(u, axis=1)
    u = u[length > MOVES * STRETCH] / length[length > MOVES * STRETCH, None]
    cosine = np.clip(np.einsum("ti,ti->t", u[1:], u[:-1]), -1, 1)
    return float(np.degrees(np.arccos(cosine).sum()))


def row(name: str, record: Record) -> str:
    """One row of the table."""
    step, path = record.step, record.path
    found = observed(step.cell)
    way = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    net = np.linalg.norm(path[-1] - path[0])
    cells = [
        name,
        f"{step.state.t:.3f}",
        record.why,
        f"{step.number}",
        f"{step.rejected}",
        f"{record.shortest_dt:.1e}",
        f"{record.worst_quality:.2f}",
        f"{found['reduced_volume']:.3f}",
        f"{lobes(step)}",
        f"{found['max_retrograde_speed']:.4f}",
        f"{found['c_front']:.3f}",
        f"{found['c_rear']:.3f}",
        f"{found['zeta0']:.3f}",
        f"{way:.2f}",
        f"{net:.2f}",
        f"{turned(record):.0f}",
        f"{record.wall:.1f}",
    ]
    return "| " + " | ".join(cells) + " |"


TITLES = (
    "| case | t_end | why | steps | rejected | shortest_dt | worst_quality | reduced_volume "
    "| lobes | speed | c_front | c_rear | zeta0 | way | net | turned | wall_s |"
)


def main() -> None:
    """Run the cases that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("cases", nargs="*", help=f"of {', '.join(CASES)}")
    parser.add_argument("--nodes", type=int, choices=sorted(SUBDIVISIONS), default=642)
    parser.add_argument("--tolerance", type=float)
    parser.add_argument("--seed", type=int, help="of the noise of noise and loud cases (1)")
    parser.add_argument("--end", type=float, default=60.0)
    parser.add_argument("--wall", type=float, default=120.0)
    parser.add_argument("--keep", type=Path)
    args = parser.parse_args()
    if args.seed is not None and args.seed < 0:
        parser.error(f"--seed must be >= 0, got {args.seed}")
    unknown = [name for name in args.cases if name not in CASES]
    if unknown:
        parser.error(f"no such case: {', '.join(unknown)}; choose from {', '.join(CASES)}")
    control = Time(end=args.end)
    if args.tolerance is not None:
        control = replace(control, tolerance=args.tolerance)
    print(TITLES)
    print("|" + "---|" * (TITLES.count("|") - 1))
    for name in args.cases or CASES:
        case = CASES[name]
        if args.seed is not None:
            case = replace(case, initial=replace(case.initial, seed=args.seed))
        label = f"{name}-{args.nodes}-seed{case.initial.seed}"
        folder = None if args.keep is None else args.keep / label
        record = followed(case, args.nodes, control, args.wall, folder)
        print(row(name, record), flush=True)


if __name__ == "__main__":
    main()

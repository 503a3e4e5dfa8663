"""Time of the stability of steady cells in 3D alone, without the search for the cell.

    python -m benchmarks.stability 3 4 5                   # 642 to 10242 nodes; 6 is 40962
    python -m benchmarks.stability 3 4 5 --against SRC     # and by another checkout, ratios

`--against`: the package in the folder SRC, the `src` of another checkout, of which this needs no
more than `leading_growth_rate`. Both get the same cells, in processes of their own, and time them
in turns. Processor time, the best of a few repetitions.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse  # noqa: E402
import json  # noqa: E402
import subprocess  # noqa: E402
import sys  # noqa: E402
import tempfile  # noqa: E402
import time  # noqa: E402
from pathlib import Path  # noqa: E402
from typing import Any  # noqa: E402

import numpy as np  # noqa: E402

HERE = Path(__file__).resolve().parents[1] / "src"
REPETITIONS = {3: 5, 4: 4, 5: 2}
CELLS: dict[str, dict[str, float]] = {
    "figure 3D": {"D": 0.4, "v_p0": 6.0},
    "parameter table": {},
    "delta_P = 11": {"D": 0.4, "v_p0": 6.0, "delta_P": 11.0},
    "delta_P = 20, v_p0 = 8": {"D": 0.4, "v_p0": 8.0, "delta_P": 20.0},
}
"""Parameters that differ from the paper's table; the last cell is unstable."""


def keep_cell(name: str, subdivisions: int, file: Path) -> None:
    """Write a steady cell with nodes as uniform as those of a run: state, flow and faces."""
    import amoeboid as am

    states = am.steady_states(am.Parameters(**CELLS[name]), degrees=(1,))
    exact = max(states, key=lambda s: s.max_retrograde_speed)
    cell = am.steady_state(exact.parameters, start=exact.as_initial(am.Icosphere(subdivisions)))
    flow = cell.flow
    np.savez(
        file, faces=cell.faces, r=cell.state.r, c=cell.state.c, zeta0=cell.state.zeta0,
        v_c=flow.v_c, v_p=flow.v_p, normals=flow.normals, node_areas=flow.node_areas,
    )  # fmt: skip


def measure(name: str, repetitions: int, file: Path) -> dict[str, Any]:
    """Best processor time of the growth rate of a kept cell, the rate, and its error."""
    from amoeboid.meshes.connectivity import connectivity
    from amoeboid.model.parameters import Parameters
    from amoeboid.surface.model import Model
    from amoeboid.surface.stability import leading_growth_rate
    from amoeboid.surface.state import Flow, State

    with np.load(file, allow_pickle=False) as kept:
        cell = dict(kept)
    model = Model(Parameters(**CELLS[name]), connectivity(cell["faces"]))
    zeta0 = float(cell["zeta0"])
    state = State(0.0, cell["r"], cell["c"], zeta0, np.zeros(3), np.zeros(3))
    flow = Flow(cell["v_c"], cell["v_p"], zeta0, cell["normals"], cell["node_areas"])
    best = np.inf
    for _ in range(repetitions + 1):  # kernels may be compiled in the first
        before = time.process_time()
        growth = leading_growth_rate(model, state, flow)
        best = min(best, time.process_time() - before)
    return {"seconds": best, "rate": growth.rate, "error": growth.error}


def _timed(source: Path, name: str, subdivisions: int, file: Path) -> dict[str, Any]:
    repetitions = str(REPETITIONS.get(subdivisions, 1))
    done = subprocess.run(
        [sys.executable, __file__, "--time", name, repetitions, str(file)],
        env=os.environ | {"PYTHONPATH": str(source)},
        check=True,
        capture_output=True,
        text=True,
    )
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("subdivisions", type=int, nargs="*", default=[3, 4])
    parser.add_argument("--against", type=Path, metavar="SRC", help="time another checkout too")
    parser.add_argument("--cell", choices=CELLS, help="only this one (default: all)")
    parser.add_argument("--time", nargs=3, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.time:
        name, repetitions, file = args.time
        print(json.dumps(measure(name, int(repetitions), Path(file))))
        return
    sources = [HERE] if args.against is None else [args.against.resolve(), HERE]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "cell.npz"
        for name in [args.cell] if args.cell else CELLS:
            for n in args.subdivisions:
                keep_cell(name, n, file)
                turns = [[_timed(source, name, n, file) for source in sources] for _ in range(2)]
                each = [
                    min(found, key=lambda one: one["seconds"]) for found in zip(*turns, strict=True)
                ]
                text = "   ".join(
                    f"{f['seconds']:8.3f} s {f['rate']:+.5f} +- {f['error']:.5f}" for f in each
                )
                ratio = each[0]["seconds"] / each[-1]["seconds"]
                told = f"   {ratio:.2f} times" if args.against else ""
                print(f"{name:24}{10 * 4**n + 2:6} nodes {text}{told}", flush=True)


if __name__ == "__main__":
    main()

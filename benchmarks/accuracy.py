"""Errors of steady cells in 3D and of their growth rates against the axisymmetric solver.

    python -m benchmarks.accuracy 2 3 4 5        # 162 to 10242 nodes; 6 is 40962
    python -m benchmarks.accuracy growth 2 3 4   # rate of the fastest growing perturbation
    python -m benchmarks.accuracy rest 2 3 4     # flow of a cell that should be at rest

The first tables of docs/numerics-surface.md, and those of growth rates and of the flow at rest. The
cells are solved for from the axisymmetric state, on nodes as uniform as those that a run begins
with; runs differ by where their nodes come to lie.
"""

from __future__ import annotations

import sys

import numpy as np

from amoeboid.axisymmetric.cell import AxisymmetricCell
from amoeboid.axisymmetric.on_mesh import on_directions
from amoeboid.axisymmetric.onset import onset_speed
from amoeboid.axisymmetric.search import steady_solutions
from amoeboid.axisymmetric.stability import AZIMUTHAL_NUMBERS, growth_rates
from amoeboid.meshes.cells import InitialCell
from amoeboid.meshes.relaxation import uniform_icosphere
from amoeboid.model.parameters import Parameters
from amoeboid.runs.meshes import Icosphere
from amoeboid.runs.steady_cell import steady_state
from amoeboid.studies.states import SteadyState
from amoeboid.surface.stability import MAX_ERROR
from amoeboid.validation import InvalidInput

OBSERVED = ("max_retrograde_speed", "c_front", "c_rear", "zeta0")
EDGE, NODE = (0.0, 0.0, 1.0), (0.0, 1.0, (1.0 + 5.0**0.5) / 2.0)
CASES = {
    "D = 0.4, v_p0 = 6": (Parameters(D=0.4, v_p0=6.0), EDGE),
    "D = 0.03, v_p0 = 3.8": (Parameters(D=0.03, v_p0=3.8), EDGE),
    "delta_P = 300, poles of valence 5": (Parameters(D=0.4, v_p0=6.0), NODE),
    "delta_P = 11": (Parameters(D=0.4, v_p0=6.0, delta_P=11.0), EDGE),
    "delta_P = 11, poles of valence 5": (Parameters(D=0.4, v_p0=6.0, delta_P=11.0), NODE),
}
"""Parameters, and the direction from the center of the mesh that the rear lies in."""

RATES = {
    "v_p0 = 6, delta_P = 300": Parameters(D=0.4, v_p0=6.0),
    "v_p0 = 6, delta_P = 11": Parameters(D=0.4, v_p0=6.0, delta_P=11.0),
    "v_p0 = 8, delta_P = 20": Parameters(D=0.4, v_p0=8.0, delta_P=20.0),
    "v_p0 = 7.9, delta_P = 20": Parameters(D=0.4, v_p0=7.9, delta_P=20.0),  # the onset of circles
    "v_p0 = 6.5, delta_P = 11": Parameters(D=0.4, v_p0=6.5, delta_P=11.0),
    "v_p0 = 9, delta_P = 30": Parameters(D=0.4, v_p0=9.0, delta_P=30.0),
    "v_p0 = 5, delta_P = 3": Parameters(D=0.4, v_p0=5.0, delta_P=3.0),
    "D = 0.1, v_p0 = 0.75, beta = 0": Parameters(D=0.1, v_p0=0.75, beta=0.0),
    "D = 0.1, v_p0 = 3, beta = 0": Parameters(D=0.1, v_p0=3.0, beta=0.0),
    "D = 0.03, v_p0 = 3.6": Parameters(D=0.03, v_p0=3.6),
    "the paper's cell": Parameters.physical(),
    "D = 0.01, v_p0 = 5": Parameters(D=0.01, v_p0=5.0),
    "paper's table": Parameters(),
}
"""Polarized cells whose fastest perturbation is known without a mesh."""


def growth(subdivisions: list[int]) -> None:
    """Print the rate of the fastest growing perturbation with its error, and without a mesh."""
    for name, p in RATES.items():
        state = max(steady_solutions(p, (1,)).states, key=lambda s: s.max_retrograde_speed)
        exact = max(growth_rates(state, m).real.max() for m in AZIMUTHAL_NUMBERS)
        found = [_rate(state, n) for n in subdivisions]
        print(f"{name:32} {exact:+.5f} ", *(f"{text:22}" for text in found), flush=True)


def _rate(state: AxisymmetricCell, subdivisions: int) -> str:
    start = SteadyState(state).as_initial(Icosphere(subdivisions))
    try:
        cell = steady_state(state.parameters, start=start)
    except InvalidInput:
        return "no such cell"
    found, _ = cell.growth(MAX_ERROR)
    return "unknown" if found.rate is None else f"{found.rate:+.5f} +- {found.error:.5f}"


PRESSURES = (300.0, 11.0, 1.0)
"""delta_P of the cells at rest. Without pressure some shapes of the sphere do not decay."""


def rest(subdivisions: list[int]) -> None:
    """Print the fastest flow, over v_p(c0), of cells at half the threshold, and the orders."""
    for pressure in PRESSURES:
        p = Parameters(D=0.4, delta_P=pressure)
        threshold = onset_speed(p)
        assert threshold is not None
        p = p.replace(v_p0=threshold / 2.0)
        flows = []
        for n in subdivisions:
            directions, faces = uniform_icosphere(n)
            start = InitialCell(p.R0 * directions, faces, np.full(len(directions), p.c0), 1.0)
            flows.append(steady_state(p, start=start).number("max_retrograde_speed") / p.v_p(p.c0))
        orders = np.log2(np.divide(flows[:-1], flows[1:]))
        print(
            f"delta_P = {pressure:<5g}",
            *(f"{flow:9.1e}" for flow in flows),
            "orders",
            *(f"{o:.2f}" for o in orders),
            flush=True,
        )


def main(subdivisions: list[int]) -> None:
    """Print relative errors [%] on every mesh, and their orders from one to the next."""
    for name, (p, rear) in CASES.items():
        exact = max(steady_solutions(p, (1,)).states, key=lambda s: s.max_retrograde_speed)
        axis = np.array(rear) / np.linalg.norm(rear)
        across = np.linalg.svd(axis[None, :])[2][1:]
        errors = []
        for n in subdivisions:
            directions, faces = uniform_icosphere(n)
            r, c = on_directions(exact, directions @ np.stack([*across, axis]).T)
            if np.linalg.det(np.stack([*across, axis])) < 0.0:
                faces = faces[:, ::-1]
            cell = steady_state(p, start=InitialCell(r, faces, np.maximum(c, 0.0), exact.zeta0))
            errors.append([100.0 * (cell.number(o) / getattr(exact, o) - 1.0) for o in OBSERVED])
        for name_of, row in zip(OBSERVED, np.transpose(errors), strict=True):
            orders = np.log2(np.abs(row[:-1] / row[1:]))
            print(
                f"{name:34} {name_of:21}",
                *(f"{e:+9.4f}" for e in row),
                "orders",
                *(f"{o:.2f}" for o in orders),
            )
            sys.stdout.flush()


if __name__ == "__main__":
    others = {"growth": growth, "rest": rest}
    if sys.argv[1:2] and sys.argv[1] in others:
        others[sys.argv[1]]([int(word) for word in sys.argv[2:]])
    else:
        main([int(word) for word in sys.argv[1:]])

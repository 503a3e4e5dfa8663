"""Errors of steady cells in 3D against the axisymmetric solver, and their orders.

    python -m benchmarks.accuracy 2 3 4 5        # 162 to 10242 nodes; 6 is 40962

The first tables of docs/numerics-surface.md. The cells are solved for from the axisymmetric state,
on nodes as uniform as those that a run begins with; runs differ by where their nodes come to lie.
"""

from __future__ import annotations

import sys

import numpy as np

from amoeboid.axisymmetric.on_mesh import on_directions
from amoeboid.axisymmetric.search import steady_solutions
from amoeboid.meshes.cells import InitialCell
from amoeboid.meshes.relaxation import uniform_icosphere
from amoeboid.model.parameters import Parameters
from amoeboid.runs.steady_cell import steady_state

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
    main([int(word) for word in sys.argv[1:]])

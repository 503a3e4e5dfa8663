"""Small runs that between them call every compiled kernel, for the build to keep.

`python -m amoeboid.runs.every_kernel FOLDER` compiles the kernels into a folder of a package that
is being built; see hatch_build.py.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numba.core import config

from amoeboid.arrays import Array
from amoeboid.axisymmetric.steady import homogeneous
from amoeboid.axisymmetric.system import SteadySystem
from amoeboid.config import Config, resolved
from amoeboid.meshes.remeshing import due
from amoeboid.model.parameters import Parameters
from amoeboid.numerics import kept
from amoeboid.runs.meshes import Icosphere
from amoeboid.runs.solution import simulate
from amoeboid.sections import Initial, Mesh, Time
from amoeboid.simulation.events import steady
from amoeboid.simulation.loop import evolve, start
from amoeboid.simulation.step import Step
from amoeboid.studies.migration import migrate

AROUND, ALONG = 10, 9  # nodes of the bent rod


def call_every_kernel() -> Step:
    """Make the runs; the last step of the run to the steady state."""
    p = Parameters(D=0.4, v_p0=6.0)
    found = simulate(p, mesh=Icosphere(1), until=steady(), progress=False)
    _first_steps(
        Config(parameters=p, mesh=Mesh(subdivisions=1), time=Time(scheme="explicit", end=1e-3))
    )
    stiff = Parameters(D=0.4, v_p0=6.0, kappa=0.1, gamma_t=1.0)
    _first_steps(Config(parameters=stiff, mesh=Mesh(subdivisions=1), time=Time(end=0.05)))
    with TemporaryDirectory() as folder:
        for sliver in (False, True):
            path = Path(folder) / f"rod{sliver}.obj"
            path.write_text(_obj(*_bent_rod(sliver)))
            initial = Initial(surface=str(path), repair=sliver)
            _first_steps(Config(parameters=p, initial=initial, time=Time(end=0.05)))
    system, sphere = SteadySystem(p, 8, ("v_p0",)), homogeneous(p, 8).x
    for kind in (float, complex):
        system.residual_and_jacobian(sphere.astype(kind), np.array([p.v_p0], dtype=kind))
    migrate(found.final, "fluid")
    last = found.last
    # as after an unsuccessful attempt to remesh: edges are too short for this length
    due(last.state.r, last.model.mesh.faces, 10 * last.model.edge_length, last.state.r)
    return last


def _first_steps(config: Config) -> None:
    for _ in evolve(start(config), resolved(config).time):
        pass


def _bent_rod(sliver: bool) -> tuple[Array, list[Sequence[int]]]:
    """Points and polygons: not star-shaped, and on request with a triangle to be repaired."""
    theta = np.linspace(0.0, np.pi, ALONG + 2)[1:-1, None]
    phi = 2 * np.pi * np.arange(AROUND)[None, :] / AROUND
    sheet = (np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), 4 * np.cos(theta) + 0 * phi)
    x = np.vstack([np.stack(sheet, axis=2).reshape(-1, 3), [[0, 0, 4], [0, 0, -4]]])
    radius = 2.0  # of the bend
    angle = x[:, 2] / radius
    across = radius + x[:, 0]
    x = np.stack([across * np.cos(angle), x[:, 1], across * np.sin(angle)], axis=1)
    middle = AROUND * (ALONG // 2) + 1
    if sliver:
        x[middle] += (1 - 1e-5) * (x[middle + 1] - x[middle])
    ring = [(j, (j + 1) % AROUND) for j in range(AROUND)]
    polygons: list[Sequence[int]] = [
        (a + k, a + k + AROUND, b + k + AROUND, b + k)
        for k in range(0, AROUND * (ALONG - 1), AROUND)
        for a, b in ring
    ]
    top, bottom, last = len(x) - 2, len(x) - 1, AROUND * (ALONG - 1)
    polygons += [(top, a, b) for a, b in ring]
    polygons += [(bottom, b + last, a + last) for a, b in ring]
    return x, polygons


def _obj(points: Array, polygons: Sequence[Sequence[int]]) -> str:
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    lines += ["f " + " ".join(str(node + 1) for node in polygon) for polygon in polygons]
    return "\n".join([*lines, ""])


def main(target: str) -> None:
    """Compile every kernel into a folder."""
    with TemporaryDirectory() as folder:
        config.CACHE_DIR = folder
        call_every_kernel()
        Path(target).mkdir(parents=True, exist_ok=True)
        for path in kept.folder().iterdir():
            if path.name != kept.LOCK:
                shutil.copyfile(path, Path(target) / path.name)


if __name__ == "__main__":
    main(*sys.argv[1:])

"""Random valid runs: each must end for a named reason, with a last frame in order.

Run as `python benchmarks/fuzz.py [--runs 200] [--first 0]`. Case k is made from seed k alone:
`--first k --runs 1` repeats it. Warnings are errors. Every accepted step is checked, not only
the last; ends with exit code 1 if a case breaks a rule, and names its seed.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse  # noqa: E402
import sys  # noqa: E402
import tempfile  # noqa: E402
import time  # noqa: E402
import traceback  # noqa: E402
import warnings  # noqa: E402
from collections import Counter  # noqa: E402
from dataclasses import dataclass, replace  # noqa: E402
from pathlib import Path  # noqa: E402
from typing import Any  # noqa: E402

import numpy as np  # noqa: E402
import pyvista  # noqa: E402

from amoeboid.config import Config, Initial, Mesh, Output, Time, resolved  # noqa: E402
from amoeboid.meshes.connectivity import icosphere  # noqa: E402
from amoeboid.meshes.geometry import MIN_QUALITY, area, mesh_quality, node_areas, volume  # noqa: E402
from amoeboid.model.parameters import Parameters  # noqa: E402
from amoeboid.output.folder import new_run  # noqa: E402
from amoeboid.simulation.loop import evolve, start  # noqa: E402
from amoeboid.simulation.step import Step  # noqa: E402
from amoeboid.simulation.step_length import Diverged  # noqa: E402
from amoeboid.validation import InvalidInput  # noqa: E402

LAWS = (
    "exponential",
    "inverse",
    "v_p0/(1 + c/c_r)",
    "v_p0/(1 + (c/c_r)**2)",
    "v_p0*exp(-(c/c_r)**2)",
    "v_p0*(1 - tanh(c/c_r))",
    "v_p0*(0.2 + exp(-c/c_r))",
)
MAX_STEPS = {"semi-implicit": 80, "explicit": 6}
# |A/A0 - 1|; the explicit scheme puts the error of one step right in the next.
AREA_ERROR = {"semi-implicit": 1e-10, "explicit": 1e-3}
FILAMENT_ERROR = 1e-10
# A run that takes so many steps without a thousandth of its time unit makes no progress.
MIN_PROGRESS = 1e-3


class Broken(AssertionError):
    """A rule that every run must keep is broken."""


@dataclass(frozen=True)
class Outcome:
    """How a case ended: the word that counts in the statistics, and the message that it gave."""

    word: str
    message: str
    steps: int
    seconds: float


def require(holds: bool, what: str) -> None:
    """Raise Broken unless it holds."""
    if not holds:
        raise Broken(what)


def power(rng: np.random.Generator, low: float, high: float) -> float:
    """10 to a uniform power."""
    return float(10.0 ** rng.uniform(low, high))


def random_parameters(rng: np.random.Generator) -> Parameters:
    """Parameters over many orders of magnitude, in units of any size."""
    length, period, viscosity = power(rng, -3, 3), power(rng, -2, 2), power(rng, -2, 2)
    often = rng.random(4)
    c0 = float(rng.uniform(0.1, 6.0))
    return Parameters(
        R0=length,
        delta_P=(0.0 if often[0] < 0.1 else power(rng, -1, 4)) * viscosity / period / length,
        eta_s=viscosity,
        eta_b=0.0 if often[1] < 0.05 else viscosity * power(rng, -2, 2),
        c0=c0 / length**2,
        c_r=1.0 / length**2,
        beta=(0.0 if often[2] < 0.2 else power(rng, -1, 1)) / period,
        D=(0.0 if often[3] < 0.1 else power(rng, -3, 1)) * length**2 / period,
        v_p0=power(rng, -1, 1.3) * length / period,
        alpha=float(rng.choice([0.0, rng.uniform(0.0, 1.0)])) * viscosity / period * length**2,
        law=str(rng.choice(LAWS)),
    )


def random_surface(rng: np.random.Generator, subdivisions: int) -> pyvista.PolyData:
    """A star-shaped surface of smooth lobes, with triangles of uneven size."""
    x, faces = icosphere(subdivisions)
    # nodes crowd towards some direction
    axis = rng.standard_normal(3)
    x = x + rng.uniform(0.0, 0.6) * axis / np.linalg.norm(axis)
    x = x / np.linalg.norm(x, axis=1, keepdims=True)
    radius = np.ones(len(x))
    for _ in range(int(rng.integers(1, 4))):
        k = rng.standard_normal(3) * rng.uniform(0.5, 2.5)
        radius += rng.uniform(0.0, 0.25) * np.sin(x @ k + rng.uniform(0, 2 * np.pi))
    points = radius[:, None] * x * power(rng, -3, 3) + rng.standard_normal(3)
    return pyvista.PolyData.from_regular_faces(points, faces)


def random_initial(rng: np.random.Generator, p: Parameters, folder: Path, sub: int) -> Initial:
    """Any mix of initial states, scaled such that c >= 0 mostly holds."""
    shares = rng.dirichlet(np.ones(3)) * rng.uniform(0.0, 0.9)
    lm = [(int(l), int(rng.integers(-l, l + 1))) for l in rng.integers(0, 5, 2)]  # noqa: E741
    initial = Initial(
        perturbation=float(shares[0]) * p.c0,
        direction=tuple(rng.standard_normal(3) * power(rng, -3, 3)),
        harmonics=tuple((l, m, float(shares[1]) * p.c0 / 2) for l, m in lm),  # noqa: E741
        noise=float(rng.choice([0.0, shares[2] * p.c0 / 4])),
        seed=int(rng.integers(1000)),
    )
    if rng.random() < 0.35:
        path = folder / f"surface.{rng.choice(['stl', 'ply', 'obj', 'vtp'])}"
        random_surface(rng, sub).save(path)
        initial = replace(initial, surface=str(path))
    return initial


def random_config(seed: int, folder: Path) -> Config:
    """The case of a seed; files that it needs are written to `folder`."""
    rng = np.random.default_rng(seed)
    p = random_parameters(rng)
    sub = int(rng.choice([1, 2]))
    explicit = rng.random() < 0.1
    unit = 1.0 / p.rate
    return Config(
        parameters=p,
        mesh=Mesh(subdivisions=sub),
        initial=random_initial(rng, p, folder, sub),
        time=Time(
            end=power(rng, -1, 1.5) * unit,
            scheme="explicit" if explicit else "semi-implicit",
            tolerance=power(rng, -4, -1.5),
            max_step=1e-6 * unit if explicit else None,
            stop_when_steady=bool(rng.random() < 0.7),
        ),
        output=Output(interval=power(rng, -1, 1) * unit),
    )


def check_step(config: Config, step: Step, filaments: float) -> None:
    """Raise Broken unless an accepted step is a cell in order. Nothing is taken from the run."""
    model, state, scheme = step.model, step.state, config.time.scheme
    faces, p = model.mesh.faces, config.parameters
    finite = (state.r, state.c, state.position, step.flow.v, state.zeta0, state.t, step.next_dt)
    require(all(np.all(np.isfinite(x)) for x in finite), "a value is not finite")
    require(state.c.min() >= 0, f"negative concentration {state.c.min()}")
    error = abs(area(state.r, faces) / model.A0 - 1)
    # a shape is imported to the precision of its file, but scaled to A0 exactly
    require(error < AREA_ERROR[scheme], f"area off by {error:.3g}")
    require(volume(state.r, faces) > 0, "the volume is not positive")
    quality = mesh_quality(state.r, faces)
    require(quality >= MIN_QUALITY, f"mesh quality {quality:.3g}")
    if p.beta == 0 and scheme != "explicit":
        lost = float(node_areas(state.r, faces) @ state.c) / filaments - 1
        require(abs(lost) < FILAMENT_ERROR, f"filaments off by {lost:.3g}")


def check_frame(folder: Path, step: Step) -> None:
    """Raise Broken unless the last frame is a closed surface that holds the last step."""
    frame = pyvista.read(sorted((folder / "frames").glob("*.vtp"))[-1])
    require(frame.is_all_triangles, "the frame has more than triangles")
    require(frame.is_manifold and frame.n_open_edges == 0, "the frame is not a closed manifold")
    require(frame.volume > 0, "the frame has no volume")
    require(np.array_equal(frame["c"], step.state.c), "the frame does not hold the last step")
    require(float(frame.field_data["t"][0]) == step.state.t, "the frame has another time")


def run_case(seed: int) -> Outcome:
    """One case from its seed to its last frame. Raises Broken, or what the program raises."""
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("error")
        config = random_config(seed, Path(folder))
        try:
            first = start(config)
        except InvalidInput as error:
            require(len(str(error)) > 20, "a refusal without a reason")
            return Outcome("refused", str(error), 0, time.perf_counter() - began)
        (Path(folder) / "run").mkdir()
        word, message, last = _followed(config, first, Path(folder) / "run")
        check_frame(Path(folder) / "run", last)
    return Outcome(word, message, last.number, time.perf_counter() - began)


def _followed(config: Config, first: Step, folder: Path) -> tuple[str, str, Step]:
    run, step, message = new_run(folder, config), first, ""
    filaments = float(node_areas(first.state.r, first.model.mesh.faces) @ first.state.c)
    scheme, end = config.time.scheme, resolved(config).time.end
    enough: Any = lambda s: "enough steps" if s.number >= MAX_STEPS[scheme] else None  # noqa: E731
    check_step(config, first, filaments)
    run.take(first)
    word = "nothing"
    try:
        for step in evolve(first, config.time, [enough]):
            check_step(config, step, filaments)
            row = run.take(step) or {}
            require(all(np.isfinite(x) for x in row.values()), f"an observable of {row}")
            word = step.ended or ""
        require(bool(word), "the run ended without a reason")
    except Diverged as error:
        word, message = "diverged", str(error)
        require(len(message) > 20, "a run that diverged without a reason")
    if word == "enough steps" and scheme != "explicit":
        share = step.state.t / min(end, 1.0 / step.model.rate)
        word = "no progress" if share < MIN_PROGRESS else word
        message = f"{share:.3g} of a unit of time, {step.rejected} rejected, dt = {step.dt:.3g}"
    run.save(step)
    run.write_manifest("diverged" if message else "finished")
    return word, message, step


def main() -> int:
    """Run the cases and print how they end."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="seed of the first case")
    parser.add_argument("--verbose", action="store_true", help="a line for every case")
    arguments = parser.parse_args()
    began, counts, broken = time.perf_counter(), Counter[str](), []
    for seed in range(arguments.first, arguments.first + arguments.runs):
        try:
            outcome = run_case(seed)
        except Exception as error:  # every one of them is a finding
            broken.append(seed)
            where = traceback.extract_tb(error.__traceback__)[-1]
            print(
                f"seed {seed}: {type(error).__name__}: {error} [{where.name}:{where.lineno}]",
                flush=True,
            )
            continue
        counts[outcome.word] += 1
        if arguments.verbose or outcome.word in ("diverged", "no progress"):
            print(
                f"seed {seed}: {outcome.word} after {outcome.steps} steps, "
                f"{outcome.seconds:.1f} s; {outcome.message}",
                flush=True,
            )
    print(f"{arguments.runs} cases in {time.perf_counter() - began:.0f} s: {dict(counts)}")
    print(f"broken: {broken or 'none'}")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())

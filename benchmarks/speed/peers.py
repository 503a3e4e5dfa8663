"""One force balance, K v = f, solved here and by NGSolve (pip, extra `peers`).

The same triangulation, the same linear elements, the same dissipation form and regularization: the
two matrices are the same up to rounding, so are the solutions, and that is checked first.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from benchmarks.speed.stopwatch import Timing, timed
from numpy.typing import NDArray

from amoeboid.meshes.geometry import geometry, weighted_area_gradient
from amoeboid.model.parameters import Parameters
from amoeboid.surface.dissipation import dissipation_blocks
from amoeboid.surface.force_balance import REGULARIZATION
from amoeboid.surface.initial import sphere
from amoeboid.surface.model import Model

Array = NDArray[np.float64]

AGREEMENT = 1e-6
"""Largest difference of the two solutions, relative to the largest velocity."""

REMEDY = "NGSolve is not installed; pip install 'amoeboid[peers]'"


class Disagreement(ArithmeticError):
    """The peer's solution is another one: its time would mean nothing."""


@dataclass(frozen=True, eq=False)
class Problem:
    """Forces (V, 3) on nodes r (V, 3) of a model; `shift` (V,) is added to the diagonal blocks."""

    model: Model
    r: Array
    force: Array
    shift: Array


def problem(p: Parameters, subdivisions: int) -> Problem:
    """The cell at rest, pulled by an uneven tension that rises from pole to pole."""
    model, rest = sphere(p, subdivisions)
    g = geometry(rest.r, model.mesh.faces)
    force = weighted_area_gradient(g, model.mesh.faces, rest.r[model.mesh.faces][..., 2].mean(1))
    shift = REGULARIZATION * (p.eta_s + p.eta_b) * g.node_areas / g.node_areas.mean()
    return Problem(model, rest.r, force, shift)


def compared_with_ngsolve(p: Parameters, subdivisions: int, repetitions: int) -> dict[str, Any]:
    """Times of both and their ratios, peer over ours. Raises Disagreement."""
    task = problem(p, subdivisions)
    entry: dict[str, Any] = {"peer": "NGSolve", "nodes": task.model.mesh.n_nodes}
    if find_spec("ngsolve") is None:
        return entry | {"missing": REMEDY}
    from importlib.metadata import version

    v, ours = _ours(task, repetitions)
    v_peer, theirs, solver = _ngsolve(task, repetitions)
    difference = float(np.abs(v - v_peer).max() / np.abs(v).max())
    if not difference < AGREEMENT:
        raise Disagreement(
            f"the solutions of NGSolve and amoeboid must agree to {AGREEMENT:g}, "
            f"they differ by {difference:.3g}"
        )
    return entry | {
        "version": version("ngsolve"),
        "solver": solver,
        "difference": difference,
        "ours": _summary(ours),
        "peer_times": _summary(theirs),
        "ratios": _ratios(ours, theirs),
    }


def _summary(times: dict[str, Timing]) -> dict[str, Any]:
    total = sum(t.best_s for t in times.values())
    return {name: asdict(t) for name, t in times.items()} | {"total_s": total}


def _ratios(ours: dict[str, Timing], theirs: dict[str, Timing]) -> dict[str, float]:
    ratios = {name: theirs[name].best_s / ours[name].best_s for name in ours}
    total = [sum(t.best_s for t in times.values()) for times in (theirs, ours)]
    return ratios | {"total": total[0] / total[1]}


def _ours(task: Problem, repetitions: int) -> tuple[Array, dict[str, Timing]]:
    model, mesh = task.model, task.model.mesh
    p = model.parameters
    found: dict[str, Any] = {}

    def assemble() -> None:
        blocks = dissipation_blocks(geometry(task.r, mesh.faces), mesh, p.eta_s, p.eta_b)
        blocks[model.diagonal] += task.shift[:, None, None] * np.eye(3)
        found["matrix"] = blocks

    def factor() -> None:
        found["factor"] = model.vector_solver.factor(found["matrix"])

    def solve() -> None:
        found["v"] = found["factor"].solve(task.force.ravel())

    tasks = {"assembly": assemble, "factorization": factor, "solve": solve}
    times = {name: timed(part, repetitions) for name, part in tasks.items()}
    return found["v"].reshape(-1, 3), times


def _ngsolve(task: Problem, repetitions: int) -> tuple[Array, dict[str, Timing], str]:
    from ngsolve import config

    form = _ngsolve_form(task)
    space, n = form.space, len(task.r)
    times = {"assembly": timed(form.Assemble, repetitions)}

    # whichever of its direct solvers is faster here
    inverses, factorizations = {}, {}
    for solver in ("sparsecholesky", "umfpack") if config.USE_UMFPACK else ("sparsecholesky",):

        def factor(solver: str = solver) -> None:
            inverses[solver] = form.mat.Inverse(space.FreeDofs(), inverse=solver)

        factorizations[solver] = timed(factor, repetitions)
    best = min(factorizations, key=lambda name: factorizations[name].best_s)
    times["factorization"] = factorizations[best]

    right = form.mat.CreateColVector()
    right.FV().NumPy()[:] = task.force.T.ravel()
    solution = right.CreateVector()

    def solve() -> None:
        solution.data = inverses[best] * right

    times["solve"] = timed(solve, repetitions)
    return solution.FV().NumPy().reshape(3, n).T.copy(), times, best


def _ngsolve_form(task: Problem) -> Any:
    """SI `dissipation` in NGSolve: eta_b tr e tr e' + 2 eta_s e:e' with e the tangential strain."""
    import ngsolve as ng
    from netgen.meshing import Element2D, FaceDescriptor, Mesh, MeshPoint, Pnt

    p = task.model.parameters
    mesh = Mesh(dim=3)
    mesh.Add(FaceDescriptor(surfnr=1, domin=1, bc=1))
    points = [mesh.Add(MeshPoint(Pnt(*map(float, x)))) for x in task.r]
    for face in task.model.mesh.faces:
        mesh.Add(Element2D(1, [points[i] for i in face]))
    space = ng.VectorH1(ng.Mesh(mesh), order=1)
    u, w = space.TnT()
    normal = ng.specialcf.normal(3)
    tangent = ng.Id(3) - ng.OuterProduct(normal, normal)
    # the surface gradient G has G P = G, so 2 e:e' = P G:G' + tr(G G'); constant on a triangle
    G, G_test = ng.Grad(u).Trace(), ng.Grad(w).Trace()
    strain = ng.InnerProduct(tangent * G, G_test) + ng.Trace(G * G_test)
    form = ng.BilinearForm(space, symmetric=True)
    middle = ng.IntegrationRule(points=[(1 / 3, 1 / 3)], weights=[1 / 2])
    form += (p.eta_s * strain + p.eta_b * ng.Trace(G) * ng.Trace(G_test)) * ng.ds(
        intrules={ng.TRIG: middle}
    )
    corners = ng.IntegrationRule(points=[(0, 0), (1, 0), (0, 1)], weights=[1 / 6] * 3)
    areas = geometry(task.r, task.model.mesh.faces).node_areas
    shift = float(task.shift[0] / areas[0])
    form += shift * u * w * ng.ds(intrules={ng.TRIG: corners})
    return form

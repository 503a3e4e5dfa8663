"""A run ends where its surface meets itself, and no step before that is lost or slowed down."""

from dataclasses import replace
from time import process_time

import numpy as np
import pytest

from amoeboid.config import Config, Mesh, Time
from amoeboid.meshes import intersections
from amoeboid.meshes.geometry import MIN_QUALITY, volume_centroid
from amoeboid.meshes.intersections import embedded, intersecting_pair
from amoeboid.model.parameters import Parameters
from amoeboid.observables import mesh_quality, reduced_volume
from amoeboid.simulation.loop import evolve, start
from amoeboid.simulation.step_length import Diverged
from amoeboid.surface.initial import sphere as resting_sphere
from amoeboid.surface.stepping import StepFailed, check_step
from surface.shapes import lumpy, sausage, sphere


def star_shaped(r, mesh):
    return bool(intersections._star_shaped(r - volume_centroid(r, mesh.faces), mesh.faces))


def test_a_rod_bent_into_a_ring_self_intersects():
    """The tips meet at the whole circle."""
    for angle, meets in ((60, False), (180, False), (350, False), (365, True), (400, True)):
        r, mesh = sausage(3, np.radians(angle))
        assert embedded(r, mesh.faces) == (not meets), angle
        assert (intersecting_pair(r, mesh.faces) is not None) == meets, angle
        if angle >= 180:  # the search decides
            assert not star_shaped(r, mesh)


def test_a_star_shaped_surface_needs_no_search_for_intersections(monkeypatch):
    def searched(*_):
        raise LookupError

    monkeypatch.setattr(intersections, "intersecting_pair", searched)
    for r, mesh in (sphere(2), lumpy(3), sausage(3, np.radians(60))):
        assert embedded(r, mesh.faces)
        with pytest.raises(LookupError):
            embedded(r, mesh.faces[:, ::-1])  # inside out


def test_two_nested_spheres_are_not_star_shaped():
    """Every triangle is seen from inside, but every direction twice."""
    r, mesh = sphere(2)
    turned = 1.01 * r @ np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    if np.linalg.det(turned[mesh.faces[0]]) < 0:
        turned = -turned
    both = np.concatenate([mesh.faces, mesh.faces + len(r)])
    assert not intersections._star_shaped(np.concatenate([r, turned]), both)
    assert not embedded(np.concatenate([r, turned]), both)


def test_a_step_into_contact_fails_with_its_reason():
    model, rest = resting_sphere(Parameters(), 3)
    apart, touching = (replace(rest, r=sausage(3, np.radians(a))[0]) for a in (350, 365))
    faces = model.mesh.faces
    model = replace(model, mesh=sausage(3, 1.0)[1])
    assert np.array_equal(model.mesh.faces, faces)
    check_step(model, apart, apart)
    with pytest.raises(StepFailed, match="self-intersects; this model has no contact forces"):
        check_step(model, apart, touching)


CONTACT = Config(
    parameters=Parameters(delta_P=3.0, D=0.4, v_p0=8.0),
    mesh=Mesh(subdivisions=2),
    time=Time(end=3.0),
)


@pytest.fixture(scope="module")
def contact():
    """All steps of a run that ends in contact, and how it ends."""
    steps = [start(CONTACT)]
    with pytest.raises(Diverged) as error:
        for step in evolve(steps[0], CONTACT.time):
            steps.append(step)
    return steps, str(error.value)


def test_a_run_follows_the_instability_until_parts_of_the_cell_meet(contact):
    """The polarized cell folds; every state of the run is embedded, the mesh in order."""
    steps, why = contact
    assert "the surface self-intersects" in why
    last = steps[-1]
    assert last.state.t > 0.5
    # 0.60 to 0.62 at contact, as the mesh is changed sooner or later
    assert reduced_volume(last.cell) < 0.65
    for step in steps:
        assert intersecting_pair(step.state.r, step.model.mesh.faces) is None
        assert mesh_quality(step.cell) > MIN_QUALITY
    # the end is that of the surface, not of a step that was too long
    assert last.dt < 1e-3


def test_contact_is_found_again_by_a_run_that_goes_on_from_any_step(contact):
    steps, why = contact
    again = []
    with pytest.raises(Diverged) as error:
        for step in evolve(steps[-20], CONTACT.time):
            again.append(step)
    assert str(error.value) == why
    assert np.array_equal(again[-1].state.r, steps[-1].state.r)


def test_the_check_costs_an_ordinary_run_next_to_nothing():
    """Convex or nearly: one pass over the triangles. Measured against the step itself."""
    first = start(Config())
    run = evolve(first, Time(end=50.0, stop_when_steady=False))
    step = next(run)
    check, whole = [], []
    for _ in range(10):
        began = process_time()
        step = next(run)
        whole.append(process_time() - began)
        began = process_time()
        assert embedded(step.state.r, step.model.mesh.faces)
        check.append(process_time() - began)
    print(min(check) / min(whole))
    assert min(check) < 0.05 * min(whole)


def test_the_search_is_cheap_beside_a_step():
    r, mesh = sausage(3, np.radians(300))
    assert not star_shaped(r, mesh)
    took = []
    for _ in range(10):
        began = process_time()
        assert embedded(r, mesh.faces)
        took.append(process_time() - began)
    print(min(took))
    assert min(took) < 0.01

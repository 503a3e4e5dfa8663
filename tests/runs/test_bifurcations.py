"""What leaves branches of 3D cells where they lose stability: circles, helices, wobbles."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import amoeboid as am
from amoeboid.config import Time
from amoeboid.runs import bifurcations
from amoeboid.runs.bifurcations import is_even, mirrors, neutral_between
from amoeboid.studies.branch import BIFURCATION, HOPF
from amoeboid.surface.stability import Growth
from amoeboid.surface.steady import NotSteady

TURNS = am.Parameters(D=0.4, delta_P=20.0)
FAST = replace(TURNS, v_p0=8.0)


@cache
def straight():
    return am.branch(TURNS, "v_p0", 7.86, 7.91, mesh=am.Icosphere(2))


@cache
def circles():
    return am.branch(TURNS, "v_p0", 7.8, 8.11, through=straight().bifurcations[0])


@cache
def helices():
    return am.branch(TURNS, "v_p0", 7.8, 8.13, through=circles().bifurcations[1])


def test_circles_become_helices_where_a_mode_out_of_their_plane_is_neutral():
    onset, point = circles().bifurcations
    assert (onset.leads_to, point.leads_to) == ("circle", "helix")
    assert (point.kind, point.m, point.in_plane) == (BIFURCATION, None, False)
    assert repr(point).startswith("bifurcation to helices at v_p0 = 8.069")
    # by the distance from the onset of circles, which the error of the mesh moves as well
    assert point.number - onset.number == pytest.approx(0.1982, rel=0.01)
    # before it circles lie in a plane of the mesh, and the stable ones end there
    assert all(abs(cell.torsion) < 1e-5 for cell in circles().states)
    stable = [cell.number("turning") for cell in circles().states if cell.stable]
    assert max(stable) < point.state.number("turning")


def test_helices_leave_the_circles_supercritically_and_are_stable():
    point = circles().bifurcations[1]
    cells = helices().states
    assert {cell.path for cell in cells} == {"helix"}
    assert all(cell.stable for cell in cells)
    # the torsion is that of either hand, and grows like the root of the distance
    shares = [cell.number("torsion") ** 2 / (cell.parameters.v_p0 - point.number) for cell in cells]
    assert shares == pytest.approx([0.14] * len(cells), rel=0.08)


@pytest.mark.slow
def test_a_circle_decays_twice_as_fast_as_bending_of_the_straight_cell_grows():
    """Supercritical. Rotations about the axis of the straight cell are neutral, and left out.

    On 642 nodes: on fewer the wide circles next to the onset are not told from straight cells.
    """
    along = am.branch(TURNS, "v_p0", 7.86, 7.91, mesh=am.Icosphere(3))
    start, point = along.states[0], along.bifurcations[0]
    circle = am.branch(TURNS, "v_p0", 7.86, 7.93, through=point, stability=False).states[0]
    bending = am.steady_state(circle.parameters, start=start).number("growth_rate")
    assert bending > 0.0
    assert circle.number("growth_rate") == pytest.approx(-2.0 * bending, rel=0.25)


@pytest.mark.slow
def test_circles_leave_straight_cells_in_the_pressure_too():
    """At v_p0 = 8 where the onset in v_p0 has come to it; the same circles lie below."""
    found = am.branch(FAST, "delta_P", 20.5, 22, mesh=am.Icosphere(2))
    (point,) = found.bifurcations
    assert (point.m, point.leads_to) == (1, "circle")
    left = am.branch(FAST, "delta_P", 19.9, 22, through=point, stability=False)
    assert left.complete
    cell = left.states[-1]
    assert (cell.parameters.delta_P, cell.path) == (19.9, "circle")
    # the cell that is found along v_p0, too, but for where its nodes lie (162 of them)
    known = am.steady_state(cell.parameters, start=circles().states[1])
    assert cell.turning == pytest.approx(known.turning, rel=0.01)


def test_images_in_mirror_planes_of_the_mesh_leave_the_straight_cell_alone():
    cell = straight().states[0]
    found = mirrors(cell)
    assert len(found) == 2
    for image in found:
        assert np.array_equal(image[image], np.arange(len(image)))
        assert np.abs(cell.cell.c[image] - cell.cell.c).max() < 1e-6
    # the mesh of a cell off its axes has none
    initial = am.Initial(direction=(0.3, 0.5, 0.8))
    run = am.simulate(FAST, mesh=am.Icosphere(1), initial=initial, until=am.time(2.0))
    assert mirrors(am.steady_state(FAST, start=run.final)) == []


def test_modes_are_even_or_odd_in_the_plane_of_a_circle():
    cell = circles().states[1]
    normal = cell.plain_angular_velocity / np.linalg.norm(cell.plain_angular_velocity)
    height = (cell.cell.r - cell.cell.r.mean(axis=0)) @ normal
    assert not is_even(cell, np.tile(height, 2).astype(complex))
    assert is_even(cell, np.tile(height**2, 2).astype(complex))


@pytest.mark.parametrize("offset", [0.0, 0.3])
def test_a_jump_of_the_growth_rate_is_a_bifurcation_that_the_mesh_blurs(offset, monkeypatch):
    """The rate x, or that of an imperfect pitchfork on the halves that the iteration falls on."""
    cell = straight().states[0]

    def rated(q, _):
        rate = q + offset * np.sign(q)
        return bifurcations.Neutral(q, cell, Growth(rate, 1e-4), np.ones(3, complex))

    monkeypatch.setattr(bifurcations, "_rated", rated)
    found = neutral_between(lambda q, _: cell, (-0.9, cell), (1.3, cell), 1.0)
    assert found.jumps == (offset > 0.0)
    assert abs(found.q) < (1e-4 if offset == 0.0 else 0.1)


def test_a_growth_rate_that_is_not_found_locates_nothing():
    cell = replace(straight().states[0])
    cell.__dict__["growth"] = lambda _: (Growth(None, problem="no step"), None)
    with pytest.raises(NotSteady, match="at 1 could not be determined: no step"):
        neutral_between(lambda q, _: cell, (1.0, cell), (2.0, cell), 1.0)


@pytest.mark.slow
def test_a_helix_past_a_Hopf_bifurcation_wobbles_at_its_frequency():
    """In a run from the helix at it, while the wobble grows; later it ends in contact."""
    bent = am.branch(TURNS, "v_p0", 7.86, 7.91, mesh=am.Icosphere(3)).bifurcations[0]
    climbs = am.branch(TURNS, "v_p0", 7.8, 8.11, through=bent).bifurcations[1]
    along = am.branch(TURNS, "v_p0", 7.8, 8.388, through=climbs, stability=False)
    p, start = along.states[-1].parameters, along.states[-1]
    left = am.branch(p, "delta_P", 13.5, 20.0, through=start)
    (point,) = left.bifurcations
    assert (point.kind, point.leads_to) == (HOPF, "wobble")
    assert "helices that wobble, frequency" in repr(point)
    assert point.number == pytest.approx(13.95, abs=0.1)
    p = p.replace(delta_P=13.6)
    cell = am.steady_state(p, start=point.state)
    assert cell.stability == "unstable"
    run = am.simulate(p, initial=point.state, time=Time(end=20.0, tolerance=1e-5))
    t = np.linspace(8.0, 20.0, 4001)
    c = np.interp(t, run.t, [row["c_rear"] for row in run.rows])
    c -= np.polyval(np.polyfit(t, c, 3), t)
    up = np.flatnonzero((c[:-1] < 0.0) & (c[1:] >= 0.0))
    frequency = 2.0 * np.pi / np.diff(t[up]).mean()
    print(point, cell.frequency, cell.growth_rate, frequency)
    assert frequency == pytest.approx(cell.frequency, rel=0.02)

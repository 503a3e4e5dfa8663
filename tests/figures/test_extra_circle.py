"""The circling cell: what is measured on a path, and the run against one without a mesh."""

from itertools import pairwise

import numpy as np
import pytest

from amoeboid import Parameters, figures
from amoeboid.figures.gallery import extra_circle
from amoeboid.figures.results import Results
from amoeboid.meshes.relaxation import uniform_icosphere
from amoeboid.model.natural_units import in_units
from amoeboid.model.units import Units
from figures.drawn import drawn, lines

OTHER_UNITS = Units(length=2.0, time=0.5, mass=3.0, filaments=7.0)
TILTED = np.linalg.qr(np.array([[1.0, 0.2, 0.5], [0.1, 1.0, -0.3], [-0.4, 0.6, 1.0]]))[0]


def straight_then_round(radius=3.0):
    """A straight path of 4 that goes over into a circle and three quarters, and its headings."""
    angle = np.linspace(0.0, 3.5 * np.pi, 300)
    circle = radius * np.column_stack([np.sin(angle), 1.0 - np.cos(angle), 0.0 * angle])
    line = np.column_stack([np.linspace(-4.0, 0.0, 30)[:-1], np.zeros((29, 2))])
    heading = np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    before = np.tile([1.0, 0.0, 0.0], (29, 1))
    return np.concatenate([line, circle]) @ TILTED.T, np.concatenate([before, heading]) @ TILTED.T


def test_circle_is_fitted_to_points_on_an_arc():
    angle = np.linspace(0.3, 1.9, 20)
    points = np.array([2.0, -7.0]) + 3.5 * np.column_stack([np.cos(angle), np.sin(angle)])
    center, radius = extra_circle.fitted_circle(points)
    np.testing.assert_allclose([*center, radius], [2.0, -7.0, 3.5], rtol=1e-10)


def test_turning_is_that_of_the_heading_and_rest_does_not_count():
    _, heading = straight_then_round()
    turned = extra_circle.turned_by(np.concatenate([np.zeros((3, 3)), heading]))
    np.testing.assert_array_equal(turned[:30], 0.0)
    assert turned[-1] == pytest.approx(3.5 * np.pi, rel=1e-9)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_plane_is_that_of_the_circle_and_the_path_starts_on_the_left(side):
    path = straight_then_round()[0] @ TILTED * [1.0, side, 1.0] @ TILTED.T  # to the left, right
    plane = extra_circle.plane_of(path, 100)
    flat = (path - path[0]) @ plane.T
    np.testing.assert_allclose(plane @ plane.T, np.eye(3), atol=1e-14)
    assert np.abs(flat[:, 2]).max() < 1e-12
    assert flat[:, 0].mean() > 0.0
    about = flat[100:] - flat[100:].mean(axis=0)
    assert np.cross(about[:-1], about[1:]).sum(axis=0)[2] > 0.0  # counterclockwise


def test_section_of_a_sphere_is_its_equator():
    r, faces = uniform_icosphere(3)
    pieces = extra_circle.section(r, faces, r[:, 0])
    ends = pieces[:, :4].reshape(-1, 2)
    length = np.hypot(*(pieces[:, 2:4] - pieces[:, :2]).T).sum()
    assert np.abs(np.hypot(*ends.T) - 1.0).max() < 0.02
    assert length == pytest.approx(2.0 * np.pi, rel=0.01)
    np.testing.assert_allclose(pieces[:, 4], pieces[:, [0, 2]].mean(axis=1), atol=1e-12)


def test_circle_of_a_path_and_none_of_a_helix():
    path, heading = straight_then_round()
    flat = (path - path[0]) @ extra_circle.plane_of(path, 100).T
    turned = extra_circle.turned_by(heading)
    t, whole = np.arange(len(path)) * 0.1, int(np.searchsorted(turned, 1.5 * np.pi)) - 1
    p = Parameters()
    way = 3.0 * 3.5 * np.pi / 29.9  # of the circle per unit time
    found = extra_circle._circle(p, t, flat, turned, np.full(len(t), way), whole)
    assert found["radius"] == pytest.approx(3.0, rel=1e-9)
    assert found["turning"] == pytest.approx(way / 3.0, rel=1e-9)
    # on a helix the way is longer than its projection
    found = extra_circle._circle(p, t, flat, turned, np.full(len(t), 1.2 * way), whole)
    assert np.isnan(found["radius"])


def test_reference_is_known_in_any_units_and_for_its_cell_alone():
    p = extra_circle.CIRCLES
    other = in_units(p, OTHER_UNITS)
    assert extra_circle.is_reference(p)
    assert extra_circle.is_reference(other)
    for change in ({"eta_b": 2.0}, {"v_p0": 7.0}, {"alpha": 0.1}, {"beta": 0.0}, {"delta_P": 30.0}):
        assert not extra_circle.is_reference(p.replace(**change)), change
    empty = np.zeros(2)
    found = extra_circle._circle(other, empty, empty, empty, empty, None)
    assert found["reference_radius"] * OTHER_UNITS.of("L") == pytest.approx(13.45)
    assert found["reference_turning"] * OTHER_UNITS.of("1/T") == pytest.approx(0.165)


def test_run_that_ends_before_it_turns_says_so(monkeypatch):
    monkeypatch.setattr(extra_circle, "SUBDIVISIONS", 1)
    monkeypatch.setattr(extra_circle, "END", 1.0)
    data = figures.extra_circle.data()
    assert "not in a circle" in data.notes[0]
    assert not data["path"]["last_turn"].any()
    assert data["path"]["t"][-1] == 1.0
    assert len(np.unique(data["outlines"]["t"])) == extra_circle.OUTLINES
    (axes,) = drawn(figures.extra_circle, data)
    assert axes.get_legend() is None


@pytest.mark.slow
def test_circle_is_that_of_the_relative_equilibrium_within_the_error_of_the_mesh():
    """TURNING, SPEED, RADIUS: spherical harmonics without a mesh (docs/large-deformation.md).

    The errors of seed 1 on 642 nodes stand there: 6.5, -0.24 and -6.5 %.
    """
    data = figures.extra_circle.data()
    circle = data["circle"]
    errors = [
        circle[k][0] / circle[f"reference_{k}"][0] - 1.0 for k in ("turning", "speed", "radius")
    ]
    np.testing.assert_allclose(errors, [0.065, -0.0024, -0.065], atol=0.005)
    path = data["path"]
    assert np.ptp(path["z"][path["last_turn"]]) < 0.02 * circle["radius"][0]
    assert np.ptp(path["turned"][path["last_turn"]]) == pytest.approx(2 * np.pi, abs=0.1)


def made_up_run(p, subdivisions, end, outlines):
    """A circle of radius 13 and 1.25 turns."""
    turned = np.linspace(0.0, 2.5 * np.pi, 126)
    t = turned / 0.17
    path = 13.0 * np.column_stack([np.sin(turned), 1.0 - np.cos(turned), 0.0 * turned])
    angle = np.linspace(0.0, 2.0 * np.pi, 13)
    round_ = np.column_stack([np.cos(angle), np.sin(angle)])
    pieces = [
        [t[k], *(path[k, :2] + a), *(path[k, :2] + b), 2.0 + a[0]]
        for k in (0, 60, 125)
        for a, b in pairwise(round_)
    ]
    return {
        "path": path.tolist(), "t": t.tolist(), "turned": turned.tolist(),
        "speed": np.full(len(t), 13.0 * 0.17).tolist(), "whole": 25, "sections": pieces,
        "status": "stopped", "ended": "parts of the cell meet",
    }  # fmt: skip


def test_drawing_shows_the_last_turn_about_the_center_of_the_reference(monkeypatch):
    monkeypatch.setattr(extra_circle, "circling_run", made_up_run)
    data = figures.extra_circle.data(results=Results())
    circle = data["circle"]
    np.testing.assert_allclose([circle[k][0] for k in ("radius", "turning")], [13.0, 0.17])
    assert data.problems == ("the run ended early: parts of the cell meet",)
    assert "error of this run: turning +3 %" in data.notes[-1]
    (axes,) = drawn(figures.extra_circle, data)
    (turn,) = (line for name, line in lines(axes).items() if "radius 13" in name)
    np.testing.assert_allclose(np.hypot(turn[0], turn[1] - 13.0), 13.0)
    (reference,) = (line for name, line in lines(axes).items() if "without mesh" in name)
    np.testing.assert_allclose(np.hypot(reference[0], reference[1] - 13.0), 13.45, rtol=1e-9)
    assert axes.get_aspect() == 1.0
    without = figures.extra_circle.data(extra_circle.CIRCLES.replace(v_p0=7.0), Results())
    assert "no solution without a mesh is known" in without.notes[-1]
    (axes,) = drawn(figures.extra_circle, without)
    assert not any("without mesh" in name for name in lines(axes))

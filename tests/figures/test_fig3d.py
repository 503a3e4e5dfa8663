"""Figure 3D: the run against the axisymmetric solver, and the files that turn the cell."""

import json
import re

import numpy as np
import pytest
from matplotlib.collections import PolyCollection

from amoeboid import Parameters, figures
from amoeboid.config import Config, Initial
from amoeboid.figures.gallery import fig3d
from amoeboid.figures.page import Scene, page
from amoeboid.model.natural_units import in_units
from amoeboid.model.units import Units
from amoeboid.observables import max_retrograde_speed
from amoeboid.output.frame_reader import read_frame
from amoeboid.simulation.loop import start
from figures.drawn import drawn

# By the axisymmetric solver, which has no mesh (`amoeboid steady --set D=0.4 --set v_p0=6`).
SPECTRAL = {
    "max_retrograde_speed": 1.834173,
    "c_front": 0.774928,
    "c_rear": 13.138030,
    "zeta0": 155.064706,
}
OTHER_UNITS = Units(length=2.0, time=0.5, mass=3.0, filaments=7.0)


@pytest.fixture
def coarse(monkeypatch):
    """The figure on 162 nodes."""
    monkeypatch.setattr(fig3d, "SUBDIVISIONS", 2)
    return figures.fig3d.data()


def vectors(table, *names):
    return np.column_stack([table[name] for name in names])


def scene_of(html):
    (found,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', html)
    return json.loads(found)


def test_cell_is_that_of_the_axisymmetric_solver(coarse):
    cell = coarse["cell"]
    assert cell["steady"][0]
    assert cell["stability"][0] == "stable"
    for name, value in SPECTRAL.items():
        # error of second order in the length of an edge: 0.2 % on 642 nodes, 4 times that on 162
        assert cell[name][0] == pytest.approx(value, rel=0.012), name


@pytest.mark.slow
def test_cell_of_the_paper_on_its_642_nodes():
    data = figures.fig3d.data()
    for name, value in SPECTRAL.items():
        assert data["cell"][name][0] == pytest.approx(value, rel=0.003), name
    # as `amoeboid run` finds them, to all the digits that it prints
    assert data["cell"]["max_retrograde_speed"][0] == pytest.approx(1.830526, abs=2e-6)
    assert data["cell"]["c_rear"][0] == pytest.approx(13.157876, abs=2e-5)


def test_rear_lies_at_positive_z_and_the_flow_goes_there(coarse):
    nodes, triangles = coarse["nodes"], coarse["triangles"]
    x, flow = vectors(nodes, *"xyz"), vectors(nodes, "flow_x", "flow_y", "flow_z")
    assert x[np.argmax(nodes["c"]), 2] > 0.95
    assert x[np.argmin(nodes["c"]), 2] < -0.95
    assert np.all(flow[np.abs(x[:, 2]) < 0.9, 2] > 0.0)
    corners = x[vectors(triangles, *"abc")]
    volume = np.linalg.det(corners).sum() / 6.0  # positive: triangles look outward
    assert volume == pytest.approx(4.0 / 3.0 * np.pi, rel=0.03)


def test_frame_is_one_that_a_run_starts_from(coarse, tmp_path):
    path = tmp_path / "fig3d.vtp"
    path.write_bytes(coarse.files["vtp"])
    frame = read_frame(path, coarse.parameters)
    np.testing.assert_array_equal(frame.state.c, coarse["nodes"]["c"])
    first = start(Config(parameters=coarse.parameters, initial=Initial(from_frame=str(path))))
    np.testing.assert_allclose(np.sort(first.state.c), np.sort(frame.state.c), rtol=1e-14)
    speed = coarse["cell"]["max_retrograde_speed"][0]
    # a steady run still changes by 1e-5, relative to its rate (STEADY in surface.steadiness)
    assert max_retrograde_speed(first.cell) == pytest.approx(speed, rel=1e-5)


def test_page_holds_the_cell_and_needs_nothing_else(coarse):
    html, nodes = coarse.files["html"], coarse["nodes"]
    assert not re.search(r"https?:|\bsrc=|<link|@import|import\(|fetch\(|\{\{", html)
    scene = scene_of(html)
    np.testing.assert_allclose(scene["nodes"], vectors(nodes, *"xyz"), atol=5.1e-5)
    np.testing.assert_allclose(scene["c"], nodes["c"], rtol=5.1e-4)
    np.testing.assert_array_equal(scene["faces"], vectors(coarse["triangles"], *"abc"))
    assert len(scene["arrows"]) == nodes["arrow"].sum()
    longest = max(np.linalg.norm(by) for _, *by in scene["arrows"])
    assert 0.9 * fig3d.ARROW < longest < 1.01 * fig3d.ARROW
    assert (scene["low"], scene["high"]) == (nodes["c"].min(), nodes["c"].max())
    (about,) = re.findall(r'aria-label="(.*?)"', html)
    assert f"{coarse['cell']['c_rear'][0]:.5g} c_r at the rear" in about


def test_words_on_the_page_are_no_markup():
    triangle = np.eye(3)
    scene = Scene(
        title='a "cell" </script><b>',
        about='"<i>',
        label="c [{{data}}]",
        values={"<": "</table>"},
        nodes=triangle,
        faces=np.array([[0, 1, 2]]),
        c=np.ones(3),
        limits=(0.0, 1.0),
        arrows=triangle,
        chosen=np.zeros(3, dtype=bool),
        view=triangle,
        moves=False,
    )
    html = page(scene)
    assert html.count("</script>") == 2
    assert "<b>" not in html
    assert "<i>" not in html
    assert "<span>c [{{data}}]</span>" in html
    assert scene_of(html)["faces"] == [[0, 1, 2]]


def test_hemispheres_are_the_whole_cell(coarse):
    """The areas of the polygons on both sides of the cut are those of the triangles."""
    nodes = coarse["nodes"]
    corners = vectors(nodes, *"xyz")[vectors(coarse["triangles"], *"abc")]
    c = nodes["c"][vectors(coarse["triangles"], *"abc")]

    def area(polygon):
        fan = np.cross(polygon[1:-1] - polygon[0], polygon[2:] - polygon[0])
        return 0.5 * np.linalg.norm(fan, axis=1).sum()

    halves = [fig3d._half(corners, c, sign)[0] for sign in (1.0, -1.0)]
    assert all(np.all(one[:, 0] >= 0.0) for one in halves[0])
    assert all(np.all(one[:, 0] <= 0.0) for one in halves[1])
    whole = sum(area(one) for one in corners)
    assert sum(area(one) for half in halves for one in half) == pytest.approx(whole, rel=1e-12)
    rim = sum(np.linalg.norm(b - a) for a, b in fig3d._rim(halves[0]))
    assert rim == pytest.approx(2.0 * np.pi, rel=0.02)


def test_cell_below_the_threshold_has_no_arrows(monkeypatch):
    monkeypatch.setattr(fig3d, "SUBDIVISIONS", 1)
    data = figures.fig3d.data(Parameters(D=0.4, v_p0=1.0))
    assert not data["nodes"]["arrow"].any()
    assert "does not move" in data.files["html"]
    (axes,) = drawn(figures.fig3d, data)
    assert not any("flow" in text.get_text() for text in axes.texts)


def test_figure_does_not_depend_on_the_units(monkeypatch):
    monkeypatch.setattr(fig3d, "SUBDIVISIONS", 1)
    one = figures.fig3d.data()
    other = figures.fig3d.data(in_units(one.parameters, OTHER_UNITS))
    np.testing.assert_allclose(
        other["nodes"]["c"] * OTHER_UNITS.of("N/L^2"), one["nodes"]["c"], rtol=1e-6
    )
    for key in ("nodes", "faces"):
        np.testing.assert_allclose(
            scene_of(other.files["html"])[key], scene_of(one.files["html"])[key], atol=2e-4
        )
    np.testing.assert_array_equal(one["nodes"]["arrow"], other["nodes"]["arrow"])


def test_drawing_has_the_arrows_of_the_nearer_half_and_both_hemispheres(coarse):
    (axes,) = drawn(figures.fig3d, coarse)
    assert {"$v_\\mathrm{mig}$", "flow 1.82 $R_0$ β"} <= {text.get_text() for text in axes.texts}
    colored = [
        one
        for one in axes.collections
        if isinstance(one, PolyCollection) and one.get_array() is not None
    ]
    assert [one.get_alpha() for one in colored] == [0.25, 1.0, 1.0, 0.25]
    c = coarse["nodes"]["c"]
    assert all(one.get_clim() == (c.min(), c.max()) for one in colored)

"""Pictures say what they show in which unit, how large it is and when."""

import re

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread

from amoeboid.config import Config, Initial, Mesh, Time
from amoeboid.model.parameters import DIMENSIONS, Parameters
from amoeboid.plotting import branches, cell, cell_picture
from amoeboid.plotting.canvas import Canvas, round_length
from amoeboid.plotting.trajectory import save_trajectory_picture
from amoeboid.simulation.loop import evolve, start
from amoeboid.studies.branch import branch
from amoeboid.studies.states import steady_states

UNIT = re.compile(r"\[[^]]+\]")


@pytest.fixture
def figures(monkeypatch):
    """The figures that are saved."""
    saved, save = [], Figure.savefig
    monkeypatch.setattr(
        Figure, "savefig", lambda self, *a, **k: (saved.append(self), save(self, *a, **k))[1]
    )
    return saved


def axes_without_unit(figure):
    """Labels of the axes and color bars that show numbers but no unit."""
    figure.canvas.draw()
    found = []
    for axes in figure.axes:
        if axes.axison:
            for axis in (axes.xaxis, axes.yaxis):
                shown = [
                    tick
                    for tick in axis.get_major_ticks()
                    if (tick.label1.get_visible() and tick.label1.get_text())
                    or (tick.label2.get_visible() and tick.label2.get_text())
                ]
                text = axis.get_label_text()
                if shown and not UNIT.search(text) and "as a share of" not in text:
                    found.append(text)
    return found


def test_every_axis_and_color_bar_of_a_figure_has_its_unit(figures, tmp_path):
    p = Parameters(D=0.4, v_p0=6.0)
    states = steady_states(p, (1,))
    branches.write_states(states, tmp_path / "states.png")
    branches.write_branch(branch(p, "v_p0", 5.5, 6.5), tmp_path / "branch.png")
    assert [axes_without_unit(figure) for figure in figures] == [[], []]
    texts = [text.get_text() for text in figures[0].findobj() if hasattr(text, "get_text")]
    assert sum(text.startswith("$R_0$ = 1 [L]") for text in texts) == len(states)


def test_the_picture_of_a_trajectory_says_what_it_assumes_and_how_long_it_is(monkeypatch, tmp_path):
    written, text = [], Canvas.text
    monkeypatch.setattr(
        Canvas, "text", lambda self, *a, **k: (written.append(a[1]), text(self, *a, **k))[1]
    )
    t = np.linspace(0.0, 9.0, 50)
    assert save_trajectory_picture(tmp_path / "way.png", t, np.column_stack([t, t**2, 0 * t]), 1.0)
    assert any("drag" in words for words in written)
    assert not any("laboratory" in words for words in written)
    assert "20 R0" in written  # the largest round length below a quarter of the way, 81 R0
    assert {"0", "9", "time t [T] (dark dot: start)"} <= set(written)


def test_the_label_of_a_parameter_has_its_dimension():
    for name, unit in DIMENSIONS.items():
        label = branches._label(Parameters(), name, unit)
        assert re.sub(r"\$\^\{(\d+)\}\$", r"^\1", label).endswith(f"[{unit}]")
        assert not label.startswith(name)
    assert DIMENSIONS.keys() >= {"v_p0", "D", "delta_P", "R0", "alpha"}


@pytest.mark.parametrize("scale", [pytest.param(1.0, marks=pytest.mark.slow), 1e-5])
def test_the_picture_of_a_cell_has_scale_time_and_units(scale, monkeypatch, tmp_path):
    p = Parameters(R0=scale, D=0.4 * scale**2, v_p0=6.0 * scale, delta_P=300.0 / scale)
    initial = Initial(perturbation=1.0)
    *_, last = evolve(start(Config(parameters=p, mesh=Mesh(subdivisions=1), initial=initial)),
                      Time(end=0.5))  # fmt: skip
    written = []
    text = Canvas.text
    monkeypatch.setattr(Canvas, "text", lambda *given: (written.append(given[2]), text(*given))[1])
    scene = {k: np.asarray(v) for k, v in cell.scene(last.cell).items()}
    cell_picture.drawn(scene).save(tmp_path / "here.png")
    cell.save_cell_picture(tmp_path / "cell.png", last)
    assert "front" in written
    assert f"{0.5 * scale:g} [L]" in written
    assert any(text.endswith("[L/T]") for text in written)
    assert any(text.strip().endswith("[N/L^2]") for text in written)
    assert "t = 0.5 [T]" in written
    assert np.ptp(imread(tmp_path / "cell.png")[..., :3]) > 0.5
    assert np.array_equal(imread(tmp_path / "cell.png"), imread(tmp_path / "here.png"))


def test_a_point_at_shares_of_a_picture_is_seen_there():
    axes = cell_picture.seen_along(np.array([0.0, 0.6, 0.8]), np.array([1.0, 0.0, 0.0]))
    view = cell_picture.View(axes, np.array([1.0, -2.0, 0.5]), 1.7, (0.0, 1.0), 1.0)
    canvas = Canvas(*view.window, view.axes, view.middle, cell_picture.HEIGHT * view.size)
    place = canvas.place(cell_picture._at(view, 0.03, 0.815))
    np.testing.assert_allclose(place, canvas.share(0.03, 0.815), atol=1e-9 * view.window[0])


def test_scale_bars_have_round_lengths():
    found = [round_length(x) for x in (0.6, 6.0, 1.99e-6, 1.0, 2.0, 4.9, 5.0, 99.0)]
    np.testing.assert_allclose(found, [0.5, 5.0, 1e-6, 1.0, 2.0, 2.0, 5.0, 50.0])

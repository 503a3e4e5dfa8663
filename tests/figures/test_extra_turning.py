"""The figure of straight, circling and helical cells."""

import numpy as np
import pytest

from amoeboid import InvalidInput, Parameters, figures
from amoeboid.figures.gallery import extra_turning
from amoeboid.figures.results import Results
from figures.drawn import drawn


def test_the_onset_of_bending_is_that_of_the_axisymmetric_branch():
    assert extra_turning.bending_onset(extra_turning.FIGURE.parameters) == pytest.approx(
        7.90323, abs=2e-5
    )


def test_a_cell_that_does_not_bend_has_no_branches_and_says_so():
    data = figures.extra_turning.data(Parameters(D=0.4))
    assert len(data["branches"]) == len(data["points"]) == 0
    assert "no straight cell becomes unstable to bending" in data.problems[0]
    assert [line.get_label() for line in drawn(figures.extra_turning, data)[0].lines] == [
        *extra_turning.PATHS, "unstable",
    ]  # fmt: skip
    with pytest.raises(InvalidInput, match="beta must be > 0"):
        figures.extra_turning.data(Parameters(beta=0.0))


@pytest.mark.slow
def test_circles_leave_straight_cells_and_helices_circles(monkeypatch):
    monkeypatch.setattr(extra_turning, "SUBDIVISIONS", 2)
    data = figures.extra_turning.data()
    table, points = data["branches"], data["points"]
    assert list(points["what"]) == ["bifurcation of m = 1", "bifurcation to helices"]
    assert not data.problems
    paths = np.asarray(table["path"])
    assert list(dict.fromkeys(paths)) == ["straight", "circle", "helix"]
    first, second = points["v_p0"]
    stable = np.asarray(table["stable"], dtype=bool)
    v, turning, torsion = (table[name] for name in ("v_p0", "turning", "torsion"))
    assert v[stable & (paths == "straight")].max() < first
    assert v[stable & (paths == "circle")].max() < second
    assert np.all(np.abs(torsion[paths == "circle"]) < 1e-4)
    assert turning[paths == "helix"].max() > 2.0 * turning[paths == "circle"].max()
    drawn(figures.extra_turning, data)


def made_up_branches(p, subdivisions):
    rows = [
        ["straight", 7.8, 0.0, 0.0, 1.0, True, "state"],
        ["straight", 7.9, 0.0, 0.0, 1.0, False, "bifurcation"],
        ["straight", 8.0, 0.0, 0.0, 1.0, False, "state"],
        ["circle", 7.9, 0.0, 0.0, 1.0, False, "bifurcation"],
        ["circle", 8.1, 0.2, 0.0, 1.0, True, "state"],
        ["helix", 8.1, 0.2, 0.0, 1.0, True, "state"],
        ["helix", 8.3, 0.3, -0.1, 1.0, True, "state"],
    ]
    points = [["bifurcation of m = 1", 7.9, 0.0], ["bifurcation to helices", 8.1, 0.2]]
    return {"rows": rows, "points": points, "onset": 7.903, "problems": ["made up"]}


def test_drawing_dashes_unstable_cells_and_marks_the_bifurcations(monkeypatch):
    monkeypatch.setattr(extra_turning, "turning_branches", made_up_branches)
    data = figures.extra_turning.data(results=Results())
    assert data.problems == ("made up",)
    assert "bifurcation to helices at v_p0 = 8.1" in data.notes
    above, below = drawn(figures.extra_turning, data)
    for axes, name in ((above, "turning"), (below, "torsion")):
        assert name in axes.get_ylabel()
        shown = [line for line in axes.lines if len(line.get_xdata())]
        colors = {extra_turning.PATHS[path] for path in ("straight", "circle", "helix")}
        assert colors <= {line.get_color() for line in shown}
        dashed = [line for line in shown if line.get_linestyle() == "--"]
        assert all(line.get_color() == extra_turning.PATHS["straight"] for line in dashed)
        assert dashed
    assert max(np.max(line.get_ydata()) for line in below.lines) == pytest.approx(0.1)  # no sign
    (marks,) = (line for line in above.lines if line.get_label() == "bifurcation")
    np.testing.assert_allclose(marks.get_data(), [[7.9, 8.1], [0.0, 0.2]])

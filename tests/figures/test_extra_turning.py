"""The figure of straight, circling and helical cells."""

import numpy as np
import pytest

from amoeboid import InvalidInput, Parameters, figures
from amoeboid.figures.gallery import extra_turning


def test_the_onset_of_bending_is_that_of_the_axisymmetric_branch():
    assert extra_turning.bending_onset(extra_turning.FIGURE.parameters) == pytest.approx(
        7.90323, abs=2e-5
    )


def test_a_cell_that_does_not_bend_has_no_branches_and_says_so():
    data = figures.extra_turning.data(Parameters(D=0.4))
    assert len(data["branches"]) == len(data["points"]) == 0
    assert "no straight cell becomes unstable to bending" in data.problems[0]
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

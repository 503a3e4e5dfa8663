"""Figure 3C: the printed line, folds by the branch, and the type of the bifurcation by theory."""

import math

import numpy as np
import pytest

from amoeboid import Parameters, branch, figures
from amoeboid.closed_forms.phase_boundary import phase_boundary
from amoeboid.figures.gallery import fig3c
from amoeboid.figures.results import Results
from amoeboid.model.parameters import DIMENSIONS
from unit_systems import SYSTEMS


def printed_line(c0, eta):
    """nu = 0 of SI eq_non_linear_coefficient solved for D."""
    above = (10 * eta + 6) * c0 + 2 * eta - (3 * eta + 2) * c0**2
    return above / (2 * ((8 * eta + 5) * c0**2 - (12 * eta + 8) * c0 - 2 * eta))


@pytest.mark.parametrize("eta", fig3c.RATIOS)
def test_lines_of_the_paper_are_the_printed_formula(monkeypatch, eta):
    monkeypatch.setattr(fig3c, "LINE", np.array([1.9, 2.2, 2.8, 3.2]))
    p = Parameters(eta_b=0.3, R0=2.0, beta=0.5, c_r=4.0)
    line = fig3c.boundary(p, eta, finite=False)
    assert len(line["c0"]) == 4
    np.testing.assert_allclose(line["D"], printed_line(np.array(line["c0"]), eta), rtol=1e-10)


def test_fold_of_figure_3b_is_that_of_the_branch():
    """The branch in v_p0 with steps of its own; its fold is at 5.2096."""
    found = fig3c.bistable(Parameters(D=0.4))
    expected = branch(Parameters(D=0.4), "v_p0", 5.0, 6.2, max_step=0.4)
    assert found["fold"] == pytest.approx(expected.folds[0].number, rel=1e-6)
    assert found["threshold"] == pytest.approx(math.exp(3) / 3 * (0.4 + 0.5), rel=1e-9)
    assert round(100 * (1 - found["fold"] / found["threshold"]), 2) == 13.54


def test_figure_3a_has_no_bistable_region():
    assert fig3c.bistable(Parameters()) == {
        "threshold": pytest.approx(math.exp(3) / 3 * (0.03 + 0.5), rel=1e-9),
        "fold": None,
        "problem": "",
    }


@pytest.mark.parametrize("share", [0.8, 1.25])
def test_folds_exist_on_the_subcritical_side_of_the_line_alone(share):
    """The line at the pressure of the figure is a closed form; the folds are not."""
    p = Parameters(c0=2.5)
    (D,) = phase_boundary(p, 2.5).D
    assert (fig3c.bistable(p.replace(D=share * D))["fold"] is not None) == (share > 1)


def test_width_does_not_depend_on_units():
    units = SYSTEMS["nm, ms, single filaments"]
    base = Parameters(c0=3.25, D=0.15)
    given = {key: getattr(base, key) / units.of(unit) for key, unit in DIMENSIONS.items()}
    at = fig3c.at(Parameters(**given), 3.25, 0.15)
    found, expected = fig3c.bistable(at), fig3c.bistable(base)
    for key in ("threshold", "fold"):
        assert found[key] * units.of("L/T") == pytest.approx(expected[key], rel=1e-7)


@pytest.fixture
def small(monkeypatch):
    """A grid of four points whose folds are given, one of them not resolved."""

    def given(p):
        if p.c0 == 3.0 * p.c_r and p.D > 0.5:
            return {"threshold": 5.0, "fold": None, "problem": "too many modes"}
        return {"threshold": 5.0, "fold": 4.0 if p.D > 0.5 else None, "problem": ""}

    given.__module__ = fig3c.__name__
    monkeypatch.setattr(fig3c, "bistable", given)
    monkeypatch.setattr(fig3c, "C0", np.array([2.0, 3.0]))
    monkeypatch.setattr(fig3c, "D_BAR", np.array([0.25, 0.75]))
    monkeypatch.setattr(fig3c, "LINE", np.array([2.5]))


def test_a_point_that_is_not_resolved_has_no_width_and_is_told(small, tmp_path):
    data = figures.fig3c.data(Parameters(), Results(tmp_path))
    grid = data["grid"]
    np.testing.assert_allclose(grid["width"], [0.0, 0.2, 0.0, np.nan])
    assert list(grid["resolved"]) == [True, True, True, False]
    assert data.problems == ("c0/c_r = 3, D/(R0^2 beta) = 0.75: too many modes",)
    written = figures.fig3c.write_tables(data, tmp_path)
    assert any("missing: c0/c_r = 3" in path.read_text() for path in written)


def test_a_point_that_is_not_resolved_is_crossed_out(small):
    from matplotlib.figure import Figure

    axes = Figure().subplots()
    figures.fig3c(ax=axes)
    (crossed,) = (patch for patch in axes.patches if patch.get_hatch())
    assert crossed.get_xy() == (3.0 - 0.125, 0.75 - 0.05)
    (colors,) = (c for c in axes.collections if c.get_array() is not None)
    assert np.ma.count(colors.get_array()) == 1


def test_the_cell_is_marked_unless_it_is_that_of_the_figure(small):
    marked = figures.fig3c.data(Parameters(), Results())["points"]["point"]
    assert list(marked) == ["3A", "3B"]
    p = Parameters.physical()
    points = figures.fig3c.data(p, Results())["points"]
    assert list(points["point"]) == ["3A", "3B", "cell"]
    assert points["c0"][2] == pytest.approx(p.c0 / p.c_r)


@pytest.mark.slow
def test_the_bistable_region_is_the_subcritical_one():
    """On the whole grid a fold exists where theory at the same pressure says nu > 0."""
    data = figures.fig3c.data()
    assert data.problems == ()
    grid = data["grid"]
    assert len(grid) == 104
    p = Parameters()
    line = phase_boundary(p, np.unique(grid["c0"]))
    at = dict(zip(line.c0, line.D, strict=True))
    # above c0 = 3.3 nu is positive for every D; at small c0 the line lies far above the picture
    for c0, D, width in zip(grid["c0"], grid["D"], grid["width"], strict=True):
        boundary = at.get(c0, 0.0 if c0 > 3.0 else np.inf)
        assert (width > 0) == (boundary < D), (c0, D)
    widths = grid["width"].reshape(len(fig3c.C0), len(fig3c.D_BAR))
    assert np.all(np.diff(widths, axis=0) >= 0)
    assert np.all(np.diff(widths, axis=1) >= 0)

"""Speeds in all environments against v_p0, and published ones."""

import numpy as np
import pytest

from amoeboid import Parameters, figures, migrate, steady_states
from amoeboid.figures.gallery import extra_motility
from amoeboid.figures.results import Results
from figures.drawn import drawn, lines


@pytest.fixture(scope="module")
def data():
    """Close to the threshold, with few states."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(extra_motility, "HIGHEST", 1.03)
        patch.setattr(extra_motility, "STATES", 4)
        return figures.extra_motility.data(results=Results())


def test_speeds_start_at_the_threshold_and_keep_their_order(data):
    table = data["speeds"]
    assert table["v_p0"][0] == pytest.approx(1.4606, abs=1e-4)
    names = list(extra_motility.ENVIRONMENTS)
    assert all(table[name][0] == 0.0 for name in names)
    assert table["stable"][0] is None
    assert all(table["stable"][1:])
    assert np.all(np.diff(table["v_p0"]) > 0)
    # near the threshold the flow is a sine: the closed forms of the sphere
    ratio = {name: table[name][1] / table[extra_motility.FLOW][1] for name in names}
    cos, sin = np.cos(np.pi / 6), np.sin(np.pi / 6)
    expected = (1, 1 / 2 + (1 + cos + cos**2) / 6, 1 - sin**2 / 3, 2 / 3, 2 / 3, 2 / 3, 0.2)
    np.testing.assert_allclose(list(ratio.values()), expected, rtol=0.02)


def test_published_speeds_are_in_the_units_of_the_cell(data):
    table = data["published"]
    assert table.unit("lowest") == "um/s"
    np.testing.assert_allclose(60 * table["lowest"], [5, 11, 4.2, 3.8])
    np.testing.assert_allclose(60 * table["highest"], [20, 23, 4.2, 3.8])
    assert all("(20" in source for source in table["source"])


def test_cell_without_units_has_no_published_speeds():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(extra_motility, "HIGHEST", 1.01)
        patch.setattr(extra_motility, "STATES", 2)
        data = figures.extra_motility.data(Parameters(D=0.1))
    assert "published" not in data
    assert not drawn(figures.extra_motility, data)[1].axison


@pytest.mark.slow
def test_documented_speeds():
    """docs/motility.md, at 1.7 um/s."""
    state = steady_states(Parameters.physical(v_p0="1.7 um/s"), (1,)).fastest_stable
    found = [migrate(state, name).speed.to("um/min").magnitude for name in (
        "matrix:normal=0", "patch:30", "channel:30", "fluid", "matrix", "matrix:per_filament=true"
    )]  # fmt: skip
    np.testing.assert_allclose(found, [9.6, 8.7, 8.5, 6.4, 6.4, 6.2], atol=0.06)


def test_drawing_has_a_line_for_each_environment_and_a_bar_for_each_published_speed(data):
    left, right = drawn(figures.extra_motility, data)
    found = lines(left)
    for name, (words, *_) in extra_motility.ENVIRONMENTS.items():
        np.testing.assert_array_equal(found[words][1], data["speeds"][name])
    published = data["published"]
    assert len(right.texts) == len(published["lowest"]) == 4
    bars = [(bar.get_y(), bar.get_y() + bar.get_height()) for bar in right.patches]
    np.testing.assert_allclose(
        bars, np.column_stack([published["lowest"], published["highest"]])[:2], rtol=1e-12
    )
    assert left.get_ylim()[1] > published["highest"].max()

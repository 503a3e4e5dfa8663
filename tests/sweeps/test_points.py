"""What a sweep varies."""

import numpy as np
import pytest

import amoeboid as am

CELL = am.Parameters.physical(D="1 um^2/s")


def test_laws_of_one_name_are_told_apart_by_their_numbers():
    expression = "v_p0/(1 + (c/c_r)**n)"
    laws = [am.Custom(expression, n=2), am.Custom(expression, n=3)]
    found = am.sweep(am.grid(law=laws), am.theory, record=["threshold"])
    assert found["law"].values.tolist() == [f"{expression} (n = 2)", f"{expression} (n = 3)"]
    assert found["threshold"].values[0] != found["threshold"].values[1]
    found = am.sweep(am.grid(law=[hill, "inverse", "none such"]), am.theory)
    assert found["law"].values.tolist() == ["hill", "inverse", "none such"]
    assert found.counts == {"ok": 2, "failed": 1}
    with pytest.raises(am.InvalidInput, match="the values of law must differ in a grid"):
        am.grid(law=[hill, hill])


def hill(c, v_p0, c_r, n=2.0):
    """A law of a user, a function."""
    return v_p0 / (1 + (c / c_r) ** n)


def test_a_grid_holds_all_combinations():
    points = am.grid(D=[0.1, 0.4], v_p0=[4, 5, 6])
    assert (points.dims, points.shape, len(points)) == (("D", "v_p0"), (2, 3), 6)
    cells = [points.cell(k) for k in range(6)]
    assert [(p.D, p.v_p0) for p in cells] == [(D, v) for D in (0.1, 0.4) for v in (4, 5, 6)]


def test_the_rest_is_as_in_the_base():
    base = am.Parameters(delta_P=20).replace(law="v_p0/(1 + (c/c_r)**n)", **{"law.n": 3})
    cell = am.grid(base, **{"law.n": [1, 2]}).cell(1)
    assert cell == base.replace(**{"law.n": 2})


def test_ranges_are_those_of_numpy():
    points = am.grid(D={"logspace": [0.01, 1, 5]}, v_p0={"linspace": [4, 8, 3]})
    assert points.axes["D"] == tuple(np.geomspace(0.01, 1, 5))
    assert points.axes["v_p0"] == (4.0, 6.0, 8.0)


def test_pairs_go_together():
    points = am.paired(D=[0.1, 0.4], v_p0=[4, 6])
    assert (points.dims, points.shape) == (("point",), (2,))
    assert points.cell(1) == am.Parameters(D=0.4, v_p0=6)


def test_quantities_of_a_physical_cell():
    points = am.grid(CELL, v_p0=["1 um/s", "120 um/min"], R0={"linspace": ["8 um", "12 um", 3]})
    cell = points.cell(5)
    assert cell.quantity(cell.v_p0, "L/T").to("um/s").magnitude == pytest.approx(2.0)
    assert cell.quantity(cell.R0, "L").to("um").magnitude == pytest.approx(12.0)
    assert cell.units == CELL.units
    with pytest.raises(am.InvalidInput, match=r"v_p0 must be a number with a unit"):
        am.grid(CELL, v_p0=[1.0])
    with pytest.raises(am.InvalidInput, match="quantities with units start from"):
        am.grid(v_p0=["1 um/s"])


def test_any_field_of_a_run_varies():
    points = am.grid(**{"mesh.subdivisions": [1, 2], "cue.strength": [0.0, 0.1]})
    config = points.cell(3)
    assert (config.mesh.subdivisions, config.cue.strength) == (2, 0.1)
    assert config.parameters == am.Parameters()


def test_laws_vary_by_name():
    points = am.grid(law=["exponential", "inverse"])
    assert [points.cell(k).law.name for k in range(2)] == ["exponential", "inverse"]


def test_random_points_fill_the_window_evenly_and_repeat():
    vary = {"D": (0.1, 0.6), "delta_P": {"logspace": [1, 100]}}
    points = am.sobol(100, seed=3, **vary)
    assert points.columns == am.sobol(100, seed=3, **vary).columns
    assert points.columns != am.sobol(100, seed=4, **vary).columns
    longer = am.sobol(128, seed=3, **vary)
    assert longer.columns["D"][:100] == points.columns["D"]
    # each of 16 equal parts has 8 of 128 points: Sobol sequences are balanced
    counts, _ = np.histogram(longer.columns["D"], bins=16, range=(0.1, 0.6))
    assert counts.tolist() == [8] * 16
    counts, _ = np.histogram(np.log10(longer.columns["delta_P"]), bins=16, range=(0, 2))
    assert counts.tolist() == [8] * 16


def test_a_list_of_parameters_varies_where_they_differ():
    cells = [am.Parameters(D=0.1, v_p0=4), am.Parameters(D=0.4, v_p0=4)]
    found = am.sweep(cells, am.theory, record="threshold")
    assert found["D"].values.tolist() == [0.1, 0.4]
    assert found["threshold"].dims == ("point",)
    assert "v_p0" not in found.dataset


def test_lists_of_physical_cells_are_measured_in_one_unit():
    cells = [am.Parameters.physical(R0="10 um"), am.Parameters.physical(R0="20 um")]
    found = am.sweep(cells, am.theory, record="threshold")
    assert found["R0"].values == pytest.approx([10.0, 20.0])
    assert found["R0"].attrs["units"] == "um"
    for k, cell in enumerate(cells):
        single = am.theory(cell).threshold.to("um/s").magnitude
        assert found["threshold"].values[k] == pytest.approx(single, rel=1e-15)
    with pytest.raises(am.InvalidInput, match="must have physical units, got both"):
        am.sweep([cells[0], am.Parameters()], am.theory)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: am.grid(), "must vary something"),
        (lambda: am.grid(E=[1]), "unknown parameter 'E'"),
        (lambda: am.grid(**{"mesh.size": [1]}), r"unknown field 'size' in \[mesh\]"),
        (lambda: am.grid(D=0.1), "the values of D must be a list"),
        (lambda: am.grid(D=[]), "must have at least one value"),
        (lambda: am.grid(D=[1, 1]), "must differ in a grid"),
        (lambda: am.grid(D=[np.nan]), "D must be a finite number"),
        (lambda: am.grid(D=["x"]), "D must be a number"),
        (lambda: am.grid(D=[True]), "D must be a number"),
        (lambda: am.grid(D={"linspace": [1, 2]}), r"must be \[first, last, count\]"),
        (lambda: am.grid(D={"linspace": [1, 2, 10**12]}), "1 to 10000000 points"),
        (lambda: am.grid(D={"linspace": [1, 1, 3]}), "two numbers that differ"),
        (lambda: am.grid(D={"logspace": [0, 1, 3]}), "must be > 0"),
        (lambda: am.grid(D={"arange": [0, 1, 3]}), "a range must be"),
        (lambda: am.grid(0.4, D=[1]), "p must be amoeboid.Parameters"),
        (lambda: am.grid(D=range(1, 5000), v_p0=range(5000)), "1 to 10000000 points"),
        (lambda: am.paired(D=[1, 2], v_p0=[1]), "equally many values"),
        (lambda: am.sobol(0, D=(0, 1)), "count must be a whole number >= 1"),
        (lambda: am.sobol(8, seed=-1, D=(0, 1)), "seed must be a whole number >= 0"),
        (lambda: am.sobol(8, D=[0, 1, 2]), r"must be \(low, high\)"),
        (lambda: am.sweep([], am.theory), "at least one point"),
    ],
)
def test_what_cannot_vary_is_refused(make, message):
    with pytest.raises(am.InvalidInput, match=message):
        make()


def test_in_a_list_of_cells_of_different_size_only_the_size_varies():
    """Each has units of its own, so that its numbers are those of the other cell."""
    cells = [am.Parameters.physical(R0=f"{size} um", D="1 um^2/s") for size in (10, 20)]
    found = am.sweep(cells, lambda p: p.quantity(p.R0, "L"))
    assert list(found.layout.coordinates) == ["R0"]
    assert found["R0"].values == pytest.approx([10.0, 20.0])
    assert found["value"].values == pytest.approx([10.0, 20.0])

"""The table of a sweep: what is recorded, what failed, in which units."""

import functools
import pickle
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor
from types import ModuleType

import numpy as np
import pytest
import xarray
from matplotlib.figure import Figure

import amoeboid as am
from sweeps import solvers

P = am.Parameters(D=0.4)
CELL = am.Parameters.physical(D="1 um^2/s")


def test_steady_states_are_those_of_one_point_each():
    found = am.sweep(am.grid(P, v_p0=[5.0, 5.5]), am.steady_states)
    states = am.steady_states(P.replace(v_p0=5.5))
    assert found["n_states"].values.tolist() == [1.0, 3.0]
    assert found["n_stable"].values.tolist() == [1.0, 2.0]
    for name in ("max_retrograde_speed", "c_front", "zeta0", "polarity"):
        assert found[name].sel(v_p0=5.5).values.tolist() == [s.number(name) for s in states]
        assert np.isnan(found[name].sel(v_p0=5.0).values[1:]).all()
    assert found["stable"].sel(v_p0=5.5).values.tolist() == [1.0, 0.0, 1.0]
    assert found["c_front"].attrs == {
        "units": "N/L^2",
        "long_name": "Concentration at the front, its minimum over the surface",
    }
    assert found.complete
    assert found.failed == ()


def test_a_branch_is_recorded_with_its_folds():
    solver = functools.partial(am.branch, name="v_p0", start=0, end=6.5, max_step=0.4)
    found = am.sweep(am.grid(delta_P=[300], base=P), solver)
    single = solver(P.replace(delta_P=300))
    at = found.dataset.sel(delta_P=300)
    assert at.fold_v_p0.values.tolist() == [fold.number for fold in single.folds]
    assert at.threshold_v_p0.values.tolist() == list(single.origins)
    assert at.v_p0.values[: len(single)].tolist() == single.v_p0.tolist()
    assert "bifurcation_m" not in found.dataset


def test_a_parameter_varied_by_the_sweep_and_by_the_answer_is_named():
    solver = functools.partial(am.branch, name="v_p0", end=6.5, max_step=0.4)
    found = am.sweep(am.grid(P, v_p0=[6.0]), solver)
    assert "'v_p0', which the sweep varies" in found.failed[0].why


def test_runs_are_recorded_at_their_end_and_in_time_if_asked_for():
    solver = functools.partial(am.simulate, mesh=am.Icosphere(1), until=am.time(0.2))
    points = am.grid(P, v_p0=[4, 6])
    run = solver(P.replace(v_p0=6))
    found = am.sweep(points, solver)
    assert found["c_rear"].values[1] == run.final.c_rear
    assert found["ended"].values.tolist() == ["end of time"] * 2
    assert not [name for name in found if name.startswith("series_")]
    series = am.sweep(points, solver, record=["series_t", "series_c_rear"])
    known = series["series_c_rear"].sel(v_p0=6).dropna("step")
    assert known.values.tolist() == run["c_rear"].tolist()


def test_a_run_that_diverges_is_incomplete_and_says_so():
    solver = functools.partial(
        am.simulate,
        mesh=am.Icosphere(1),
        time=am.Time(scheme="explicit", max_step=0.01, end=5.0),
    )
    found = am.sweep(am.grid(P, v_p0=[6.0]), solver)
    assert found["status"].values.tolist() == ["incomplete"]
    assert found["why"].values[0].startswith("diverged: ")
    assert found.failed == ()


def test_steady_cells_on_a_mesh_have_a_path():
    solver = functools.partial(am.steady_state, mesh=am.Icosphere(1))
    found = am.sweep(am.grid(P, v_p0=[6.0]), solver)
    assert found["path"].values.tolist() == ["straight"]
    assert found["stability"].values.tolist() == ["stable"]
    assert np.isinf(found["radius_of_curvature"].values).all()


def test_functions_give_numbers_arrays_texts_quantities_and_what_is_missing():
    assert am.sweep(am.grid(D=[1, 2]), lambda p: 2 * p.D)["value"].values.tolist() == [2.0, 4.0]
    found = am.sweep(am.grid(v_p0=[1, 2]), solvers.square)
    assert found["powers"].dims == ("v_p0", "powers_i")
    assert found["powers"].values.tolist() == [[1, 1, 1], [1, 2, 4]]
    assert found["w"].values.tolist() == ["a", "a"]
    mixed = am.sweep(am.grid(v_p0=[4, 5, 6]), solvers.picky)
    assert mixed["y"].values.tolist()[1] == np.inf
    assert np.isnan(mixed["y"].values[[0, 2]]).all()
    speed = am.sweep(am.grid(CELL, v_p0=["1 um/s"]), lambda p: p.quantity(p.v_p0, "L/T"))
    assert speed["value"].attrs["units"] == "µm / s"
    assert speed["value"].values == pytest.approx([1.0])


def test_arrays_of_different_length_are_padded():
    found = am.sweep(am.grid(D=[1, 3]), lambda p: {"a": list(range(int(p.D))), "b": ["x"]})
    values = found["a"].values
    assert values[1].tolist() == [0, 1, 2]
    assert np.isnan(values[0]).tolist() == [False, True, True]


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (1j, "real numbers"),
        (object(), "real numbers"),
        ({}, "names of solver results"),
        ({1: 2}, "names of solver results"),
        ({"why": 2}, "'why', which the sweep varies"),
        ({"a": [1, "x"]}, "only numbers or only texts"),
        ({"a": [[1], [1, 2]]}, "1 dimensions, got more"),
        ({"a": [1, 2], "a_i": 3}, "'a_i', which is the name of a dimension"),
        ({"point": 1}, "'point', which is the name of a dimension"),
        ({"a/b": 1.0}, "valid in NetCDF, without '/'"),
        ({" a": 1.0}, "valid in NetCDF, without '/'"),
        ({"a": "x\0y"}, "valid in UTF-8 and NetCDF"),
        ({"a": ["\ud800"]}, "valid in UTF-8 and NetCDF"),
    ],
)
def test_what_cannot_be_recorded_is_a_failure_with_a_reason(answer, message):
    found = am.sweep(am.grid(D=[1]), lambda p: answer)
    assert message in found.failed[0].why


def test_a_masked_number_is_none():
    found = am.sweep(am.grid(D=[1]), lambda p: {"a": np.ma.array([7.0, 8.0], mask=[True, False])})
    assert np.isnan(found["a"].values[0, 0])
    assert found["a"].values[0, 1] == 8.0


def test_a_message_with_control_characters_is_one_line_and_goes_into_the_file(tmp_path):
    def angry(p):
        raise RuntimeError("red \x1b[31m\nand\0 zero \ud800")

    found = am.sweep(am.grid(D=[1]), angry)
    assert found.failed[0].why == r"RuntimeError: red \x1b[31m and\x00 zero \ud800"
    found.save(tmp_path / "a.nc")


def test_an_error_that_cannot_tell_itself_is_a_failure_with_its_name():
    class Mute(Exception):
        def __str__(self):
            raise ValueError("no text")

    def mute(p):
        raise Mute

    found = am.sweep(am.grid(D=[1, 2]), mute)
    assert [failure.why for failure in found.failed] == ["Mute", "Mute"]


OF_ANOTHER_KIND = {
    "a text": lambda p: 1.0 if p.v_p0 < 2 else "none",
    "an array": lambda p: 1.0 if p.v_p0 < 2 else [1.0, 2.0],
    "a unit": lambda p: p.quantity(p.v_p0, "L/T" if p.v_p0 < 2 else "L^2/T"),
}


@pytest.mark.parametrize("answer", OF_ANOTHER_KIND.values(), ids=OF_ANOTHER_KIND)
@pytest.mark.parametrize("folder", [None, "here"])
@pytest.mark.parametrize("points_per_task", [1, 3])
def test_a_point_that_means_something_else_fails_alone(tmp_path, answer, folder, points_per_task):
    cells = am.grid(CELL, v_p0=["1 um/s", "3 um/s", "1.5 um/s"])
    place = None if folder is None else tmp_path / folder
    with ThreadPoolExecutor(1) as executor:
        found = am.sweep(
            cells, answer, executor=executor, points_per_task=points_per_task, folder=place, key="a"
        )
    assert found.counts == {"ok": 2, "failed": 1}
    assert "'value' must be of one kind at all points" in found.failed[0].why
    assert np.isfinite(found["value"].values[[0, 2]]).all()
    if place is not None:
        assert am.load_sweep(place).rows == found.rows


@pytest.mark.parametrize("points_per_task", [1, 3])
def test_no_value_goes_together_with_any(points_per_task):
    def answer(p):
        return {"a": None if p.D != 2 else [1.0, 2.0]}

    with ThreadPoolExecutor(1) as executor:
        found = am.sweep(
            am.grid(D=[1, 2, 3]), answer, executor=executor, points_per_task=points_per_task
        )
    assert found.complete
    assert np.isnan(found["a"].values).sum() == 4


def test_five_impossible_points_among_a_hundred_are_named():
    points = am.grid(P, D=[*np.linspace(0.1, 0.6, 19), -1.0], v_p0=[4, 5, 6, 7, 8])
    found = am.sweep(points, solvers.growth)
    assert found.counts == {"ok": 95, "failed": 5}
    assert [f.values for f in found.failed] == [{"D": -1.0, "v_p0": v} for v in (4, 5, 6, 7, 8)]
    assert {f.why for f in found.failed} == {"D must be a finite number >= 0, got -1.0"}
    assert np.isnan(found["value"].sel(D=-1)).all()
    single = am.growth_rate(P.replace(D=0.1, v_p0=8), l=1)
    assert found["value"].sel(D=0.1, v_p0=8).item() == single
    assert np.isfinite(found["value"].isel(D=slice(19))).all()
    assert (found["status"].sel(D=-1) == "failed").all()


def test_errors_and_warnings_of_a_point_are_told_and_the_rest_goes_on():
    found = am.sweep(am.grid(v_p0=[3, 4, 5, 6]), solvers.picky)
    assert found["status"].values.tolist() == ["ok", "failed", "ok", "ok"]
    assert found["why"].values[1] == "ZeroDivisionError: nothing to divide"
    assert found["warnings"].values.tolist() == ["", "", "a guess", ""]
    with warnings.catch_warnings(record=True) as told:  # as before
        warnings.simplefilter("always")
        warnings.warn("seen", stacklevel=1)
    assert len(told) == 1


def test_what_is_recorded_is_chosen_by_name():
    found = am.sweep(am.grid(P, v_p0=[6.0]), am.theory, record=["threshold"])
    assert list(found) == ["status", "why", "warnings", "threshold"]
    found = am.sweep(am.grid(P, v_p0=[6.0]), am.theory, record=["treshold"])
    assert "did you mean threshold?" in found.failed[0].why


def scaled(p, by):
    return {"scaled": by * p.D}


def test_a_table_names_its_solver_without_the_arguments():
    table = am.sweep(am.grid(D=[0.1, 0.2]), functools.partial(scaled, by=2.5))
    assert repr(table).startswith("Sweep of scaled at 2 points in D")


def test_a_function_of_a_program_on_standard_input_is_a_solver(monkeypatch):
    typed = ModuleType("typed")
    typed.__file__ = "<stdin>"
    monkeypatch.setitem(sys.modules, "typed", typed)
    exec("def double(p):\n    return {'double': 2 * p.D}\n", typed.__dict__)  # noqa: S102  (our own text)
    assert am.sweep(am.grid(D=[0.1, 0.2]), typed.double)["double"].values.tolist() == [0.2, 0.4]


def test_coordinates_of_physical_cells_are_selected_by_what_was_given():
    given = [700.0, 1000.0, 1370.0, 2000.0, 3000.0]
    points = am.grid(am.Parameters.physical(), c0=[f"{c} / um^2" for c in given])
    threshold = am.sweep(points, am.theory, record="threshold")["threshold"]
    assert threshold.c0.values.tolist() == given
    assert threshold.sel(c0=1370).item() == pytest.approx(1.4606, abs=1e-4)


def test_physical_cells_are_recorded_in_customary_units():
    found = am.sweep(am.grid(CELL, v_p0=["2 um/s"]), am.theory, record=["threshold"])
    assert found["v_p0"].attrs["units"] == "um/s"
    assert found["v_p0"].values == pytest.approx([2.0])
    assert found["threshold"].attrs["units"] == "um/s"
    expected = am.theory(CELL).threshold.to("um/s").magnitude
    assert found["threshold"].values == pytest.approx([expected], rel=1e-14)


def test_the_table_is_written_as_netcdf_and_read_back_the_same(tmp_path):
    points = am.sobol(3, P, seed=5, v_p0=(4, 8), delta_P=(10, 20))
    found = am.sweep(points, am.theory)
    found.save(tmp_path / "a.nc")
    found.save(tmp_path / "b.nc")
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()
    with xarray.open_dataset(tmp_path / "a.nc", engine="h5netcdf") as read:
        for name in found.dataset.variables:
            np.testing.assert_array_equal(read[name].values, found.dataset[name].values)
        assert read.attrs["seed"] == 5
        assert read.attrs["solver"] == "amoeboid.studies.theory.theory"
        assert '"D": 0.4' in read.attrs["base"]
        assert read["l"].values.tolist() == [1, 2, 3, 4, 5, 6]
    assert len(found.to_pandas()) == 3 * found.dataset.sizes["l"] * 2 * 1


def test_a_solver_that_takes_many_cells_at_once_gets_them_so():
    found = am.sweep(am.grid(v_p0=[1, 2, 3, 4, 5, 6]), solvers.batched)
    assert found["n"].values[:5].tolist() == [4, 4, 4, 4, 2]
    assert found["square"].values[:5].tolist() == [1, 4, 9, 16, 25]
    assert found.failed[0].why == "ValueError: too fast"
    assert am.sweep(am.grid(v_p0=[1]), functools.partial(solvers.batched)).complete


def test_a_sweep_pickles_draws_and_shows_itself_in_a_few_lines():
    points = am.grid(P, D=[0.4, -1], v_p0=[6])
    for found in (
        am.sweep(points, am.theory),
        am.sweep(am.grid(P, v_p0=[5.0, 5.5]), am.steady_states),
        am.sweep(am.refine(am.grid(D=[1, 2], v_p0=[1, 2]), "value"), lambda p: p.D * p.v_p0 > 2),
    ):
        again = pickle.loads(pickle.dumps(found))  # noqa: S301
        assert repr(again) == repr(found)
        assert len(repr(found)) < 1000
        assert "<table>" in found._repr_html_()
        axes = Figure().add_subplot()
        assert found.plot(ax=axes) is axes
    assert am.sweep(points, am.theory).plot(observable="bifurcation").get_xlabel().startswith("D")
    with pytest.raises(am.InvalidInput, match="one or two varied numbers"):
        am.sweep(am.grid(D=[1], v_p0=[1], c0=[1]), lambda p: 1).plot()


def test_progress_is_told_to_a_function():
    told = []
    am.sweep(am.grid(v_p0=[1, 2]), solvers.square, progress=lambda *n: told.append(n))
    assert told == [(0, 2), (1, 2), (2, 2)]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"solver": 3}, "solver must be a function"),
        ({"points": None}, "must be what amoeboid.grid"),
        ({"points": P}, r"give \[p\] for a single one"),
        ({"record": 3}, "record must be a list of names, got 3"),
        ({"record": ["a", 3]}, "record must be a list of names"),
        (
            {"points": am.refine(am.grid(D=[1, 2]), "n"), "record": ["m"]},
            "'n' is not among m; add it to record",
        ),
        ({"workers": 0}, "workers must be a whole number >= 1"),
        ({"executor": 3}, "executor must have `submit`"),
        ({"executor": 3, "workers": 2}, "an executor or workers, not both"),
        ({"shard": (1, 2)}, "a shard needs a folder"),
        ({"shard": (3, 2), "folder": "x"}, "1 <= k <= n"),
        ({"progress": 3}, "progress must be"),
        ({"folder": "x", "solver": lambda p: 1}, "code can be identified"),
        ({"workers": 2, "solver": lambda p: 1}, "other processes can import"),
    ],
)
def test_a_wrong_call_is_refused_before_anything_is_computed(
    options, message, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(am.InvalidInput, match=message):
        am.sweep(**{"points": am.grid(D=[1]), "solver": am.theory, **options})
    assert list(tmp_path.iterdir()) == []

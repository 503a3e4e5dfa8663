"""`simulate` and its solution: the run of the command, as an object."""

import pickle

import numpy as np
import pytest
from matplotlib.figure import Figure

import amoeboid as am
from amoeboid.config import Config, Initial, Mesh, Output, Time
from amoeboid.observables import observed
from amoeboid.runs.snapshot import FIELDS
from amoeboid.simulation.loop import evolve, start
from surface.written import ellipsoid, sliver

P = am.Parameters(D=0.4, v_p0=6.0)
SMALL = am.Icosphere(1)


@pytest.fixture(scope="module")
def solution():
    return am.simulate(P, mesh=SMALL, until=[am.steady(), am.time(2.0)])


def same(a, b):
    return np.array_equal(a.state.r, b.state.r) and np.array_equal(a.state.c, b.state.c)


def test_solution_is_the_run_of_the_time_loop(solution):
    config = Config(parameters=P, mesh=Mesh(subdivisions=1), time=Time(end=2.0))
    *_, last = evolve(start(config), config.time)
    assert solution.last.number == last.number
    assert same(solution.last, last)
    assert solution.ended == "end of time"
    assert (solution.growth_rate, solution.stability) == (None, "unknown")
    for name, value in observed(last.cell).items():
        assert solution[name][-1] == value
    assert len(solution.t) == last.number + 1
    assert solution["cortex_drag_heading"].shape == (len(solution), 3)
    assert np.array_equal(solution.trajectory[-1], last.state.position)
    frames = [frame.t for frame in solution.frames]
    np.testing.assert_allclose(frames, [0.0, 0.5, 1.0, 1.5, 2.0], rtol=1e-12)


def test_without_arguments_it_is_the_default_run():
    """The configuration of `amoeboid run`; made here for a few steps only."""
    steps = []
    found = am.simulate(until=lambda step: len(steps) > 3 or steps.append(step), observe="zeta0")
    first = start(Config())
    assert found.config.parameters == Config().parameters
    assert len(found.final.c) == 642
    assert same(steps[0], next(evolve(first, Time())))


def test_final_cell_has_fields_and_observables(solution):
    final, cell = solution.final, solution.last.cell
    for name in FIELDS:
        assert np.array_equal(getattr(final, name), getattr(cell, name))
    assert final.max_retrograde_speed == solution["max_retrograde_speed"][-1]
    assert final.cortex_drag_heading.shape == (3,)
    assert {"c", "polarity"} <= set(dir(final))
    with pytest.raises(AttributeError, match="no attribute or observable 'velocity'"):
        final.velocity  # noqa: B018


def test_resumed_solution_ends_with_the_bits_of_the_uninterrupted_one(solution, tmp_path):
    whole = am.simulate(P, mesh=SMALL, until=am.time(3.0))
    first = am.simulate(P, mesh=SMALL, until=am.when("t > 1.2"))
    assert first.ended == "t > 1.2"
    resumed = first.resume(until=am.time(3.0))
    assert same(resumed.last, whole.last)
    assert resumed.rows == whole.rows
    # frames of the first part, its end, and the rest
    times = [f.t for f in whole.frames]
    assert [f.t for f in resumed.frames] == sorted([*times, first.final.t])
    with pytest.raises(am.InvalidInput, match="must end after t = 3"):
        whole.resume()
    with pytest.raises(am.InvalidInput, match=r"has ended at t = 1.*: t > 1\.2"):
        first.resume()
    # and from its folder
    stored = first.save(tmp_path / "run").resume(until=am.time(3.0))
    assert same(stored.last, whole.last)
    assert stored.rows == whole.rows


def test_frames_are_exactly_at_the_times_that_are_asked_for(tmp_path):
    times = [0.0, 0.31, 0.32, 0.7]
    for folder in (None, tmp_path / "run"):
        found = am.simulate(P, mesh=SMALL, until=am.time(1.0), times=times, folder=folder)
        assert [frame.t for frame in found.frames] == times
    # the run itself does not depend on it, nor on a resume between the times
    other = am.simulate(P, mesh=SMALL, until=am.time(1.0))
    assert same(found.last, other.last)
    part = am.simulate(P, mesh=SMALL, until=am.time(0.5), times=[0.2, 0.4, 0.8, 1.0])
    stored = part.save(tmp_path / "part").resume(until=am.time(1.0))
    assert stored.frames.times == [0.2, 0.4, 0.8, 1.0]
    assert [f.t for f in part.resume(until=am.time(1.0)).frames] == stored.frames.times
    with pytest.raises(am.InvalidInput, match="each larger than the one before"):
        am.simulate(P, mesh=SMALL, times=[1.0, 0.5])


def test_a_run_without_frames_can_be_stored_and_resumed(tmp_path):
    found = am.simulate(P, mesh=SMALL, until=am.time(0.4), times=[0.9], folder=tmp_path / "run")
    assert len(found.frames) == 0
    with pytest.raises(am.InvalidInput, match="needs frames"):
        found.kymograph()
    assert am.load(tmp_path / "run").resume(until=am.time(1.0)).frames.times == [0.9]


def test_solution_and_everything_on_it_pickles(solution):
    back = pickle.loads(pickle.dumps(solution))  # noqa: S301  (our own)
    assert repr(back) == repr(solution)
    assert same(back.last, solution.last)
    assert back.frames[-1].polarity == solution.frames[-1].polarity
    assert same(back.resume(until=am.time(2.5)).last, solution.resume(until=am.time(2.5)).last)


def test_reprs_are_short(solution):
    assert (
        repr(solution) == f"Solution(end of time at t = 2, {solution.last.number} steps, 42 nodes)"
    )
    for shown in (
        solution,
        solution.final,
        SMALL,
        solution.kymograph(9),
        solution.spectrum("c", 2),
    ):
        assert len(repr(shown)) < 200
    for shown in (solution, solution.final):
        assert "<table>" in shown._repr_html_()
        assert "data:image/png" in shown._repr_html_()


def test_a_run_of_few_observables_is_drawn_by_the_first_of_them():
    for names, label in ((["c_rear", "polarity"], "c_rear"), (["cortex_drag_heading"], None)):
        run = am.simulate(P, mesh=SMALL, until=am.time(0.05), observe=names)
        axes = run.plot(Figure().add_subplot())
        assert axes.get_ylabel().startswith(label or "cortex_drag_heading_x")
        assert "data:image/png" in run._repr_html_()
    run = am.simulate(P, mesh=SMALL, until=am.time(0.05), observe=[])
    assert "<img" not in run._repr_html_()


def test_tables_of_the_time_series(solution):
    pytest.importorskip("pandas")
    table = solution.to_pandas()
    assert table.index.name == "t"
    assert np.array_equal(table["c_rear"], solution["c_rear"])
    assert table.attrs["units"]["c_rear"] == "N/L^2"
    pytest.importorskip("xarray")
    dataset = solution.to_xarray()
    assert np.array_equal(dataset.c_rear, solution["c_rear"])
    assert dataset.c_rear.attrs["units"] == "N/L^2"
    assert dataset.attrs["ended"] == "end of time"


def test_numbers_of_a_physical_cell_have_units(tmp_path):
    cell = am.Parameters.physical(R0="10 um", v_p0="1.7 um/s")
    found = am.simulate(cell, mesh=SMALL, until=am.time("30 s"), folder=tmp_path / "run")
    for run in (found, am.load(tmp_path / "run")):
        assert run.final.t.to("s").magnitude == pytest.approx(30.0)
        assert run["max_retrograde_speed"].to("um/s").magnitude[-1] == pytest.approx(
            run.final.max_retrograde_speed.to("um/s").magnitude
        )
        assert run.final.c.to("1/um^2").magnitude.mean() > 100
        assert "t = 30 s" in repr(run)
    with pytest.raises(am.InvalidInput, match="time must be a number in the units"):
        am.simulate(P, until=am.time("30 s"))


def test_a_shape_of_your_own_is_a_mesh(solution, tmp_path):
    r = solution.final.r * [1.0, 1.0, 1.2]
    shape = am.Surface(r, solution.final.faces)
    found = am.simulate(P, mesh=shape, until=am.time(0.1), folder=tmp_path / "run")
    assert found.frames[0].deformation > 0.05
    assert found.frames[0].area == pytest.approx(4 * np.pi)
    # the same from a file, and once more from the folder of the run
    config = am.load(tmp_path / "run").config
    assert config.initial.from_frame == "initial_frame.vtp"
    path = tmp_path / "shape.obj"
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in r.tolist()]
    lines += ["f {} {} {}".format(*(np.array(f) + 1)) for f in solution.final.faces]
    path.write_text("\n".join(lines))
    other = am.simulate(P, mesh=am.Surface(path), until=am.time(0.1))
    np.testing.assert_allclose(other.final.c, found.final.c, rtol=1e-9)


def test_nodes_and_faces_of_slivers_are_repaired_on_request():
    r, faces = sliver()
    with pytest.raises(am.InvalidInput, match="or set repair=True"):
        am.simulate(P, mesh=am.Surface(r, faces), until=am.time(0.1))
    shape = am.Surface(r, faces, repair=True, subdivisions=1)
    found = am.simulate(P, mesh=shape, until=am.time(0.1))
    assert 30 < len(found.final.c) < 60
    assert any("remeshed" in change for change in found.adapted.repairs)
    assert am.Surface(*ellipsoid()).cell(P).repairs == ()


def test_the_fineness_of_a_repair_needs_a_repair():
    with pytest.raises(am.InvalidInput, match="subdivisions must come with repair=True"):
        am.Surface("cell.ply", subdivisions=2)
    with pytest.raises(am.InvalidInput, match=r"mesh\.subdivisions must be a whole number"):
        am.Surface("cell.ply", repair=True, subdivisions=0)


def test_a_run_starts_as_another_cell(solution):
    again = am.simulate(P, initial=solution.final, until=am.time(0.5))
    # scaled to the area of the membrane, from which it is off by the error of the run
    np.testing.assert_allclose(again.frames[0].r, solution.final.r, atol=1e-6)
    np.testing.assert_array_equal(again.frames[0].c, solution.final.c)
    initial = Initial(perturbation=0.0, noise=0.1)
    noisy = am.simulate(P, mesh=SMALL, initial=initial, until=am.time(0.1))
    assert np.std(noisy.frames[0].c - 3.0) > 0.05


@pytest.mark.parametrize(
    ("keywords", "says"),
    [
        ({"parameters": 3.0}, "parameters must be Parameters or a Config"),
        ({"mesh": 3}, "mesh must be amoeboid.Icosphere"),
        ({"until": "steady"}, "until must be an event"),
        ({"initial": 3.0}, "initial must be"),
        ({"times": []}, "at least one time"),
        ({"times": 0.5}, "times must be a list of times, got 0.5"),
        ({"observe": ["speed"]}, "unknown observable 'speed'"),
        ({"writers": [print]}, "must have the methods due"),
        ({"progress": "yes"}, "progress must be"),
        ({"output": Output(times=[1.0]), "mesh": "ball"}, "mesh must be"),
    ],
)
def test_wrong_arguments_are_refused(keywords, says):
    with pytest.raises(am.InvalidInput, match=says):
        am.simulate(**keywords)


def test_extreme_objects_have_short_texts(solution):
    step, many = solution.last, tuple(range(1, 1000))
    texts = ("t > 1 or " * 40 + "t > 2",) * 20
    changes = {
        name: am.steps(*[(float(t), 1.0 / t) for t in many])
        for name in ("v_p0", "D", "beta", "alpha", "c_r", "eta_s", "eta_b", "delta_P", "c0")
    }
    for found in (
        step,
        step.model,
        step.state,
        step.flow,
        step.cell,
        am.OBSERVABLES,
        Output(times=many),
        Time(until=texts),
        Initial(harmonics=[(2, 0, 0.1)] * 300),
        Config(changes=changes, time=Time(until=texts), output=Output(times=many)),
    ):
        assert len(repr(found)) < 1000
        assert repr(found).startswith(type(found).__name__)
    assert repr(Time(end=2.0)).startswith("Time(end=2.0, scheme='semi-implicit', tolerance=0.001,")


@pytest.mark.parametrize("count", [0, -1, 7, 99, 1.5, True, "3"])
def test_an_icosphere_that_no_run_can_have_is_refused_at_once(count):
    with pytest.raises(am.InvalidInput, match=r"mesh.subdivisions must be a whole number >= 1"):
        am.Icosphere(count)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((np.zeros((4, 3)),), "add the faces"),
        ((np.zeros((4, 2)), np.zeros((4, 3), int)), "must be \\(V, 3\\)"),
        ((np.zeros((4, 3)), np.full((4, 3), 4)), "numbers of nodes, 0 to 3"),
        ((np.full((4, 3), np.nan), np.zeros((4, 3), int)), "finite"),
        (("cell.ply", np.zeros((4, 3), int)), "got both"),
    ],
)
def test_a_surface_that_is_none_is_refused(arguments, says):
    with pytest.raises(am.InvalidInput, match=says):
        am.Surface(*arguments)


@pytest.mark.slow
def test_a_run_that_diverges_keeps_its_good_steps():
    p = am.Parameters(law="inverse", D=1e-4, v_p0=30.0)
    found = am.simulate(p, mesh=SMALL, initial=Initial(perturbation=2.9))
    assert found.status == "diverged"
    assert "at t = " in found.ended
    assert np.all(np.isfinite(found.final.c))
    assert repr(found).startswith("Solution(diverged at t = ")

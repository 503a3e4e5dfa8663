"""What a user adds from a script, without touching the package."""

import json

import numpy as np
import pytest

import amoeboid as am
from amoeboid.cli.main import main

P = am.Parameters(D=0.4, v_p0=6.0)
SMALL = am.Icosphere(1)


@pytest.fixture
def registered():
    """The list of observables, put back afterwards."""
    saved = dict(am.OBSERVABLES)
    yield am.OBSERVABLES
    am.OBSERVABLES.clear()
    am.OBSERVABLES.update(saved)


def test_an_observable_of_a_script_is_seen_in_every_solver(registered, tmp_path):
    @am.observable("N/L^2")
    def rms_c(cell):
        return np.sqrt(cell.integral(cell.c**2) / cell.area)

    # the 3D cell: time series, snapshots, folder
    run = am.simulate(P, mesh=SMALL, until=am.time(0.5), folder=tmp_path / "run")
    assert run["rms_c"][0] == pytest.approx(np.sqrt(3.0**2 + 3.0**2 / 3.0), rel=0.02)
    assert run.final.rms_c == run["rms_c"][-1] == am.load(tmp_path / "run")["rms_c"][-1]
    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text())
    assert manifest["units"]["rms_c"] == "N/L^2"
    # and as a condition that ends it
    assert am.simulate(P, mesh=SMALL, until=am.when("rms_c > 4")).final.rms_c > 4
    # the axisymmetric cell: the same number of the same state, to the error of the mesh
    states = am.steady_states(am.Parameters(D=0.4, v_p0=5.5))
    assert states[0].rms_c == pytest.approx(3.0, rel=1e-12)
    fast = states.fastest_stable
    mesh = am.simulate(fast.parameters, initial=fast, mesh=am.Icosphere(2), until=am.time(0.01))
    assert mesh.frames[0].rms_c == pytest.approx(fast.rms_c, rel=0.01)
    assert list(states.to_pandas()["rms_c"]) == [state.rms_c for state in states]


def test_an_observable_of_a_script_is_in_tables_and_json_of_steady(registered, capsys):
    registered["half_rear"] = am.Observable(lambda cell: 0.5 * cell.maximum(cell.c), "N/L^2")
    words = ["steady", "--set", "D=0.4", "--set", "v_p0=3", "--observe", "half_rear"]
    assert main([*words, "--json"]) == 0
    (state,) = json.loads(capsys.readouterr().out)["states"]
    assert state["half_rear"] == 0.5 * state["c_rear"] == 1.5
    assert main(words) == 0
    assert "half_rear" in capsys.readouterr().out
    assert main([*words, "--observe", "mesh_quality"]) == 2
    assert "unknown observable 'mesh_quality' of an axisymmetric" in capsys.readouterr().err


@pytest.mark.slow
def test_an_observable_of_a_script_is_a_column_of_a_branch(registered):
    registered["double_speed"] = am.Observable(
        lambda cell: 2.0 * am.OBSERVABLES["max_retrograde_speed"].function(cell), "L/T"
    )
    branch = am.branch(am.Parameters(D=0.4), "v_p0", 5.0, 7.0)
    np.testing.assert_array_equal(branch.double_speed, 2.0 * branch.max_retrograde_speed)
    assert "double_speed" in branch.to_pandas()


@pytest.mark.parametrize(
    ("name", "function", "says"),
    [
        ("mine", 3.0, "must be a function of a cell, got 3.0"),
        ("my speed", len, "must have a name of letters"),
        (3, len, "must have a name of letters"),
        ("_mine", len, "must have a name of letters"),
    ],
)
def test_a_wrong_registration_is_refused_at_once(registered, name, function, says):
    before = list(registered)
    with pytest.raises(am.InvalidInput, match=says):
        registered[name] = function
    with pytest.raises(am.InvalidInput, match="add the brackets"):
        am.observable(len)
    assert list(registered) == before


def test_a_vector_has_three_columns_and_a_mesh_one_is_of_meshes_alone(registered):
    registered["middle"] = am.Observable(lambda cell: cell.r.mean(axis=0), "L", True, True)
    run = am.simulate(P, mesh=SMALL, until=am.time(0.1))
    assert run["middle"].shape == (len(run), 3)
    np.testing.assert_array_equal(run.final.middle, [run[f"middle_{a}"][-1] for a in "xyz"])
    state = am.steady_states(am.Parameters(D=0.4, v_p0=3.0))[0]
    for name in ("middle", "mesh_quality"):
        with pytest.raises(AttributeError):
            getattr(state, name)
    with pytest.raises(AttributeError, match="triangulated surfaces only"):
        state.solution.mesh_quality  # noqa: B018


def test_an_event_is_any_function_of_a_step():
    def dense_rear(step):
        return step.cell.c.max() > 3 * step.model.parameters.c0

    found = am.simulate(P, mesh=SMALL, until=dense_rear)
    assert (found.status, found.ended) == ("finished", "dense_rear")
    assert found.final.c.max() > 9 >= found.frames[0].c.max()

    class Fast:
        name = "fast enough"

        def __call__(self, step):
            return step.cell.max_length(step.flow.v) > 0.0

    assert am.simulate(P, mesh=SMALL, until=[Fast(), am.steady()]).ended == "fast enough"


class Widths:
    """Writes the extent of the cell along z, twice per unit of time, to a file of its own."""

    def __init__(self, path):
        self.path, self.count, self.last = path, 0, None

    def due(self, step):
        times = []
        while 0.5 * self.count <= step.state.t:
            times.append(0.5 * self.count)
            self.count += 1
        return times

    def write(self, step):
        with self.path.open("a") as file:
            file.write(f"{step.state.t} {np.ptp(step.state.r[:, 2])}\n")

    def finish(self, step):
        self.last = step.number


def test_a_writer_of_a_script_writes_at_its_own_times(tmp_path):
    for folder in (None, tmp_path / "run"):
        widths = Widths(tmp_path / f"{folder is None}.txt")
        run = am.simulate(P, mesh=SMALL, until=am.time(1.2), writers=[widths], folder=folder)
        table = np.loadtxt(widths.path)
        np.testing.assert_array_equal(table[:, 0], [0.0, 0.5, 1.0])
        assert table[-1, 1] == np.ptp(run.frames[2].r[:, 2])
        assert widths.last == run.last.number

    class EverySecondStep:
        numbers = ()

        def due(self, step):
            return step.number % 2 == 0

        def write(self, step):
            self.numbers = (*self.numbers, step.number)

    counted = EverySecondStep()
    run = am.simulate(P, mesh=SMALL, until=am.time(0.5), writers=[counted])
    assert counted.numbers == tuple(range(0, run.last.number + 1, 2))


class Asks:
    def __init__(self, due):
        self.answer = due

    def due(self, step):
        return self.answer(step)

    def write(self, step):
        pass


@pytest.mark.parametrize(
    "due",
    [
        lambda step: [step.state.t + 5.0],
        lambda step: [-3.0],
        lambda step: "never",
        lambda step: [None],
        lambda step: [float("nan")],
    ],
)
def test_a_writer_that_asks_for_no_time_of_the_step_is_refused_by_name(due):
    with pytest.raises(am.InvalidInput, match=r"due.step. of a writer .* Asks returned"):
        am.simulate(P, mesh=SMALL, until=am.time(0.05), writers=[Asks(due)])


def test_an_event_that_gives_no_truth_value_is_refused_by_name():
    def two_answers(step):
        return step.state.c[:2] > 3.0

    with pytest.raises(am.InvalidInput, match="must return true, false or a text, two_answers"):
        am.simulate(P, mesh=SMALL, until=two_answers)


def test_a_condition_ends_a_run_of_the_command_and_stands_in_its_configuration(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr("amoeboid.plotting.cell.save_cell_picture", lambda *_: None)
    folder = str(tmp_path / "run")
    words = ["run", "--set", "mesh.subdivisions=1", "--json", "-o", folder]
    assert main([*words, "--until", "t > 0.3", "--until", "c_rear < 0"]) == 0
    found = json.loads(capsys.readouterr().out)
    run = am.load(folder)
    assert run.ended == "t > 0.3"
    assert run.config.time.until == ("t > 0.3", "c_rear < 0")
    assert found["steps"] == run.last.number
    for name in ("cell.png", "trajectory.png"):
        (run.folder / name).touch()  # or they would be drawn
    assert main(["run", "--resume", folder]) == 2
    assert "has ended t > 0.3 at t = 0.3" in capsys.readouterr().err
    go_on = ["run", "--resume", folder, "--set", "time.until=[]", "--set", "time.end=0.5", "--json"]
    assert main(go_on) == 0
    assert am.load(folder).ended == "end of time"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "speed > 1",
            "'speed' is not t, a parameter or one of max_retrograde_speed",
        ),
        ("polarity", "nothing is compared"),
        ("polarity == 1", "use >, >=, < or <="),
        ("__import__('os') > 1", "is not allowed"),
        ("polarity > ", "must be a comparison such as"),
        ("t > 'x'", "'x' is not a number"),
        ("cortex_drag_heading > 1", "is not t, a parameter"),
        ("9" * 600 + " > 1", "must be a comparison"),
    ],
)
def test_a_condition_that_compares_nothing_known_is_refused(text, says, capsys):
    with pytest.raises(am.InvalidInput, match=says):
        am.when(text)
    assert main(["run", "--until", text]) == 2
    assert "Traceback" not in capsys.readouterr().err


def test_conditions_compare_observables_parameters_and_the_time():
    step = am.simulate(P, mesh=SMALL, until=am.time(0.1)).last
    for text, expected in (
        ("c_front < c0 < c_rear", True),
        ("not c_front < c0 or t > 1", False),
        ("-zeta0 + 2*delta_P >= 0 and t <= 0.1", True),
        ("(c_rear - c_front)**2 / c0 > 1e9", False),
    ):
        assert am.when(text)(step) is expected, text
    with pytest.raises(am.InvalidInput, match=r"must have a value at t = 0\.1"):
        am.when("1/alpha > 1")(step)


def test_conditions_name_parameters_of_an_own_law():
    p = am.Parameters(D=0.4, v_p0=9.5, law=am.Custom("v_p0/(1 + (c/c_r)**n)", n=3.0))
    run = am.simulate(p, mesh=SMALL, until=[am.when("t > 0.1*law.n"), am.time(1.0)])
    assert run.ended == "t > 0.1 * law.n"
    assert 0.3 < run.t[-1] < 1.0
    for text in ("law.m > 1", "stress.n > 1"):
        with pytest.raises(am.InvalidInput, match=r"unknown parameter .*;.* allowed: .*law\.n"):
            am.simulate(p, mesh=SMALL, until=am.when(text))
    with pytest.raises(am.InvalidInput, match=r"'t\.n' is not allowed"):
        am.when("t.n > 1")

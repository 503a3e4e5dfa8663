"""The commands steady, branch and phase-diagram: what they print, draw and refuse."""

import json

import pytest

from amoeboid.cli.main import main


def run(capsys, *words):
    code = main(list(words))
    out, err = capsys.readouterr()
    return code, out, err


def test_steady_prints_every_state_with_its_stability(capsys):
    code, out, err = run(capsys, "steady", "--set", "D=0.4", "--set", "v_p0=5.5", "--json")
    assert code == 0
    assert err == ""
    document = json.loads(out)
    assert [s["stable"] for s in document["states"]] == [True, False, True]
    assert document["states"][0]["max_retrograde_speed"] == 0.0
    assert document["states"][2]["max_retrograde_speed"] == pytest.approx(1.4537, abs=5e-5)
    assert set(document["states"][2]) >= {
        "max_retrograde_speed", "c_front", "c_rear", "zeta0", "stable",
    }  # fmt: skip


def test_branch_prints_points_folds_and_branch_points(capsys):
    code, out, err = run(
        capsys, "branch", "--set", "D=0.4", "--vary", "v_p0", "--to", "8", "--json"
    )
    assert code == 0
    assert err == ""
    document = json.loads(out)
    assert document["folds"][0]["v_p0"] == pytest.approx(5.20959845, abs=1e-8)
    assert document["folds"][0]["stable"] is None
    assert document["folds"][0]["unstable_modes"] == {"0": None, "1": 0, "2": 0, "3": 0}
    assert document["branch_points"][0]["v_p0"] == pytest.approx(6.0256610770, abs=1e-9)
    assert document["points"][-1]["v_p0"] == 8.0
    assert set(document["points"][0]) >= {
        "v_p0", "max_retrograde_speed", "c_front", "c_rear", "zeta0", "stable",
    }  # fmt: skip
    assert document["message"] == ""


def test_branch_in_another_parameter(capsys):
    words = ("branch", "--set", "D=0.4", "--set", "v_p0=6", "--vary", "delta_P", "--to", "50")
    code, out, _ = run(capsys, *words, "--json")
    assert code == 0
    points = json.loads(out)["points"]
    assert points[0]["delta_P"] == 300.0
    assert points[0]["max_retrograde_speed"] == pytest.approx(1.834173, abs=5e-7)
    assert points[-1]["delta_P"] == 50.0


@pytest.mark.parametrize("command", [("steady",), ("branch", "--to", "6", "--max-step", "0.4")])
def test_what_may_be_missing_is_part_of_the_document(capsys, command):
    code, out, err = run(capsys, *command, "--set", "D=0.4", "--set", "v_p0=5.5", "--json")
    document = json.loads(out)
    assert (code, err) == (0, "")
    assert document["complete"] is True
    assert document["problems"] == []


def test_a_branch_that_is_in_the_window_twice_is_listed_in_pieces(capsys):
    words = ("branch", "--set", "D=0.4", "--from", "5.5", "--to", "8", "--max-step", "0.4")
    code, out, err = run(capsys, *words, "--json")
    points = json.loads(out)["points"]
    assert (code, err) == (0, "")
    assert [p["v_p0"] for p in points if p["piece"] == 0][-1] == 5.5
    upper = [p for p in points if p["piece"] == 1]
    assert [upper[0]["v_p0"], upper[-1]["v_p0"]] == [5.5, 8.0]
    assert all(p["stable"] for p in upper)
    _, out, _ = run(capsys, *words)
    assert "enters the window 2 times" in out


def test_an_incomplete_branch_says_so(capsys):
    words = ("branch", "--set", "D=0.4", "--to", "8", "--max-points", "5", "--json")
    code, out, err = run(capsys, *words)
    assert code == 1
    assert "incomplete" in err
    assert "allow more" in json.loads(out)["message"]


def test_phase_diagram_prints_and_draws_regions_and_edges(capsys, tmp_path):
    path = tmp_path / "diagram.png"
    words = ("--from", "0.04", "--to", "0.4", "--columns", "3", "--rows", "3", "--plot", str(path))
    code, out, _ = run(capsys, "phase-diagram", *words, "--json")
    assert code == 0
    assert path.stat().st_size > 5000
    document = json.loads(out)
    assert len(document["regions"]) == 3
    assert {len(row) for row in document["regions"]} == {3}
    assert len(document["threshold"]) == 3
    assert document["boundary"][0]["D"] == pytest.approx(0.0451, abs=1e-4)
    assert document["fold"]
    assert document["problems"] == []


def test_tables_for_people(capsys):
    _, out, _ = run(capsys, "steady")
    assert "0.3417" in out
    _, out, _ = run(capsys, "branch", "--set", "D=0.4", "--to", "6", "--max-step", "0.4")
    assert "fold at v_p0 = 5.20959845" in out


@pytest.mark.parametrize(
    ("suffix", "words"),
    [
        (".png", ("steady",)),
        (".svg", ("branch", "--set", "D=0.4", "--set", "delta_P=11", "--to", "8",
                  "--max-step", "0.3")),
    ],
)  # fmt: skip
def test_pictures_are_drawn(capsys, tmp_path, words, suffix):
    path = tmp_path / f"picture{suffix}"
    assert run(capsys, *words, "--plot", str(path))[0] == 0
    assert path.stat().st_size > 5000


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (("steady", "--set", "D=-1"), "D must be"),
        (("steady", "--set", "time.end=50"), "'time.end=50'"),
        (("branch", "--to", "8", "--set", "mesh.subdivisions=2"), "only parameters"),
        (("phase-diagram", "--set", "output.interval=1"), "only parameters"),
        (("theory", "--set", "initial.seed=1"), "leave it out"),
        (("steady", "--set", "time.nonsense=1"), "nonsense"),
        (("steady", "--set", "law=nonsense"), "law must be one of"),
        (("steady", "--plot", "picture.jpg"), "--plot must end in"),
        (("steady", "--plot", "no/such/folder/a.png"), "existing folder"),
        (("branch", "--vary", "law", "--to", "1"), "--vary must be one of"),
        (("branch", "--vary", "D", "--to", "-1"), "D must be"),
        (("branch", "--to", "nan"), "--to must be a finite number"),
        (("branch", "--from", "3", "--to", "3"), "must differ"),
        (("branch", "--to", "8", "--max-step", "0"), "--max-step must be > 0"),
        (("branch", "--to", "8", "--max-points", "0"), "--max-points must be >= 1"),
        (("branch", "--to", "2"), "does not enter"),
        (("branch", "--to", "8", "--set", "law=v_p0*(1+c)"), "no polarized state"),
        (("branch", "--vary", "alpha", "--to", "1", "--set", "v_p0=1"), "no polarized state"),
        (("phase-diagram", "--vary", "v_p0"), "--vary must be one of"),
        (("phase-diagram", "--from", "1", "--to", "0.5"), "--from must be < --to"),
        (("phase-diagram", "--speed-from", "9"), "--speed-from must be < --speed-to"),
        (("phase-diagram", "--columns", "1"), "--columns must be a whole number >= 2"),
        (("phase-diagram", "--to", "inf"), "finite number"),
    ],
)
def test_mistakes_are_one_message_and_exit_code_2(capsys, words, text):
    code, out, err = run(capsys, *words)
    assert code == 2
    assert out == ""
    assert text in err
    assert len(err.strip().splitlines()) == 1


@pytest.mark.parametrize("command", ["steady", "theory"])
def test_commands_say_which_parameters_count(capsys, command):
    _, out, _ = run(capsys, command, "--set", "v_p0=3.6")
    assert "D = 0.03" in out.splitlines()[0]
    assert "v_p0 = 3.6" in out.splitlines()[0]


@pytest.mark.parametrize(
    ("words", "first"),
    [
        (("branch", "--to", "6", "--max-step", "0.4"), "D = 0.4, v_p0 varies, all else as"),
        (
            ("phase-diagram", "--from", "0.3", "--to", "0.4", "--columns", "2", "--rows", "2"),
            "D varies, v_p0 varies, all else as",
        ),
    ],
)
def test_a_parameter_that_varies_has_no_value_in_the_first_line(capsys, words, first):
    _, out, _ = run(capsys, *words, "--set", "D=0.4")
    assert out.splitlines()[0].startswith(first)


SMOOTH = ("--physical", "--set", "D=1 um^2/s", "--set", "v_p0=2 um/s")


def test_steady_states_of_a_physical_cell_have_units(capsys):
    code, out, err = run(capsys, "steady", *SMOOTH, "--json")
    document = json.loads(out)
    assert (code, err) == (0, "")
    assert document["units"] == {
        "max_retrograde_speed": "um/s", "c_front": "1/um^2", "c_rear": "1/um^2", "zeta0": "mN/m",
    }  # fmt: skip
    assert document["states"][0]["c_rear"] == pytest.approx(1370)
    assert document["states"][1]["max_retrograde_speed"] == pytest.approx(0.293923, abs=1e-6)
    _, out, _ = run(capsys, "steady", *SMOOTH)
    assert "D = 1 um^2/s, v_p0 = 2 um/s" in out
    assert "max_retrograde_speed [um/s]" in out


def test_branches_of_a_physical_cell_take_quantities(capsys):
    words = ("branch", *SMOOTH, "--to", "2.2 um/s", "--max-step", "0.4")
    document = json.loads(run(capsys, *words, "--json")[1])
    assert document["branch_points"][0]["v_p0"] == pytest.approx(
        1.46060025 * (0.1 + 0.5) / (0.003 + 0.5),
        rel=1e-8,  # that of the paper at D/R0 = 0.003 um/s
    )
    assert document["points"][-1]["v_p0"] == pytest.approx(2.2)
    assert document["units"]["v_p0"] == "um/s"
    for words, text in (
        (("branch", *SMOOTH, "--to", "2.2"), "--to must be a number with a unit"),
        (("branch", *SMOOTH, "--to", "2.2 um"), "--to must have the dimension L/T"),
        (("branch", "--to", "8 um/s"), "--physical"),
        (("phase-diagram", *SMOOTH, "--from", "1"), "--from must be a number with a unit"),
    ):
        code, out, err = run(capsys, *words)
        assert (code, out) == (2, "")
        assert text in err
        assert len(err.strip().splitlines()) == 1


def test_a_phase_diagram_of_a_physical_cell_has_units(capsys):
    words = ("--from", "1 um^2/s", "--to", "1.2 um^2/s", "--speed-from", "1.6 um/s")
    words += ("--speed-to", "2.2 um/s", "--columns", "2", "--rows", "2", "--json")
    document = json.loads(run(capsys, "phase-diagram", *SMOOTH, *words)[1])
    assert document["units"] == {"v_p0": "um/s", "D": "um^2/s"}
    assert document["D"] == pytest.approx([1.0, 1.2])
    assert document["v_p0"] == pytest.approx([1.6, 2.2])
    assert document["regions"] == [["rest", "rest"], ["polarized", "polarized"]]

"""`amoeboid theory` as a user calls it."""

import json
import subprocess
import sys

import pytest

from amoeboid.cli.main import main
from amoeboid.closed_forms.linear import critical_speed, thresholds
from amoeboid.model.parameters import Parameters

CONTRACT = {
    "v_p_critical",
    "growth_rates",
    "growth_rates_finite_pressure",
    "nu",
    "nu_infinite_pressure",
    "bifurcation",
    "first_mode",
    "max_retrograde_speed",
    "delta_P_star",
}


def _json(capsys, *arguments):
    assert main(["theory", "--json", *arguments]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert out.count("\n") == 1
    return json.loads(out)


def _set(**changes):
    return [text for name, value in changes.items() for text in ("--set", f"{name}={value}")]


def test_json_has_the_keys_of_the_contract(capsys):
    found = _json(capsys)
    assert set(found) >= CONTRACT
    assert found["v_p_critical"] == pytest.approx(float(critical_speed(Parameters())))
    assert list(found["growth_rates"]) == ["1", "2", "3", "4", "5", "6"]
    assert list(found["growth_rates_finite_pressure"]) == ["2", "3", "4", "5", "6"]
    slow, fast = found["growth_rates_finite_pressure"]["2"]
    assert slow > fast
    assert found["bifurcation"] == "supercritical"
    assert 0.2 < found["relative_error"] < 0.55


def test_table_is_readable_and_names_everything(capsys):
    assert main(["theory"]) == 0
    out = capsys.readouterr().out
    for words in (
        "3.54844", "-0.0127883", "-0.0130014", "supercritical", "-0.327339", "estimated relative",
    ):  # fmt: skip
        assert words in out


def test_physical_units(capsys):
    found = _json(capsys, "--physical")
    assert found["v_p_critical"] == pytest.approx(1.46060025, rel=1e-8)
    assert found["units"]["v_p_critical"] == "um/s"
    # 0.173 for delta_P -> infinity, the 0.17 of the paper; the exact flow is 0.163.
    assert found["max_retrograde_speed"] == pytest.approx(0.1479, abs=5e-5)
    assert found["relative_error"] == 1
    stiff = _json(capsys, "--physical", *_set(alpha="4.16058e-20 Pa m^3"))
    assert stiff["v_p_critical"] == pytest.approx(1.614, abs=5e-4)
    # Rates in 1/s: beta is 0.1/s.
    assert found["growth_rates"]["1"] == pytest.approx(2 * 1.7 / found["v_p_critical"] * (
        3e-4 + 0.05) - 2 * 3e-4 - 0.1, rel=1e-9)  # fmt: skip
    assert main(["theory", "--physical"]) == 0
    assert "um/s" in capsys.readouterr().out


SILENT = [
    {"c0": 0},
    {"D": 0},
    {"beta": 0},
    {"v_p0": 0},
    {"delta_P": 0},
    {"eta_b": 0},
    {"alpha": 5},
    {"D": 0, "beta": 0},
    {"D": 0, "beta": 0, "alpha": 0.1},
    {"D": 0, "beta": 0, "alpha": 0.1, "law": "v_p0/(1+c)"},
    {"law": "v_p0*c/c_r"},
    {"law": "v_p0*(1 - v_p0/40)*exp(-c/c_r)"},
    {"law": "v_p0*exp(-(c/c_r-3)**2)"},
    {"law": "1 + 0*c"},
    {"law": "exp(-c)"},
    {"law": "v_p0*sin(c)"},
    {"law": "log(v_p0)*c"},
    {"D": 0.4, "v_p0": 5.9},
    {"D": 0.4, "v_p0": 7},
    {"delta_P": 0, "v_p0": 3.6},
    {"delta_P": 60, "beta": 60, "v_p0": 40},
    {"v_p0": 0, "delta_P": 0, "law": "inverse"},
    {"c0": 700},
    {"v_p0": 1e6},
]


@pytest.mark.parametrize("changes", SILENT, ids=str)
def test_odd_but_valid_points_get_an_answer(capsys, theory_once, changes):
    found = _json(capsys, *_set(**changes))
    assert set(found) >= CONTRACT
    if found["v_p_critical"] is None:
        assert any("no threshold" in note for note in found["notes"])
        assert found["nu"] is None
    if found["max_retrograde_speed"] in (None, 0.0):
        assert found["notes"]
    assert main(["theory", *_set(**changes)]) == 0
    assert "nan" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (_set(c0=0, law="inverse"), "c > 0"),
        (_set(c0=-1), "c0 must be a finite number >= 0"),
        (_set(R0=0), "R0 must be a finite number > 0"),
        (_set(D="abc"), "D must be"),
        (_set(nonsense=1), "nonsense"),
        (_set(law="v_p0*exp(-d)"), "the name 'd'"),
        (_set(law="v_p0/(c-3)"), "must be finite"),
        (_set(R0=1e-200), "exceeds double precision"),
        (_set(v_p0=1e308, c0=1e-5), "exceeds double precision"),
        (["--set", "D"], "name=value"),
        (["--physical", "--set", "D=1 parrot"], "number with a unit"),
        (["--physical", "--set", "D=0.3"], "dimension"),
        (["--physical", "--set", "R0=3 s"], "R0 must have the dimension L"),
        (["--physical", "--set", "time.end=3 s"], "unknown parameter"),
        (["--physical", "--set", "D="], "name=value"),
        (["--physical", *_set(law="foo")], "law"),
    ],
    ids=str,
)
@pytest.mark.parametrize("format_", [[], ["--json"]], ids=["table", "json"])
def test_user_mistakes_get_one_message_and_exit_code_2(capsys, arguments, words, format_):
    assert main(["theory", *format_, *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert words in err
    assert err.startswith("amoeboid theory: ")
    assert "Traceback" not in err


@pytest.mark.slow
def test_json_goes_through_a_real_process():
    run = subprocess.run(
        [sys.executable, "-c", "import amoeboid.cli.main as m; m.main()", "theory", "--json"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert run.returncode == 0
    assert json.loads(run.stdout)["v_p_critical"] > 0


def test_several_thresholds_are_all_listed(capsys):
    law = "v_p0*(1 - v_p0/40)*exp(-c/c_r)"
    found = _json(capsys, *_set(law=law))
    assert found["thresholds"] == pytest.approx(thresholds(Parameters(law=law)).v_p0.tolist())
    assert len(found["thresholds"]) == 2
    assert any("several thresholds" in note for note in found["notes"])


def test_nu_and_the_bifurcation_belong_to_the_pressure_of_the_cell(capsys):
    found = _json(capsys, *_set(delta_P=5, D=0.03, v_p0=3.56))
    assert found["nu"] == pytest.approx(0.0026143419, rel=1e-7)
    assert found["nu_infinite_pressure"] == pytest.approx(-0.0130014430, rel=1e-8)
    assert found["bifurcation"] == "subcritical"
    assert found["bifurcation_infinite_pressure"] == "supercritical"
    assert found["max_retrograde_speed"] is None
    assert any("subcritical at this pressure" in note for note in found["notes"])
    assert not any("at this pressure and super" in note for note in _json(capsys)["notes"])


@pytest.mark.parametrize("v_p0", [3.4, 3.6])
def test_a_cell_whose_second_mode_goes_first_is_not_predicted_to_polarize(capsys, v_p0):
    """delta_P = 0.5 < delta_P* = 0.918: the sphere becomes unstable at 3.09, mode 1 at 3.55."""
    found = _json(capsys, *_set(delta_P=0.5, D=0.03, v_p0=v_p0))
    assert found["first_mode"] == 2
    assert found["first_mode_v_p0"] < found["v_p_critical"]
    assert found["max_retrograde_speed"] is None
    assert not found.get("amplitude_stable", False)
    first, branch_, speed = found["notes"][-3:]
    assert "mode l = 2 goes unstable first" in first
    assert "symmetric from front to rear" in first
    assert "polarized branch" in branch_
    assert "amoeboid steady" in speed


def test_a_cell_that_rests_above_the_critical_pressure_is_said_to_rest(capsys):
    found = _json(capsys, *_set(delta_P=5, v_p0=3.0))
    assert found["max_retrograde_speed"] == 0
    assert any("no flow" in note for note in found["notes"])


def test_a_flow_that_the_theory_does_not_reach_is_not_predicted(capsys):
    """At beta = 0, c0 = 1.5 and delta_P = 3 nu is nearly 0: the cubic flow is 3 times too fast."""
    found = _json(capsys, *_set(D=0.2, delta_P=3, beta=0, c0=1.5, v_p0=0.65))
    assert found["in_reach"] is False
    assert found["max_retrograde_speed"] is None
    assert any("too far from the threshold" in note for note in found["notes"])

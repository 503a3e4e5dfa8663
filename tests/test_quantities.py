"""Quantities with units in the input of runs, and the same units in what runs leave."""

import csv
import json
import re
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

import amoeboid as am
from amoeboid.cli.main import main
from amoeboid.config import config_of, with_settings
from amoeboid.model.units import Units
from amoeboid.output.scale import Scale
from amoeboid.toml import toml_text
from amoeboid.validation import InvalidInput

pytestmark = pytest.mark.usefixtures("without_pictures")

FILE = """
physical = true
[parameters]
R0 = "8 um"
v_p0 = "1.3 um/s"
[initial]
perturbation = "300 / um^2"
harmonics = [[2, 0, "100 / um^2"]]
[time]
end = "15 min"
[output]
times = ["1 min", "120 s"]
[changes]
D = {ramp = [["0 s", "0.03 um^2/s"], ["10 min", "0.1 um^2/s"]]}
v_p0 = [["5 min", "0 um/s"]]
[cue]
pokes = [["1 min", "30 s", 0, 0, 1, 0.5]]
[environment]
medium = "fluid:2 mPa s"
"""
CELL = ["R0=8 um", "v_p0=1.3 um/s"]
SHORT = ["mesh.subdivisions=1", "time.end=10 s", "environment.medium=matrix"]


def settings(*texts):
    return [word for text in texts for word in ("--set", text)]


def run(folder, *words):
    return main(["run", "-o", str(folder), "--json", *words])


def test_a_file_with_units_is_the_cell_of_python():
    config = am.config_from_toml(FILE)
    cell = am.Parameters.physical(R0="8 um", v_p0="1.3 um/s")
    assert (config.parameters, config.parameters.units) == (cell, cell.units)
    minute, area = 60 / cell.units.time, cell.units.length**2 / cell.units.filaments * 1e12
    assert config.time.end == pytest.approx(15 * minute, rel=1e-14)
    assert config.output.times == pytest.approx([minute, 2 * minute], rel=1e-14)
    assert config.initial.perturbation == pytest.approx(300 * area, rel=1e-14)
    assert config.initial.harmonics[0][2] == pytest.approx(100 * area, rel=1e-14)
    assert config.cue.pokes[0][:2] == pytest.approx((minute, minute / 2), rel=1e-14)
    D, v_p0 = config.changes["D"].points, config.changes["v_p0"].points
    assert D[1] == pytest.approx((10 * minute, cell.replace(D="0.1 um^2/s").D), rel=1e-14)
    assert v_p0 == ((pytest.approx(5 * minute, rel=1e-14), 0.0),)


def test_a_configuration_with_units_is_read_back_equal():
    config = am.config_from_toml(FILE)
    again = am.config_from_toml(am.config_to_toml(config))
    assert again == config
    assert again.parameters.units == config.parameters.units


def test_settings_and_a_file_make_one_cell():
    """The units of the cell follow from all that is given, so that R0 is 1 in them."""
    file = {
        "physical": True,
        "parameters": {"R0": "20 um", "law": "v_p0/(1+c/c_r+k*c)", "law.k": 2},
    }
    found = config_of(file, [*CELL, "law=inverse", "time.end=2 min"])
    expected = am.Parameters.physical(R0="8 um", v_p0="1.3 um/s", law="inverse")
    assert (found.parameters, found.parameters.units) == (expected, expected.units)
    assert found == config_of({}, [*CELL, "law=inverse", "time.end=2 min"], physical=True)


def test_a_declared_parameter_of_a_stress_takes_a_quantity_later_too():
    cell = am.Parameters.physical(stress="saturating", **{"stress.chi": "4e-20 Pa m^3",
                                                          "stress.c_s": 1.0})  # fmt: skip
    again = cell.replace(**{"stress.chi": "8e-20 Pa m^3"})
    assert again.stress.chi == pytest.approx(2 * cell.stress.chi, rel=1e-14)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("time.end=90", "time.end must be a number with a unit, such as '300 s', got 90"),
        ("time.end=15 m", "time.end must have the dimension T, such as '300 s'"),
        ("time.end=-5 s", "time.end must be a finite number > 0"),
        ("time.end=soon", "time.end must be a number with a unit"),
        ("output.times=[1, 2]", "output.times must be a number with a unit"),
        ("D=0.3", "D must be a number with a unit"),
        ("initial.perturbation=3", "initial.perturbation must be a number with a unit"),
        ("initial.harmonics=[[2, 0, 1]]", "initial.harmonics must be a number with a unit"),
        ("changes.v_p0=[[5, 0]]", "changes.v_p0 must be a number with a unit"),
        ("changes.v_p0=[['5 min', '2 um']]", "changes.v_p0 must have the dimension L/T"),
        ("environment.medium=fluid:1", "fluid.viscosity must have a unit"),
        ("cue.strength=1 um", "got '1 um'; it has no unit, leave that out"),
    ],
)
def test_numbers_without_a_unit_are_refused_for_a_cell_with_units(setting, message):
    with pytest.raises(InvalidInput, match=re.escape(message)):
        with_settings(am.Config(parameters=am.Parameters.physical()), [setting])


@pytest.mark.parametrize("setting", ["time.end=15 min", "R0=8 um", "output.interval=3 s"])
def test_quantities_without_a_cell_with_units_name_the_remedy(setting):
    with pytest.raises(InvalidInput, match=r"--physical on the command line, physical = true at"):
        with_settings(am.Config(), [setting])


@pytest.mark.parametrize(
    ("file", "message"),
    [
        ('physical = "yes"', "physical must be true or false, got 'yes'"),
        ("[units]\nlength = 1.0", "[units] must have length, time, mass, filaments"),
        ("[units]\nlength=1e-200\ntime=1.0\nmass=1.0\nfilaments=1e200", "double precision"),
        ("[units]\nlength=1.0\ntime=-1.0\nmass=1.0\nfilaments=1.0", "each a number > 0"),
        (
            "physical = true\n[units]\nlength=1.0\ntime=1.0\nmass=1.0\nfilaments=1.0",
            "either [units], for plain numbers, or physical = true",
        ),
        ("physical = true\n[time]\nend = 90", "time.end must be a number with a unit"),
        ("parameters = 3\nphysical = true", "[parameters] must be a section"),
    ],
)
def test_wrong_heads_of_a_file_are_refused(file, message):
    with pytest.raises(InvalidInput, match=re.escape(message)):
        am.config_from_toml(file)


def test_physical_contradicts_a_file_that_says_no(tmp_path, capsys):
    (tmp_path / "c.toml").write_text("physical = false")
    assert main(["run", str(tmp_path / "c.toml"), "--physical"]) == 2
    assert "contradict" in capsys.readouterr().err


@given(
    st.floats(allow_nan=False, allow_infinity=False, min_value=-1e200, max_value=1e200),
    st.sampled_from(["T", "L", "L/T", "N/L^2", "M/T^2", "M/(L T^2)", "1", None]),
)
def test_a_number_in_a_table_gives_back_every_bit(value, dimension):
    cell = Units(length=8e-6, time=10.0, mass=0.027000000000000003, filaments=62244.8)
    for units in (None, cell):
        scale = Scale(units)
        found = scale.number(scale.text(value, dimension), dimension)
        assert found == value or abs(value) < 1e-250


def test_the_texts_of_a_table_are_in_customary_units():
    scale = Scale(Units(length=8e-6, time=10.0, mass=0.027, filaments=62244.8))
    assert scale.text(0.25, "T") == "2.5"
    assert float(scale.text(1.0, "L")) == pytest.approx(8.0, rel=1e-15)
    assert float(scale.text(1.0, "M/T^2")) == pytest.approx(0.27, rel=1e-15)  # mN/m


def test_a_run_with_units_gives_all_its_numbers_in_them(tmp_path, capsys):
    folder = tmp_path / "x"
    assert run(folder, "--physical", *settings(*CELL, *SHORT)) == 0
    found = json.loads(capsys.readouterr().out)
    cell = am.Parameters.physical(R0="8 um", v_p0="1.3 um/s")
    expected = am.simulate(cell, mesh=am.Icosphere(1), until=[am.steady(), am.time("10 s")],
                           environment="matrix")  # fmt: skip
    assert found["units"]["c_front"] == "1/um^2"
    for name in ("max_retrograde_speed", "c_front", "c_rear", "zeta0"):
        quantity = getattr(expected.final, name)
        assert found[name] == pytest.approx(quantity.to(found["units"][name]).magnitude, rel=1e-12)
    assert found["rate_of_change"] < 1.0  # 1/s; 1 in the units of the cell is 0.1
    with (folder / "timeseries.csv").open() as file:
        *_, last = csv.DictReader(file)
    assert float(last["t"]) == 10.0
    assert float(last["max_retrograde_speed"]) == pytest.approx(
        found["max_retrograde_speed"], rel=1e-12
    )
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["units_in_timeseries"]["zeta0"] == "mN/m"
    stored = am.load(folder)
    assert stored["t"][-1].to("s").magnitude == pytest.approx(10.0, rel=1e-14)
    assert str(stored.final.max_retrograde_speed.units) == "µm/s"


def test_a_summary_is_in_the_units_of_the_cell(tmp_path, capsys):
    assert main(["run", "--physical", "-o", str(tmp_path / "x"), *settings(*CELL, *SHORT)]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "R0 = 8 um, D = 0.03 um^2/s, v_p0 = 1.3 um/s" in text
    assert re.search(r"max_retrograde_speed \S+ um/s", text)
    assert re.search(r"zeta0 \S+ mN/m", text)
    assert re.search(r"falls at \S+ 1/s; to continue", text)
    assert "end of time at t = 10 s" in text
    again = re.search(r"amoeboid (run --resume \S+) --set 'time.end=20 s'", text)
    assert main([*again[1].split(), "--set", "time.end=20 s"]) == 0
    assert "end of time at t = 20 s" in capsys.readouterr().out


def test_a_resumed_run_with_units_has_the_table_of_an_uninterrupted_one(tmp_path, capsys):
    cell = am.Parameters.physical(R0="8 um", v_p0="1.3 um/s")
    options = {"mesh": am.Icosphere(1), "environment": "matrix"}
    half = am.simulate(cell, until=am.time("10 s"), folder=tmp_path / "half", **options)
    am.load(tmp_path / "half").resume(until=am.time("20 s"))
    kept = half.resume(until=am.time("20 s")).save(tmp_path / "kept")
    files = [(kept.folder / "timeseries.csv"), tmp_path / "half" / "timeseries.csv"]
    assert files[0].read_text() == files[1].read_text()
    assert [*kept.rows] == [*am.load(tmp_path / "half").rows]


def test_a_folder_that_states_its_units_in_the_manifest_alone_is_read_and_continued(tmp_path):
    """As versions before [units] wrote it: the table is in the units of the cell."""
    cell = am.Parameters.physical(R0="8 um", v_p0="1.3 um/s")
    made = am.simulate(cell, mesh=am.Icosphere(1), until=am.time("10 s"), folder=tmp_path / "x")
    plain = replace(made.config, parameters=replace(cell, units=None))
    (tmp_path / "x" / "config.toml").write_text(am.config_to_toml(plain))
    lines = [list(made.units), *([row[n] for n in made.units] for row in made.rows)]
    with (tmp_path / "x" / "timeseries.csv").open("w", newline="") as file:
        csv.writer(file).writerows(lines)
    old = am.load(tmp_path / "x")
    assert [*old.rows] == [*made.rows]
    assert old["t"][-1].to("s").magnitude == pytest.approx(10.0)
    new = old.resume(until=am.time("12 s"))
    assert [*new.rows][: len(made.rows)] == [*made.rows]
    assert "[units]" in (tmp_path / "x" / "config.toml").read_text()
    last = (tmp_path / "x" / "timeseries.csv").read_text().splitlines()[-1]
    assert float(last.split(",")[1]) == pytest.approx(12.0)


def test_a_stored_configuration_with_units_repeats_the_run(tmp_path, capsys):
    assert run(tmp_path / "a", "--physical", *settings(*CELL, *SHORT)) == 0
    assert run(tmp_path / "b", str(tmp_path / "a" / "config.toml")) == 0
    assert run(tmp_path / "c", str(tmp_path / "a" / "config.toml"), *settings("D=0.1 um^2/s")) == 0
    a, b, c = map(json.loads, capsys.readouterr().out.splitlines())
    assert (a["c_rear"], a["units"]) == (b["c_rear"], b["units"])
    assert c["c_rear"] < a["c_rear"]
    tables = [(tmp_path / name / "timeseries.csv").read_text() for name in "ab"]
    assert tables[0] == tables[1]


def test_a_sweep_of_runs_takes_times_with_units(tmp_path, capsys):
    document = {
        "physical": True,
        "base": {"R0": "8 um"},
        "vary": {"v_p0": ["1.3 um/s", "2 um/s"]},
        "solver": {
            "name": "simulate", "mesh": {"subdivisions": 1}, "time": {"end": "5 s"}
        },
        "record": {"names": ["t", "max_retrograde_speed"]},
    }  # fmt: skip
    (tmp_path / "s.toml").write_text(toml_text(document))
    assert main(["sweep", str(tmp_path / "s.toml"), "-o", str(tmp_path / "s")]) == 0
    assert "2 ok" in capsys.readouterr().out
    table = am.load_sweep(tmp_path / "s")
    assert table["t"].values == pytest.approx([5.0, 5.0])
    assert table["t"].attrs["units"] == "s"
    document["vary"] = {"time.end": ["1 s", "2 um"]}
    (tmp_path / "u.toml").write_text(toml_text(document))
    assert main(["sweep", str(tmp_path / "u.toml"), "--dry-run"]) == 2
    assert "time.end must have the dimension T" in capsys.readouterr().err
    document["solver"]["time"]["end"] = 5
    (tmp_path / "t.toml").write_text(toml_text(document))
    assert main(["sweep", str(tmp_path / "t.toml")]) == 2
    assert "time.end must be a number with a unit" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("condition", "message"),
    [
        ("t > 300", "with t and 300; for a cell with units write a quantity in quotes"),
        ("t > '5 um'", "must have one dimension"),
        ("c_front + t > c0", "with c_front and t"),
        ("zeta0**2 > zeta0", "with zeta0 ** 2 and zeta0"),
        ("not t > 3 and polarity > 0.5", "with t and 3"),
        ("t > '5 parrots'", "its unit is unknown"),
        ("t > '5 K'", "must be a quantity of length, time and mass"),
        ("t > '3'", "with t and '3'"),
        ("t**'5 s' > 3", "an exponent in a condition must be a number"),
        ("t > '5 s'*1e400", "inf is not a number"),
    ],
)
def test_a_condition_on_a_cell_with_units_compares_one_dimension(condition, message):
    with pytest.raises(InvalidInput, match=re.escape(message)):
        am.Config(parameters=am.Parameters.physical(), time=am.Time(until=(condition,)))


@pytest.mark.parametrize(
    "condition",
    ["t > '1.5 s'", "t*beta > 0.15", "t/'1 s' > 1.5", "zeta0/(delta_P*R0) > 0.3 and t > '1.5 s'"],
)
def test_a_condition_with_units_ends_a_run_at_its_time(condition):
    sol = am.simulate(
        am.Parameters.physical(), mesh=am.Icosphere(1), until=[am.when(condition), am.time("3 s")]
    )
    assert sol.ended == am.when(condition).condition
    assert sol.t[-2].to("s").magnitude <= 1.5 < sol.t[-1].to("s").magnitude


def test_a_quantity_in_a_condition_needs_a_cell_with_units():
    with pytest.raises(InvalidInput, match="on a cell without units must have plain numbers"):
        am.Config(time=am.Time(until=("t > '5 min'",)))

"""What commands print, where, and what happens when that place is narrow, closed or full."""

import json
import os
import re
import subprocess
import sys
import warnings
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from amoeboid.cli import output
from amoeboid.cli.main import main
from amoeboid.cli.tables import number, table, text
from amoeboid.studies.columns import percent
from amoeboid.terminal import fitting
from command import COMMAND, SHORT

# One cell, as base units of length, time, mass and number in units of R0, 1/beta, eta_s/beta and
# c_r R0^2: its own, m s kg 1, um s, mm min, units that nobody uses.
UNIT_SYSTEMS = {
    "own": (1.0, 1.0, 1.0, 1.0),
    "SI": (1e5, 0.1, 37.0, 1e-5),
    "um": (0.1, 0.1, 3.7e-8, 1e-5),
    "mm": (100.0, 6.0, 37.0, 1e-5),
    "odd": (3e-20, 7e15, 1e12, 5e-30),
}
DIMENSIONS = {  # powers of length, time, mass, number
    "R0": (1, 0, 0, 0),
    "delta_P": (-1, -2, 1, 0),
    "eta_s": (0, -1, 1, 0),
    "eta_b": (0, -1, 1, 0),
    "c0": (-2, 0, 0, 1),
    "c_r": (-2, 0, 0, 1),
    "beta": (0, -1, 0, 0),
    "D": (2, -1, 0, 0),
    "v_p0": (1, -1, 0, 0),
}
CELL = dict(R0=1, delta_P=300, eta_s=1, eta_b=1, c0=3, c_r=1, beta=1, D=0.03, v_p0=3.8)


def settings_in(system):
    words = []
    for name, value in CELL.items():
        for unit, power in zip(UNIT_SYSTEMS[system], DIMENSIONS[name], strict=True):
            value = value / unit**power
        words += ["--set", f"{name}={value!r}"]
    return words


def numbers_in(text):
    found = re.findall(r"(?<![\w.])-?\d+\.?\d*(?:e[+-]?\d+)?(?![\w.])", text)
    return [float(word) for word in found]


def is_printed(value, printed):
    return any(abs(value - x) <= 5e-5 * abs(value) for x in printed)


@pytest.fixture
def without_pictures(monkeypatch):
    monkeypatch.setattr("amoeboid.plotting.cell_painter.CellPainter.__enter__", lambda self: self)
    monkeypatch.setattr("amoeboid.plotting.cell.save_cell_picture", lambda *_: None)


@pytest.mark.parametrize("system", UNIT_SYSTEMS)
def test_theory_prints_significant_digits_in_any_units(system, theory_once, monkeypatch, capsys):
    assert main(["theory", "--json", *settings_in(system)]) == 0
    result = json.loads(capsys.readouterr().out)
    values = [x for x in result.values() if isinstance(x, float)]
    values += [*result["growth_rates"].values(), *result["thresholds"]]
    values += [x for pair in result["growth_rates_finite_pressure"].values() for x in pair]
    assert len(values) > 25
    for columns in (None, "40"):
        if columns:
            monkeypatch.setenv("COLUMNS", columns)
        assert main(["theory", *settings_in(system)]) == 0
        out = capsys.readouterr().out
        printed = numbers_in(out)
        missing = [x for x in values if not is_printed(x, printed)]
        assert missing == []
    table_lines = [x for x in out.splitlines() if not x.startswith(("Theory", "Note"))]
    assert max(map(len, table_lines)) <= 60


@pytest.mark.parametrize("columns", [None, "40"])
def test_steady_states_have_significant_digits_in_si_units(columns, monkeypatch, capsys):
    if columns:
        monkeypatch.setenv("COLUMNS", columns)
    assert main(["steady", "--json", *settings_in("SI")]) == 0
    states = json.loads(capsys.readouterr().out)["states"]
    assert main(["steady", *settings_in("SI")]) == 0
    out = capsys.readouterr().out
    printed = numbers_in(out)
    assert len(states) == 2
    for state in states:
        for key in ("max_retrograde_speed", "c_front", "c_rear", "zeta0"):
            assert is_printed(state[key], printed), (key, state[key], printed)
    assert is_printed(100 * states[1]["deformation"], printed)
    if columns:
        assert max(map(len, out.splitlines())) <= 40


@pytest.mark.slow
@pytest.mark.parametrize("columns", [None, "40"])
def test_branches_and_phase_diagrams_have_significant_digits_in_si_units(
    columns, monkeypatch, capsys
):
    if columns:
        monkeypatch.setenv("COLUMNS", columns)
    speed, diffusion = 1e-5 / 10.0, 1e-10 / 10.0  # R0 beta and R0^2 beta
    words = ["branch", *settings_in("SI"), "--to", repr(4.0 * speed), "--max-step", "0.5"]
    assert main([*words, "--json"]) == 0
    branch = json.loads(capsys.readouterr().out)
    assert main(words) == 0
    printed = numbers_in(capsys.readouterr().out)
    assert len(branch["points"]) > 2
    for point in branch["points"]:
        for key in ("v_p0", "max_retrograde_speed", "c_front", "c_rear", "zeta0"):
            assert is_printed(point[key], printed), (key, point[key])
    assert is_printed(branch["branch_points"][0]["v_p0"], printed)
    words = ["phase-diagram", *settings_in("SI"), "--columns", "3", "--rows", "3"]
    words += ["--from", repr(0.04 * diffusion), "--to", repr(0.4 * diffusion)]
    words += ["--speed-from", repr(3 * speed), "--speed-to", repr(8 * speed)]
    assert main([*words, "--json"]) == 0
    diagram = json.loads(capsys.readouterr().out)
    assert main(words) == 0
    printed = numbers_in(capsys.readouterr().out)
    values = [*diagram["v_p0"], diagram["D"][0], diagram["D"][-1]]
    values += [x for tip in diagram["boundary"] for x in tip.values()]
    assert [x for x in values if not is_printed(x, printed)] == []


finite = st.floats(-1e300, 1e300, allow_subnormal=False)


@given(finite, st.integers(4, 9))
def test_a_printed_number_reads_back_as_itself(value, digits):
    assert float(number(value, digits)) == pytest.approx(value, rel=10.0 ** (1 - digits), abs=0.0)


def test_values_that_are_no_numbers_are_words():
    assert text([1.5, None, True, "a", []]) == "1.5, none, yes, a, none"
    assert number(-0.0) == "0"
    assert percent(1.2345678e-9) == "1.23457e-07 %"
    assert percent(3e-17) == "0 %"


@settings(max_examples=40)
@given(
    st.lists(st.tuples(finite, finite, finite), min_size=1, max_size=3),
    st.one_of(st.none(), st.integers(1, 60)),
    st.booleans(),
)
def test_cells_of_a_table_are_never_cut(rows, limit, headed):
    titles = ("" if headed else "first", "a longer title", "c")
    cells = [tuple(map(number, row)) for row in rows]
    lines = table(titles, cells, limit=limit)
    words = " ".join(lines).split()
    for row in cells:
        for cell in row:
            assert cell in words
    beside = table(titles, cells)
    assert len(beside) == len(rows) + 2
    assert len({len(line) for line in beside}) == 1
    assert (lines == beside) == (limit is None or limit >= len(beside[0]))


@given(st.lists(st.text(alphabet="ab", min_size=1, max_size=9), max_size=5), st.integers(0, 30))
def test_parts_of_progress_are_never_cut(parts, limit):
    line = fitting(parts, limit)
    assert len(line) <= limit
    shown = line.split()
    assert shown == parts[: len(shown)]


@pytest.mark.parametrize("columns", [None, "40"])
@pytest.mark.parametrize("name", ["a[/b]", "x[red]y", "[link=x]", "long name " * 11, "[bold]\\["])
def test_paths_are_printed_as_they_are(
    name, columns, without_pictures, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    if columns:
        monkeypatch.setenv("COLUMNS", columns)
    assert main(["run", *SHORT, "-o", name]) == 0
    out, err = capsys.readouterr()
    assert f"output in {Path(name)}: cell.png" in out
    assert err == ""


def test_control_characters_are_printed_as_escapes(without_pictures, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["run", *SHORT, "-o", "two\nlines\x1b[2J"]) == 0
    assert "output in two\\nlines\\x1b[2J: cell.png" in capsys.readouterr().out


def test_messages_are_one_line_whatever_is_in_them(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "40")
    for name in ("[/red]" * 30 + ".toml", "two\nlines\x1b[2J.toml"):
        assert main(["run", name]) == 2
        err = capsys.readouterr().err
        assert err.count("\n") == 1
        assert name.replace("\n", "\\n").replace("\x1b", "\\x1b") in err.replace("\\\\", "\\")


def test_warnings_are_messages_of_the_command(capsys):
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        with output.warnings_told("run"):
            warnings.warn("a[/b] is slow", RuntimeWarning, stacklevel=1)
    assert capsys.readouterr() == ("", "amoeboid run: a[/b] is slow\n")


@pytest.mark.parametrize(
    "words", [["theory", "--json"], ["theory"], ["--help"], ["run", "--help"], ["--version"]]
)
def test_a_reader_that_leaves_is_no_error(words):
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [*COMMAND, *words], stdout=writing, stderr=subprocess.PIPE, text=True, check=False
    )
    os.close(writing)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize("words", [["theory", "--json"], ["--help"]])
def test_results_that_cannot_be_written_are_an_error(words):
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [*COMMAND, *words], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert done.stderr.count("\n") <= 1


def closed(*numbers):
    def close():
        for n in numbers:
            os.close(n)

    return close


def test_no_file_gets_the_number_of_a_closed_stream():
    code = (
        "import os, sys\n"
        "from amoeboid.cli.output import open_streams\n"
        "open_streams()\n"
        "assert os.open(os.devnull, os.O_RDONLY) > 2\n"
        "print('lost', file=sys.stderr)\n"
        "print('lost', flush=True)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], preexec_fn=closed(0, 1, 2), check=False)
    assert done.returncode == 0


def test_closed_streams_stay_silent(tmp_path):
    """Messages go nowhere then, not into the results, and no file takes their number."""
    run = [*COMMAND, "theory", "--json"]
    options = dict(cwd=tmp_path, text=True, check=False)
    done = subprocess.run(run, stdout=subprocess.PIPE, preexec_fn=closed(2), **options)
    assert done.returncode == 0
    assert json.loads(done.stdout)["nu"] < 0
    done = subprocess.run(run, stderr=subprocess.PIPE, preexec_fn=closed(0, 1), **options)
    assert (done.returncode, done.stderr) == (0, "")
    mistaken = [*run, "--set", "D=-1"]
    done = subprocess.run(mistaken, stdout=subprocess.PIPE, preexec_fn=closed(2), **options)
    assert (done.returncode, done.stdout) == (2, "")


@pytest.mark.slow
def test_a_run_needs_no_streams(tmp_path):
    """Its files are whole: none has the number of a stream that is printed to."""
    run = [*COMMAND, "run", *SHORT]
    done = subprocess.run(run, cwd=tmp_path, preexec_fn=closed(0, 1, 2), check=False)
    assert done.returncode == 0
    assert (tmp_path / "amoeboid-run/cell.png").read_bytes().startswith(b"\x89PNG")
    assert json.loads((tmp_path / "amoeboid-run/manifest.json").read_text())["t"] == 0.01


@pytest.mark.parametrize(
    "words",
    [
        ["branch", "--to", "1_0"],
        ["branch", "--to", "８"],
        ["branch", "--to", "8,5"],
        ["branch", "--to", "infinity"],
        ["branch", "--to", "8", "--max-points", "1_0"],
        ["phase-diagram", "--columns", "１０"],
        ["phase-diagram", "--speed-to", "8 9"],
    ],
)
def test_numbers_of_options_are_read_as_people_write_them(words, capsys):
    with pytest.raises(SystemExit) as leaving:
        main(words)
    assert leaving.value.code == 2
    assert "must be a" in capsys.readouterr().err


def test_settings_take_points_at_an_end_and_refuse_commas(capsys):
    assert main(["theory", "--json", "--set", "D=.03", "--set", "c0=3."]) == 0
    parameters = json.loads(capsys.readouterr().out)["parameters"]
    assert (parameters["D"], parameters["c0"]) == (0.03, 3.0)
    assert main(["theory", "--set", "D=0,03"]) == 2
    assert "got '0,03'; write a decimal point" in capsys.readouterr().err
    for quantity in ("8 um", "-1.5e3 nm/s", "1370 / um^2", "3µm"):
        assert main(["theory", "--set", f"R0={quantity}"]) == 2
        remedy = f"got '{quantity}'; values with units need a cell with units: --physical"
        assert remedy in capsys.readouterr().err
    for text_ in ("０.03", "infinity", "0.0.3", "3 4", "0x"):
        assert main(["theory", "--set", f"D={text_}"]) == 2
        assert "D must be a finite number" in capsys.readouterr().err

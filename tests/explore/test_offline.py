"""The page in one file, and the sentences about a point."""

import json
import re

import pytest

import amoeboid as am
from amoeboid.cli.main import main
from amoeboid.closed_forms.linear import critical_pressure
from amoeboid.explorer import offline
from amoeboid.explorer.words import verdict

CELL = {"D": 0.4, "v_p0": 5.5}


@pytest.fixture
def small(monkeypatch):
    """Two branches with few points."""
    monkeypatch.setattr(offline, "FACTORS", (0.5, 1.0))
    monkeypatch.setattr(offline, "SPEEDS", 2)
    monkeypatch.setattr(offline, "POINTS", 7)


@pytest.mark.slow
def test_a_page_holds_the_states_that_the_package_finds(small, tmp_path, capsys):
    path = tmp_path / "page.html"
    words = ["explore", "--export", str(path), "--json"]
    assert main([*words, *(f"--set={name}={value}" for name, value in CELL.items())]) == 0
    page = path.read_text(encoding="utf-8")
    assert json.loads(capsys.readouterr().out) == {
        "page": str(path),
        "bytes": len(page.encode()),
    }
    assert not re.search(r'(src|href)="https?:', page)
    data = offline.precomputed(am.Parameters(**CELL))
    assert data["values"]["D"] == [0.2, 0.4]
    assert (data["preset"]["values"]["D"], data["preset"]["values"]["v_p0"]) == (0.4, 5.5)
    branch = data["branches"][1]
    at = branch["speeds"].index(5.5)
    found = [
        state["numbers"]["max_retrograde_speed"]
        for state in branch["points"][at]["states"]["states"]
    ]
    expected = [
        state.max_retrograde_speed for state in am.steady_states(am.Parameters(**CELL)).states
    ]
    assert sorted(found) == pytest.approx(sorted(expected), rel=1e-3, abs=1e-9)


def test_a_page_without_diffusion_is_refused_before_it_is_written(tmp_path, capsys):
    path = tmp_path / "page.html"
    assert main(["explore", "--export", str(path), "--set", "D=0"]) == 2
    assert "D must be > 0 for a page with several of them, got 0" in capsys.readouterr().err
    assert not path.exists()


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"D": 0.4, "v_p0": 5.5}, r"Two states last.*flows at 1\.45"),
        ({"D": 0.4, "v_p0": 6.0, "delta_P": 300.0}, r"Two states last"),
        ({"D": 0.4, "v_p0": 6.5}, r"The polarized cell is stable, with a retrograde flow of 2"),
        ({"D": 0.4, "v_p0": 3.0}, r"No polarized steady state is known here"),
        ({"D": 0.4, "v_p0": 9.0, "delta_P": 20.0}, r"is unstable: it bends and leaves its axis"),
    ],
)
def test_the_verdict_names_what_lasts(values, words):
    p = am.Parameters(**values)
    states = am.steady_states(p, (1,)).states
    assert re.search(words, " ".join(verdict(am.theory(p), states))), states


def test_the_verdict_on_a_soft_cell_names_the_modes_that_grow():
    """Below the critical pressure the mode l = 2 grows first."""
    p = am.Parameters(v_p0=0.95 * 3.5484, delta_P=0.2 * critical_pressure(am.Parameters()))
    assert "does not polarize, but it deforms: l = 2" in verdict(am.theory(p))[0]

"""`many_steady_states` as the solver of a sweep; JAX is an optional package."""

import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import amoeboid as am
from amoeboid.sweeps.document import sweep_document

REASON = "JAX is not installed: pip install 'amoeboid[gpu]'"
GRID = {"D": [0.4, 0.1], "v_p0": [4.0, 6.1]}
MANY = partial(am.many_steady_states, max_modes=32)


@pytest.fixture(scope="module")
def found():
    """Cells at rest, polarized, and with more modes than are allowed; and one that cannot be."""
    pytest.importorskip("jax", reason=REASON)
    return am.sweep(am.grid(D=[*GRID["D"], -1.0], v_p0=GRID["v_p0"]), MANY)


def test_states_of_a_sweep_are_those_of_many_steady_states(found):
    D, v_p0 = np.meshgrid(GRID["D"], GRID["v_p0"], indexing="ij")
    many = am.many_steady_states(
        am.points(am.Parameters(), D=D, v_p0=v_p0), max_modes=32, progress=False
    )
    for name in ("max_retrograde_speed", "c_rear", "zeta0"):
        np.testing.assert_allclose(found[name].sel(D=GRID["D"]), many[name], rtol=1e-9)
    assert found["max_retrograde_speed"].attrs["units"] == "L/T"
    assert found["modes"].sel(D=0.4, v_p0=6.1) == 32


def test_statuses_and_reasons_of_lanes_are_those_of_points(found):
    assert found["status"].values.tolist() == [["ok", "ok"], ["ok", "failed"], ["failed"] * 2]
    assert found["state"].values.tolist() == [["sphere", "polarized"], ["polarized", ""], ["", ""]]
    assert "no other state here" in str(found["why"].sel(D=0.4, v_p0=4.0).values)
    assert "unresolved: the series of 32 modes" in str(found["why"].sel(D=0.1, v_p0=6.1).values)
    assert "D must be a finite number" in str(found["why"].sel(D=-1.0, v_p0=4.0).values)


@pytest.mark.slow
def test_cells_that_cannot_be_side_by_side_are_computed_in_turns():
    pytest.importorskip("jax", reason=REASON)
    p = am.Parameters(D=0.4, v_p0=6.1)
    rows = am.sweep([p, p.replace(gamma_t=0.1), p.replace(D=0.41)], MANY)
    assert rows["status"].values.tolist() == ["ok"] * 3
    alone = am.sweep([p], MANY)
    assert rows["c_rear"].values[0] == pytest.approx(alone["c_rear"].values[0], rel=1e-9)


def test_a_file_asks_for_many_steady_states_by_name():
    pytest.importorskip("jax", reason=REASON)
    text = "[vary]\nD = [0.1]\n[solver]\nname = 'steady'\nmany = true\nmax_modes = 32\n"
    solver = sweep_document(text, "a sweep", Path()).solver
    assert (solver.func, solver.keywords) == (am.many_steady_states, {"max_modes": 32})
    for wrong, told in (
        ("degrees = [1]", "degrees needs many = false"),
        ("many = 1", "must be true or false"),
        ("max_modes = 8", "max_modes must be a whole number >= 32"),
    ):
        text = f"[vary]\nD = [0.1]\n[solver]\nname = 'steady'\n{wrong}\n"
        text += "" if "many" in wrong else "many = true\n"
        with pytest.raises(am.InvalidInput, match=told):
            sweep_document(text, "a sweep", Path())
    with pytest.raises(am.InvalidInput, match="max_modes needs many = true"):
        sweep_document(
            "[vary]\nD = [0.1]\n[solver]\nname = 'steady'\nmax_modes = 64\n", "a sweep", Path()
        )


def test_without_jax_the_message_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "jax", None)
    needed = r"need JAX, which is not installed; pip install 'amoeboid\[gpu\]'"
    with pytest.raises(am.InvalidInput, match=needed):
        am.many_steady_states([am.Parameters(D=0.4)])
    text = "[vary]\nD = [0.1]\n[solver]\nname = 'steady'\nmany = true\n"
    with pytest.raises(am.InvalidInput, match=needed):
        sweep_document(text, "a sweep", Path())
    failed = am.sweep(am.grid(D=[0.1, 0.4]), am.many_steady_states).failed
    assert all("pip install 'amoeboid[gpu]'" in point.why for point in failed)
    assert len(failed) == 2

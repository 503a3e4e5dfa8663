"""`many_steady_states` as the solver of a sweep: how it is asked for, and JAX that is missing.

What such a sweep finds: axisymmetric/test_many_steady_states.py, which has it compiled.
"""

import sys
from pathlib import Path

import pytest

import amoeboid as am
from amoeboid.sweeps.document import sweep_document

REASON = "JAX is not installed: pip install 'amoeboid[gpu]'"


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

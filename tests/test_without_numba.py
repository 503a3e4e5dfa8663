"""Theory and the axisymmetric solver where no package is there that they do not compute with."""

import json
import subprocess
import sys

import pytest

import amoeboid as am
from amoeboid.extras import EXTRAS

OTHERS = ("llvmlite", "threadpoolctl", "vtk", "pyvista", *(m for e in EXTRAS.values() for m in e))
BRANCH = "branch --set D=0.4 --from 5 --to 5.5"
COMMANDS = {
    "theory --set D=0.4": "thresholds",
    "steady --set D=0.4 --set v_p0=5.5": "states",
    BRANCH: "folds",
    "phase-diagram --from 0.3 --to 0.4 --columns 2 --rows 2": "threshold",
}
PROGRAM = f"""
import contextlib, io, json, sys
sys.modules |= dict.fromkeys({OTHERS!r})
import amoeboid as am
from amoeboid.cli.main import main
p = am.Parameters(D=0.4, v_p0=5.5)
states = am.steady_states(p)
try:
    am.simulate(p, mesh=am.Icosphere(1), until=am.time(1))
except am.InvalidInput as refused:
    told = str(refused)
commands = {{}}
for command in {list(COMMANDS)!r}:
    with contextlib.redirect_stdout(io.StringIO()) as out:
        code = main([*command.split(), "--json"])
    commands[command] = code, json.loads(out.getvalue())
print(json.dumps({{
    "threshold": am.theory(p).threshold, "flows": [s.max_retrograde_speed for s in states],
    "stable": [s.stable for s in states], "told": told,
    "commands": commands,
}}))
"""


@pytest.fixture(scope="module")
def alone():
    """What a program finds where other packages are missing, and what it is told of meshes."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    return json.loads(done.stdout)


def test_states_and_branches_without_numba_are_those_with_it(alone):
    p = am.Parameters(D=0.4, v_p0=5.5)
    states = am.steady_states(p)
    assert alone["threshold"] == pytest.approx(am.theory(p).threshold, rel=1e-14)
    flows = [s.max_retrograde_speed for s in states]
    assert alone["flows"] == pytest.approx(flows, rel=1e-9, abs=1e-12)
    assert alone["stable"] == [s.stable for s in states]
    _, branch = alone["commands"][BRANCH]
    assert branch["folds"][0]["v_p0"] == pytest.approx(5.20959845, rel=1e-8)  # axisymmetric page


def test_meshes_without_numba_are_refused_with_the_remedy(alone):
    assert "need Numba, which is not installed; pip install 'amoeboid[surface]'" in alone["told"]


@pytest.mark.parametrize(("command", "key"), COMMANDS.items())
def test_commands_work_without_numba(alone, command, key):
    code, printed = alone["commands"][command]
    assert code == 0
    assert printed["complete" if key != "thresholds" else key]
    assert printed[key]

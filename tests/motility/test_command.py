"""`amoeboid motility`."""

import json

import numpy as np
import pytest

import amoeboid as am
from amoeboid.cli.main import main
from amoeboid.meshes.vtp import frame_bytes
from motility.bodies import ellipsoid

FIGURE_3D = ["--set", "D=0.4", "--set", "v_p0=6"]


def told(capsys, *args):
    assert main(["motility", *args]) == 0
    return capsys.readouterr().out


def test_json_has_the_keys_of_the_contract(capsys):
    found = json.loads(told(capsys, *FIGURE_3D, "--json"))
    environments = found["environments"]
    assert list(environments) == ["fluid", "matrix", "patch:30", "channel:30"]
    assert environments["fluid"]["velocity"] == pytest.approx(1.158803, abs=1e-6)
    ratio = environments["fluid"]["velocity_over_max_retrograde_speed"]
    assert ratio == pytest.approx(1.158803 / 1.834173, abs=1e-6)
    assert found["front"] == [0.0, 0.0, -1.0]
    assert "units" not in found


def test_table_and_infinite_efficiency(capsys):
    text = told(capsys, *FIGURE_3D, "--in", "fluid, matrix:normal=0 ,patch:20+fluid")
    assert "1.1588" in text
    assert "1.73793" in text
    assert "patch:20+fluid" in text
    assert "beta = B_2/|B_1| = 0.0312845" in text
    # a resting cell
    found = json.loads(told(capsys, "--set", "v_p0=1", "--json"))
    assert found["environments"]["fluid"]["velocity"] == 0.0


def test_physical_units(capsys):
    cell = ["--physical", "--set", "D=4 um^2/s", "--set", "v_p0=2.8 um/s"]
    found = json.loads(told(capsys, *cell, "--json", "--in", "fluid:0.7 mPa s"))
    assert found["units"]["velocity"] == "um/s"
    speed = found["environments"]["fluid:0.7 mPa s"]["velocity"]
    p = am.Parameters.physical(D="4 um^2/s", v_p0="2.8 um/s")
    expected = am.migrate(am.steady_states(p, (1,)).fastest_stable).speed
    assert speed == pytest.approx(expected.to("um/s").magnitude, rel=1e-12)


def test_folder_of_a_run_and_surface_with_vectors(capsys, tmp_path):
    run = am.simulate(mesh=am.Icosphere(1), until=am.time(3.0), folder=tmp_path / "run")
    found = json.loads(told(capsys, str(tmp_path / "run"), "--in", "fluid,cortex", "--json"))
    expected = am.migrate(run.final, "fluid").speed
    assert found["environments"]["fluid"]["velocity"] == pytest.approx(expected, rel=1e-12)
    r, faces, normals = ellipsoid(np.ones(3), 1)
    flow = -np.array([0.0, 0.0, 1.0]) + normals[:, 2:] * normals
    path = tmp_path / "cell.vtp"
    path.write_bytes(frame_bytes(8.0 * r, faces, {"flow": flow}, {"t": np.zeros(1)}))
    args = (str(path), "--flow", "flow", "--units", "um,s", "--in", "fluid", "--json")
    found = json.loads(told(capsys, *args))
    assert found["units"]["velocity"] == "um/s"
    assert found["environments"]["fluid"]["velocity"] == pytest.approx(2 / 3, rel=0.02)


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["--in", "fluid,,matrix"], "--in takes environments"),
        (["--in", "swamp"], "must be one of fluid"),
        (["nowhere"], "'nowhere', which does not exist"),
        (["--flow", "u"], "--flow needs a surface"),
        (["x.vtp", "--set", "D=0.4"], "leave them out"),
        (["--set", "time.end=3"], "takes only parameters"),
        (["--in", "fluid:1 mPa s"], "need a cell with units"),
        (["--physical", "--in", "fluid:1"], "fluid.viscosity must have a unit, since the cell has"),
    ],
)
def test_mistakes_are_told_in_one_line(capsys, args, message):
    assert main(["motility", *args]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_velocity_by_the_friction_of_the_force_balance_is_told(capsys):
    """In that friction as an environment the cell moves just as fast."""
    args = ("--set", "D=0.4", "--set", "v_p0=6", "--set", "gamma_t=1", "--set", "gamma_n=1")
    found = json.loads(told(capsys, *args, "--in", "matrix", "--json"))
    speed = found["environments"]["matrix"]["velocity"]
    assert found["friction_velocity"] == pytest.approx(speed, rel=1e-9)
    assert "the cell moves at 0.944569." in told(capsys, *args, "--in", "matrix")


def test_units_of_a_surface_are_two(capsys, tmp_path):
    path = tmp_path / "cell.vtp"
    path.write_bytes(b"")
    assert main(["motility", str(path), "--units", "um"]) == 2
    assert "--units takes a length and a time" in capsys.readouterr().err
    assert main(["motility", str(tmp_path), "--json"]) == 2  # a folder without a run


def test_a_cell_that_is_not_polarized_is_said_not_to_move(capsys):
    resting = ["--set", "v_p0=1", "--in", "fluid"]
    text = told(capsys, *resting)
    assert text.splitlines()[-1] == "the cell is not polarized and does not move"
    assert "velocity" not in text
    assert json.loads(told(capsys, *resting, "--json"))["polarized"] is False
    found = am.migrate(am.steady_states(am.Parameters(v_p0=1.0))[0])
    assert "not polarized" in repr(found)
    assert "not polarized" in found._repr_html_()

import json
import xml.etree.ElementTree as ElementTree
from dataclasses import asdict, replace
from itertools import pairwise

import numpy as np
import pytest
import pyvista as pv

from amoeboid import versions
from amoeboid.config import Config, Initial, Mesh, Output, Time, config_from_toml, resolved
from amoeboid.observables import observed, retrograde_flow
from amoeboid.parameters import Parameters
from amoeboid.simulation import evolve, start
from amoeboid.store import (
    new_folder,
    new_run,
    resumed_run,
    stored_config,
    write_atomically,
    write_text,
)
from amoeboid.validation import InvalidInput

CONFIG = Config(
    mesh=Mesh(subdivisions=1),
    initial=Initial(perturbation=1.0),
    time=Time(end=1.5),
    output=Output(interval=0.4),
)


def run_into(folder, config=CONFIG, stop_after=None):
    step = start(config)
    run = new_run(new_folder(folder), config)
    run.take(step)
    for step in evolve(step, config.time):
        run.take(step)
        if step.number == stop_after:
            break
    run.save(step)
    return step.model, run, step


def test_frames_open_in_pyvista_with_all_fields(tmp_path):
    model, run, last = run_into(tmp_path / "run")
    times = [t for t, _ in run.frame_times]
    assert times[0] == 0
    assert times[-1] == pytest.approx(1.5)
    assert all(b - a >= 0.4 * (1 - 1e-9) for a, b in pairwise(times[:-1]))
    series = pv.get_reader(str(tmp_path / "run" / "frames.pvd"))
    assert series.time_values == pytest.approx(times)
    series.set_active_time_value(series.time_values[-1])
    surface = series.read()[0]
    assert surface.n_points == 42
    assert surface.is_manifold
    np.testing.assert_array_equal(surface.points, last.state.r)
    np.testing.assert_array_equal(surface["c"], last.state.c)
    np.testing.assert_array_equal(surface["v"], last.flow.v_c + last.flow.v_p)
    np.testing.assert_array_equal(
        surface["retrograde_flow"], retrograde_flow(model, last.state, last.flow)
    )
    assert surface.field_data["t"][0] == last.state.t
    # the triangles look outward, as VTK wants it
    assert surface.volume > 0


def test_time_series_has_every_step_and_observable(tmp_path):
    model, run, last = run_into(tmp_path / "run")
    columns = tuple(run.units)
    table = np.genfromtxt(tmp_path / "run" / "timeseries.csv", delimiter=",", names=True)
    assert table.dtype.names == columns
    assert np.array_equal(table["step"], np.arange(last.number + 1))
    assert np.all(np.isfinite([table[name] for name in columns]))
    for name, value in observed(model, last.state, last.flow).items():
        assert table[name][-1] == value


def test_manifest_says_how_to_repeat_the_run(tmp_path):
    _, run, _ = run_into(tmp_path / "run")
    run.write_manifest("finished", ended="end of time")
    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text())
    assert manifest["status"] == "finished"
    assert manifest["parameters"]["v_p0"] == 6.0
    assert manifest["seed"] == 0
    assert {"amoeboid", "numpy", "scipy", "numba"} <= manifest["versions"].keys()
    assert [f["file"] for f in manifest["frames"]] == [f"frames/{n}" for _, n in run.frame_times]
    assert manifest["time"] == asdict(resolved(CONFIG).time)
    assert config_from_toml((tmp_path / "run" / "config.toml").read_text()) == CONFIG


def test_a_resumed_run_ends_with_the_same_bits(tmp_path):
    config = replace(CONFIG, time=Time(end=2.0, tolerance=1e-4))
    _, _, whole = run_into(tmp_path / "whole", config)
    # resume where the error estimate, not the limit on growth, decides on the next step
    run_into(tmp_path / "halves", config, stop_after=12)
    config = stored_config(tmp_path / "halves")
    assert config == replace(CONFIG, time=Time(end=2.0, tolerance=1e-4))
    run, step = resumed_run(tmp_path / "halves", config)
    assert step.number == 12
    assert [row["step"] for row in run.rows] == list(range(13))
    for step in evolve(step, config.time):
        run.append(step)
    assert step.number == whole.number
    assert np.array_equal(step.state.r, whole.state.r)
    assert np.array_equal(step.state.c, whole.state.c)
    assert step.state.zeta0 == whole.state.zeta0


def test_rows_beyond_the_checkpoint_are_dropped(tmp_path):
    """A run killed between the time series and the checkpoint."""
    _, run, _ = run_into(tmp_path / "run", stop_after=3)
    table = run.folder / "timeseries.csv"
    rows = table.read_text().splitlines()
    extra = ",".join(["4", *rows[-1].split(",")[1:]])
    table.write_text("\n".join([*rows, extra]) + "\n")
    resumed, _ = resumed_run(run.folder, run.config)
    assert [row["step"] for row in resumed.rows] == [0, 1, 2, 3]
    table.write_text("\n".join(rows[:-1]) + "\n")
    with pytest.raises(InvalidInput, match="lacks step 3"):
        resumed_run(run.folder, run.config)


def test_a_changed_configuration_cannot_be_resumed(tmp_path):
    _, run, _ = run_into(tmp_path / "run", stop_after=2)
    other = replace(run.config, parameters=run.config.parameters.replace(D=0.7))
    with pytest.raises(InvalidInput, match=r"keeps \[parameters\]"):
        resumed_run(run.folder, other)


def test_a_failing_write_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "table.csv"
    write_text(path, "old")

    def fail(temporary):
        temporary.write_text("half")
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        write_atomically(path, fail)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_folders_that_hold_something_are_refused(tmp_path):
    write_text(tmp_path / "notes", "mine")
    with pytest.raises(InvalidInput, match="new or empty"):
        new_folder(tmp_path)
    with pytest.raises(InvalidInput, match="new or empty"):
        new_folder(tmp_path / "notes")
    with pytest.raises(InvalidInput, match="cannot be made"):
        new_folder(tmp_path / "notes" / "run")
    assert new_folder(tmp_path / "a" / "b").is_dir()


def test_default_folders_are_numbered(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert [str(new_folder(None)) for _ in range(3)] == [
        "amoeboid-run",
        "amoeboid-run-2",
        "amoeboid-run-3",
    ]


def test_what_cannot_be_resumed_is_refused(tmp_path):
    with pytest.raises(InvalidInput, match=r"config\.toml"):
        stored_config(tmp_path)
    with pytest.raises(InvalidInput, match="checkpoint"):
        resumed_run(tmp_path, CONFIG)
    _, run, _ = run_into(tmp_path / "run", stop_after=2)
    other = replace(CONFIG, mesh=Mesh(subdivisions=2))
    with pytest.raises(InvalidInput, match=r"keeps \[mesh\]"):
        resumed_run(run.folder, other)
    (run.folder / "checkpoint.npz").write_bytes(b"PK\x03\x04 no archive")
    with pytest.raises(InvalidInput, match="cannot be read"):
        resumed_run(run.folder, CONFIG)


def test_frames_that_have_been_deleted_are_no_longer_listed(tmp_path):
    _, run, _ = run_into(tmp_path / "run", stop_after=4)
    names = [name for _, name in run.frame_times]
    (run.folder / "frames" / names[1]).unlink()
    resumed, step = resumed_run(run.folder, run.given)
    for step in evolve(step, run.given.time):
        resumed.append(step)
    resumed.save(step)
    resumed.write_manifest("finished")
    listed = [names[0], *names[2:], f"frame_{len(names):05d}.vtp"]
    manifest = json.loads((run.folder / "manifest.json").read_text())
    assert [f["file"] for f in manifest["frames"]] == [f"frames/{name}" for name in listed]
    assert [line.split('file="frames/')[1][:15] for line in _sets(run)] == listed


def _sets(run):
    lines = (run.folder / "frames.pvd").read_text().splitlines()
    return [line for line in lines if "DataSet" in line]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda rows: rows[:-1], "lacks step 2"),
        (lambda rows: [], "as a run writes it"),
        (lambda rows: rows[1:], "its columns are not step, t"),
        (lambda rows: [rows[0] + ",more", *rows[1:]], "its columns are not"),
        (lambda rows: [*rows[:-1], rows[-1] + ",1"], "its columns are not"),
        (lambda rows: [*rows[:-1], rows[-1].rsplit(",", 1)[0]], "its columns are not"),
        (lambda rows: [*rows[:-1], rows[-1].rsplit(",", 1)[0] + ",nan"], "finite"),
        (lambda rows: [*rows[:-1], rows[-1].rsplit(",", 1)[0] + ",much"], "'much'"),
        (lambda rows: [rows[0], rows[2], rows[1], rows[3]], "in the order of time"),
        (lambda rows: [*rows[:-1], "2,7.5," + rows[-1].split(",", 2)[2]], "lacks step 2"),
        (lambda rows: [*rows[:-1], "\0" + rows[-1]], "as a run writes it"),
        (lambda rows: [*rows[:-1], '"' + rows[-1]], "as a run writes it"),
        (lambda rows: [*rows[:-1], "2.5," + rows[-1].split(",", 1)[1]], "'2.5'"),
    ],
)
def test_a_damaged_time_series_is_refused(tmp_path, change, says):
    _, run, _ = run_into(tmp_path / "run", stop_after=2)
    table = run.folder / "timeseries.csv"
    table.write_text("".join(f"{row}\n" for row in change(table.read_text().splitlines())))
    with pytest.raises(InvalidInput, match=says) as refusal:
        resumed_run(run.folder, run.given)
    assert "cannot be read" in str(refusal.value)


def test_a_time_series_that_is_no_text_or_not_there_is_refused(tmp_path):
    _, run, _ = run_into(tmp_path / "run", stop_after=2)
    table = run.folder / "timeseries.csv"
    table.write_bytes(b"\xff\xfe")
    with pytest.raises(InvalidInput, match="as a run writes it"):
        resumed_run(run.folder, run.given)
    table.unlink()
    with pytest.raises(InvalidInput, match="No such file"):
        resumed_run(run.folder, run.given)


def test_automatic_fields_stay_open_in_the_stored_configuration(tmp_path):
    """So that they follow the scheme, and the parameters, where the configuration is used again."""
    _, run, _ = run_into(tmp_path / "run", stop_after=2)
    stored = stored_config(run.folder)
    assert stored == CONFIG
    explicit = replace(stored, time=replace(stored.time, scheme="explicit"))
    resumed, step = resumed_run(run.folder, explicit)
    assert resumed.config.time.max_step == 1e-5
    assert next(evolve(step, resumed.config.time)).dt == pytest.approx(1e-5)
    # what was given is kept
    given = replace(CONFIG, time=Time(end=1.5, max_step=0.25))
    _, run, _ = run_into(tmp_path / "given", given, stop_after=2)
    assert stored_config(run.folder).time.max_step == 0.25


def test_packages_that_are_not_installed_are_not_recorded(monkeypatch):
    monkeypatch.setattr(versions, "PACKAGES", ("numpy", "no-such-package"))
    assert versions.installed_versions() == {"numpy": np.__version__}


def test_collection_is_well_formed(tmp_path):
    _, run, _ = run_into(tmp_path / "run")
    tree = ElementTree.parse(run.folder / "frames.pvd")  # noqa: S314  (our own file)
    sets = tree.getroot().find("Collection").findall("DataSet")
    assert [(run.folder / s.get("file")).is_file() for s in sets] == [True] * len(run.frame_times)


def test_a_run_whose_mesh_has_changed_goes_on_as_the_uninterrupted_one(tmp_path):
    """The checkpoint holds the mesh: nodes and triangles are no longer those of the start."""
    config = Config(
        parameters=Parameters(D=0.4, v_p0=8.0, delta_P=2.0, beta=0.0),
        mesh=Mesh(subdivisions=2),
        initial=Initial(perturbation=2.0),
        time=Time(end=0.7, stop_when_steady=False),
        output=Output(interval=10.0),
    )
    _, _, whole = run_into(tmp_path / "whole", config)
    assert whole.model.mesh.n_nodes != 162
    _, run, half = run_into(tmp_path / "half", config, stop_after=whole.number - 8)
    assert half.model.mesh.n_nodes != 162
    _, step = resumed_run(run.folder, run.config)
    *_, step = evolve(step, config.time)
    assert step.number == whole.number
    assert np.array_equal(step.model.mesh.faces, whole.model.mesh.faces)
    assert np.array_equal(step.state.r, whole.state.r)
    assert np.array_equal(step.state.c, whole.state.c)

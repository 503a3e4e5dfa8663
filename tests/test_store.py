import json
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import pyvista as pv

from amoeboid.config import Config, Initial, Mesh, Output, Time, config_from_toml, resolved
from amoeboid.observables import observed, retrograde_flow
from amoeboid.parameters import Parameters
from amoeboid.simulation import evolve, start
from amoeboid.store import (
    COLUMNS,
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
    run.append(step)
    run.save(step)
    for step in evolve(step, config.time):
        run.append(step)
        if run.frame_due(step) or step.ended:
            run.save(step)
        if step.number == stop_after:
            run.save(step)
            break
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
    model, _, last = run_into(tmp_path / "run")
    table = np.genfromtxt(tmp_path / "run" / "timeseries.csv", delimiter=",", names=True)
    assert table.dtype.names == COLUMNS
    assert np.array_equal(table["step"], np.arange(last.number + 1))
    assert np.all(np.isfinite([table[name] for name in COLUMNS]))
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
    assert config_from_toml((tmp_path / "run" / "config.toml").read_text()) == resolved(CONFIG)


def test_a_resumed_run_ends_with_the_same_bits(tmp_path):
    config = replace(CONFIG, time=Time(end=2.0, tolerance=1e-4))
    _, _, whole = run_into(tmp_path / "whole", config)
    # resume where the error estimate, not the limit on growth, decides on the next step
    run_into(tmp_path / "halves", config, stop_after=12)
    config = stored_config(tmp_path / "halves")
    assert config == resolved(replace(CONFIG, time=Time(end=2.0, tolerance=1e-4)))
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


def test_a_checkpoint_with_nan_is_refused(tmp_path):
    _, run, _ = run_into(tmp_path / "run", stop_after=1)
    path = run.folder / "checkpoint.npz"
    with np.load(path, allow_pickle=False) as data:
        arrays = dict(data)
    arrays["history_c"][0, 3] = np.nan
    np.savez(path, **arrays)
    with pytest.raises(InvalidInput, match="not finite"):
        resumed_run(run.folder, run.config)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("faces", lambda a: a[:-1]),
        ("faces", lambda a: a - 1),
        ("history_r", lambda a: a[:, :-1]),
        ("history_c", lambda a: a[:, :-1]),
        ("history_c", lambda a: -a),
        ("history_position", lambda a: a[:, :2]),
        ("history_scalars", lambda a: a[:0]),
        ("flow_vectors", lambda a: a[:, :-1]),
        ("flow_areas", lambda a: a[:-1]),
        ("edge_length", lambda a: -a),
    ],
)
def test_a_checkpoint_whose_parts_do_not_fit_is_refused(tmp_path, name, change):
    _, run, _ = run_into(tmp_path / "run", stop_after=2)
    path = run.folder / "checkpoint.npz"
    with np.load(path, allow_pickle=False) as data:
        arrays = dict(data)
    arrays[name] = change(arrays[name])
    np.savez(path, **arrays)
    with pytest.raises(InvalidInput):
        resumed_run(run.folder, run.config)


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


def test_no_pickle_is_ever_loaded(tmp_path):
    _, run, _ = run_into(tmp_path / "run", stop_after=1)
    path = run.folder / "checkpoint.npz"
    with np.load(path, allow_pickle=False) as data:
        arrays = dict(data)
    arrays["frame_names"] = np.array([object()], dtype=object)
    np.savez(path, **arrays)
    with pytest.raises(InvalidInput, match="cannot be read"):
        resumed_run(run.folder, CONFIG)


def test_frame_names_from_a_file_never_leave_the_folder(tmp_path):
    _, run, _ = run_into(tmp_path / "run", stop_after=1)
    path = run.folder / "checkpoint.npz"
    with np.load(path, allow_pickle=False) as data:
        arrays = dict(data)
    arrays["frame_names"] = np.array(["../../outside.vtp"] * len(arrays["frame_names"]))
    np.savez(path, **arrays)
    with pytest.raises(InvalidInput, match="frame name"):
        resumed_run(run.folder, CONFIG)


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
        time=Time(end=0.52, stop_when_steady=False),
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

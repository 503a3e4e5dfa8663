import json
import os
import pickle
import re
import time
import xml.etree.ElementTree as ElementTree
from dataclasses import asdict, fields, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from benchmarks.kills import killed_runs
from pyvista import get_reader
from pyvista import read as opened

from amoeboid.cli.main import main
from amoeboid.config import (
    Config,
    Initial,
    Mesh,
    Output,
    Time,
    config_from_toml,
    config_to_toml,
    resolved,
)
from amoeboid.model.parameters import Parameters, parameters_to_toml
from amoeboid.model.polymerization import NAMED_LAWS, Law
from amoeboid.observables import OBSERVABLES, Observable, observed, retrograde_flow
from amoeboid.output import atomic, versions
from amoeboid.output.atomic import write_atomically, write_text
from amoeboid.output.folder import new_folder, new_run, resumed_run, stored_config
from amoeboid.output.timeseries import read_table
from amoeboid.simulation.loop import evolve, start
from amoeboid.simulation.rows import Rows
from amoeboid.surface.cell import SurfaceCell
from amoeboid.validation import InvalidInput

CONFIG = Config(
    mesh=Mesh(subdivisions=1),
    initial=Initial(perturbation=1.0),
    time=Time(end=1.5),
    output=Output(interval=0.4),
)

pytestmark = pytest.mark.usefixtures("without_pictures")


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
    series = get_reader(str(tmp_path / "run" / "frames.pvd"))
    assert series.time_values == pytest.approx(times)
    series.set_active_time_value(series.time_values[-1])
    surface = series.read()[0]
    assert surface.n_points == 42
    assert surface.is_manifold
    np.testing.assert_array_equal(surface.points, last.state.r)
    np.testing.assert_array_equal(surface["c"], last.state.c)
    np.testing.assert_array_equal(surface["v"], last.flow.v_c + last.flow.v_p)
    np.testing.assert_array_equal(
        surface["retrograde_flow"], retrograde_flow(SurfaceCell(model, last.state, last.flow))
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
    for name, value in observed(SurfaceCell(model, last.state, last.flow)).items():
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
    assert manifest["time"] == json.loads(json.dumps(asdict(resolved(CONFIG).time)))
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


def test_what_a_killed_run_left_half_written_is_removed_when_it_is_resumed(tmp_path):
    _, run, _ = run_into(tmp_path / "run", stop_after=2)
    left = [
        run.folder / ".checkpoint.123.partial.npz",
        run.folder / "frames" / ".frame.9.partial.vtp",
    ]
    own = run.folder / ".notes.partial"
    for path in (*left, own):
        path.write_text("half")
    resumed, _ = resumed_run(run.folder, run.config)
    assert all(path.exists() for path in left)
    run._lock.release()  # as the end of the process would
    resumed.begin()
    assert not any(path.exists() for path in left)
    assert own.exists()


def test_folders_that_hold_something_are_refused(tmp_path):
    write_text(tmp_path / "notes", "mine")
    with pytest.raises(InvalidInput, match="new or empty"):
        new_folder(tmp_path)
    with pytest.raises(InvalidInput, match="new or empty"):
        new_folder(tmp_path / "notes")
    with pytest.raises(InvalidInput, match="cannot be created"):
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
        (lambda rows: [rows[0], rows[2], rows[1], rows[3]], "in order of time"),
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


@pytest.mark.slow
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


def frame_times(folder):
    """Times of the list of frames, of the frames themselves, and of the manifest if it is there."""
    series = get_reader(str(folder / "frames.pvd"))
    read = [
        float(opened(folder / "frames" / f"frame_{k:05d}.vtp").field_data["t"][0])
        for k in range(len(series.time_values))
    ]
    assert read == series.time_values
    return read


@pytest.mark.parametrize(
    ("interval", "end", "count"), [(0.02, 0.5, 26), (0.3, 1.0, 5), (0.5, 0.4, 2), (0.1, 0.3, 4)]
)
def test_frames_are_at_multiples_of_the_interval_and_at_the_end(interval, end, count, tmp_path):
    """Intervals shorter and longer than a step; ends that are multiples and others."""
    config = replace(CONFIG, time=Time(end=end), output=Output(interval=interval))
    _, run, last = run_into(tmp_path / "run", config)
    times = [t for t, _ in run.frame_times]
    assert times == frame_times(run.folder)
    expected = [k * interval for k in range(count - 1)] + [last.state.t]
    np.testing.assert_allclose(times, expected, rtol=1e-12)
    # the run itself does not depend on it
    _, other, alike = run_into(tmp_path / "other", replace(config, output=Output(interval=9.0)))
    assert np.array_equal(alike.state.c, last.state.c)
    assert [row["t"] for row in run.rows] == [row["t"] for row in other.rows]


def files_of(folder):
    return {p.name: p.read_bytes() for p in (folder / "frames").iterdir()}


@pytest.mark.parametrize("subdivisions", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_frames_of_a_resumed_run_are_those_of_the_uninterrupted_one(subdivisions, tmp_path):
    """Resumed from a checkpoint in the middle of the frames, with a changing mesh on the way."""
    config = Config(
        parameters=Parameters(D=0.4, v_p0=8.0, delta_P=2.0, beta=0.0),
        mesh=Mesh(subdivisions=subdivisions),
        initial=Initial(perturbation=2.0),
        time=Time(end=0.7, stop_when_steady=False),
        output=Output(interval=0.01),
    )
    _, whole, last = run_into(tmp_path / "whole", config)
    assert (last.model.mesh.n_nodes != 10 * 4**subdivisions + 2) == (subdivisions == 2)
    assert len(whole.frame_times) == 71
    times = np.array([t for t, _ in whole.frame_times])
    np.testing.assert_allclose(times, 0.01 * np.arange(71), rtol=1e-9)
    step = start(config)
    run = new_run(new_folder(tmp_path / "half"), config)
    run.take(step)
    killed = last.number - 10
    for step in evolve(step, config.time):
        run.take(step)
        if step.number == killed:  # without another word
            break
    resumed, step = resumed_run(run.folder, config)
    assert 0 < step.number <= killed
    for step in evolve(step, config.time):
        resumed.take(step)
    resumed.save(step)
    assert files_of(run.folder) == files_of(whole.folder)
    for name in ("timeseries.csv", "frames.pvd"):
        assert (run.folder / name).read_bytes() == (whole.folder / name).read_bytes()


def test_another_interval_on_resuming_counts_from_where_the_run_stands(tmp_path):
    _, run, _ = run_into(tmp_path / "run", replace(CONFIG, time=Time(end=0.7)))
    config = replace(CONFIG, time=Time(end=1.1), output=Output(interval=0.1))
    resumed, step = resumed_run(run.folder, config)
    for step in evolve(step, config.time):
        resumed.take(step)
    resumed.save(step)
    times = frame_times(run.folder)
    np.testing.assert_allclose(times, [0.0, 0.4, 0.7, 0.8, 0.9, 1.0, 1.1], rtol=1e-9)


def test_a_save_reads_and_writes_no_more_the_longer_the_run(tmp_path, monkeypatch):
    """Neither rows nor entries that are there already, nor the older frames."""
    step = start(CONFIG)
    run = new_run(new_folder(tmp_path / "run"), replace(CONFIG, output=Output(interval=1e-3)))
    run.take(step)
    step = next(evolve(step, CONFIG.time))
    run.take(step)
    written, looked_for = [], []
    write_whole, is_file = atomic.write_text, Path.is_file
    monkeypatch.setattr(atomic, "write_text", lambda p, t: (written.append(p), write_whole(p, t)))
    monkeypatch.setattr(Path, "is_file", lambda p: (looked_for.append(p), is_file(p))[1])
    sizes = []
    for _ in range(40):
        later = tuple(replace(s, t=s.t + 1e-3) for s in step.history)
        step = replace(step, history=later, number=step.number + 1)
        before = [(run.folder / n).stat().st_size for n in ("timeseries.csv", "frames.pvd")]
        run.take(step)
        after = [(run.folder / n).stat().st_size for n in ("timeseries.csv", "frames.pvd")]
        sizes.append(np.subtract(after, before))
    assert written == []
    assert looked_for == []
    assert np.ptp(sizes, axis=0)[1] < 30
    assert frame_times(run.folder) == [t for t, _ in run.frame_times]
    _, back = resumed_run(run.folder, run.given)
    assert back.number == step.number


@pytest.mark.slow
def test_cost_and_memory_of_a_frame_are_the_same_after_ten_thousand(tmp_path):
    """642 nodes; memory as the system counts it, which it does on Linux alone."""
    config = replace(CONFIG, mesh=Mesh(subdivisions=3), output=Output(interval=1e-3))
    step = start(config)
    run = new_run(new_folder(tmp_path / "run"), config)
    run.take(step)
    step = next(evolve(step, CONFIG.time))
    spent, used, statm = [], [], Path("/proc/self/statm")
    for _ in range(10_000):
        later = tuple(replace(s, t=s.t + 1e-3) for s in step.history)
        step = replace(step, history=later, number=step.number + 1)
        began = time.process_time()
        run.take(step)
        spent.append(time.process_time() - began)
        if statm.is_file():
            used.append(int(statm.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE"))
    early, late = np.median(spent[100:1000]), np.median(spent[-900:])
    print(f"{1e3 * early:.2f} ms a frame after 100 frames, {1e3 * late:.2f} ms after 9100")
    assert late < 1.2 * early
    if used:
        print(f"{(used[-1] - used[999]) / 2**20:.1f} MB more after 10000 frames than after 1000")
        assert used[-1] - used[999] < 8 * 2**20  # 360 bytes a row, as numbers


@pytest.mark.parametrize("torn", ["7,0.3", "7,0.3,1\n", "\0", '"'])
def test_a_row_torn_by_a_kill_is_dropped(torn, tmp_path):
    """A run killed while a row was written, before the checkpoint that belongs to it."""
    _, run, last = run_into(tmp_path / "run", stop_after=3)
    whole = (run.folder / "timeseries.csv").read_bytes()
    (run.folder / "timeseries.csv").write_bytes(whole + torn.encode("latin-1"))
    pvd = (run.folder / "frames.pvd").read_bytes()
    (run.folder / "frames.pvd").write_bytes(pvd[:-15])
    resumed, step = resumed_run(run.folder, run.given)
    assert step.number == last.number
    resumed.save(step)
    assert (run.folder / "timeseries.csv").read_bytes() == whole
    resumed.write_manifest("finished")
    assert (run.folder / "frames.pvd").read_bytes() == pvd


def test_a_table_that_was_changed_or_removed_meanwhile_is_written_anew(tmp_path):
    step = start(CONFIG)
    run = new_run(new_folder(tmp_path / "run"), CONFIG)
    run.take(step)
    for step in evolve(step, CONFIG.time):
        run.take(step)
        if step.number == 2:
            (run.folder / "frames.pvd").unlink()
            (run.folder / "timeseries.csv").write_text("")
    run.save(step)
    _, whole, _ = run_into(tmp_path / "whole")
    for name in ("timeseries.csv", "frames.pvd"):
        assert (run.folder / name).read_bytes() == (whole.folder / name).read_bytes()


def test_every_column_has_its_dimension_in_the_manifest(tmp_path):
    _, run, _ = run_into(tmp_path / "run", stop_after=2)
    units = json.loads((run.folder / "manifest.json").read_text())["units"]
    header = (run.folder / "timeseries.csv").read_text().splitlines()[0].split(",")
    assert list(units) == header
    assert None not in units.values()
    # a cell twice as large, four times as slow, and so on: numbers go as their dimensions say
    L, T, M, N = 2.0, 4.0, 8.0, 32.0
    p = CONFIG.parameters
    sizes = {f.name: f.metadata["unit"] for f in fields(p) if "unit" in f.metadata}
    other = p.replace(**{n: getattr(p, n) * factor(u, L, T, M, N) for n, u in sizes.items()})
    initial, interval = Initial(perturbation=1.0 * N / L**2), Output(interval=0.4 * T)
    config = replace(CONFIG, parameters=other, initial=initial, output=interval)
    _, scaled, _ = run_into(tmp_path / "scaled", replace(config, time=Time(end=1.5 * T)), 2)
    for name, unit in units.items():
        for row, alike in zip(run.rows, scaled.rows, strict=True):
            assert alike[name] == pytest.approx(
                row[name] * factor(unit, L, T, M, N), rel=1e-6, abs=1e-9
            ), name


def factor(unit, L, T, M, N):
    """What a number of this dimension is multiplied with."""
    text = re.sub(r"(?<=[\w)]) (?=[\w(])", "*", unit).replace("^", "**")
    return eval(text, {"L": L, "T": T, "M": M, "N": N})  # noqa: S307  (our own texts)


@pytest.fixture
def observables():
    """The list of observables, put back afterwards."""
    saved = dict(OBSERVABLES)
    yield OBSERVABLES
    OBSERVABLES.clear()
    OBSERVABLES.update(saved)


def r_std(cell):
    return np.linalg.norm(cell.r, axis=1).std()


def test_a_users_observable_is_a_column_of_the_next_run(observables, tmp_path):
    observables["r_std"] = r_std
    _, run, last = run_into(tmp_path / "run", stop_after=3)
    table = np.genfromtxt(run.folder / "timeseries.csv", delimiter=",", names=True)
    assert table["r_std"][-1] == r_std(last.cell)
    assert json.loads((run.folder / "manifest.json").read_text())["units"]["r_std"] is None
    resumed, _ = resumed_run(run.folder, run.given)
    assert resumed.rows == run.rows


def test_a_resumed_run_has_the_columns_it_had_and_those_that_are_new(observables, tmp_path):
    """Cells without a number are empty: before a column began, and after it ended."""
    observables["r_std"] = Observable(r_std, "L", on_meshes=True)
    _, run, _ = run_into(tmp_path / "run", stop_after=3)
    before = tuple(run.units)
    del observables["r_std"]
    observables["r_max"] = lambda cell: np.linalg.norm(cell.r, axis=1).max()
    resumed, step = resumed_run(run.folder, run.given)
    for step in evolve(step, CONFIG.time):
        resumed.take(step)
    resumed.save(step)
    resumed.write_manifest("finished")
    columns, rows = read_table(run.folder / "timeseries.csv")
    assert tuple(columns) == (*before, "r_max")
    assert [row["step"] for row in rows] == list(range(step.number + 1))
    assert ["r_std" in row for row in rows] == [True] * 4 + [False] * (step.number - 3)
    assert ["r_max" in row for row in rows] == [False] * 4 + [True] * (step.number - 3)
    units = json.loads((run.folder / "manifest.json").read_text())["units"]
    assert (units["r_std"], units["r_max"]) == ("L", None)
    # read by their names: the file is what goes on, whatever the order of its columns
    again, _ = resumed_run(run.folder, run.given)
    assert again.rows == rows
    text = (run.folder / "timeseries.csv").read_text()
    (run.folder / "timeseries.csv").write_text(text.replace("step,t,", "t,step,", 1))
    with pytest.raises(InvalidInput, match="as a run writes it"):
        resumed_run(run.folder, run.given)
    swapped = [line.split(",", 2) for line in text.splitlines()]
    lines = [",".join([b, a, rest]) for a, b, rest in swapped]
    (run.folder / "timeseries.csv").write_text("\n".join(lines) + "\n")
    assert resumed_run(run.folder, run.given)[0].rows == rows


@pytest.mark.parametrize(
    ("observable", "says"),
    [
        (lambda cell: 1 / 0, "'mine' must return a finite number; it raised ZeroDivi"),
        (lambda: 0.0, "'mine' must return a finite number; it raised TypeError"),
        (lambda cell: np.nan, "'mine' must return a finite number, got nan"),
        (lambda cell: cell.r, "'mine' must return a finite number, got"),
        (lambda cell: None, "'mine' must return a finite number"),
        (lambda cell: "much", "'mine' must return a finite number; it raised Value"),
    ],
)
def test_an_observable_that_fails_is_named_and_the_run_has_failed(
    observable, says, observables, tmp_path, capsys
):
    observables["mine"] = observable
    folder = tmp_path / "run"
    run = ["run", "--set", "mesh.subdivisions=1", "--set", "time.end=0.1", "-o", str(folder)]
    assert main(run) == 2
    out, err = capsys.readouterr()
    assert " ".join(out.split()) == "D = 0.4, v_p0 = 6, all else as in the paper's table"
    assert says in err
    manifest = json.loads((folder / "manifest.json").read_text())
    assert manifest["status"] == "failed"
    assert says in manifest["ended"]


@pytest.mark.parametrize("name", ["t", "step", "cortex_drag_x", "cortex_drag_heading_x"])
def test_an_observable_must_have_a_name_of_its_own(name, observables, tmp_path):
    observables[name] = r_std
    with pytest.raises(InvalidInput, match=f"must differ from the columns .* got {name!r}"):
        run_into(tmp_path / "run")
    assert list((tmp_path / "run").iterdir()) == []


class Linear(Law):
    name = "linear"

    def value(self, c, v_p0, c_r):
        return v_p0 * (1 - c / (10 * c_r))


def test_a_law_that_no_file_can_hold_is_refused_before_anything_is_written(tmp_path, monkeypatch):
    config = replace(CONFIG, parameters=CONFIG.parameters.replace(law=Linear()))
    # without a folder it runs
    *_, last = evolve(start(config), Time(end=0.2))
    assert last.ended == "end of time"
    for write in (config_to_toml, lambda c: parameters_to_toml(c.parameters)):
        with pytest.raises(InvalidInput, match="name 'linear', which could not be read"):
            write(config)
    with pytest.raises(InvalidInput, match="could not be read back"):
        new_run(new_folder(tmp_path / "run"), config)
    assert list((tmp_path / "run").iterdir()) == []
    # listed, it is read back and the run can be resumed
    monkeypatch.setitem(NAMED_LAWS, "linear", Linear)
    assert config_from_toml(config_to_toml(config)) == config
    _, run, last = run_into(tmp_path / "listed", config, stop_after=3)
    assert resumed_run(run.folder, stored_config(run.folder))[1].number == last.number


def test_a_law_needs_a_name():
    class Nameless(Linear):
        name = None

    with pytest.raises(InvalidInput, match="Nameless has none"):
        Parameters(law=Nameless())

    # one that has the name of another
    class Other(Linear):
        name = "exponential"

    with pytest.raises(InvalidInput, match="could not be read back"):
        parameters_to_toml(Parameters(law=Other()))


@pytest.mark.parametrize("surface", [False, True])
def test_a_run_killed_before_its_first_checkpoint_begins_anew(surface, tmp_path, capsys):
    config = replace(CONFIG, time=Time(end=0.2))
    if surface:
        _, run, _ = run_into(tmp_path / "shape", config, stop_after=1)
        shape = str(run.folder / "frames" / "frame_00000.vtp")
        config = replace(config, initial=Initial(perturbation=1.0, surface=shape))
    _, whole, _ = run_into(tmp_path / "whole", config)
    folder = new_folder(tmp_path / "killed")
    new_run(folder, config)._lock.release()  # as the end of the process would
    again = ["run", "--resume", str(folder), "--json"]
    assert main([*again, "--set", "D=1"]) == 2
    assert "--resume keeps [parameters]" in capsys.readouterr().err
    assert main(["run", "-o", str(folder)]) == 2
    assert "continue the run in it with --resume" in capsys.readouterr().err
    assert main(again) == 0
    assert "had ended before its first checkpoint; it restarts" in capsys.readouterr().err
    assert files_of(folder) == files_of(whole.folder)
    name = "timeseries.csv"
    assert (folder / name).read_bytes() == (whole.folder / name).read_bytes()
    # what has no configuration is no run
    (folder / "config.toml").unlink()
    assert main(["run", "-o", str(folder)]) == 2
    assert "--resume" not in capsys.readouterr().err


@pytest.mark.parametrize("end", ["steady", "end of time"])
@pytest.mark.parametrize("killed_before", ["the manifest", "the pictures"])
def test_what_a_run_did_not_tell_after_its_end_is_told_by_resume(
    killed_before, end, tmp_path, capsys, monkeypatch
):
    """It ended, and was killed before its summary was written, or its pictures were drawn."""
    monkeypatch.chdir(tmp_path)
    short = [] if end == "steady" else ["--set", "time.end=0.5"]
    assert main(["run", "-o", "cell", "--set", "mesh.subdivisions=1", *short, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    manifest = json.loads(Path("cell/manifest.json").read_text())
    if killed_before == "the manifest":
        gone = {"status": "running"} | {k: None for k in ("ended", "t", "summary")}
        text = json.dumps({k: v for k, v in (manifest | gone).items() if v is not None})
        Path("cell/manifest.json").write_text(text)
    else:
        Path("cell/cell.png").unlink()
    assert main(["run", "--resume", "cell", "--json"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert again.pop("wall_s") <= told.pop("wall_s")
    assert again == told
    assert Path("cell/cell.png").is_file()
    found = json.loads(Path("cell/manifest.json").read_text())
    assert {**found, "summary": None} == {**manifest, "summary": None}
    assert main(["run", "--resume", "cell"]) == 2  # all is told
    assert "to continue" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kills", "subdivisions", "end"),
    [(1, 1, 0.5), (20, 2, 10.0)],
)
def test_killed_runs_are_resumed_bit_for_bit(kills, subdivisions, end, tmp_path):
    assert killed_runs(tmp_path, kills, subdivisions, end) == kills


def test_rows_are_given_back_as_they_were_appended():
    """Also where columns begin or end on the way; whole numbers stay whole."""
    given = [{"step": 0, "t": 0.0}, {"step": 1, "t": 0.1, "a": 2.0}, {"step": 2, "t": 0.3}]
    rows = Rows(given)
    assert list(rows) == given
    assert rows == given
    assert rows[1:] == given[1:]
    assert rows[-1] == given[-1]
    assert json.dumps(rows[1]) == json.dumps(given[1])
    with pytest.raises(IndexError):
        rows[3]
    assert pickle.loads(pickle.dumps(rows)) == given  # noqa: S301
    assert len(repr(rows)) < 200

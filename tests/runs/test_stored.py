"""Stored runs: read as far as they are asked for."""

import pickle
import shutil

import numpy as np
import pytest
from pyvista import read as opened

import amoeboid as am
from amoeboid.output.frame_reader import read_frame
from amoeboid.runs import stored as module

P = am.Parameters(D=0.4, v_p0=6.0)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stored") / "run"
    return am.simulate(P, mesh=am.Icosphere(1), until=am.time(1.2), folder=folder), folder


def test_stored_run_is_the_solution(made):
    solution, folder = made
    run = am.load(folder)
    assert run.rows == solution.rows
    assert list(run.units.items()) == list(solution.units.items())
    assert (run.status, run.ended) == ("finished", "end of time")
    assert np.array_equal(run.final.c, solution.final.c)
    assert np.array_equal(run.trajectory, solution.trajectory)
    assert repr(run).endswith(f", end of time at t = 1.2, {solution.last.number} steps, 42 nodes)")
    assert "<table>" in run._repr_html_()


def test_nothing_is_read_until_it_is_asked_for(made, monkeypatch):
    _, folder = made
    read = []
    for name in ("read_frame", "read_table", "read_checkpoint", "text_in", "stored_manifest"):
        function = getattr(module, name)
        monkeypatch.setattr(
            module, name, lambda *a, f=function, n=name, **k: (read.append(n), f(*a, **k))[1]
        )
    run = am.load(folder)
    frames = run.frames
    assert read == ["text_in"]
    assert frames.times == pytest.approx([0.0, 0.5, 1.0, 1.2])
    frames[1:3]
    frames[-1].c  # noqa: B018
    assert read == ["text_in", "read_frame"]
    run["c_rear"]
    run["c_front"]
    assert read == ["text_in", "read_frame", "read_table", "stored_manifest"]


def test_frames_are_read_with_all_bits(made):
    """By the reader of our own, against VTK, and against the run."""
    solution, folder = made
    for k, (_, name) in enumerate(solution.frames.entries):
        path = folder / "frames" / name
        ours, vtk = read_frame(path, P), opened(path)
        assert np.array_equal(ours.state.r, vtk.points)
        assert np.array_equal(ours.model.mesh.faces, vtk.regular_faces)
        for field, values in (
            ("c", ours.state.c),
            ("v_c", ours.flow.v_c),
            ("v_p", ours.flow.v_p),
            ("normal", ours.flow.normals),
        ):
            assert np.array_equal(values, vtk[field])
        assert ours.state.t == vtk.field_data["t"][0] == solution.frames.times[k]
        assert ours.state.zeta0 == vtk.field_data["zeta0"][0]
    last = solution.frames[-1]
    assert np.array_equal(last.c, solution.final.c)
    assert last.max_retrograde_speed == solution.final.max_retrograde_speed


def test_frames_have_the_parameters_of_their_time(tmp_path):
    """A washout: v_p0 jumps; the frame at the jump has what was before it."""
    run = am.simulate(
        P, mesh=am.Icosphere(1), until=am.time(0.8), times=[0.0, 0.4, 0.8],
        changes={"v_p0": am.steps((0.4, 1.0))},
    )  # fmt: skip
    stored = run.save(tmp_path / "run")
    for frames in (run.frames, stored.frames):
        assert [frame.parameters.v_p0 for frame in frames] == [6.0, 6.0, 1.0]
    assert stored.final.parameters.v_p0 == 1.0
    assert stored.config == am.load(tmp_path / "run").config
    longer = stored.resume(until=am.time(1.0))
    assert np.array_equal(longer.final.c, run.resume(until=am.time(1.0)).final.c)


@pytest.mark.parametrize(
    "change",
    [
        lambda data: data[:-400],
        lambda data: data[:200],
        lambda data: b"",
        lambda data: data.replace(b'Name="c"', b'Name="d"'),
        lambda data: data.replace(b"UInt64", b"UInt32"),
        lambda data: data[:-900] + b"A" * 400 + data[-500:],
        lambda data: data.replace(b'type="Float64" Name="c"', b'type="Float16" Name="c"'),
    ],
)
def test_a_damaged_frame_is_refused_with_one_line(made, tmp_path, change):
    _, folder = made
    path = tmp_path / "frame.vtp"
    path.write_bytes(change((folder / "frames" / "frame_00001.vtp").read_bytes()))
    with pytest.raises(am.InvalidInput, match="must be a frame that a run has written") as problem:
        read_frame(path, P)
    assert "\n" not in str(problem.value)


def test_what_is_no_run_is_refused(made, tmp_path):
    with pytest.raises(am.InvalidInput, match="load needs the folder of a run"):
        am.load(tmp_path)
    _, folder = made
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    # a folder of another version: refused in one line, whatever is still there can be read
    (copy / "checkpoint.npz").write_bytes(b"PK old")
    run = am.load(copy)
    assert run["t"][-1] == 1.2
    for act in (lambda: run.last, lambda: run.resume(until=am.time(2.0))):
        with pytest.raises(am.InvalidInput, match="cannot be read: its checkpoint") as problem:
            act()
        assert "\n" not in str(problem.value)
    assert "unreadable" in repr(run)
    assert len(repr(run)) < 1000


def test_columns_that_are_not_known_at_all_times_are_masked(made, tmp_path):
    """A resumed run that observes less: no number stands for one that is missing."""
    solution, folder = made
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    run = am.load(copy).resume(until=am.time(2.0), observe=["c_rear"])
    before = len(solution.t)
    assert len(run.t) > before
    assert not np.ma.isMaskedArray(run["c_rear"])
    assert list(run["c_front"].mask) == [False] * before + [True] * (len(run.t) - before)
    assert run["cortex_drag_heading"].mask[-1].all()
    pytest.importorskip("pandas")
    assert run.to_pandas()["c_front"].isna().sum() == len(run.t) - before
    run.plot(observable="c_front").figure.clf()


def test_stored_runs_pickle_as_their_folder(made):
    _, folder = made
    run = am.load(folder)
    run.rows  # noqa: B018
    data = pickle.dumps(run)
    assert len(data) < 1000
    assert pickle.loads(data).rows == run.rows  # noqa: S301  (our own)


def test_a_folder_that_lacks_files_shows_what_is_missing(made, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(made[1], folder)
    (folder / "checkpoint.npz").unlink()
    run = am.load(folder)
    assert "has no checkpoint.npz" in repr(run)
    assert "has no checkpoint.npz" in run._repr_html_()
    (folder / "timeseries.csv").unlink()
    with pytest.raises(am.InvalidInput, match="needs a time series"):
        am.load(folder).columns  # noqa: B018


def test_a_wrong_progress_leaves_no_run_in_the_folder(made, tmp_path):
    with pytest.raises(am.InvalidInput, match="progress must be"):
        am.simulate(P, mesh=am.Icosphere(1), folder=tmp_path / "run", progress="yes")
    assert not (tmp_path / "run").exists()
    before = (made[1] / "manifest.json").read_text()
    with pytest.raises(am.InvalidInput, match="progress must be"):
        am.load(made[1]).resume(until=am.time(2.0), progress="yes")
    assert (made[1] / "manifest.json").read_text() == before

"""Folders that another version, a damaged disk or somebody with bad intentions has made."""

import json
import os
import shutil
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest

import amoeboid as am
from amoeboid.cli.main import main
from amoeboid.config import config_to_toml
from amoeboid.meshes.vtp import frame_bytes
from amoeboid.output import lock, reading
from amoeboid.output.folder import resumed_run, stored_config
from amoeboid.output.frame_reader import read_frame
from amoeboid.output.frames import FrameFiles, collection, frame_arrays
from amoeboid.output.manifest import FORMAT
from amoeboid.simulation.dense_output import Schedule
from runs import damage

P = am.Parameters(D=0.4, v_p0=6.0)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hostile") / "run"
    am.simulate(
        P, mesh=am.Icosphere(1), until=am.time(0.4), output=am.Output(interval=0.2), folder=folder
    )
    return folder


@pytest.fixture
def folder(made, tmp_path):
    shutil.copytree(made, tmp_path / "run")
    return tmp_path / "run"


@pytest.fixture
def quick(monkeypatch):
    """Runs draw nothing: each picture takes a process of its own."""
    monkeypatch.setattr("amoeboid.cli.run._draw", lambda *_: None)


def rewritten(folder, **changes):
    path = folder / "manifest.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def test_a_folder_says_its_format_and_older_ones_are_read(folder):
    path = folder / "manifest.json"
    manifest = json.loads(path.read_text())
    assert manifest.pop("format") == FORMAT == 1
    path.write_text(json.dumps(manifest))
    assert len(am.load(folder).frames) == 3


def test_a_newer_folder_is_refused_by_every_command(folder, capsys):
    rewritten(folder, format=FORMAT + 1, versions={"amoeboid": "9.9"})
    before = {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    for words in (["show"], ["export", "--to", "csv"], ["run", "--resume"]):
        assert main([*words, str(folder), *(["--json"] if words == ["show"] else [])]) == 2
        err = capsys.readouterr().err
        assert f"must be at most {FORMAT}" in err
        assert "written by amoeboid 9.9" in err
        assert err.count("\n") == 1
    for act in (lambda run: run["t"], lambda run: run.frames[0], lambda run: run.final,
                lambda run: run.resume(until=am.time(1.0))):  # fmt: skip
        with pytest.raises(am.InvalidInput, match="install that version"):
            act(am.load(folder))
    assert before == {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.mark.parametrize("given", [0, -1, 1.5, "1", True, None, [1]])
def test_a_format_that_is_no_version_is_refused(given, folder):
    rewritten(folder, format=given)
    with pytest.raises(am.InvalidInput, match="must be a whole number >= 1"):
        am.load(folder).config  # noqa: B018


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(
    "name",
    ["manifest.json", "config.toml", "timeseries.csv", "frames.pvd", "checkpoint.npz", "frames"],
)
def test_links_out_of_the_folder_are_refused(name, folder, tmp_path, capsys):
    elsewhere = tmp_path / "elsewhere"
    (folder / name).rename(elsewhere)
    (folder / name).symlink_to(elsewhere)
    before = sorted(p.name for p in tmp_path.rglob("*"))
    inside = {p: p.read_bytes() for p in [elsewhere, *elsewhere.rglob("*")] if p.is_file()}
    resumed = main(["run", "--resume", str(folder), "--set", "time.end=0.5", "--json"])
    assert inside == {p: p.read_bytes() for p in inside}
    if name == "frames.pvd":  # which is not read then, but written anew: a file of the folder
        assert resumed == 0
        assert not (folder / name).is_symlink()
        (folder / name).unlink()
        (folder / name).symlink_to(elsewhere)
    else:
        assert resumed == 2
        assert "but is a link to" in capsys.readouterr().err
        assert sorted(p.name for p in tmp_path.rglob("*")) == before
    acts = {
        "timeseries.csv": lambda run: run["t"],
        "checkpoint.npz": lambda run: run.last,
        "frames.pvd": lambda run: run.frames,
        "frames": lambda run: run.frames,
    }
    with pytest.raises(am.InvalidInput, match="but is a link to"):
        acts.get(name, lambda run: run.config)(am.load(folder))


def test_a_frame_is_never_read_from_outside(folder, tmp_path):
    """Neither by the list of frames, which names files of one form alone, nor by a link."""
    frame = folder / "frames/frame_00001.vtp"
    shutil.copy(frame, tmp_path / "frame_00001.vtp")
    text = (folder / "frames.pvd").read_text()
    (folder / "frames.pvd").write_text(
        text.replace("frames/frame_00001", "frames/../../frame_00001")
    )
    assert len(am.load(folder).frames) == 2
    (folder / "frames.pvd").write_text(text)
    frame.unlink()
    frame.symlink_to(tmp_path / "frame_00001.vtp")
    with pytest.raises(am.InvalidInput, match="but is a link to"):
        am.load(folder).frames[1]
    frame.unlink()
    os.mkfifo(frame)  # nobody waits for what never comes
    with pytest.raises(am.InvalidInput, match="must be a file"):
        am.load(folder).frames[1]


@pytest.mark.parametrize("name", list(reading.MAX_SIZES))
def test_absurd_sizes_are_refused_before_they_are_read(name, folder, monkeypatch):
    monkeypatch.setitem(reading.MAX_SIZES, name, 10)
    run = am.load(folder)
    with pytest.raises(am.InvalidInput, match=f"{name} in .* must have at most 0 MiB"):
        (run.config, run["t"], run.frames, run.last)


def test_an_archive_that_announces_more_than_it_holds_takes_no_memory(folder):
    """A header of 8 TB in front of a few bytes, and an array that packs a GB into a MB."""
    path = folder / "checkpoint.npz"
    with np.load(path) as archive:
        arrays = dict(archive)
    with path.open("rb") as file, zipfile.ZipFile(file) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    header = entries["frame_times.npy"].replace(b"(3,)", b"(1%s,)" % (b"0" * 12))
    for name, data in (("huge", header), ("bomb", bytes(2**27))):
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for entry, old in (entries | {"frame_times.npy": data}).items():
                archive.writestr(entry, old)
        assert path.stat().st_size < 10**6, name
        with pytest.raises(am.InvalidInput, match=r"damaged: frame_times\.npy must"):
            am.load(folder).last  # noqa: B018
    np.savez(path, **arrays)
    assert am.load(folder).last.state.t == 0.4


@pytest.mark.parametrize(
    "text",
    [
        b"[" * 10**6,
        b'{"a":' * 10**5,
        b'{"status": NaN, "ended": Infinity, "units": [NaN], "unit_sizes": NaN}',
        b'{"status": {"a": []}, "ended": "' + b"x" * 10**6 + b'"}',
        b'{"status": "finished", "ended": "a\\u0000\\ud800b"}',
    ],
    ids=["deep lists", "deep objects", "no numbers", "long text", "no text"],
)
def test_absurd_manifests_leave_the_run_readable(text, folder):
    (folder / "manifest.json").write_bytes(text)
    run = am.load(folder)
    assert run["t"][-1] == 0.4
    assert len(repr(run)) < 1000
    assert len(run.ended) <= 2000
    assert run.ended.encode().count(b"\0") == 0
    assert main(["export", str(folder), "--to", "csv", "-o", str(folder / "out")]) == 0


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda text: text.replace('timestep="0.2"', 'timestep="nan"'), "in the order of time"),
        (lambda text: text.replace('timestep="0.2"', 'timestep="9"'), "in the order of time"),
        (lambda text: text.replace('timestep="0.2"', 'timestep="a"'), "must be numbers"),
    ],
)
def test_a_list_of_frames_that_no_run_has_written_is_refused(change, says, folder):
    path = folder / "frames.pvd"
    text = path.read_text()
    assert change(text) != text
    path.write_text(change(text))
    with pytest.raises(am.InvalidInput, match=says):
        am.load(folder).frames  # noqa: B018


def replaced(name, value):
    """A frame with another array, and the checksum that belongs to it."""

    def change(arrays):
        found = dict(arrays)
        found[name] = value(np.array(found[name]))
        return found

    return change


def at(place, value):
    def change(array):
        array[place] = value
        return array

    return change


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (replaced("Points", at((3, 1), np.nan)), "finite"),
        (replaced("c", at(3, np.inf)), "finite"),
        (replaced("c", at(3, -1.0)), ">= 0"),
        (replaced("c", at(3, 1e300)), "too large"),
        (replaced("v_c", at((3, 0), 1e300)), "too large"),
        (replaced("normal", at((3, 0), 3.0)), "must have length 1"),
        (replaced("t", lambda t: t - 9.0), ">= 0"),
        (replaced("t", lambda t: np.concatenate([t, t])), "reshape"),
        (replaced("zeta0", lambda z: z * np.nan), "finite"),
        (replaced("cortex_drag_position", lambda x: x[:1]), "reshape"),
        (replaced("c", lambda c: c.astype(int)), "finite and real, c"),
        (replaced("c", lambda c: c[:-1]), "reshape"),
        (replaced("faces", lambda f: f.astype(float)), "refer to its points"),
        (replaced("faces", at((0, 0), 42)), "refer to its points"),
        (replaced("faces", at((0, 0), -1)), "refer to its points"),
        (replaced("faces", lambda f: f[:, ::-1].copy()), "volume > 0"),
        (replaced("faces", lambda f: f[:-1]), "closed"),
        (replaced("Points", lambda r: 2.0 * r), "area must be"),
        (replaced("Points", lambda r: 1e200 * r), "within"),
        (replaced("Points", lambda r: 0.0 * r), "area must be"),
    ],
)
def test_frames_that_are_no_cells_are_refused(change, says, made, tmp_path):
    cell = am.load(made).frames[1].cell
    fields, numbers = frame_arrays(cell)
    arrays = change({**fields, **numbers, "Points": cell.r, "faces": cell.faces})
    path = tmp_path / "frame.vtp"
    path.write_bytes(
        frame_bytes(
            arrays["Points"], arrays["faces"],
            {name: arrays[name] for name in fields}, {name: arrays[name] for name in numbers},
        )
    )  # fmt: skip
    with pytest.raises(am.InvalidInput, match=f"must be a frame that a run has written: .*{says}"):
        read_frame(path, P)


@pytest.mark.usefixtures("quick")
def test_two_processes_do_not_write_to_one_folder(folder, capsys):
    """The second is refused in one line and changes nothing; a killed one is no hindrance."""
    script = (
        "import sys, time\nfrom pathlib import Path\nfrom amoeboid.output.lock import FolderLock\n"
        "lock = FolderLock(Path(sys.argv[1]))\nlock.take()\n"
        "print('taken', flush=True)\ntime.sleep(60)\n"
    )
    holder = subprocess.Popen(
        [sys.executable, "-c", script, str(folder)], stdout=subprocess.PIPE, text=True
    )
    try:
        assert holder.stdout.readline() == "taken\n"
        before = {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}
        words = ["run", "--resume", str(folder), "--set", "time.end=0.5", "--json"]
        assert main(words) == 2
        err = capsys.readouterr().err
        assert f"is being written by process {holder.pid} on" in err
        assert err.count("\n") == 1
        with pytest.raises(am.InvalidInput, match="only one process may write to a run"):
            am.load(folder).resume(until=am.time(0.5))
        assert before == {p: p.read_bytes() for p in folder.rglob("*") if p.is_file()}
        assert am.load(folder)["t"][-1] == 0.4  # reading is free
    finally:
        holder.kill()
        holder.communicate()
    assert main(words) == 0
    assert not (folder / lock.NAME).exists()


@pytest.mark.slow
def test_one_of_two_runs_that_start_together_is_refused(folder):
    """Both go on with the same run; what one of them leaves is the run, whole."""
    program = "import sys; from amoeboid.cli.main import main; sys.exit(main(sys.argv[1:]))"
    words = ["run", "--resume", str(folder), "--set", "time.end=3", "--json"]
    both = [
        subprocess.Popen([sys.executable, "-c", program, *words], stdout=subprocess.PIPE,
                         stderr=subprocess.PIPE, text=True)
        for _ in range(2)
    ]  # fmt: skip
    said = [one.communicate() for one in both]
    codes = sorted(one.returncode for one in both)
    # the second may also have come when the first had ended
    assert codes == [0, 2], said
    assert any("only one process" in err or "time.end must be" in err for _, err in said)
    run = am.load(folder)
    assert run.status == "finished"
    assert run["t"][-1] == run.last.state.t == 3.0


def test_a_run_that_another_process_continued_since_it_was_read_is_left_alone(folder, quick):
    """Its checkpoint is of an earlier time: what came after would be cut off."""
    run, _ = resumed_run(folder, stored_config(folder))
    assert main(["run", "--resume", str(folder), "--set", "time.end=0.6", "--json"]) == 0
    with pytest.raises(am.InvalidInput, match="since it was read; resume it again"):
        run.begin()
    assert am.load(folder)["t"][-1] == 0.6
    assert main(["run", "--resume", str(folder), "--set", "time.end=0.7", "--json"]) == 0


def test_a_run_frees_its_folder_however_it_ends(folder, monkeypatch):
    taken = []
    take = lock.FolderLock.take
    monkeypatch.setattr(
        lock.FolderLock, "take", lambda self: (take(self), taken.append(self.path.exists()))[0]
    )
    am.load(folder).resume(until=am.time(0.45))
    with pytest.raises(RuntimeError, match="mine"):
        am.load(folder).resume(until=[am.time(0.6), failing])
    assert taken == [True, True]
    assert not (folder / lock.NAME).exists()


def failing(step):
    if step.state.t > 0.5:
        raise RuntimeError("mine")


def test_a_full_disk_names_the_file(folder, monkeypatch, capsys):
    def full(self, data):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    assert main(["run", "--resume", str(folder), "--set", "time.end=0.7"]) == 1
    err = capsys.readouterr().err
    assert f"No space left on device: '{folder}/frames/frame_" in err
    monkeypatch.undo()
    assert am.load(folder).status == "failed"
    assert "frame_" in am.load(folder).ended


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 400, 100))
def test_damaged_folders_are_read_or_refused_in_a_line_and_in_little_memory(first, made):
    """400 folders with one random damage each, used as people do, see damage.py."""
    done = subprocess.run(
        [sys.executable, damage.__file__, str(made), str(first), "100"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    *problems, summary = done.stdout.splitlines()
    assert not problems, done.stdout
    assert int(summary.split("peak ")[1].split()[0]) < 700  # MB; the libraries take some 250


@pytest.mark.slow
def test_access_to_a_frame_and_its_cost_do_not_depend_on_their_number(made, tmp_path):
    """10^4 frames: the last is read and appended as quickly as the hundredth (best of 20)."""
    best = {}
    for count in (100, 10_000):
        folder = tmp_path / str(count)
        shutil.copytree(made, folder)
        run = am.load(folder)
        last = run.last
        data = (folder / "frames/frame_00001.vtp").read_bytes()
        for k in range(count):
            (folder / f"frames/frame_{k:05d}.vtp").write_bytes(data)
        listed = [(0.01 * k, f"frame_{k:05d}.vtp") for k in range(count)]
        (folder / "frames.pvd").write_text(collection(listed))
        frames = am.load(folder).frames
        assert len(frames) == count
        files = FrameFiles(folder, Schedule(0.01))
        files.continued([t for t, _ in listed], 0.01 * count)
        files.write(last)  # the first after a resumption lists all frames anew
        best[count] = [
            min(timed(read_last, frames) for _ in range(20)),
            min(timed(files.write, last) for _ in range(20)),
        ]
    ratio = np.array(best[10_000]) / np.array(best[100])
    assert np.all(ratio < 2.0), ratio


def read_last(frames):
    return frames[-1].c.max()


def timed(act, given):
    begin = time.perf_counter()
    act(given)
    return time.perf_counter() - begin


def test_configuration_of_the_folder_is_that_of_the_run(folder):
    assert (folder / "config.toml").read_text() == config_to_toml(am.load(folder).config)

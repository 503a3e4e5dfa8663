"""A sweep's folder: what is done is not done again, whatever happened before."""

import json
import os
import random
import resource
import signal
import subprocess
import sys
import time
from itertools import pairwise, product
from pathlib import Path

import pytest

import amoeboid as am
from amoeboid.cli.main import main
from amoeboid.sweeps.evaluation import STATUSES
from amoeboid.sweeps.folder import SweepFolder, read_manifest
from sweeps import solvers

POINTS = am.grid(v_p0={"linspace": [1, 9, 60]})
SCRIPT = """
import sys
import amoeboid as am
from sweeps import solvers
if __name__ == "__main__":
    points = am.grid(v_p0={"linspace": [1, 9, int(sys.argv[3])]})
    am.sweep(points, solvers.slow, folder=sys.argv[1], workers=int(sys.argv[2]) or None)
"""
TESTS = Path(__file__).parents[1]


def started(folder, workers=0, count=60):
    """A process that makes the sweep in a folder."""
    env = {**os.environ, "PYTHONPATH": str(TESTS)}
    script = folder.with_suffix(".py")
    script.write_text(SCRIPT)
    return subprocess.Popen(
        [sys.executable, str(script), str(folder), str(workers), str(count)],
        env=env,
        stderr=subprocess.PIPE,
    )


def lines(folder):
    """How many lines there are in the files of a folder."""
    return sum(p.read_bytes().count(b"\n") for p in (folder / "results").glob("*.jsonl"))


def killed(folder, kills, workers, count, seed=0):
    """Make the sweep with that many kills at random moments; how many have hit."""
    chance, hits = random.Random(seed), 0  # noqa: S311
    while True:
        process = started(folder, workers, count)
        begun = lines(folder)
        wanted = begun + chance.randrange(1, 4)
        while hits < kills and process.poll() is None and lines(folder) < wanted:
            time.sleep(0.002)
        if hits < kills and process.poll() is None:
            time.sleep(chance.uniform(0.0, 0.04))
            process.send_signal(signal.SIGKILL)
        process.communicate()
        if process.returncode == 0:
            return hits
        assert process.returncode == -signal.SIGKILL
        hits += 1


@pytest.mark.parametrize(
    ("kills", "workers"),
    [
        (1, 0),
        pytest.param(20, 0, marks=pytest.mark.slow),
        pytest.param(20, 2, marks=pytest.mark.slow),
    ],
)
def test_a_killed_sweep_that_is_continued_has_the_same_table_bit_for_bit(tmp_path, kills, workers):
    count = 10 * (kills + 1)  # so many that no run between two kills comes to the end
    points = am.grid(v_p0={"linspace": [1, 9, count]})
    am.sweep(points, solvers.slow, folder=tmp_path / "whole")
    assert killed(tmp_path / "killed", kills, workers, count) == kills
    assert solvers.whole(tmp_path / "killed") == solvers.whole(tmp_path / "whole")
    # nothing was computed twice but for what was in flight
    extra = lines(tmp_path / "killed") - lines(tmp_path / "whole")
    assert extra <= kills * max(1, 2 * workers)


def test_points_side_by_side_have_the_same_bits_wherever_their_sweep_was_killed(tmp_path):
    points = am.grid(v_p0={"linspace": [1, 9, 10]})
    am.sweep(points, solvers.summed, folder=tmp_path / "whole")
    data = (tmp_path / "whole" / "results" / "1-of-1.jsonl").read_bytes()
    file = tmp_path / "killed" / "results" / "1-of-1.jsonl"
    am.sweep(points, solvers.summed, folder=tmp_path / "killed")
    for size in [*range(0, len(data), 149), len(data) - 1]:
        file.write_bytes(data[:size])  # as a kill in the midst of writing leaves it
        assert am.load_sweep(tmp_path / "killed").done in (0, 4, 8)
        am.sweep(points, solvers.summed, folder=tmp_path / "killed")
        assert file.read_bytes() == data, size
    assert solvers.whole(tmp_path / "killed") == solvers.whole(tmp_path / "whole")


def test_a_strange_number_of_points_side_by_side_loses_no_later_ones(tmp_path):
    points = am.grid(v_p0={"linspace": [1, 9, 8]})
    am.sweep(points, solvers.summed, folder=tmp_path)
    file = tmp_path / "results" / "1-of-1.jsonl"
    whole = file.read_text()
    for strange in ("1e3", "-4", "null", "[4]", "0", "{"):
        file.write_text(whole.replace('"together": 4', f'"together": {strange}', 1))
        assert am.load_sweep(tmp_path).done == 8
    file.write_text(whole.replace('"together": 4', '"together": 5', 1))
    assert am.load_sweep(tmp_path).done == 4  # as if the first four were not all there


def test_what_is_done_is_not_done_again_and_more_points_are_added(tmp_path):
    counted = []

    def solver(p):
        counted.append(p.v_p0)
        return p.v_p0

    for values, new in (([1, 2], 2), ([1, 2], 0), ([2, 3, 1], 1), ([2, 2.5], 1)):
        before = len(counted)
        found = am.sweep(am.grid(v_p0=values), solver, folder=tmp_path / "a", key="1")
        assert len(counted) - before == new
        assert found["value"].values.tolist() == values
    # the same cells are reached in another way
    found = am.sweep(am.grid(v_p0=[1, 2], D=[0.03]), solver, folder=tmp_path / "a", key="1")
    assert len(counted) == 4
    assert found.complete


def test_results_of_other_code_are_computed_anew(tmp_path):
    points = am.grid(v_p0=[1, 2])
    am.sweep(points, lambda p: p.v_p0, folder=tmp_path / "a", key="1")
    found = am.sweep(points, lambda p: {"value": "two"}, folder=tmp_path / "a", key="2")
    assert found["value"].values.tolist() == ["two", "two"]


def test_results_of_another_version_are_computed_anew_also_with_a_key(tmp_path, monkeypatch):
    counted = []

    def count(p):
        counted.append(p.v_p0)
        return p.v_p0

    for _ in range(2):
        am.sweep(am.grid(v_p0=[1, 2]), count, folder=tmp_path, key="a")
    assert len(counted) == 2
    monkeypatch.setattr("amoeboid.sweeps.computation.version", lambda _: "0.0.0")
    am.sweep(am.grid(v_p0=[1, 2]), count, folder=tmp_path, key="a")
    assert len(counted) == 4


def test_a_changed_file_of_a_solver_is_other_code(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    file = tmp_path / "my_solver_of_a_test.py"
    file.write_text("def f(p):\n    return 1\n")
    import my_solver_of_a_test

    am.sweep(am.grid(v_p0=[1]), my_solver_of_a_test.f, folder=tmp_path / "a")
    first = read_manifest(tmp_path / "a")["code"]
    file.write_text("def f(p):\n    return 1 + 1\n")
    am.sweep(am.grid(v_p0=[1]), my_solver_of_a_test.f, folder=tmp_path / "a")
    assert read_manifest(tmp_path / "a")["code"] != first


def test_failures_are_kept_and_computed_again_if_asked_for(tmp_path):
    counted = []

    def solver(p):
        counted.append(p.v_p0)
        if p.v_p0 == 2 and len(counted) < 4:
            raise ValueError("not yet")
        if p.v_p0 == 3 and len(counted) < 4:
            raise OSError("no room")
        return p.v_p0

    points = am.grid(v_p0=[1, 2, 3])
    found = am.sweep(points, solver, folder=tmp_path / "a", key="1")
    assert found.counts == {"ok": 1, "failed": 2}
    # what the machine lacked may be there now
    found = am.sweep(points, solver, folder=tmp_path / "a", key="1")
    assert (counted[3:], found.counts) == ([3.0], {"ok": 2, "failed": 1})
    found = am.sweep(points, solver, folder=tmp_path / "a", key="1", retry=True)
    assert (counted[4:], found.counts) == ([2.0], {"ok": 3})


@pytest.fixture
def full_disk():
    """Files cannot grow beyond 7000 bytes, until `full_disk` is called with no limit."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (7000, hard))
    yield lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_full_disk_ends_the_sweep_and_what_is_done_is_kept(tmp_path, full_disk):
    with pytest.raises(OSError, match="File too large"):
        am.sweep(POINTS, solvers.square, folder=tmp_path / "full")
    full_disk()
    (file,) = (tmp_path / "full" / "results").glob("*.jsonl")
    assert 0 < file.stat().st_size <= 7000
    assert file.read_bytes().endswith(b"\n")
    assert 0 < am.load_sweep(tmp_path / "full").done < len(POINTS)
    am.sweep(POINTS, solvers.square, folder=tmp_path / "full")
    am.sweep(POINTS, solvers.square, folder=tmp_path / "whole")
    assert solvers.whole(tmp_path / "full") == solvers.whole(tmp_path / "whole")


def test_two_processes_on_one_folder_are_refused(tmp_path):
    am.sweep(POINTS, solvers.square, folder=tmp_path / "a")
    manifest = read_manifest(tmp_path / "a")
    refused = pytest.raises(am.InvalidInput, match="only one process at a time")
    with SweepFolder(tmp_path / "a").opened(manifest, (1, 1)):
        for shard in (None, (1, 2)):
            with refused:
                am.sweep(POINTS, solvers.square, folder=tmp_path / "a", shard=shard)
    with SweepFolder(tmp_path / "a").opened(manifest, (1, 2)):
        for shard in (None, (1, 2)):
            with refused:
                am.sweep(POINTS, solvers.square, folder=tmp_path / "a", shard=shard)
        am.sweep(POINTS, solvers.square, folder=tmp_path / "a", shard=(2, 2))
    assert am.sweep(POINTS, solvers.square, folder=tmp_path / "a").complete


@pytest.mark.slow
def test_a_second_process_is_refused_while_the_first_is_at_work(tmp_path):
    process = started(tmp_path / "a")
    while process.poll() is None and not lines(tmp_path / "a"):
        time.sleep(0.01)
    with pytest.raises(am.InvalidInput, match="only one process at a time"):
        am.sweep(POINTS, solvers.slow, folder=tmp_path / "a")
    process.communicate()
    assert process.returncode == 0
    assert am.load_sweep(tmp_path / "a").complete


def test_shards_share_the_points_and_merge(tmp_path):
    am.sweep(POINTS, solvers.square, folder=tmp_path / "whole")
    for k in (2, 3, 1):
        found = am.sweep(POINTS, solvers.square, folder=tmp_path / "a", shard=(k, 3))
    assert found.done == 60
    assert not (tmp_path / "a" / "sweep.nc").exists()
    counts = [lines_of(tmp_path / "a" / "results" / f"{k}-of-3.jsonl") for k in (1, 2, 3)]
    assert counts == [21, 21, 21]  # 20 points each, and what the names mean
    am.sweep(POINTS, solvers.square, folder=tmp_path / "a")  # all is done: the table alone
    assert solvers.whole(tmp_path / "a") == solvers.whole(tmp_path / "whole")


def lines_of(path):
    """How many lines a file has."""
    return path.read_bytes().count(b"\n")


def test_shards_that_mean_different_things_are_not_mixed(tmp_path):
    def speed(p):
        return p.quantity(p.v_p0, "L/T")

    cell = am.Parameters.physical()
    other = am.grid(cell, v_p0=["1 um/s", "2 um/s"])
    am.sweep(other, speed, folder=tmp_path, shard=(1, 2), key="a")
    results = tmp_path / "results"
    (results / "1-of-2.jsonl").rename(results / "kept")  # as if both had begun together
    am.sweep(other, speed, folder=tmp_path, shard=(2, 2), key="a")
    (results / "kept").rename(results / "1-of-2.jsonl")
    second = results / "2-of-2.jsonl"
    second.write_text(second.read_text().replace("\\u00b5m / s", "nm / s"))
    found = am.load_sweep(tmp_path)
    assert found["status"].values.tolist() == ["ok", "failed"]
    assert "in µm / s at one and a single number in nm / s at another" in found.failed[0].why


def test_a_merge_tells_of_shards_that_other_code_has_computed(tmp_path, monkeypatch, capsys):
    points = am.grid(v_p0=[1, 2, 3, 4, 5])
    with monkeypatch.context() as older:
        older.setattr("amoeboid.sweeps.computation.version", lambda _: "0.0.0")
        am.sweep(points, solvers.square, folder=tmp_path, shard=(1, 2))
    am.sweep(points, solvers.square, folder=tmp_path, shard=(2, 2))
    found = am.load_sweep(tmp_path)
    assert (found.done, found.outdated) == (2, 3)
    assert "3 results in the folder are those of another version" in repr(found)
    assert main(["sweep", "--merge", str(tmp_path)]) == 1
    err = capsys.readouterr().err
    assert err.startswith("amoeboid sweep: 3 of 5 points are missing: not computed yet, or comp")
    assert err.endswith("compute all shards with the same one\n")
    # and no more where they were computed anew
    assert am.sweep(points, solvers.square, folder=tmp_path).missing == ""
    assert am.load_sweep(tmp_path).complete


def test_points_that_no_shard_has_computed_yet_are_missing(tmp_path):
    am.sweep(am.grid(v_p0=[1, 2, 3]), solvers.square, folder=tmp_path / "a", shard=(1, 2))
    found = am.load_sweep(tmp_path / "a")
    assert found["status"].values.tolist() == ["ok", "missing", "ok"]
    assert not found.complete
    assert found.done == 2
    assert repr(found).endswith("\n- 1 of 3 points are missing: not computed yet")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"solver": solvers.slow}, "has solver = 'sweeps.solvers.square', now it is"),
        ({"record": ["square"]}, "has record = None, now it is"),
        ({"points": am.grid(am.Parameters(D=0.4), v_p0=[1])}, r"has base.D = 0.03, now it is 0.4"),
    ],
)
def test_the_folder_of_another_sweep_is_refused(tmp_path, change, message):
    am.sweep(am.grid(v_p0=[1]), solvers.square, folder=tmp_path / "a")
    given = {"points": am.grid(v_p0=[1]), "solver": solvers.square, **change}
    with pytest.raises(am.InvalidInput, match=message):
        am.sweep(folder=tmp_path / "a", **given)


def test_folders_of_something_else_and_of_a_newer_format_are_refused(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").touch()
    (tmp_path / "file").touch()
    for name, message in (("mine", "holds 'thesis.tex'"), ("file", "is a file")):
        with pytest.raises(am.InvalidInput, match=message):
            am.sweep(am.grid(v_p0=[1]), solvers.square, folder=tmp_path / name)
    assert [p.name for p in (tmp_path / "mine").iterdir()] == ["thesis.tex"]
    with pytest.raises(am.InvalidInput, match="has none; give the output folder"):
        am.load_sweep(tmp_path / "mine")
    am.sweep(am.grid(v_p0=[1]), solvers.square, folder=tmp_path / "a")
    manifest = tmp_path / "a" / "sweep.json"
    found = json.loads(manifest.read_text())
    manifest.write_text(json.dumps(found | {"format_version": 2}))
    with pytest.raises(am.InvalidInput, match="must be 1 or older, it is 2"):
        am.load_sweep(tmp_path / "a")
    with pytest.raises(am.InvalidInput, match="must be 1 or older, it is 2"):
        am.sweep(am.grid(v_p0=[1]), solvers.square, folder=tmp_path / "a")
    for text in ("{", "[]", "{}", "[" * 100000, '{"format": "amoeboid run"}'):
        manifest.write_text(text)
        with pytest.raises(am.InvalidInput, match="must be the manifest of a sweep"):
            am.load_sweep(tmp_path / "a")


def test_what_is_no_path_is_refused():
    points = am.grid(v_p0=[1])
    run = am.simulate(mesh=am.Icosphere(1), until=am.time(0.1))
    calls = (
        am.load_sweep,
        am.load,
        am.sweep(points, solvers.square).save,
        run.save,
        run.export,
        lambda path: am.sweep(points, solvers.square, folder=path),
    )
    for call, path in product(calls, (3, b"a", "", "a\0b", "\ud800")):
        with pytest.raises(am.InvalidInput, match=r"must be a path, a text or pathlib\.Path"):
            call(path)


def test_damaged_lines_do_not_count(tmp_path):
    points = am.grid(v_p0=[1, 2, 3])
    whole = am.sweep(points, solvers.square, folder=tmp_path / "a")
    file = tmp_path / "a" / "results" / "1-of-1.jsonl"
    good = file.read_text().splitlines(keepends=True)
    for bad in (b"\xff\n", b"[1]\n", b'{"key": 3}\n', b'{"meanings": 3}\n', b"[" * 10**5 + b"\n",
                b'{"key": "a", "status": "x"}\n'):  # fmt: skip
        file.write_bytes("".join(good[:-1]).encode() + bad + good[-1][:-5].encode())
        assert am.load_sweep(tmp_path / "a").done == 2
        again = am.sweep(points, solvers.square, folder=tmp_path / "a")
        assert again.dataset.identical(whole.dataset)


def test_a_law_that_no_file_can_hold_is_refused_with_a_folder(tmp_path):
    p = am.Parameters(law=lambda c, v_p0, c_r: v_p0 / (1 + c / c_r))
    with pytest.raises(am.InvalidInput, match="law"):
        am.sweep(am.grid(p, v_p0=[1]), solvers.square, folder=tmp_path / "a")
    assert am.sweep(am.grid(p, v_p0=[1]), solvers.square).complete


def test_a_point_costs_the_same_however_many_there_are(tmp_path):
    folder = SweepFolder(tmp_path / "a")
    manifest = {"format": "amoeboid sweep", "format_version": 1, "code": "1"}
    row = '{"status":"ok","values":{"x":1.0}}'
    with folder.opened(manifest, (1, 1)):
        sizes = []
        for k in range(3000):
            folder.add({f"{k:032d}": row}, {})
            sizes.append((tmp_path / "a" / "results" / "1-of-1.jsonl").stat().st_size)
    assert {b - a for a, b in pairwise(sizes)} == {len(row) + 32 + 10}
    assert len(list((tmp_path / "a").rglob("*"))) == 3  # no file for each point


STRANGE = (None, True, -1, 1e308, "", "x", [], [[]], {}, {"a": 1}, [1, "x"], "nan", 10**400)


def damaged(found, chance):
    """A document of JSON with one entry removed, or something else in its place."""
    places = []

    def walk(node, path):
        places.append(path)
        inner = node.items() if isinstance(node, dict) else enumerate(node[:4])
        for name, entry in inner:
            walk(entry, [*path, name]) if isinstance(entry, dict | list) else places.append(
                [*path, name]
            )

    walk(found, [])
    *above, last = chance.choice(places[1:])
    for name in above:
        found = found[name]
    if chance.random() < 0.25:
        del found[last]
    else:
        found[last] = chance.choice(STRANGE)


@pytest.mark.parametrize("count", [60, pytest.param(3000, marks=pytest.mark.slow)])
def test_damaged_files_of_a_sweep_are_refused_or_count_as_not_computed(tmp_path, count):
    points = am.grid(v_p0=[1, 2, 3], D=[1, 2])
    am.sweep(points, solvers.square, folder=tmp_path)
    chance = random.Random(count)  # noqa: S311
    files = [tmp_path / "results" / "1-of-1.jsonl", tmp_path / "sweep.json"]
    whole = [path.read_text() for path in files]
    refused = missing = 0
    for number in range(count):
        lines = whole[number % 2].splitlines()
        k = chance.randrange(len(lines))
        changed = json.loads(lines[k])
        damaged(changed, chance)
        lines[k] = json.dumps(changed)
        files[number % 2].write_text("".join(f"{line}\n" for line in lines))
        try:
            found = am.load_sweep(tmp_path)
            assert set(found.dataset["status"].values.ravel()) <= set(STATUSES)
            missing += not found.complete
        except am.InvalidInput:
            refused += 1
        files[number % 2].write_text(whole[number % 2])
    assert refused > count / 20
    assert missing > count / 20


def test_a_point_whose_line_is_damaged_is_computed_again(tmp_path):
    points = am.grid(v_p0=[1, 2, 3])
    first = am.sweep(points, solvers.square, folder=tmp_path)
    file = tmp_path / "results" / "1-of-1.jsonl"
    whole = file.read_text()
    file.write_text(whole.replace('"third":0.', '"fourth":0.', 1))
    assert am.load_sweep(tmp_path).counts == {"ok": 2, "missing": 1}
    assert am.sweep(points, solvers.square, folder=tmp_path).rows == first.rows
    file.write_text(whole.replace('"third":', '"fourth":', 1))  # what the names mean
    assert am.load_sweep(tmp_path).counts == {"missing": 3}
    assert am.sweep(points, solvers.square, folder=tmp_path).rows == first.rows
    assert am.load_sweep(tmp_path).complete

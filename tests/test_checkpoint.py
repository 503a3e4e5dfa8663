"""What a checkpoint must be: a step that a run can have written."""

import itertools
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from amoeboid.cli.main import main
from amoeboid.config import Config, Initial, Mesh, Output, Time
from amoeboid.meshes.connectivity import icosphere
from amoeboid.model.parameters import Parameters
from amoeboid.output.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from amoeboid.output.folder import new_run
from amoeboid.simulation.loop import evolve, start
from amoeboid.surface.stability import Growth
from amoeboid.surface.steadiness import Rest
from amoeboid.validation import InvalidInput
from surface.written import write_surface

CONFIG = Config(
    mesh=Mesh(subdivisions=1),
    initial=Initial(perturbation=1.0),
    time=Time(end=0.4),
    output=Output(interval=0.1),
)


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """The folder of a finished run, and the arrays of its checkpoint."""
    folder = tmp_path_factory.mktemp("run")
    step = start(CONFIG)
    run = new_run(folder, CONFIG)
    run.take(step)
    for step in evolve(step, CONFIG.time):
        run.take(step)
    run.save(step)
    assert len(step.history) == 3
    assert len(run.frame_times) > 2
    with np.load(folder / "checkpoint.npz", allow_pickle=False) as data:
        return folder, dict(data)


@pytest.mark.parametrize("scheme", ["semi-implicit", "explicit"])
@pytest.mark.parametrize("steps", [0, 1, 2, 5])
def test_every_step_is_read_back_with_the_same_bits(scheme, steps, tmp_path):
    config = replace(CONFIG, time=Time(end=0.4, scheme=scheme))
    step = start(config)
    run = evolve(step, config.time)
    for _ in range(steps):
        step = next(run)
    path = tmp_path / "checkpoint.npz"
    write_checkpoint(path, Checkpoint(config, step, (step.state.t,)))
    back = read_checkpoint(path)
    assert back.config == config
    assert back.frame_times == (step.state.t,)
    for name in ("number", "next_dt", "rejected", "rate", "rest"):
        assert getattr(back.step, name) == getattr(step, name)
    assert back.step.model.edge_length == step.model.edge_length
    assert np.array_equal(back.step.model.mesh.faces, step.model.mesh.faces)
    assert len(back.step.history) == len(step.history)
    for a, b in zip(back.step.history, step.history, strict=True):
        assert (a.t, a.zeta0) == (b.t, b.zeta0)
        for name in ("r", "c", "position"):
            assert np.array_equal(getattr(a, name), getattr(b, name))
    for name in ("v_c", "v_p", "normals", "node_areas", "zeta0"):
        assert np.array_equal(getattr(back.step.flow, name), getattr(step.flow, name))


def with_entry(index, value):
    def change(array):
        array = array.copy()
        array[index] = value
        return array

    return change


def swapped(array):
    array = array.copy()
    array[[0, 1]] = array[[1, 0]]
    return array


def turned_over(faces):
    return np.concatenate([faces[:1, ::-1], faces[1:]])


def with_one_thrice(faces):
    return np.concatenate([faces[:-2], faces[:1], faces[:1]])


FLOAT_NAMES = (
    "numbers",
    "rest",
    "frame_times",
    "edge_length",
    "tried",
    "history_r",
    "history_c",
    "history_scalars",
    "history_position",
    "history_angular_velocity",
    "flow_vectors",
    "flow_areas",
    "flow_zeta0",
)
OTHER_NAMES = (
    "config", "step", "rest_known", "rest_problem", "faces", "tried_known",
    "history_angular_velocity_known",
)  # fmt: skip
LAYOUT = [
    (name, change)
    for name in (*OTHER_NAMES, *FLOAT_NAMES)
    for change in (
        None,
        lambda a: a[None],
        lambda a: a[..., None],
        lambda a: np.array(["text"] * 3),
        lambda a: a[:0] if a.ndim else np.zeros(0, a.dtype),
        lambda a: np.zeros((0, 0, 0)),
    )
]
FLOATS = [
    (name, change)
    for name in FLOAT_NAMES
    for change in (
        lambda a: a * np.nan,
        lambda a: a + np.inf,
        lambda a: a.astype(np.float32),
        lambda a: a.astype(">f8"),
        lambda a: a.astype(complex),
        lambda a: a.astype(np.int64),
        lambda a: a.astype("U20"),
        lambda a: a > 0,
    )
]
VALUES = [
    ("step", with_entry(0, -1)),
    ("step", with_entry(1, -1)),
    ("step", lambda a: a.astype(float)),
    ("step", lambda a: a[:1]),
    ("numbers", with_entry(0, 0.0)),
    ("numbers", with_entry(0, -0.1)),
    ("numbers", with_entry(1, -1.0)),
    ("rest_known", lambda a: a.astype(int)),
    ("rest_known", with_entry(1, True)),
    ("rest", with_entry(2, -1.0)),
    ("frame_times", lambda a: a[::-1]),
    ("frame_times", lambda a: a[:-1]),
    ("frame_times", lambda a: np.append(a, a[-1] + 1)),
    ("faces", lambda a: a[:-1]),
    ("faces", lambda a: a[:-2]),
    ("faces", lambda a: a - 1),
    ("faces", lambda a: a + 1),
    ("faces", lambda a: a[:, ::-1]),
    ("faces", lambda a: a.astype(float)),
    ("faces", lambda a: a.astype(np.int32)),
    ("faces", lambda a: a[:, :2]),
    ("faces", with_entry((0, 0), 10**9)),
    ("faces", with_entry((0, 0), 2**62)),
    ("faces", with_entry((0, 0), -(2**62))),
    ("faces", turned_over),
    ("faces", with_one_thrice),
    ("faces", lambda a: np.zeros_like(a)),
    ("faces", lambda a: np.concatenate([a, a])),
    ("faces", lambda a: np.roll(icosphere(1)[1], 5) % 42),
    ("edge_length", lambda a: np.array([1.0, 2.0])),
    ("edge_length", lambda a: a * 0),
    ("edge_length", lambda a: -a),
    ("edge_length", lambda a: a * 100),
    ("edge_length", lambda a: a * 1e-3),
    ("tried_known", lambda a: a.astype(int)),
    ("tried", lambda a: a[:-1]),
    ("history_r", lambda a: a[:, :-1]),
    ("history_r", lambda a: a[:2]),
    ("history_r", lambda a: a * 2),
    ("history_r", lambda a: a * 1e200),
    ("history_r", lambda a: a * 0),
    ("history_r", lambda a: -a),
    ("history_r", with_entry((2, 3), 1e3)),
    ("history_r", with_entry((0, 3), 0.0)),
    ("history_r", lambda a: np.concatenate([-a[:1], a[1:]])),
    ("history_c", lambda a: a[:, :-1]),
    ("history_c", lambda a: a[:2]),
    ("history_c", lambda a: -a),
    ("history_c", with_entry((1, 5), -1e-3)),
    ("history_scalars", lambda a: a[:0]),
    ("history_scalars", lambda a: a[::-1]),
    ("history_scalars", swapped),
    ("history_scalars", with_entry((1, 0), 0.4)),
    ("history_scalars", with_entry((2, 0), -1.0)),
    ("history_scalars", with_entry((0, 0), 7.0)),
    ("history_position", lambda a: a[:, :2]),
    ("flow_vectors", lambda a: a[:, :-1]),
    ("flow_vectors", lambda a: a[:2]),
    ("flow_areas", lambda a: a[:-1]),
    ("flow_areas", lambda a: -a),
    ("config", lambda a: np.array("D = [")),
    ("config", lambda a: np.array("[parameters]\nD = -1")),
    ("config", lambda a: np.array("[parameters]\nR0 = 2.0")),
    ("config", lambda a: np.array(3.0)),
]


def test_more_states_than_a_step_needs_are_refused(stored, tmp_path, capsys):
    folder, arrays = stored
    history = {n: np.concatenate([a, a]) for n, a in arrays.items() if n.startswith("history_")}
    latest = history["history_scalars"][0, 0]
    history["history_scalars"][:, 0] = np.linspace(latest, 0.5 * latest, len(history["history_r"]))

    def write(path):
        with path.open("wb") as file:
            np.savez(file, **arrays | history)

    refused(folder, tmp_path, write, capsys)


@pytest.mark.parametrize(("name", "change"), [*LAYOUT, *FLOATS, *VALUES])
def test_what_no_run_has_written_is_refused(name, change, stored, tmp_path, capsys):
    folder, arrays = stored
    if change is None:
        arrays = {n: a for n, a in arrays.items() if n != name}
    else:
        arrays = arrays | {name: change(arrays[name])}
    refused(folder, tmp_path, lambda path: np.savez(path, **arrays), capsys)


def refused(folder, tmp_path, write, capsys):
    """As a user meets it: one message, exit code 2, and the folder stays as it is."""
    for file in ("config.toml", "timeseries.csv", "manifest.json"):
        (tmp_path / file).write_bytes((folder / file).read_bytes())
    write(tmp_path / "checkpoint.npz")
    before = {p: p.read_bytes() for p in tmp_path.iterdir()}
    with pytest.raises(InvalidInput):
        read_checkpoint(tmp_path / "checkpoint.npz")
    assert main(["run", "--resume", str(tmp_path), "--set", "time.end=0.6", "--json"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"amoeboid run: the run in {str(tmp_path)!r} cannot be read: ")
    assert err.count("\n") == 1
    assert "start a new one" in err
    assert before == {p: p.read_bytes() for p in tmp_path.iterdir()}


def half(good):
    return good[: len(good) // 2]


def flipped(good):
    place = good.index(b"history_r") + 2000
    return good[:place] + bytes([good[place] ^ 1]) + good[place + 1 :]


def member_damaged(good):
    """The header of an array says something that is none."""
    return good.replace(b"'fortran_order': False", b"'fortran_order': Falsy", 1)


@pytest.mark.parametrize(
    "damage",
    [
        lambda good: b"",
        lambda good: b"no archive",
        lambda good: b"PK\x03\x04 no archive",
        lambda good: b"\x93NUMPY" + good,
        lambda good: good.replace(b"PK", b"KP"),
        half,
        flipped,
        member_damaged,
    ],
)
def test_a_damaged_file_is_refused(damage, stored, tmp_path, capsys):
    folder, _ = stored
    damaged = damage((folder / "checkpoint.npz").read_bytes())
    refused(folder, tmp_path, lambda path: path.write_bytes(damaged), capsys)


def test_an_archive_of_something_else_is_refused(stored, tmp_path, capsys):
    def write(path):
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("history_r.npy", "no array")

    refused(stored[0], tmp_path, write, capsys)


@pytest.mark.parametrize("name", ["config", "faces", "history_r"])
def test_no_pickle_is_ever_loaded(name, stored, tmp_path, capsys):
    folder, arrays = stored
    arrays = arrays | {name: np.array([object()], dtype=object)}
    refused(folder, tmp_path, lambda path: np.savez(path, **arrays), capsys)


def test_a_rest_that_begins_later_is_refused(tmp_path):
    step = start(CONFIG)
    path = tmp_path / "checkpoint.npz"
    write_checkpoint(path, Checkpoint(CONFIG, replace(step, rest=Rest(0.1, Growth(None))), (0.0,)))
    with pytest.raises(InvalidInput, match="rest"):
        read_checkpoint(path)


@pytest.mark.parametrize(
    "rest",
    [
        Rest(0.0, Growth(None, problem="not found")),
        Rest(0.0, Growth(-0.3, 0.1)),
        Rest(0.0, Growth(0.3, 0.01)),
    ],
)
def test_a_rest_is_read_back(rest, tmp_path):
    path = tmp_path / "checkpoint.npz"
    step = replace(start(CONFIG), rest=rest)
    write_checkpoint(path, Checkpoint(CONFIG, step, (0.0,)))
    assert read_checkpoint(path).step.rest == rest


def test_what_else_a_file_holds_is_not_even_read(stored, tmp_path):
    """Names of frames come from their number, never from a file."""
    _, arrays = stored
    path = tmp_path / "checkpoint.npz"
    np.savez(path, **arrays, frame_names=np.array([object()], dtype=object))
    assert read_checkpoint(path).step.number == arrays["step"][0]


@pytest.mark.slow
def test_a_run_with_a_mesh_that_was_tried_in_vain_goes_on_with_the_same_bits(tmp_path):
    """A rod whose ends no mesh of so few nodes resolves: some attempts to remesh it fail."""
    r, faces = icosphere(2)
    surface = write_surface(tmp_path / "rod.stl", r * [1.0, 1.0, 12.0], faces)
    config = Config(
        parameters=Parameters(D=0.4, v_p0=6.0, delta_P=30.0),
        initial=Initial(surface=str(surface), perturbation=0.5),
    )
    steps = list(itertools.islice(evolve(start(config), config.time), 14))
    at = next(k for k, step in enumerate(steps) if step.tried is not None)
    assert at < len(steps) - 2
    write_checkpoint(tmp_path / "a.npz", Checkpoint(config, steps[at], (steps[at].state.t,)))
    back = read_checkpoint(tmp_path / "a.npz").step
    assert np.array_equal(back.tried, steps[at].tried)
    for again, step in zip(evolve(back, config.time), steps[at + 1 :], strict=False):
        assert np.array_equal(again.state.r, step.state.r)
        assert np.array_equal(again.state.c, step.state.c)
        assert (again.tried is None) == (step.tried is None)

"""Exports hold what the run holds, in the formats and units that other programs read."""

import csv
import hashlib
import json
import re
import shutil
import subprocess
import sys
from importlib import import_module
from importlib.util import find_spec

import numpy as np
import pytest
from PIL import Image
from pyvista import get_reader, read

import amoeboid as am
from amoeboid import exports
from amoeboid.cli.main import main
from amoeboid.exports import movie
from amoeboid.exports.export import export, selected
from amoeboid.exports.job import Job
from amoeboid.meshes.files import surface_file
from amoeboid.observables import retrograde_flow
from amoeboid.plotting.canvas import Canvas
from amoeboid.runs.words import ASSUMED

PLAIN = am.Parameters(D=0.4, v_p0=6.0)
PHYSICAL = am.Parameters.physical(R0="10 um", v_p0="3 um/s")


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    for name, p in (("plain", PLAIN), ("physical", PHYSICAL)):
        am.simulate(p, mesh=am.Icosphere(1), until=am.time(0.8), folder=folder / name)
    return folder


@pytest.fixture
def plain(runs):
    return am.load(runs / "plain")


@pytest.fixture
def physical(runs):
    # what makes its numbers physical is in the manifest
    run = am.load(runs / "physical")
    assert run.parameters.units is not None
    return run


def table(path, skip=0):
    with path.open(newline="") as file:
        rows = list(csv.reader(file))
    return rows[0], rows[1 : 1 + skip], rows[1 + skip :]


def test_vtp_frames_are_those_of_the_run_where_the_cell_is(plain, tmp_path):
    files = plain.export(tmp_path / "out", "vtp")
    assert [file.name for file in files] == [*(n for _, n in plain.frames.entries), "frames.pvd"]
    listed = get_reader(str(tmp_path / "out/frames.pvd"))
    assert listed.time_values == plain.frames.times
    for file, frame in zip(files[:-1], plain.frames, strict=True):
        found = read(file)
        position = frame.state.position
        np.testing.assert_allclose(found.points, frame.x + position, atol=1e-14)
        np.testing.assert_array_equal(found["c"], frame.c)
        np.testing.assert_array_equal(found.regular_faces, frame.faces)
        np.testing.assert_array_equal(found["retrograde_flow"], frame.retrograde_flow)
    assert np.linalg.norm(position) > 0.1  # the cell has moved
    plain.export(tmp_path / "centred", "vtp", follow=True)
    centred = read(tmp_path / "centred/frame_00002.vtp")
    np.testing.assert_allclose(centred.points, plain.frames[2].x, atol=1e-14)


@pytest.mark.parametrize(("kind", "tolerance"), [("ply", 0.0), ("stl", 1e-6)])
def test_surfaces_are_read_back_as_the_cell(kind, tolerance, physical, tmp_path):
    frame = physical.frames[-1]
    (path,) = physical.export(tmp_path / f"cell.{kind}", frames=-1)
    found = surface_file(str(path), "surface")
    nodes = (frame.x + frame.parameters.quantity(frame.state.position, "L")).to("um").magnitude
    np.testing.assert_allclose(
        found.r[found.faces], nodes[frame.faces], rtol=1e-12 + tolerance, atol=10 * tolerance
    )
    mesh = read(path)
    assert mesh.volume == pytest.approx(frame.volume.to("um^3").magnitude, rel=1e-5)
    if kind == "ply":
        head, _, body = path.read_bytes().partition(b"end_header\n")
        assert b"length um" in head
        names = re.findall(r"property double (\w+)", head.decode())
        values = np.frombuffer(body, "<f8", 42 * len(names)).reshape(42, -1)
        c = frame.c.to("1/um^2").magnitude
        np.testing.assert_array_equal(values[:, names.index("c")], c)


def test_tables_have_titles_with_units_and_all_digits(physical, tmp_path):
    series, profiles = physical.export(tmp_path, "csv")
    titles, _, rows = table(series)
    assert titles[:2] == ["step", "t [s]"]
    assert "max_retrograde_speed [um/s]" in titles
    column = [float(row[titles.index("c_rear [1/um^2]")]) for row in rows]
    assert np.array_equal(column, physical["c_rear"].to("1/um^2").magnitude)
    titles, _, rows = table(profiles)
    assert titles == ["frame", "t [s]", "theta [rad]", "c [1/um^2]", "flow [um/s]"]
    last = np.array([row for row in rows if row[0] == rows[-1][0]], dtype=float)
    np.testing.assert_allclose(
        last[:, 3], physical.kymograph().c[-1].to("1/um^2").magnitude, rtol=1e-12
    )
    # towards the rear, where c is high, and nearly as fast as anywhere on the cell
    fastest = physical.final.max_retrograde_speed.to("um/s").magnitude
    assert 0.7 * fastest < last[:, 4].max() <= 1.01 * fastest
    assert last[:, 4].min() > -0.02 * fastest


@pytest.mark.slow
def test_flow_profile_is_that_of_the_axisymmetric_state(tmp_path):
    """The steady state of the spectral solver, put on a mesh."""
    state = am.steady_states(PLAIN, (1,)).fastest_stable
    run = am.simulate(PLAIN, mesh=am.Icosphere(2), initial=state, until=am.time(0.02))
    _, profiles = run.export(tmp_path, "csv")
    rows = np.array(table(profiles)[2], dtype=float)
    flow = rows[rows[:, 0] == rows[-1, 0]][:, 4]
    # of second order in the length of an edge: 1 % at 162 nodes, as the speed in fig3d
    assert flow.max() == pytest.approx(state.max_retrograde_speed, rel=0.03)


def test_a_table_of_spots_is_that_of_trackmate(physical, tmp_path):
    (path,) = physical.export(tmp_path, "trackmate")
    keys, below, rows = table(path, skip=3)
    assert keys == [
        "LABEL", "ID", "TRACK_ID", "QUALITY", "POSITION_X", "POSITION_Y", "POSITION_Z",
        "POSITION_T", "FRAME", "RADIUS", "VISIBILITY",
    ]  # fmt: skip
    assert below[0][1:4] == ["Spot ID", "Track ID", "Quality"]
    assert below[2] == [
        "", "", "", "(quality)", "(micron)", "(micron)", "(micron)", "(sec)", "", "(micron)", "",
    ]  # fmt: skip
    assert len(rows) == len(physical.frames)
    assert [row[keys.index("FRAME")] for row in rows] == [str(k) for k in range(len(rows))]
    place = [float(rows[-1][keys.index(f"POSITION_{k}")]) for k in "XYZ"]
    np.testing.assert_allclose(place, physical.trajectory[-1].to("um").magnitude, atol=1e-9)
    pandas = pytest.importorskip("pandas")
    spots = pandas.read_csv(path, skiprows=[1, 2, 3])  # as such tables are read
    assert spots.POSITION_T.iloc[-1] == pytest.approx(physical.t[-1].to("s").magnitude)


def test_layers_of_napari_have_the_shapes_of_its_documentation(plain, tmp_path):
    tracks, surface = plain.export(tmp_path, "napari")
    rows = np.loadtxt(tracks, delimiter=",", skiprows=1)
    assert tracks.read_text().startswith("track_id,t,z,y,x\n")
    assert rows.shape == (len(plain.frames), 5)
    np.testing.assert_allclose(rows[-1, :1:-1], plain.frames[-1].state.position, atol=1e-14)
    with np.load(surface) as found:
        vertices, faces, values = (found[name] for name in ("vertices", "faces", "values"))
    n = sum(len(frame.c) for frame in plain.frames)
    assert (vertices.shape, values.shape, faces.shape[1]) == ((n, 4), (n,), 3)
    assert (faces.min(), faces.max()) == (0, n - 1)
    # no triangle joins two frames
    assert np.all(np.ptp(vertices[faces][:, :, 0], axis=1) == 0.0)
    last = vertices[:, 0] == len(plain.frames) - 1
    frame = plain.frames[-1]
    np.testing.assert_allclose(vertices[last, :0:-1], frame.x + frame.state.position, atol=1e-14)
    np.testing.assert_array_equal(values[last], frame.c)


def test_netcdf_is_a_dataset_with_units(physical, tmp_path):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    (path,) = physical.export(tmp_path / "run.nc")
    frame = physical.frames[2]
    with xarray.open_dataset(path) as data:
        assert data.sizes["frame"] == len(physical.frames)
        assert (data.c.units, data.x.units, data.v.units, data.frame_t.units) == (
            "1/um^2", "um", "um/s", "s",
        )  # fmt: skip
        np.testing.assert_array_equal(data.c[2], frame.c.to("1/um^2").magnitude)
        np.testing.assert_array_equal(data.x[2], frame.x.to("um").magnitude)
        np.testing.assert_array_equal(data.triangles[2], frame.faces)
        np.testing.assert_array_equal(data.t, physical.t.to("s").magnitude)
        assert data.max_retrograde_speed.dims == ("step",)
        assert data.attrs["ended"] == "end of time"


def remeshed():
    """Cells in memory whose numbers of nodes differ, as those of a run whose mesh changes."""
    runs = [
        am.simulate(PLAIN, mesh=am.Icosphere(n), until=am.time(0.01), progress=False)
        for n in (1, 2)
    ]
    frames = [runs[0].frames[0], runs[1].frames[-1]]
    return am.Solution(runs[1].config, runs[1].rows, runs[1].units, frames, runs[1].last,
                       "finished", "end of time")  # fmt: skip


def test_frames_with_different_numbers_of_nodes_are_exported(tmp_path):
    run = remeshed()
    _, surface = run.export(tmp_path, "napari")
    with np.load(surface) as found:
        assert len(found["values"]) == 42 + 162
        assert found["faces"].max() == 203
    data = page_data(run.export(tmp_path / "run.html")[0])
    assert [len(one["faces"]) for one in (data, *data["later"])] == [80, 320]
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    with xarray.open_dataset(run.export(tmp_path / "run.nc")[0]) as data:
        assert list(data.n_nodes) == [42, 162]
        assert data.triangles.dtype.kind == "i"
        assert np.all(data.triangles[0, 80:] == -1)
        np.testing.assert_array_equal(data.c[0].dropna("node"), run.frames[0].c)
        np.testing.assert_array_equal(data.c[1], run.frames[1].c)


def page_data(path):
    html = path.read_text()
    (found,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', html)
    return json.loads(found)


def test_a_page_holds_all_frames_and_needs_nothing_else(physical, tmp_path):
    (path,) = physical.export(tmp_path / "run.html")
    html = path.read_text()
    assert not re.search(r"https?:|\bsrc=|<link|@import|import\(|fetch\(|\{\{", html)
    data = page_data(path)
    assert len(data["later"]) == len(physical.frames) - 1
    assert not any("faces" in one for one in data["later"])  # the mesh does not change
    assert data["later"][-1]["words"] == "t = 8 s"
    c = physical.final.c.to("1/um^2").magnitude
    np.testing.assert_allclose(data["later"][-1]["c"], c, rtol=5.1e-4)


def images(path):
    with Image.open(path) as movie:
        for k in range(movie.n_frames):
            movie.seek(k)
            yield np.asarray(movie.convert("RGB"), dtype=int)


@pytest.mark.slow
def test_movies_keep_one_view_and_the_cell_crosses_it(plain, tmp_path, monkeypatch):
    """The cell is what is drawn in the middle band of the picture, below the words above."""
    words, text = [], Canvas.text
    monkeypatch.setattr(
        Canvas, "text", lambda self, *a, **k: (words.append(a[1]), text(self, *a, **k))[1]
    )
    middles = {}
    for follow in (False, True):
        (path,) = plain.export(tmp_path / f"{follow}.gif", follow=follow, fps=10)
        with Image.open(path) as found:
            assert (found.n_frames, found.size) == (len(plain.frames), movie.WINDOW)
            assert found.info["duration"] == 100
            assert found.info["loop"] == 0
        band = [image[260:420].min(axis=(0, 2)) < 240 for image in images(path)]
        middles[follow] = [np.mean(np.flatnonzero(dark)) for dark in band]
    assert np.ptp(middles[True]) < 12  # pixels; arrows grow on one side
    assert middles[False][0] - middles[False][-1] > 60  # the front is on the left
    assert {"t = 0 [T]", "t = 0.8 [T]"} <= set(words)
    assert any(re.fullmatch(r"\d+(\.\d+)? \[L\]", text) for text in words)
    assert f"path: {ASSUMED}" in words


def test_the_colors_of_a_movie_span_all_its_frames(plain):
    job = Job(plain, "run", range(len(plain.frames)))
    view = movie.view_of(job, movie.extent_of(job, "gif"))
    c = np.concatenate([frame.c for frame in plain.frames])
    assert view.limits == (c.min(), c.max())
    speeds = [frame.max_retrograde_speed for frame in plain.frames]
    assert view.fastest == pytest.approx(max(speeds), rel=1e-12)


def test_a_movie_has_the_frames_at_their_rate(plain, tmp_path, monkeypatch):
    written, text = [], Canvas.text
    monkeypatch.setattr(
        Canvas, "text", lambda self, *a, **k: (written.append(a[1]), text(self, *a, **k))[1]
    )
    (path,) = plain.export(tmp_path / "a.gif", frames="::2", fps=10)
    with Image.open(path) as found:
        assert (found.n_frames, found.size) == (2, movie.WINDOW)
        assert (found.info["duration"], found.info["loop"]) == (100, 0)
    assert [words for words in written if words.startswith("t = ")] == ["t = 0 [T]", "t = 0.8 [T]"]
    assert f"path: {ASSUMED}" in written


@pytest.mark.slow
def test_a_gif_is_close_to_the_pictures_that_it_was_made_of(plain, tmp_path):
    (path,) = plain.export(tmp_path / "run.gif", frames=-1)
    job = Job(plain, "run", range(len(plain.frames))[-1:])
    (canvas,) = movie.pictures(job, "gif")
    (found,) = images(path)
    assert np.abs(found - np.asarray(canvas.image(), dtype=int)).mean() < 1.5  # of 255


@pytest.mark.slow
def test_an_mp4_is_a_movie(plain, tmp_path):
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    (path,) = plain.export(tmp_path / "run.mp4", fps=5)
    frames, seconds = ffmpeg.count_frames_and_secs(str(path))
    assert frames == len(plain.frames)
    assert seconds == pytest.approx(frames / 5, abs=0.01)


SLOW = ("gif", "html", "mp4", "netcdf")


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow if n in SLOW else ()) for n in exports.names()]
)
def test_the_same_run_gives_the_same_files(name, plain, tmp_path):
    for package in exports.named(name).packages:
        pytest.importorskip(package)
    if name == "mp4":
        pytest.importorskip("imageio_ffmpeg")
    digests = []
    for k in range(2):
        files = plain.export(tmp_path / str(k), name, frames="::2")
        digests.append([hashlib.sha256(file.read_bytes()).hexdigest() for file in files])
        assert not [p for p in (tmp_path / str(k)).iterdir() if p not in files]
    assert digests[0] == digests[1]


def test_files_are_not_replaced_without_being_asked(plain, tmp_path):
    plain.export(tmp_path, "stl", frames=0)
    path = tmp_path / "frame_00000.stl"
    path.write_bytes(b"mine")
    with pytest.raises(am.InvalidInput, match=r"exists; choose another path, or .*--force"):
        plain.export(tmp_path, "stl")
    assert [p.name for p in tmp_path.iterdir()] == [path.name]  # nothing else was written either
    plain.export(tmp_path, "stl", force=True)
    assert path.read_bytes() != b"mine"


def test_a_file_is_no_folder_for_an_export(plain, tmp_path):
    path = tmp_path / "mine"
    path.write_bytes(b"mine")
    for below in (path, path / "deeper"):
        with pytest.raises(am.InvalidInput, match=r"must lie in a folder, '.*mine' is a file"):
            plain.export(below, "stl", frames=0)
    assert path.read_bytes() == b"mine"


def test_the_list_of_surfaces_is_in_the_order_of_time(plain, tmp_path):
    plain.export(tmp_path / "back", "vtp", frames="::-1")
    text = (tmp_path / "back/frames.pvd").read_text()
    assert re.findall(r"frame_(\d+)", text) == ["00000", "00001", "00002"]


def test_the_files_of_the_run_are_never_replaced(plain, runs):
    before = {p: p.read_bytes() for p in runs.rglob("*") if p.is_file()}
    for path, name in ((plain.folder, "csv"), (plain.folder / "frames", "vtp")):
        with pytest.raises(am.InvalidInput, match="must not replace the files of the run"):
            plain.export(path, name, force=True)
    assert before == {p: p.read_bytes() for p in runs.rglob("*") if p.is_file()}


def test_a_failing_export_leaves_the_old_file_and_nothing_else(plain, tmp_path, monkeypatch):
    path = tmp_path / "run.gif"
    path.write_bytes(b"old")

    def fail(self):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Canvas, "image", fail)
    with pytest.raises(OSError, match=r"No space left on device: '.*run\.gif'"):
        plain.export(path, force=True)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("given", "numbers"),
    [
        (None, [0, 1, 2, 3, 4]),
        ("1:4:2", [1, 3]),
        ("::2", [0, 2, 4]),
        ("-2:", [3, 4]),
        ("::-2", [4, 2, 0]),
        ("3", [3]),
        ("-1", [4]),
        (-1, [4]),
        (np.int64(2), [2]),
        (slice(0, 2), [0, 1]),
        ("0:100:10", [0]),
        ("7:", []),
    ],
)
def test_frames_are_chosen_as_in_slices(given, numbers):
    assert list(selected(given, 5)) == numbers


@pytest.mark.parametrize("given", ["", "a", "1:2:0", "1:2:3:4", "1.5", 1.5, True, 5, -6, "1 2", []])
def test_what_chooses_no_frame_is_refused(given):
    with pytest.raises(am.InvalidInput, match="fr"):
        selected(given, 5)


@pytest.mark.filterwarnings("default")  # the command shows it
def test_frames_without_a_time_series_are_exported_and_it_is_told(runs, tmp_path, capsys):
    folder = tmp_path / "alone"
    shutil.copytree(runs / "plain", folder)
    (folder / "timeseries.csv").unlink()
    for name, files in (("csv", ["profiles.csv"]), ("netcdf", ["alone.nc"])):
        assert main(["export", str(folder), "--to", name, "-o", str(tmp_path / name)]) == 0
        assert sorted(path.name for path in (tmp_path / name).iterdir()) == files
        assert capsys.readouterr().err == (
            "amoeboid export: the run has no time series; only its frames are exported\n"
        )
    xarray = pytest.importorskip("xarray", reason="the extra amoeboid[data]")
    with xarray.open_dataset(tmp_path / "netcdf" / "alone.nc") as data:
        assert "step" not in data.sizes
        np.testing.assert_allclose(data.c[-1], am.load(folder).frames[-1].c)
    (folder / "frames.pvd").unlink()
    assert main(["export", str(folder), "--to", "csv"]) == 2
    assert "csv needs a time series or frames, the run has none" in capsys.readouterr().err


MANY = """
import resource, sys
import amoeboid as am
run = am.load(sys.argv[1])
run.export(sys.argv[2], sys.argv[3], frames=f":{sys.argv[4]}", force=True)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["netcdf", "gif", "mp4", "csv", "vtp"])
def test_exports_of_many_frames_need_no_more_memory_than_those_of_few(tmp_path, name):
    if name == "mp4" and find_spec("imageio_ffmpeg") is None:
        pytest.skip("the extra amoeboid[movie]")
    folder, count = tmp_path / "many", 1000 if name in ("netcdf", "csv") else 300
    run = am.simulate(PLAIN, mesh=am.Icosphere(2), until=am.time(0.2), folder=folder)
    listed = (folder / "frames.pvd").read_text().splitlines(keepends=True)
    frame, end = (folder / "frames/frame_00001.vtp").read_bytes(), run.frames[-1].state.t
    for k in range(count):
        (folder / f"frames/frame_{k:05d}.vtp").write_bytes(frame)
    entries = [
        f'    <DataSet timestep="{end * k / count!r}" part="0" file="frames/frame_{k:05d}.vtp"/>\n'
        for k in range(count)
    ]
    (folder / "frames.pvd").write_text("".join([*listed[:3], *entries, *listed[-2:]]))
    kilobytes = []
    for frames in (100, count):
        found = subprocess.run(
            [sys.executable, "-c", MANY, str(folder), str(tmp_path / "out"), name, str(frames)],
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        kilobytes.append(int(found.stdout))
    # all frames together have 22 MB of numbers; variables of NetCDF keep a chunk of 1 MB each
    assert kilobytes[1] - kilobytes[0] < (9000 if name == "netcdf" else 3000)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--to", "avi"], "unknown export format 'avi'"),
        ([], "follow from the extension of the path"),
        (["-o", "a.png"], "follow from the extension of the path"),
        (["--to", "vtp", "--fps", "3"], "fps has no effect on vtp"),
        (["--to", "csv", "--follow"], "follow has no effect on csv"),
        (["--to", "gif", "--fps", "0"], "fps must be"),
        (["--to", "gif", "--frames", "50:"], "selects none of the"),
        (["--to", "gif", "--frames", "50"], "must be a number from 0 to"),
        (["-o", "out.vtp"], "choose one frame"),
        (["--to", "csv", "--frames", "50:"], "selects none of the"),
        (["--to", "stl", "--frames", "::0"], "a step that is not 0, got '::0'"),
        (["--to", "stl", "--frames=-50"], "or -3 to -1 from the end, got -50"),
        (["-o", "a.gif", "--fps", "51"], "fps must be a number > 0 and <= 50 here"),
        (["-o", "a.csv"], "(timeseries.csv, profiles.csv) and needs the path of a folder, got"),
        (["--to", "stl", "-o", "a.ply"], "must have the extension .stl"),
    ],
)
def test_wrong_exports_are_refused_in_one_line(words, says, runs, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["export", str(runs / "plain"), *words]) == 2
    err = capsys.readouterr().err
    assert says in err
    assert err.startswith("amoeboid export: ")
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_missing_package_is_named_with_its_extra(plain, tmp_path, monkeypatch):
    for package in ("h5netcdf", "imageio_ffmpeg"):
        monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(am.InvalidInput, match=r"netcdf needs h5netcdf.*'amoeboid\[data\]'"):
        plain.export(tmp_path / "run.nc")
    with pytest.raises(am.InvalidInput, match=r"mp4 needs ffmpeg.*'amoeboid\[movie\]'"):
        plain.export(tmp_path / "run.mp4")
    assert not list(tmp_path.iterdir())


def test_the_command_names_few_files_and_counts_many(runs, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["export", str(runs / "plain"), "--to", "csv"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(": ")[0] for line in lines] == [
        "plain-csv/timeseries.csv", "plain-csv/profiles.csv",
    ]  # fmt: skip
    assert main(["export", str(runs / "plain"), "-o", "a", "--to", "vtp"]) == 0
    n = len(am.load(runs / "plain").frames)
    assert capsys.readouterr().out.startswith("a/frame_00000.vtp: ")
    monkeypatch.setattr("amoeboid.cli.export.MANY", 2)
    assert main(["export", str(runs / "plain"), "-o", "c", "--to", "vtp"]) == 0
    counted = f"{n + 1} files in c, frame_00000.vtp to frames.pvd: "
    assert capsys.readouterr().out.startswith(counted)
    assert main(["export", str(runs / "plain"), "-o", "b.gif", "--frames=-1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found == {"files": ["b.gif"], "bytes": [(tmp_path / "b.gif").stat().st_size]}


def test_formats_are_found_by_their_modules(monkeypatch):
    assert {"vtp", "ply", "stl", "csv", "netcdf", "gif", "mp4", "html"} <= set(exports.names())
    for name in exports.names():
        assert exports.named(name) is import_module(f"amoeboid.exports.formats.{name}").FORMAT
        assert f"{name}" in am.StoredRun.export.__doc__
    code = "import sys, amoeboid.cli.main; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "PIL" not in done.stdout


def test_runs_in_memory_are_exported_as_their_folders(plain, tmp_path):
    run = am.simulate(PLAIN, mesh=am.Icosphere(1), until=am.time(0.8))
    for k, one in enumerate((run, plain)):
        export(one, tmp_path / str(k), "ply")
    files = [sorted((tmp_path / str(k)).iterdir()) for k in range(2)]
    assert [a.read_bytes() for a in files[0]] == [b.read_bytes() for b in files[1]]
    assert retrograde_flow(run.final.cell).shape == (42, 3)


def interrupted(folder):
    """Make of a finished run one that was killed while it wrote a row of its time series."""
    manifest = json.loads((folder / "manifest.json").read_text())
    ended = {"ended", "end"}
    left = {name: value for name, value in manifest.items() if name not in ended}
    (folder / "manifest.json").write_text(json.dumps(left | {"status": "running"}))
    series = folder / "timeseries.csv"
    series.write_bytes(series.read_bytes()[:-37])


STRANGE_RUNS = {
    "diverged": {"time": am.Time(scheme="explicit", max_step=0.01, end=5.0)},
    "running": {},
    "cue": {"cue": am.Cue(strength=0.2)},
    "friction": {"parameters": PLAIN.replace(gamma_t=0.2, gamma_n=0.1)},
    "noise": {"noise": am.Noise(filaments=1e5, seed=1)},
    "environment": {"environment": "fluid"},
    "remeshed": None,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", STRANGE_RUNS)
def test_runs_of_every_kind_are_exported_in_every_format(name, tmp_path):
    if STRANGE_RUNS[name] is None:
        run = remeshed()
    else:
        kept = {"time": am.Time(end=0.2, max_step=0.1), "output": am.Output(interval=0.1)}
        given = {"parameters": PLAIN, "mesh": am.Mesh(subdivisions=1), **kept}
        am.simulate(am.Config(**given | STRANGE_RUNS[name]), folder=tmp_path / "run")
        if name == "running":
            interrupted(tmp_path / "run")
        run = am.load(tmp_path / "run")
        assert run.status == (name if name in ("diverged", "running") else "finished")
    for to in exports.names():
        packages = exports.named(to).packages
        if all(find_spec(package) for package in packages):
            files = run.export(tmp_path / to, to, frames=slice(-2, None))
            assert all(file.stat().st_size > 0 for file in files)

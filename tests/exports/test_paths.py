"""Exports put a cell where it is in the environment of its run, and say which that is."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from pyvista import read

import amoeboid as am
from amoeboid.cli.main import main
from amoeboid.exports import movie
from amoeboid.exports.job import Job
from amoeboid.plotting.canvas import Canvas
from amoeboid.runs import words
from amoeboid.simulation.path import RecordedPath, advanced, path_row, rotation_of, rotation_vector

P = am.Parameters(D=0.4, v_p0=6.0)
QUARTER = rotation_of(np.array([np.pi / 2, 0.0, 0.0]))  # y to z


@pytest.fixture(scope="module")
def run():
    return am.simulate(P, mesh=am.Icosphere(1), environment="matrix:normal=3", until=am.time(0.6))


def rows_of_a_helix(count, end=1.0):
    """Rows of a body whose velocity and angular velocity, in its own axes, are linear in time."""
    rows = []
    for t in np.linspace(0.0, end, count):
        turning = np.array([0.0, 0.0, 1.0 + 2.0 * t])  # the angle is t + t**2
        velocity = np.array([1.0, 0.5 * t, 0.3])
        place, axes = advanced(rows[-1] if rows else None, float(t), velocity, turning)
        moving = axes @ velocity
        speed = float(np.linalg.norm(moving))
        vectors = {"migration": place, "migration_heading": moving / speed,
                   "migration_turning": axes @ turning, "migration_axes": rotation_vector(axes),
                   "migration_axes_turning": turning}  # fmt: skip
        rows.append({"t": float(t)} | path_row(speed, vectors))
    return rows


def test_a_path_between_its_rows_is_of_second_order_and_at_them_that_of_the_rows():
    errors = []
    fine = rows_of_a_helix(513)
    reference = RecordedPath(fine)
    times = [fine[k]["t"] for k in (65, 193, 375, 501)]
    for count in (9, 17, 33):
        path = RecordedPath(rows_of_a_helix(count))
        found = [path.at(t)[0] for t in times]
        exact = [reference.at(t)[0] for t in times]
        errors.append(np.abs(np.subtract(found, exact)).max())
        for t in times:  # rotations about one axis are exact: the integral of a linear function
            angle = rotation_vector(path.at(t)[1])
            np.testing.assert_allclose(angle, [0.0, 0.0, t + t**2], atol=1e-12)
    assert errors[2] < 1e-3
    assert 3.3 < errors[0] / errors[1] < 4.7
    assert 3.3 < errors[1] / errors[2] < 4.7
    for row in fine[::128]:
        place = reference.at(row["t"])[0]
        assert place.tolist() == [row[f"migration_{axis}"] for axis in "xyz"]


def test_a_path_says_how_far_it_is_known():
    path = RecordedPath(rows_of_a_helix(3))
    for t in (-0.1, 1.1):
        with pytest.raises(am.InvalidInput, match=r"up to t = .*reaches t = 1 .*--follow"):
            path.at(t)
    partial = {k: v for k, v in rows_of_a_helix(1)[0].items() if k != "migration_x"}
    for row in ({"t": 0.0}, partial):
        with pytest.raises(am.InvalidInput, match="reaches no time"):
            RecordedPath([row]).at(0.0)


def test_every_format_puts_the_cell_on_the_path_in_its_environment(run, tmp_path):
    place = run.trajectory[-1]
    drag = run.frames[-1].state.position
    assert np.linalg.norm(place - drag) > 0.1
    vtp = read(run.export(tmp_path / "last.vtp", frames=-1)[0])
    np.testing.assert_allclose(vtp.points, run.final.x + place, atol=1e-12)
    np.testing.assert_array_equal(vtp.field_data["migration_position"], place)
    (spots,) = run.export(tmp_path / "spots.csv", "trackmate")
    with spots.open(newline="") as file:
        keys, *_, last = csv.reader(file)
    found = [float(last[keys.index(f"POSITION_{axis}")]) for axis in "XYZ"]
    np.testing.assert_array_equal(found, place)
    tracks, surface = run.export(tmp_path, "napari")
    np.testing.assert_array_equal(np.loadtxt(tracks, delimiter=",", skiprows=1)[-1, 4:1:-1], place)
    with np.load(surface) as layer:
        nodes = layer["vertices"][-42:, :0:-1]
    np.testing.assert_allclose(nodes, run.final.x + place, atol=1e-12)
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    with xarray.open_dataset(run.export(tmp_path / "run.nc")[0]) as data:
        np.testing.assert_array_equal(data.center[-1], place)
        assert data.attrs["path"] == "matrix, tangential 1, normal 3"


def test_with_follow_the_cell_stays_at_the_origin_in_the_axes_of_the_run(run, tmp_path):
    found = read(run.export(tmp_path / "last.vtp", frames=-1, follow=True)[0])
    np.testing.assert_array_equal(found.points, run.final.x)
    np.testing.assert_array_equal(found["v"], run.final.v)
    assert "migration_position" not in found.field_data.keys()  # noqa: SIM118


@pytest.fixture
def turned(run):
    """The same run, as if its axes had been rotated about x by a quarter from the start."""
    still = {f"migration_axes_turning_{axis}": 0.0 for axis in "xyz"}
    axes = dict(zip((f"migration_axes_{axis}" for axis in "xyz"), rotation_vector(QUARTER),
                    strict=True))  # fmt: skip
    rows = [row | axes | still for row in run.rows]
    return am.Solution(run.config, rows, run.units, run.frames, run.last, "finished", "end of time")


def test_vectors_turn_with_the_nodes(turned, run, tmp_path):
    end = run.final
    found = read(turned.export(tmp_path / "last.vtp", frames=-1)[0])
    np.testing.assert_allclose(found.points, end.x @ QUARTER.T + turned.trajectory[-1], atol=1e-12)
    fields = {"v": end.v, "v_c": end.v_c, "v_p": end.v_p, "normal": end.normals}
    for name, field in (fields | {"retrograde_flow": end.retrograde_flow}).items():
        np.testing.assert_allclose(found[name], field @ QUARTER.T, atol=1e-12)
    np.testing.assert_array_equal(found["c"], end.c)
    scene = movie.placed(Job(turned, "run", range(1)), end.cell)
    np.testing.assert_allclose(scene["flow"], end.retrograde_flow @ QUARTER.T, atol=1e-12)
    np.testing.assert_allclose(scene["normals"], end.normals @ QUARTER.T, atol=1e-12)
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    with xarray.open_dataset(turned.export(tmp_path / "run.nc")[0]) as data:
        for name, field in (("x", end.x), ("v", end.v), ("retrograde_flow", end.retrograde_flow)):
            np.testing.assert_allclose(data[name][-1], field @ QUARTER.T, atol=1e-12)


def test_the_side_from_which_a_movie_is_seen_turns_with_the_cell(turned, run):
    jobs = [Job(one, "run", range(len(run.frames))) for one in (run, turned)]
    straight, rotated = (movie.extent_of(job, "gif") for job in jobs)
    np.testing.assert_allclose(rotated.polarization, QUARTER @ straight.polarization, atol=1e-12)
    np.testing.assert_array_equal(straight.centers[-1], run.trajectory[-1])


def test_triangles_of_napari_look_outward_in_the_order_of_its_axes(run, tmp_path):
    """Napari mirrors both the axes and the triangles when it draws a surface."""
    _, surface = run.export(tmp_path, "napari", frames=-1)
    with np.load(surface) as layer:
        corners = layer["vertices"][:, 1:][layer["faces"]]
    volume = np.linalg.det(corners - corners.mean(axis=(0, 1))).sum() / 6.0
    assert volume == pytest.approx(run.final.volume, rel=1e-9)


def test_movies_name_the_environment_and_write_units_behind_numbers(run, tmp_path, monkeypatch):
    written, text = [], Canvas.text
    monkeypatch.setattr(
        Canvas, "text", lambda self, *a, **k: (written.append(a[1]), text(self, *a, **k))[1]
    )
    run.export(tmp_path / "a.gif", frames=-1)
    assert "path: matrix, tangential 1, normal 3" in written
    p = am.Parameters.physical(R0="10 um", v_p0="3 um/s")
    cell = am.simulate(p, mesh=am.Icosphere(1), until=am.time("0.1 s"))
    cell.export(tmp_path / "b.gif", frames=-1)
    assert "t = 0.1 s" in written
    assert "5 um" in written
    assert any(word.startswith("retrograde flow ") and word.endswith(" um/s") for word in written)
    assert "filament concentration c [1/um^2]" in written
    page = cell.export(tmp_path / "b.html", frames=-1)[0].read_text()
    assert "from one frame of a run." in page
    assert "R0 = 10 um. The table is of the end of the run, t = 0.1 s." in page


def test_the_picture_of_a_trajectory_names_the_environment(tmp_path, monkeypatch):
    given = []
    drawing = "amoeboid.plotting"
    monkeypatch.setattr(f"{drawing}.trajectory.save_trajectory_picture", lambda *a: given.append(a))
    monkeypatch.setattr(f"{drawing}.cell.save_cell_picture", lambda *a: None)
    fields = ("mesh.subdivisions=1", "time.end=0.02", "environment.medium=patch:20")
    options = [word for field in fields for word in ("--set", field)]
    assert main(["run", "-o", str(tmp_path / "x"), "--json", *options]) == 0
    assert given[0][-1] == "patch, half_angle 20"


@pytest.mark.parametrize(
    ("environment", "said"),
    [
        ("cortex", ""),
        ("fluid:3", "fluid"),
        ("patch:20:friction=2:axis=0 1 0", "patch, half_angle 20, axis (0, 1, 0)"),
        ("matrix:normal=0:coupled=0.5", "matrix, coupled 0.5, tangential 1, normal 0"),
        ("matrix:per_filament=true", "matrix, tangential 1, normal 1, per_filament yes"),
        ("fluid:0.7+patch:20", "fluid, viscosity 0.7 + patch, friction 1, half_angle 20"),
        ("cortex:coupled=0.5", "cortex, coupled 0.5"),
    ],
)
def test_an_environment_is_said_by_what_the_path_depends_on(environment, said):
    assert words.environment(am.Config(environment=environment)) == said


def test_quantities_of_an_environment_are_said_with_their_units():
    config = am.Config(
        parameters=am.Parameters.physical(),
        environment=am.Mixed(am.Fluid(viscosity="2 mPa s"), am.Patch(half_angle=20)),
    )
    assert (
        words.environment(config)
        == "fluid, viscosity 2 mPa s + patch, friction 1 Pa s/um, half_angle 20"
    )


def test_a_run_whose_rows_end_early_is_exported_up_to_there(run, tmp_path):
    cut = replace(run, rows=run.rows[:3])
    with pytest.raises(am.InvalidInput, match=r"must record the path up to"):
        cut.export(tmp_path / "a", "ply")
    assert not list(tmp_path.rglob("*.ply"))[1:]
    assert len(cut.export(tmp_path / "b", "ply", follow=True)) == len(run.frames)

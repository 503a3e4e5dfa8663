"""Surfaces as programs for images make them: mended on request, and what was done is told."""

import numpy as np
import pytest
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D

from amoeboid.config import Config, Initial, Mesh, resolved
from amoeboid.meshes import repair
from amoeboid.meshes.checks import check_surface, joined
from amoeboid.meshes.connectivity import icosphere
from amoeboid.meshes.geometry import (
    area,
    equilateral_edge_length,
    mesh_quality,
    volume,
    volume_centroid,
)
from amoeboid.meshes.remeshing import distortion
from amoeboid.meshes.repair import repaired
from amoeboid.model.parameters import Parameters
from amoeboid.surface.initial import initial_condition
from amoeboid.validation import InvalidInput
from surface.written import (
    crossing,
    cube,
    ellipsoid,
    hemisphere,
    inside_out,
    one_turned,
    pinched,
    seam,
    sliver,
    torus,
    two_spheres,
    unused,
    with_fin,
    write_surface,
)


def marching_cubes(n, half_width=18.0):
    """A bent cell of about 20 micrometers on a grid of n^3: nodes, faces, oriented inward."""
    x = np.linspace(-half_width, half_width, n)
    z, y, x = np.meshgrid(x, x, x, indexing="ij")
    inside = 1 - (x / 10) ** 2 - (y / 12.5) ** 2 - (z / 15) ** 2
    inside -= 0.15 * np.sin(x / 4) * np.cos(y / 5)
    image = vtkImageData()
    image.SetDimensions(n, n, n)
    image.SetSpacing(*3 * [2 * half_width / (n - 1)])
    image.GetPointData().SetScalars(numpy_to_vtk(inside.astype(np.float32).ravel(), deep=True))
    contour = vtkFlyingEdges3D()
    contour.SetInputData(image)
    contour.SetValue(0, 0.0)
    contour.Update()
    found = contour.GetOutput()
    faces = vtk_to_numpy(found.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    r = vtk_to_numpy(found.GetPoints().GetData()).astype(float)
    return r, faces[:, ::-1].astype(np.int64)


@pytest.mark.parametrize(
    ("grid", "subdivisions"),
    [pytest.param(67, 3, marks=pytest.mark.slow), (31, 1), (31, 2), (31, 4)],
)
def test_a_marching_cubes_surface_becomes_a_uniform_mesh_of_the_wanted_size(grid, subdivisions):
    """Of 10 000 points, as scikit-image gives them, and of 2000; all have slivers."""
    r, faces = marching_cubes(grid)
    assert grid < 67 or 9000 < len(r) < 11000
    assert mesh_quality(r, faces) < 0.02
    assert volume(r, faces) < 0
    n = 10 * 4**subdivisions + 2
    new, new_faces, changes = repaired(r, faces, n, "x")
    check_surface(new, new_faces, "x")
    assert own_disorder(new, new_faces) < 1.0
    # measured: 8 %; of 42 nodes, the fewest that there may be, a few more
    assert abs(len(new) / n - 1) < (0.15 if n > 42 else 0.4)
    # the shape is the same: nodes on the surface, chords between them as those of an icosphere
    lost = 1 - volume(new, new_faces) / abs(volume(r, faces))
    chords = 1 - volume(*icosphere(subdivisions)) / (4 * np.pi / 3)
    assert -0.1 * chords < lost < 1.3 * chords
    shift = volume_centroid(new, new_faces) - volume_centroid(r, faces)
    assert np.abs(shift).max() < max(1e-3, 0.05 * chords) * np.ptp(r)
    turned, remeshed = changes
    assert "oriented inward" in turned
    assert f"remeshed {len(r)} points as {len(new)}" in remeshed


def test_repair_does_not_depend_on_units():
    """The same mesh for a cell in meters and micrometers, the same shape far from the origin."""
    r, faces = marching_cubes(31)
    first, first_faces, _ = repaired(r, faces, 162, "x")
    for scale in (2.0**-450, 2.0**450):
        new, new_faces, _ = repaired(scale * r, faces, 162, "x")
        np.testing.assert_array_equal(new_faces, first_faces)
        np.testing.assert_array_equal(new, scale * first)
    new, new_faces, _ = repaired(1e-6 * r + 1e-3, faces, 162, "x")
    assert area(new, new_faces) == pytest.approx(1e-12 * area(first, first_faces), rel=5e-3)


def own_disorder(r, faces):
    return distortion(r, faces, equilateral_edge_length(area(r, faces), len(faces)))


def soup(r, faces, rng, digits):
    """Triangles each with its own points, as text of so many digits or in other roundings gives."""
    apart = r[faces].reshape(-1, 3)
    apart = apart * (1 + 10.0**-digits * rng.uniform(-0.5, 0.5, apart.shape))
    return apart, np.arange(len(apart)).reshape(-1, 3)


@pytest.mark.parametrize("scale", [1e-5, 1.0, 1e7])
def test_points_that_differ_by_rounding_are_joined_and_reported(scale):
    r, faces = ellipsoid()
    rng = np.random.default_rng(1)
    apart, own = soup(scale * (r + np.array([3, 0, -2])), faces, rng, 6)
    new, new_faces, (told,) = joined(apart, own)
    check_surface(new, new_faces, "x")
    assert (len(new), len(new_faces)) == (len(r), len(faces))
    assert "by rounding" in told
    np.testing.assert_allclose(new[new_faces] / scale - [3, 0, -2], r[faces], atol=1e-5)
    # nothing is touched where nothing is open, and what is farther apart is not joined
    assert joined(new, new_faces)[2] == ()
    with pytest.raises(InvalidInput, match="must be closed"):
        check_surface(*joined(*soup(r, faces, rng, 4))[:2], "x")


def test_distinct_points_of_a_surface_far_from_the_origin_are_not_joined():
    """Double precision tells points apart that single precision would not."""
    r, faces = hemisphere()
    assert joined(r + 1e9, faces)[2] == ()
    assert len(joined(r + 1e9, faces)[0]) == len(r)


def turned_half():
    r, faces = ellipsoid()
    faces[::2] = faces[::2, ::-1]
    return r, faces


def repeated():
    r, faces = ellipsoid()
    return r, np.vstack([faces, faces[:5], faces[7:9, ::-1], [[3, 3, 4]]])


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (inside_out, "oriented inward"),
        (one_turned, "reversed 1 triangles"),
        (turned_half, "reversed 160 triangles"),
        (sliver, "remeshed 162 points"),
        (unused, "removed 1 points"),
        (repeated, "removed 8 triangles"),
    ],
)
def test_repairs_are_made_and_reported(make, says):
    r, faces = make()
    new, new_faces, changes = repaired(r, faces, 162, "x")
    check_surface(new, new_faces, "x")
    assert any(says in change for change in changes)
    whole = volume(*ellipsoid())
    assert volume(new, new_faces) == pytest.approx(whole, rel=0.02 if make is sliver else 1e-12)
    with pytest.raises(InvalidInput):
        check_surface(r, faces, "x")


def test_an_acceptable_surface_is_not_repaired():
    r, faces = ellipsoid()
    new, new_faces, changes = repaired(r, faces, 642, "x")
    assert changes == ()
    np.testing.assert_array_equal(new[new_faces], r[faces])


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (hemisphere, "must be closed: .* 24 edges have one; fill the holes"),
        (seam, "must be closed"),
        (with_fin, "must be a manifold: two triangles at every edge"),
        (pinched, "must be a manifold: one fan"),
        (two_spheres, r"one piece, got 2 \(of 320, 320 triangles\); keep one"),
        (torus, "deformed sphere"),
        (crossing, "must not intersect or touch itself"),
    ],
)
def test_ambiguous_surfaces_are_rejected_also_with_repair(make, says):
    with pytest.raises(InvalidInput, match=f"^x .*{says}"):
        repaired(*make(), 162, "x")


def test_a_self_intersection_is_found_before_remeshing_removes_it():
    """A dent so deep that it comes out on the other side."""
    r, faces = marching_cubes(31)
    x, y, z = (r - r.mean(axis=0)).T
    r[:, 2] -= np.where(z > 0, 1.1 * np.ptp(z) * np.exp(-(x**2 + y**2) / 9), 0.0)
    with pytest.raises(InvalidInput, match="must not intersect"):
        repaired(r, faces, 162, "x")


def test_messages_name_the_option_repair_and_the_repaired_cell_starts(tmp_path):
    path = write_surface(tmp_path / "cell.stl", *marching_cubes(31))
    with pytest.raises(InvalidInput, match=r"initial\.repair = true"):
        initial_condition(resolved(Config(initial=Initial(surface=str(path)))))
    for R0 in (1.0, 10.0, 1e-5):
        config = Config(
            parameters=Parameters(R0=R0, D=0.4 * R0**2, v_p0=6.0 * R0),
            mesh=Mesh(subdivisions=2),
            initial=Initial(surface=str(path), repair=True),
        )
        begin = initial_condition(resolved(config))
        assert abs(len(begin.state.r) - 162) < 20
        assert area(begin.state.r, begin.model.mesh.faces) == pytest.approx(begin.model.A0)
        assert len(begin.adapted.repairs) == 2
        assert "scaled by" in begin.adapted.scaling
        assert f"= {begin.model.A0:.6g}" in begin.adapted.scaling


def test_messages_about_unrepairable_surfaces_do_not_name_repair(tmp_path):
    path = write_surface(tmp_path / "cell.stl", *hemisphere())
    with pytest.raises(InvalidInput) as refusal:
        initial_condition(resolved(Config(initial=Initial(surface=str(path)))))
    assert "initial.repair" not in str(refusal.value)


def test_polygons_and_corners_of_a_cube_are_remeshed():
    r, quads = cube(12)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    new, new_faces, _ = repaired(r * [1.0, 1.0, 8.0], faces, 642, "x")
    check_surface(new, new_faces, "x")
    assert volume(new, new_faces) == pytest.approx(64.0, rel=0.04)


def test_too_many_points_for_a_repair_are_rejected(monkeypatch):
    monkeypatch.setattr(repair, "MAX_POINTS", 100)
    with pytest.raises(InvalidInput, match="at most 100 points to be repaired, got 162; decimate"):
        repaired(*inside_out(), 162, "x")


def test_repair_needs_a_surface():
    with pytest.raises(InvalidInput, match=r"^initial\.repair must be false without"):
        Initial(repair=True)

"""Surfaces with a flow that come from no model."""

import pickle

import numpy as np
import pytest

import amoeboid as am
from amoeboid.meshes.vtp import frame_bytes
from amoeboid.motility.cells import MeasuredCell
from motility.bodies import ellipsoid


@pytest.fixture(scope="module")
def sphere():
    """Nodes and faces of 162 nodes, and the flow u0 sin(theta) from the front at z > 0."""
    r, faces, normals = ellipsoid(np.ones(3), 2)
    flow = -np.array([0.0, 0.0, 1.0]) + normals[:, 2:] * normals
    return r, faces, flow


def test_measured_sphere_in_units(sphere):
    r, faces, flow = sphere
    cell = MeasuredCell(8.0 * r, faces, 10.0 * flow, length="um", time="min")
    found = am.migrate(cell, am.Fluid("1 mPa s"))
    assert found.speed.to("um/min").magnitude == pytest.approx(20 / 3, rel=5e-3)
    assert found.drag[2, 2].to("pN s/um").magnitude == pytest.approx(
        6 * np.pi * 1e-3 * 8e-6 * 1e6, rel=0.01
    )
    assert found.velocity_over_max_retrograde_speed == pytest.approx(2 / 3, rel=5e-3)
    assert found.efficiency == pytest.approx(0.5, rel=0.12)
    plain = am.migrate(am.Surface(r, faces), flow=flow)
    assert plain.speed == pytest.approx(2 / 3, rel=5e-3)


def test_front_is_where_c_is_low_or_against_the_flow(sphere):
    r, faces, flow = sphere
    np.testing.assert_allclose(MeasuredCell(r, faces, flow).surface.front, [0, 0, 1], atol=1e-9)
    by_c = MeasuredCell(r, faces, flow, c=2.0 + r[:, 2])
    np.testing.assert_allclose(by_c.surface.front, [0, 0, -1], atol=1e-9)
    assert am.migrate(by_c).speed == pytest.approx(-2 / 3, rel=5e-3)
    given = MeasuredCell(r, faces, flow, front=(0, 0, 2))
    np.testing.assert_allclose(given.surface.front, [0, 0, 1])


def test_a_uniform_velocity_is_no_flow(sphere):
    """A flow given in the axes of the laboratory is that in those of the cell."""
    r, faces, flow = sphere
    a = am.migrate(MeasuredCell(r, faces, flow, front=(0, 0, 1)))
    moving = flow + np.array([3.0, 0.0, 1.0])
    b = am.migrate(MeasuredCell(r, faces, moving, front=(0, 0, 1)))
    assert b.speed == pytest.approx(a.speed, rel=1e-12)
    drifting = am.migrate(MeasuredCell(r, faces, flow + 1e3, front=(0, 0, 1)))
    assert drifting.speed == pytest.approx(a.speed, rel=1e-9)


def test_deformation_swims_too():
    """A sphere whose surface also moves normally, with u_r = a P_2: no force, no motion of P_2."""
    r, faces, normals = ellipsoid(np.ones(3), 2)
    flow = 0.1 * (1.5 * normals[:, 2:] ** 2 - 0.5) * normals
    found = am.migrate(MeasuredCell(r, faces, flow, front=(0, 0, 1)))
    assert np.linalg.norm(found.velocity) < 1e-3


def test_file_with_vectors(sphere, tmp_path):
    r, faces, flow = sphere
    path = tmp_path / "cell.vtp"
    path.write_bytes(frame_bytes(r, faces, {"speed": flow, "normal": r}, {"t": np.zeros(1)}))
    cell = MeasuredCell.from_file(str(path), length="um", time="s")
    assert am.migrate(cell).speed.to("um/s").magnitude == pytest.approx(2 / 3, rel=5e-3)
    np.testing.assert_allclose(cell.flow, flow)
    two = tmp_path / "two.vtp"
    two.write_bytes(frame_bytes(r, faces, {"a": flow, "b": r}, {"t": np.zeros(1)}))
    with pytest.raises(am.InvalidInput, match="one of its vectors at points, which are a, b"):
        MeasuredCell.from_file(str(two))
    np.testing.assert_allclose(MeasuredCell.from_file(str(two), "a").flow, flow)


def test_measured_cells_pickle_and_are_short(sphere):
    r, faces, flow = sphere
    cell = MeasuredCell(r, faces, flow)
    again = pickle.loads(pickle.dumps(cell))  # noqa: S301
    assert repr(again) == repr(cell) == "MeasuredCell(162 nodes, 320 faces)"


def test_mistakes_are_rejected(sphere):
    r, faces, flow = sphere
    flat = r.copy()
    flat[faces[0, 0]] = flat[faces[0, 1]]
    bad = [
        (dict(r=r[:, :2]), "r must be finite numbers"),
        (dict(flow=flow[:-1]), "a vector for each of the 162 nodes"),
        (dict(faces=faces[1:]), "must be closed"),
        (dict(faces=faces[:, ::-1]), "must be oriented outward"),
        (dict(faces=faces + 0.5), "whole numbers"),
        (dict(c=np.zeros(162)), "not 0 everywhere"),
        (dict(front=(0, 0, 0)), "front must be three finite numbers"),
        (dict(length="um"), "given together"),
        (dict(flow=np.full_like(flow, np.nan)), "it is not at 162 of 162 nodes, the first is 0"),
        (dict(flow=np.zeros((320, 3))), "average vectors on triangles"),
        (dict(faces=np.zeros((0, 3), dtype=int)), "must have triangles"),
        (dict(c=["a"] * 162), "c must be an array of numbers"),
        (dict(front="z"), "front must be an array of numbers"),
        (dict(length="um", time="m"), "time must have the dimension T"),
        (dict(length="foo", time="s"), "length must be a number with a unit"),
        (dict(r=flat), "2 of them have area 0"),
    ]
    for changes, message in bad:
        with pytest.raises(am.InvalidInput, match=message):
            MeasuredCell(**(dict(r=r, faces=faces, flow=flow) | changes))
    pair = (np.vstack([r, r + 5.0]), np.vstack([faces, faces + 162]), np.vstack([flow, flow]))
    with pytest.raises(am.InvalidInput, match="must be one cell, this one has 2 pieces"):
        MeasuredCell(*pair)
    with pytest.raises(am.InvalidInput, match="per_filament must be true or false, got 'false'"):
        am.Matrix(per_filament="false")
    cell = MeasuredCell(r, faces, flow)
    for environment, message in (
        (am.CortexDrag(), "needs the flow of the cortex"),
        (am.Matrix(per_filament=True), "per_filament must be false"),
    ):
        with pytest.raises(am.InvalidInput, match=message):
            am.migrate(cell, environment)
    with pytest.raises(am.InvalidInput, match="needs its flow"):
        am.migrate(am.Surface(r, faces))
    with pytest.raises(am.InvalidInput, match="must be a steady state"):
        am.migrate(3.0)
    with pytest.raises(am.InvalidInput, match="c and front are used only with a flow"):
        am.migrate(cell, front=(0, 0, 1))


def test_rounding_is_no_power(sphere):
    """Where surroundings feel nothing of the flow, power and efficiency are 0."""
    cell = MeasuredCell(*sphere)
    for nothing in ("matrix:0:normal=1", "matrix:1:normal=0:coupled=0"):
        found = am.migrate(cell, nothing)
        assert found.power == found.efficiency == 0.0

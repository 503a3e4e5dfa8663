"""Paths of runs in an environment: circles and helices, order in time, resumption, files."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import amoeboid as am
from amoeboid.config import config_from_toml, config_to_toml, with_settings
from amoeboid.forces import friction
from amoeboid.motility.words import environment, written
from amoeboid.output.folder import resumed_run
from amoeboid.simulation.path import (
    MIGRATION,
    PATH_UNITS,
    advanced,
    path_row,
    rotation_of,
    rotation_vector,
)

SMALL = am.Icosphere(1)
FIGURE_3D = am.Parameters(D=0.4, v_p0=6.0)


def screw(count, end=6.0):
    """Path of a cell that moves on a helix, seen from axes that turn in a way of their own.

    The shape turns with `turning` in the axes of the run, and with `spin` in the laboratory.
    """
    turning, spin = np.array([0.2, -0.1, 0.3]), np.array([0.1, 0.5, 0.2])
    velocity, row = np.array([1.0, 0.4, -0.2]), None
    for t in np.linspace(0.0, end, count + 1):
        shape = rotation_of(turning * t)  # from the axes of the shape to those of the run
        whole = rotation_of(spin * t) @ shape.T  # axes of the run in the laboratory
        axes_turning = whole.T @ spin - turning
        seen = shape @ velocity
        position, axes = advanced(row, t, seen, axes_turning)
        moving = axes @ seen
        speed = np.linalg.norm(moving)
        row = {"t": t} | path_row(
            speed,
            {
                "migration": position,
                "migration_heading": moving / speed,
                "migration_axes": rotation_vector(axes),
                "migration_axes_turning": axes_turning,
            },
        )
    # the helix: velocity fixed in the cell, which turns with the spin around a fixed axis
    size = np.linalg.norm(spin)
    axis = spin / size
    cross = np.cross(axis, np.eye(3)).T
    angle = size * end
    integral = (
        np.eye(3) * end
        + (1 - np.cos(angle)) / size * cross
        + (end - np.sin(angle) / size) * cross @ cross
    )
    return np.linalg.norm(position - integral @ velocity), np.linalg.norm(axes - whole)


def test_helices_are_integrated_to_second_order_in_time():
    counts = np.array([20, 40, 80, 160])
    errors = np.array([screw(n) for n in counts])
    orders = -np.diff(np.log(errors), axis=0) / np.diff(np.log(counts))[:, None]
    assert np.all(np.abs(orders - 2.0) < 0.2)
    assert np.all(errors[-1] < 1e-3)


def test_rotation_vectors_are_those_of_their_matrices():
    for vector in ([0.3, -0.2, 0.5], [0.0, 0.0, 0.0], [3.0, 0.1, 0.2]):
        np.testing.assert_allclose(rotation_vector(rotation_of(np.array(vector))), vector)
    np.testing.assert_allclose(
        rotation_of(np.array([0, 0, np.pi / 2])) @ [1, 0, 0], [0, 1, 0], atol=1e-15
    )


@pytest.fixture(scope="module")
def straight():
    """Figure 3D on 42 nodes in a matrix with drag along the surface only."""
    return am.simulate(FIGURE_3D, mesh=SMALL, until=am.time(2.0), environment="matrix:normal=0")


def test_path_is_recorded_and_changes_no_bit_of_the_run(straight):
    plain = am.simulate(FIGURE_3D, mesh=SMALL, until=am.time(2.0))
    assert not set(PATH_UNITS) & set(plain.units)
    assert set(PATH_UNITS) < set(straight.units)
    for name in plain.units:
        assert np.array_equal(plain[name], straight[name]), name
    assert np.array_equal(plain.final.r, straight.final.r)
    np.testing.assert_array_equal(plain.trajectory, plain_positions(plain))


def plain_positions(run):
    return np.stack([run[f"cortex_drag_{axis}"] for axis in "xyz"], axis=1)


def test_path_of_a_straight_cell_is_the_integral_of_its_speed(straight):
    speed, t = straight["migration_speed"], straight.t
    assert speed[-1] == pytest.approx(am.migrate(straight.final, "matrix:normal=0").speed)
    length = np.sum(0.5 * (speed[1:] + speed[:-1]) * np.diff(t))
    x = straight.trajectory
    assert np.array_equal(x, np.stack([straight[name] for name in MIGRATION], axis=1))
    assert np.linalg.norm(x[-1] - x[0]) == pytest.approx(length, rel=1e-3)
    heading = straight["migration_heading"]
    np.testing.assert_allclose(heading[-1], [0, 0, -1], atol=1e-2)
    assert straight.units["migration_x"] == "L"
    assert straight.to_pandas().attrs["units"]["migration_turning_x"] == "1/T"
    assert straight.plot_trajectory() is not None


def twenty(step):
    return step.number >= 20


def test_resumed_run_goes_on_with_the_same_bits(straight, tmp_path):
    half = am.simulate(FIGURE_3D, mesh=SMALL, until=twenty, environment="matrix:normal=0")
    assert len(half) == 21
    again = half.resume(until=am.time(2.0))
    stored = half.save(tmp_path / "run").resume(until=am.time(2.0))
    assert stored.config.environment == straight.config.environment
    for run in (again, stored):
        for name in PATH_UNITS:
            assert np.array_equal(run[name], straight[name]), name
    config = with_settings(half.config, ["environment.medium=fluid", "time.end=8"])
    with pytest.raises(am.InvalidInput, match=r"keeps \[environment\] unchanged"):
        resumed_run(tmp_path / "run", config)


@pytest.mark.slow
def test_circle_has_the_radius_of_its_speed_and_turning():
    """A cell that circles (docs/large-deformation.md): in a matrix it circles faster or slower.

    Its shape turns with the angular velocity by which force and torque vanish.
    """
    p = am.Parameters(D=0.4, v_p0=8.0, delta_P=20.0)
    run = am.simulate(
        p,
        mesh=am.Icosphere(2),
        initial=am.Initial(perturbation=0.0, noise=0.3, seed=1),
        until=am.time(60.0),
        environment="matrix",
    )
    late = run.t > 45.0
    t, x = run.t[late], run.trajectory[late]
    speed = run["migration_speed"][late].mean()
    turning = np.linalg.norm(run["migration_turning"][late], axis=1).mean()
    plane = np.linalg.svd(x - x.mean(axis=0), full_matrices=False)[2][:2]
    flat = (x - x.mean(axis=0)) @ plane.T
    system = np.column_stack([2 * flat, np.ones(len(flat))])
    a, b, rest = np.linalg.lstsq(system, np.sum(flat**2, axis=1), rcond=None)[0]
    radius = np.sqrt(rest + a * a + b * b)
    assert radius == pytest.approx(speed / turning, rel=0.01)
    heading = run["migration_heading"][late]
    angle = np.arccos(np.clip(np.sum(heading[1:] * heading[:-1], axis=1), -1, 1)).sum()
    assert angle / (t[-1] - t[0]) == pytest.approx(turning, rel=0.01)


def test_environment_in_a_configuration():
    config = config_from_toml('[environment]\nmedium = "patch:30"\n')
    assert config.environment == am.Patch(30.0)
    assert config_from_toml(config_to_toml(config)) == config
    default = config_from_toml("")
    assert default.environment == am.CortexDrag()
    assert default.section("environment") == {"medium": "cortex"}
    settings = ["environment.medium=matrix:normal=2"]
    assert with_settings(config, settings).environment == am.Matrix(normal=2.0)
    for text, message in (
        ("swamp", "must be one of fluid"),
        ("fluid:1 mPa s", "need a cell with units"),
    ):
        with pytest.raises(am.InvalidInput, match=message):
            with_settings(config, [f"environment.medium={text}"])
    with pytest.raises(am.InvalidInput, match=r"environment.medium must be a text"):
        with_settings(config, ["environment.medium=3"])
    with pytest.raises(am.InvalidInput, match="must be an environment such as"):
        am.Config(environment=3)


@pytest.mark.parametrize(
    "given",
    [
        am.Fluid(0.7, coupled=0.2),
        am.Matrix(1.0, 0.0, per_filament=True),
        am.Mixed(am.Patch(20.0, axis=(1.0, 0.0, 0.0)), am.Fluid()),
        am.CortexDrag(),
    ],
)
def test_environments_are_read_as_they_are_written(given):
    assert environment(written(given)) == given


def test_quantities_become_numbers_of_the_run(tmp_path):
    cell = am.Parameters.physical(D="4 um^2/s", v_p0="2.8 um/s")
    run = am.simulate(
        cell,
        mesh=SMALL,
        until=am.time("5 s"),
        environment=am.Fluid("0.7 mPa s"),
        folder=tmp_path / "run",
    )
    assert run["migration_speed"].check("[length]/[time]")
    assert isinstance(run.config.environment.viscosity, float)
    assert am.load(tmp_path / "run").config.environment == run.config.environment
    assert am.load(tmp_path / "run").trajectory.shape == (len(run), 3)


def test_environment_of_a_script_is_recorded_but_not_written(tmp_path):
    @dataclass(frozen=True)
    class Own(am.Environment):
        def dissipation(self, surface):
            return surface.everywhere.drag(1.0, 0.0)

    run = am.simulate(FIGURE_3D, mesh=SMALL, until=am.time(0.5), environment=Own())
    assert "migration_x" in run.units
    with pytest.raises(am.InvalidInput, match="exists only in Python"):
        run.save(tmp_path / "run")


def test_rotation_of_the_shape_in_the_axes_of_a_run_is_no_flow(straight):
    """A cell that turns in the axes of its nodes, with all its velocities, migrates the same."""
    cell = straight.final.cell
    turning = np.array([0.3, -0.2, 0.5])
    state = replace(cell.state, angular_velocity=turning)
    flow = replace(cell.flow, v_c=cell.flow.v_c + np.cross(turning, cell.x))
    at_rest = replace(cell, state=replace(cell.state, angular_velocity=np.zeros(3)))
    for name in ("fluid", "matrix", "patch:30"):
        a = am.migrate(at_rest, name)
        b = am.migrate(replace(cell, state=state, flow=flow), name)
        np.testing.assert_allclose(b.velocity, a.velocity, atol=1e-10)
        np.testing.assert_allclose(b.angular_velocity, a.angular_velocity, atol=1e-10)


def test_a_cell_with_friction_records_the_path_that_its_friction_gives(tmp_path):
    """Of uniform friction that is the path in the environment of the same drags; not far as
    with all drag on the cortex. A resumed run has the bits of an uninterrupted one."""
    p = am.Parameters(D=0.4, v_p0=6.0, gamma_t=1.0, gamma_n=1.0, gamma_c=0.3)
    mesh, drags = am.Icosphere(1), am.Mixed(am.Matrix(1.0, 1.0), am.CortexDrag(0.3))
    own = am.simulate(p, mesh=mesh, until=am.time(1.0), folder=tmp_path / "own")
    same = am.simulate(p, mesh=mesh, until=am.time(1.0), environment=drags)
    np.testing.assert_allclose(own.trajectory, same.trajectory, rtol=0, atol=1e-9)
    U = np.linalg.norm(friction.velocity(own.final.cell))
    assert own["migration_speed"][-1] == pytest.approx(U, rel=1e-12)
    assert own["cortex_drag_z"][-1] < 1.1 * own.trajectory[-1, 2] < 0.0
    assert "path in               friction of the cell" in str(own.show())
    longer = am.load(tmp_path / "own").resume(until=am.time(1.2))
    np.testing.assert_array_equal(longer.trajectory, own.resume(am.time(1.2)).trajectory)


def test_no_path_is_recorded_where_none_can_be(tmp_path):
    """Without friction, and where the friction itself changes in time."""
    for changes in ({}, {"gamma_t": am.steps((0.05, 0.0))}):
        p = am.Parameters(gamma_t=1.0 if changes else 0.0)
        run = am.simulate(p, mesh=am.Icosphere(1), until=am.time(0.1), changes=changes)
        assert "migration_x" not in run.keys()  # noqa: SIM118

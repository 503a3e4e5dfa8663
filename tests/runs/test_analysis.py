"""Kymographs and spectra of fields that are known."""

from dataclasses import replace

import numpy as np
import pytest

import amoeboid as am
from amoeboid.numerics.spherical_harmonics import real_harmonic
from amoeboid.plotting.runs import LONGEST_ARROW
from amoeboid.runs.analysis import along_axis, axis, power_by_degree
from amoeboid.runs.snapshot import Snapshot
from amoeboid.surface.cell import SurfaceCell
from amoeboid.surface.initial import sphere
from amoeboid.surface.state import Flow


def cell_with(subdivisions, c=None, stretch=(1.0, 1.0, 1.0)):
    """A sphere, stretched, with c a function of directions."""
    model, state = sphere(am.Parameters(), subdivisions)
    unit = state.r / np.linalg.norm(state.r, axis=1, keepdims=True)
    c = state.c if c is None else c(unit)
    state = replace(state, r=state.r * stretch, c=c)
    flow = Flow(0 * unit, 0 * unit, 0.0, unit, np.full(len(unit), model.A0 / len(unit)))
    return SurfaceCell(model, state, flow)


def test_c_along_the_axis_is_that_of_the_field():
    """c = 3 + 2 cos + cos^2 about a tilted axis; linear on triangles, the error falls as h^2."""
    tilted = np.array([0.3, -0.5, 0.8]) / np.linalg.norm([0.3, -0.5, 0.8])
    theta = (np.arange(20) + 0.5) * np.pi / 20
    exact = 3 + 2 * np.cos(theta) + np.cos(theta) ** 2
    errors = []
    for subdivisions in (1, 2, 3):
        cell = cell_with(subdivisions, lambda u: 3 + 2 * (u @ tilted) + (u @ tilted) ** 2)
        assert axis(cell, np.zeros(3)) @ tilted > 0.999
        errors.append(np.abs(along_axis(cell, tilted, theta) - exact).max())
    print(errors)
    assert errors[0] < 0.25
    assert np.log2(errors[0] / errors[2]) / 2 > 1.7


def test_spectra_have_the_power_of_the_harmonics_they_are_made_of():
    """C_lm has the mean square 1/(2 l + 1); the fit is exact for what it is made of."""

    def c(unit):
        return 5 + 0.5 * real_harmonic(1, 0, unit) + 0.3 * real_harmonic(3, -2, unit)

    found = power_by_degree(cell_with(1, c), "c", 3)
    np.testing.assert_allclose(found, [25, 0.25 / 3, 0, 0.09 / 7], atol=1e-12)
    # of the shape to first order: an ellipsoid is a second harmonic
    flat = power_by_degree(cell_with(2, stretch=(1, 1, 1.03)), "shape", 3)
    assert flat[2] == pytest.approx((0.03 * 2 / 3) ** 2 / 5, rel=0.05)
    assert max(flat[1], flat[3]) < 1e-8 * flat[2]


def test_the_sum_over_degrees_is_the_mean_square():
    found = power_by_degree(cell_with(3, lambda u: np.exp(u[:, 2])), "c", 8)
    assert found.sum() == pytest.approx(np.sinh(2) / 2, rel=1e-3)


def test_analysis_of_a_run_turns_with_the_cell():
    """Along its own axis a cell is the same, whatever its orientation in space."""
    found = []
    for direction in ((0.0, 0.0, 1.0), (1.0, 0.5, 0.2)):
        initial = am.Initial(perturbation=1.0, direction=direction)
        run = am.simulate(
            am.Parameters(D=0.4, v_p0=6.0),
            mesh=am.Icosphere(2),
            initial=initial,
            until=am.time(0.5),
            times=[0.0, 0.25, 0.5],
        )
        found.append((run.kymograph(12), run.spectrum("c", 2), run.spectrum("shape", 2)))
    (one, power, shape), (other, other_power, other_shape) = found
    assert one.values.shape == (3, 12)
    assert np.all(np.diff(one.values[-1]) < 0)  # from the rear to the front
    np.testing.assert_allclose(one.values, other.values, rtol=0.03)
    np.testing.assert_allclose(power.values[:, :2], other_power.values[:, :2], rtol=0.02)
    np.testing.assert_allclose(shape.values[:, 0], other_shape.values[:, 0], rtol=1e-3)
    for result in (one, power):
        axes = result.plot()
        assert axes.get_xlabel() == "t [T]"
        axes.figure.clf()
    axes = run.plot_trajectory()
    assert axes.get_xlabel() == "first principal axis [L]"
    axes.figure.clf()
    pytest.importorskip("xarray")
    assert one.to_xarray().c.dims == ("t", "theta")
    assert power.to_xarray().power.dims == ("t", "l")


def test_what_has_no_angles_or_too_few_nodes_is_refused():
    waist = cell_with(2, stretch=(1, 1, 1))
    r = waist.state.r.copy()
    r[:, 2] += 4.0 * np.hypot(r[:, 0], r[:, 1]) ** 2  # a bowl around its center
    bowl = SurfaceCell(waist.model, replace(waist.state, r=r), waist.flow)
    with pytest.raises(am.InvalidInput, match="some cross it more often"):
        along_axis(bowl, np.array([0.0, 0.0, 1.0]), np.array([1.0]))
    with pytest.raises(am.InvalidInput, match="l_max must be at most 3 on a mesh of 42 nodes"):
        power_by_degree(cell_with(1), "c", 4)


def test_a_cell_is_drawn_on_given_axes():
    from matplotlib.figure import Figure

    cell = cell_with(1, lambda u: 3 + u[:, 2])
    axes = Figure().add_subplot()
    assert Snapshot(cell.model, cell.state, cell.flow).plot(axes) is axes
    assert len(axes.collections) == 1


def test_a_picture_of_a_cell_shows_its_flow_and_its_rear_to_the_right():
    from matplotlib.figure import Figure
    from matplotlib.quiver import Quiver

    polarized = am.steady_states(am.Parameters(D=0.4, v_p0=6.0), (1,)).fastest_stable
    run = am.simulate(
        polarized.parameters, mesh=am.Icosphere(2), initial=polarized, until=am.time(0.01)
    )
    axes = run.final.plot(Figure().add_subplot())
    (arrows,) = (child for child in axes.get_children() if isinstance(child, Quiver))
    # the flow runs from the front to the rear, which is on the right
    assert arrows.U.mean() > 0.2
    assert 0.3 < np.hypot(arrows.U, arrows.V).max() <= LONGEST_ARROW

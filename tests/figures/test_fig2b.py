"""Figure 2B: the velocity fields against the paper's formulas and against the 3D shell."""

from dataclasses import replace

import numpy as np
import pytest

from amoeboid import InvalidInput, Parameters, figures
from amoeboid.model.natural_units import in_units
from amoeboid.model.polymerization import Custom
from amoeboid.model.units import Units
from amoeboid.observables import retrograde_flow
from amoeboid.surface.cell import SurfaceCell
from amoeboid.surface.equilibrium import flow_of
from amoeboid.surface.initial import sphere

OTHER_UNITS = Units(length=2.0, time=0.5, mass=3.0, filaments=7.0)


def vectors(table, name):
    return np.column_stack([table[f"{name}_z"], table[f"{name}_x"]])


@pytest.fixture(scope="module")
def data():
    return figures.fig2b.data()


def test_fields_are_those_of_the_main_text(data):
    """Equations `deltavp` and the text after it, evaluated here from c_r, c0 and v_p0 alone."""
    p, fields = data.parameters, data["fields"]
    dv = p.v_p0 * np.exp(-p.c0 / p.c_r) * data["cell"]["dc_1"][0] / p.c_r
    theta = fields["theta"]
    n = np.column_stack([np.cos(theta), np.sin(theta)])
    t = np.column_stack([-np.sin(theta), np.cos(theta)])
    for name, expected in {
        "v_p": -dv * np.cos(theta)[:, None] * n,
        "v_c": np.tile([dv, 0.0], (theta.size, 1)),
        "v": -dv * np.sin(theta)[:, None] * t,
    }.items():
        np.testing.assert_allclose(vectors(fields, name), expected, atol=1e-13 * dv)
    assert data["cell"]["migration_z"][0] == pytest.approx(-dv, rel=1e-14)


def test_membrane_that_moves_with_v_p_is_the_shifted_cell(data):
    """To first order in the shift: the dashed circle passes the tips of the arrows of v_p."""
    fields, cell = data["fields"], data["cell"]
    shift = float(cell["shift_z"][0])
    tips = np.column_stack([fields["z"], fields["x"]]) + cell["time"][0] * vectors(fields, "v_p")
    distance = np.hypot(tips[:, 0] - shift, tips[:, 1])
    assert shift == pytest.approx(-0.3)
    assert np.abs(distance - 1.0).max() < 0.5 * shift**2 + 1e-12


def test_flow_is_that_of_the_3d_shell(data):
    """On 162 nodes, whose error is 1 to 2 % (docs/comparison-3d.md); a small amplitude."""
    p, small = data.parameters, 1e-3
    model, state = sphere(p, 2)
    cosine = state.r[:, 2] / np.linalg.norm(state.r, axis=1)
    homogeneous, polarized = (
        SurfaceCell(model, s, flow_of(model, s, 1e-2))
        for s in (state, replace(state, c=state.c + small * cosine))
    )
    change = (retrograde_flow(polarized) - retrograde_flow(homogeneous)) / small
    n = state.r / np.linalg.norm(state.r, axis=1)[:, None]
    along = np.array([0.0, 0.0, 1.0]) - cosine[:, None] * n  # -sin(theta) t, of length sin(theta)
    slope = -data["cell"]["migration_z"][0] / data["cell"]["dc_1"][0]
    assert np.abs(change - slope * along).max() < 0.03 * slope


def test_fields_do_not_depend_on_the_units():
    one = figures.fig2b.data()
    p = in_units(Parameters(), OTHER_UNITS)
    other = figures.fig2b.data(p)
    speed, length = OTHER_UNITS.of("L/T"), OTHER_UNITS.of("L")
    for name in ("v_p_z", "v_c_z", "v_x"):
        np.testing.assert_allclose(
            other["fields"][name] * speed, one["fields"][name], rtol=1e-12, atol=1e-14
        )
    np.testing.assert_allclose(other["cell"]["shift_z"] * length, one["cell"]["shift_z"])


def test_law_without_slope_has_no_perturbation():
    with pytest.raises(InvalidInput, match="must not be 0 at c0"):
        figures.fig2b.data(Parameters(v_p0=0.0))


@pytest.mark.parametrize("name", ["fig1", "fig2b"])
def test_the_arrow_of_migration_points_where_the_cell_goes(name):
    """To the left, away from high c; to the right for a law that grows with c."""
    from matplotlib.figure import Figure as Canvas
    from matplotlib.quiver import Quiver

    figure = figures.named(name)
    for p, side in ((Parameters(), -1.0), (Parameters(law=Custom("v_p0*c")), 1.0)):
        axes = Canvas().subplots(*figure.panels, squeeze=False)
        drawn = figure(axes, p)
        panel = drawn[2] if name == "fig1" else drawn
        arrows = [q for q in panel.collections if isinstance(q, Quiver) and q.width == 0.02]
        assert [np.sign(q.U[0]) for q in arrows] == [side]

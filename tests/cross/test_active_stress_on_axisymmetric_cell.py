"""One velocity instead of two, on a steady state of the axisymmetric solver."""

import numpy as np
import pytest

from amoeboid.axisymmetric.force_balance import Motion, Stress, forces, stress
from amoeboid.axisymmetric.unknowns import fields_of
from amoeboid.closed_forms.active_stress import Meridian, principal_active_stresses
from amoeboid.model.parameters import Parameters
from cross.spectral import polarized


@pytest.mark.parametrize(
    "p",
    [
        Parameters(D=0.4, v_p0=6.0, delta_P=11.0),
        Parameters(law="inverse", v_p0=1.7, eta_b=1.0, alpha=0.01),
    ],
    ids=["soft cell", "inverse law"],
)
def test_the_single_velocity_formulation_is_the_same_force_balance(p):
    state = polarized(p)
    shape, f = state.shape, fields_of(state.x, state.n)
    c, u = np.asarray(f.c), np.asarray(f.u)
    meridian = Meridian(
        r=shape.r,
        r_x=shape.cos_psi,
        z_x=-shape.sin_psi,
        r_xx=-shape.sin_psi * shape.kappa_1,
        z_xx=-shape.cos_psi * shape.kappa_1,
    )
    active = principal_active_stresses(meridian, p.v_p(c), p.eta_s, p.eta_b)
    # the full velocity of a cell at rest in its own frame is tangential
    passive = stress(shape, u, 0 * u, c, f.zeta0, p)
    one = Stress(passive.meridian + active[0], passive.parallel + active[1])
    two = stress(shape, u, -p.v_p(c), c, f.zeta0, p)
    np.testing.assert_allclose(one.meridian, two.meridian, rtol=1e-11)
    np.testing.assert_allclose(one.parallel, two.parallel, rtol=1e-11)
    motion = Motion(u, 0 * u, -p.v_p(c), c)
    for force in forces(shape, one, motion, f.axial, p):
        assert np.abs(force).max() < 1e-7 * max(1.0, p.delta_P)
    assert np.abs(active[0]).max() > 0.1

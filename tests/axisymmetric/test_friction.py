"""Friction and bending in the axisymmetric solver: onset, branch, shape, stability, velocity.

Values of steady states at D = 0.4, delta_P = 300 were computed with a separate prototype before.
"""

import json

import numpy as np
import pytest

import amoeboid as am
from amoeboid.axisymmetric.criticality import criticality
from amoeboid.axisymmetric.evolution import Dynamics, state_of
from amoeboid.axisymmetric.onset import onsets_anywhere
from amoeboid.axisymmetric.shape import shape
from amoeboid.axisymmetric.spectral import grid
from amoeboid.axisymmetric.stability import growth_rates, linearization, sphere_block
from amoeboid.axisymmetric.steady import (
    homogeneous,
    homogeneous_unknowns,
    steady_state,
    strong_residual,
)
from amoeboid.axisymmetric.system import SteadySystem
from amoeboid.cli.main import main
from amoeboid.closed_forms.amplitude import cubic_coefficient_at_speed
from amoeboid.closed_forms.linear import (
    critical_speed,
    finite_pressure_matrix,
    growth_rate,
    push_share,
)
from amoeboid.forces import bending, friction
from amoeboid.model.natural_units import natural_units
from amoeboid.validation import InvalidInput
from theory.test_forces import random_cells

P = am.Parameters(D=0.4, v_p0=6.0)
ALL = {
    "gamma_t": 1.3,
    "gamma_n": 0.7,
    "gamma_c": 0.4,
    "gamma_share": 0.6,
    "kappa": 0.2,
    "chi": 0.05,
}
KINDS = [
    {"gamma_t": 1.3},
    {"gamma_n": 1.0, "gamma_t": 0.2},
    {"gamma_c": 0.6, "gamma_share": 1.0},
    {"kappa": 0.5},
    ALL,
]


@pytest.fixture(scope="module")
def free():
    return am.steady_states(P).fastest_stable.solution


@pytest.fixture(scope="module")
def soft():
    return am.steady_states(P.replace(delta_P=30.0)).fastest_stable.solution


def test_jacobian_is_singular_at_the_predicted_threshold():
    """20 cells with friction of every kind, contractility and bending."""
    for p in random_cells(20, seed=11):
        at = p.replace(v_p0=float(critical_speed(p)))
        system = SteadySystem(at, 12)
        x = homogeneous_unknowns(at, 12)
        sizes = np.linalg.svd(system.jacobian(x, np.zeros(0)) * system.scale, compute_uv=False)
        assert sizes[-1] < 1e-10 * sizes[-2]
        assert np.abs(system.residual(x, np.zeros(0))).max() < 1e-11


@pytest.mark.parametrize(
    "forces",
    [
        {"gamma_t": 1.0, "gamma_n": 1.0},
        {"gamma_t": 2.0, "gamma_n": 0.5, "kappa": 0.3, "chi": 0.1, "eta_b": 0.4},
    ],
)
def test_slope_of_the_branch_at_onset_is_that_of_nu(forces):
    """v_p0 = v_p^c + v_2 a^2, v_2 = -nu/(d lambda_1/d v_p0), with a the amplitude of cos(x)."""
    p = am.Parameters(D=0.1, delta_P=20.0, **forces)
    at = p.replace(v_p0=float(critical_speed(p)))
    step = 1e-4 * at.v_p0
    rates = [float(growth_rate(p.replace(v_p0=at.v_p0 + k * step), 1)) for k in (-1, 1)]
    expected = -float(cubic_coefficient_at_speed(at)) * 2 * step / (rates[1] - rates[0])
    assert criticality(p) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(
    ("forces", "speed", "velocity", "rear"),
    [
        ({"gamma_t": 1.0, "gamma_n": 1.0}, 1.494543, 0.944569, 10.20908),
        ({"gamma_t": 1.0}, 1.830589, 1.737691, 13.193806),
        ({}, 1.834173, None, 13.138030),
    ],
)
def test_steady_cell_with_friction(free, forces, speed, velocity, rear):
    state = steady_state(P.replace(**forces), free)
    assert state.converged
    assert state.max_retrograde_speed == pytest.approx(speed, abs=6e-7)
    assert state.c_rear == pytest.approx(rear, abs=6e-6)
    if velocity is not None:
        moved = friction.velocity(state.cell)
        assert moved[2] == pytest.approx(-velocity, abs=6e-7)
        # what the solver itself found as the drag on the motion of the frame
        found = -state.x[-2] / friction.unit(state.parameters)
        assert found == pytest.approx(moved[2], rel=1e-9)
        assert strong_residual(state) < 5e-9


def test_weak_friction_moves_the_cell_as_drag_without_feedback_does(free):
    """u_max 1.834173: uniform 1.158850, along the surface 1.737927, proportional to c 0.871863."""
    for forces, expected in (
        ({"gamma_t": 1e-7, "gamma_n": 1e-7}, 1.158850),
        ({"gamma_t": 1e-7}, 1.737927),
        ({"gamma_t": 1e-7, "gamma_n": 1e-7, "gamma_share": 1.0}, 0.871863),
    ):
        state = steady_state(P.replace(**forces), free)
        assert np.linalg.norm(friction.velocity(state.cell)) == pytest.approx(expected, abs=6e-7)
    on_cortex = steady_state(P.replace(gamma_c=1e-7), free)
    drawn = np.linalg.norm(friction.velocity(on_cortex.cell))
    assert drawn == pytest.approx(free.cortex_drag_speed, rel=1e-6)
    with pytest.raises(InvalidInput, match="must be > 0 for a velocity of the cell"):
        friction.velocity(free.cell)


def test_drag_on_the_cortex_leaves_a_threshold_that_only_treadmilling_moves():
    assert push_share(am.Parameters(gamma_c=1.0)) == pytest.approx(1.0 / 12.0, rel=1e-14)
    assert push_share(am.Parameters(gamma_t=1.0, gamma_n=1.0)) == 0.0


@pytest.mark.parametrize("l", [2, 3, 6])
def test_linearization_about_the_sphere_is_the_matrix_of_the_theory(l):
    for p in random_cells(3, seed=5):
        unit = natural_units(p).of("1/T")
        found = np.sort_complex(np.linalg.eigvals(sphere_block(p, l) * unit))
        expected = np.sort_complex(np.linalg.eigvals(finite_pressure_matrix(p, l)))
        assert found == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("forces", KINDS)
def test_growth_rates_are_those_of_the_time_evolution(soft, forces):
    p = P.replace(delta_P=30.0, **forces)
    state = steady_state(p, soft)
    rates = np.linalg.eigvals(Dynamics(p, state.n).jacobian(state_of(state)))
    for rate in growth_rates(state, 0)[:4]:
        assert np.abs(rates - rate).min() < 1e-7 * abs(rate)


@pytest.mark.parametrize("forces", KINDS)
def test_rigid_motions_of_a_polarized_cell_change_nothing_but_its_place(soft, forces):
    """Their images are rigid motions: a cell that is turned moves in another direction."""
    state = steady_state(P.replace(delta_P=30.0, **forces), soft)
    about = linearization(state, 34)
    for m, constraints in ((0, 1), (1, 0)):
        matrix, removed, _ = about.reduced_matrix(m)
        motions = removed[:, constraints:]
        images = matrix @ motions
        left = images - motions @ np.linalg.lstsq(motions, images)[0]
        scale = np.linalg.norm(np.abs(matrix) @ np.abs(motions), axis=0)
        assert np.all(np.linalg.norm(left, axis=0) < 1e-9 * scale)
        if state.parameters.has_friction:
            # without turning, not even that
            assert np.linalg.norm(images[:, 0]) < 1e-9 * scale[0]


def test_bending_force_is_the_derivative_of_the_bending_energy():
    """Along scaled normal motions of a deformed meridian, by differences of the energy."""
    g = grid(32)
    k = np.arange(1, 4)

    def energy(scale, bend):
        s = meridian(scale, bend)
        H = s.kappa_1 + s.kappa_2
        return 0.5 * float(s.surface_integral(H * H)[0])

    def meridian(scale, bend):
        a = np.array([0.0, bend, 0.05])
        a[0] = closing(a)
        psi = g.x + np.sin(np.outer(g.x, k)) @ a
        slope = 1 + (np.cos(np.outer(g.x, k)) * k) @ a
        return shape(g, psi, slope, np.array([scale]))

    def closing(a):
        for _ in range(30):
            psi = g.x + np.sin(np.outer(g.x, k)) @ a
            a[0] += np.mean(np.cos(psi)) / np.mean(np.sin(psi) * np.sin(g.x))
        return a[0]

    here, step = meridian(1.2, 0.1), 1e-4
    density = bending.density(here, P.replace(kappa=1.0))
    for change in ((1.0, 0.0), (0.0, 1.0)):
        sides = [meridian(1.2 + k * step * change[0], 0.1 + k * step * change[1]) for k in (-1, 1)]
        moved = [
            [(far - near) / (2 * step) for far, near in zip(q(sides[1]), q(sides[0]), strict=True)]
            for q in (lambda s: s.r, lambda s: s.height)
        ]
        along = np.array(moved[0]) * here.sin_psi + np.array(moved[1]) * here.cos_psi
        work = float(here.surface_integral(density * along)[0])
        energies = [energy(1.2 + k * step * change[0], 0.1 + k * step * change[1]) for k in (-1, 1)]
        derivative = (energies[1] - energies[0]) / (2 * step)
        assert -work == pytest.approx(derivative, rel=1e-6, abs=1e-6)


def test_homogeneous_sphere_balances_friction_of_the_treadmilling_cortex():
    p = P.replace(gamma_c=2.0)
    expected = homogeneous(P).zeta0 + 2.0 * float(P.v_p(P.c0)) * P.R0 / 2
    assert homogeneous(p).zeta0 == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(
    ("forces", "fold"),
    [
        ({"gamma_t": 1.0}, 5.242429),
        # isotropic friction that leaves no polarized state below v_p0 = 6
        ({"gamma_t": 1.881389, "gamma_n": 1.881389}, 6.0),
    ],
)
def test_fold_of_the_branch_with_friction(forces, fold):
    p = am.Parameters(D=0.4, **forces)
    found = am.branch(p, "v_p0", 0, float(critical_speed(p)) + 0.1, max_step=0.3)
    (first,) = found.folds
    assert first.value == pytest.approx(fold, abs=1e-6)


def test_a_branch_in_friction_starts_without_it_and_ends_at_the_fold():
    p = P.replace(gamma_t=1.881389)
    (fold,) = am.branch(p, "gamma_n", 0.0, 3.0, max_step=0.4).folds
    assert fold.value == pytest.approx(1.881389, abs=1e-6)


def test_onsets_in_friction_and_contractility_are_those_of_the_theory():
    p = am.Parameters(D=0.4, v_p0=6.3, gamma_t=1.0)
    (onset,) = onsets_anywhere(p, "gamma_n")
    assert growth_rate(p.replace(gamma_n=onset), 1) == pytest.approx(0.0, abs=1e-10)
    q = am.Parameters(v_p0=2.0)
    (onset,) = onsets_anywhere(q, "chi")
    assert growth_rate(q.replace(chi=onset), 1) == pytest.approx(0.0, abs=1e-10)


def test_steady_states_and_branches_tell_the_speed_that_friction_gives(capsys):
    """U: that of `friction.velocity`, and that of the same friction as an environment."""
    given = ["--set", "D=0.4", "--set", "v_p0=6", "--set", "gamma_t=1", "--set", "gamma_n=1"]
    assert main(["steady", *given, "--json"]) == 0
    state = json.loads(capsys.readouterr().out)["states"][-1]
    known = am.steady_states(P.replace(gamma_t=1.0, gamma_n=1.0), (1,))
    assert state["friction_speed"] == pytest.approx(0.944569, abs=1e-6)  # of docs/forces.md
    assert known[-1].friction_speed == pytest.approx(state["friction_speed"], rel=1e-9)
    assert "friction_speed" in repr(known)
    assert known.columns["friction_speed"].values[0] == pytest.approx(0.0, abs=1e-12)
    on_mesh = am.steady_state(known.parameters, mesh=am.Icosphere(2), start=known[-1])
    # 162 nodes: as far below as max_retrograde_speed, some 1 %
    assert on_mesh.number("friction_speed") == pytest.approx(0.944569, rel=0.015)
    with pytest.raises(AttributeError):
        _ = am.steady_states(P, (1,))[-1].friction_speed

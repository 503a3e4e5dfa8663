"""The bifurcation without turnover: subcritical, with the number of filaments conserved."""

import numpy as np
import pytest

from amoeboid import Icosphere, Parameters, figures, simulate, steady_states
from amoeboid.closed_forms.amplitude import cubic_coefficient
from amoeboid.closed_forms.linear import critical_speed
from amoeboid.closed_forms.points import infinite_pressure
from amoeboid.config import Time
from amoeboid.figures import computed
from amoeboid.figures.computed import ERRORS

FILAMENTS = 4 * np.pi * 3.0  # c0 of the sphere
FOLD = 0.12861978  # axisymmetric; docs/numerics-axisymmetric.md


def test_threshold_is_that_of_diffusion_alone_and_the_bifurcation_subcritical():
    """Main text `vpc` at beta = 0; nu as derived for beta = 0 in docs/theory.md."""
    p = figures.s_beta0.parameters
    assert float(critical_speed(p)) == pytest.approx(0.03 * np.exp(3.0) / 3.0, rel=1e-12)
    c, D = 3.0, 0.03
    nu = D * (13 * c**2 - 20 * c - 2) / (15 * c**2 * 3)
    assert float(cubic_coefficient(infinite_pressure(p))) == pytest.approx(nu, rel=1e-12)
    assert nu > 0
    assert float(cubic_coefficient(Parameters())) < 0  # with turnover: supercritical


def test_branch_has_a_fold_and_keeps_the_number_of_filaments():
    """The fold 0.128620 is quoted in docs/numerics-axisymmetric.md."""
    p = figures.s_beta0.parameters
    threshold = float(critical_speed(p))
    found = computed.branch_points(p, "v_p0", 0.0, 1.1 * threshold, 0.3)
    assert found["folds"] == [pytest.approx(0.128620, abs=1e-6)]
    assert found["complete"]
    np.testing.assert_allclose(found["points"]["filament_number"], FILAMENTS, rtol=1e-9)


def test_run_keeps_the_number_of_filaments():
    p = Parameters(beta=0.0, v_p0=0.168)
    run = computed.steady_run(p, 2, p.c0)
    assert run["steady"]
    assert run["polarized"]
    start = computed.steady_run(p.replace(v_p0=0.1), 2, 0.0)
    assert run["filament_number"] == pytest.approx(start["filament_number"], rel=1e-3)


@pytest.fixture(scope="module")
def data():
    return figures.s_beta0.data()


def stated_error(data, start):
    """The mesh error that the note on the jump of the runs from a start states."""
    (note,) = (n for n in data.notes if f"from the {start} start: jump" in n)
    return float(note.rsplit("mesh error ", 1)[1])


@pytest.mark.slow
def test_runs_from_the_weak_start_jump_at_the_threshold_line(data):
    threshold, runs = float(data["threshold"]["v_p0"][0]), data["runs-weak"]
    k, stated = int(np.argmax(runs["polarized"])), stated_error(data, "weak")
    assert runs["v_p0"][k - 1] - stated < threshold < runs["v_p0"][k] + stated
    assert stated < 0.02 * threshold
    np.testing.assert_allclose(runs["filament_number"], FILAMENTS, rtol=2e-3)


@pytest.mark.slow
def test_strong_start_is_outside_the_basin_just_above_the_fold(data):
    """There the branch of the axisymmetric solver is stable on the mesh, too; the notes say so."""
    runs = data["runs-strong"]
    k, stated = int(np.argmax(runs["polarized"])), stated_error(data, "strong")
    assert runs["v_p0"][k] > FOLD
    assert stated < 0.02 * FOLD
    np.testing.assert_allclose(runs["filament_number"], FILAMENTS, rtol=2e-3)
    assert np.isfinite(runs[ERRORS[0]]).sum() >= 7
    at_rest = [v for v in runs["v_p0"][:k] if v > FOLD + stated]
    assert at_rest
    for v in at_rest:
        assert f"{v:#.5g}" in data.notes[-1]
        p, mesh = data.parameters.replace(v_p0=v), Icosphere(3)
        state = steady_states(p).fastest_stable
        time = Time(end=computed.END / p.rate, max_step=computed.MAX_STEP / p.rate)
        run = simulate(p, mesh=mesh, initial=state.as_initial(mesh), time=time, progress=False)
        assert run.steady
        speed = run.final.number("max_retrograde_speed")
        assert speed == pytest.approx(state.number("max_retrograde_speed"), rel=0.05)
    assert "basin of attraction" in data.notes[-1]

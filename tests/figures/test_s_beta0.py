"""The bifurcation without turnover: subcritical, with the number of filaments conserved."""

import numpy as np
import pytest

from amoeboid import Parameters, figures
from amoeboid.closed_forms.amplitude import cubic_coefficient
from amoeboid.closed_forms.linear import critical_speed
from amoeboid.closed_forms.points import infinite_pressure
from amoeboid.figures import computed
from amoeboid.figures.computed import ERRORS

FILAMENTS = 4 * np.pi * 3.0  # c0 of the sphere


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


@pytest.mark.slow
def test_runs_jump_at_the_threshold_line_and_at_the_fold():
    data = figures.s_beta0.data()
    threshold = float(data["threshold"]["v_p0"][0])
    for start, place, note in (("weak", threshold, -2), ("strong", 0.12861978, -1)):
        runs = data[f"runs-{start}"]
        k = int(np.argmax(runs["polarized"]))
        stated = float(data.notes[note].rsplit("mesh error ", 1)[1])
        assert start in data.notes[note]
        assert runs["v_p0"][k - 1] - stated < place < runs["v_p0"][k] + stated
        assert stated < 0.02 * place
        np.testing.assert_allclose(runs["filament_number"], FILAMENTS, rtol=2e-3)
    errors = data["runs-strong"][ERRORS[0]]
    assert np.isfinite(errors).sum() >= 7

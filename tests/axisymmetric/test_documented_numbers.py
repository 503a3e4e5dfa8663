"""The figures that docs/numerics-axisymmetric.md publishes, and the cell without pressure.

Digits are this code's own, each taken at 32 and at 64 modes to see that it does not depend on them.
"""

import json

import numpy as np
import pytest

from amoeboid.axisymmetric.bifurcations import branch_points
from amoeboid.axisymmetric.branches import branch_from_sphere
from amoeboid.axisymmetric.onset import branch_tangent, onset_speed
from amoeboid.axisymmetric.search import steady_solutions
from amoeboid.axisymmetric.steady import strong_residual
from amoeboid.axisymmetric.window import Window
from amoeboid.cli.main import main
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.branch_points import Options
from amoeboid.numerics.continuation import follow

STEPS = Options(parameter_scale=5.0, max_step=0.2)
SOFT = Parameters(D=0.4, delta_P=11.0)
SOFTER = Parameters(D=0.4, delta_P=1.0)


@pytest.mark.parametrize("n", [32, pytest.param(64, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("p", "high", "fold", "headings"),
    [
        (Parameters(D=0.03, beta=0.0), 0.22, 0.128620, {}),
        (Parameters(D=0.4, law="inverse"), 2.72, 2.421971, {}),
        (SOFTER, 4.6, 4.080373, {2: 4.5064}),
        (SOFT, 6.9, 5.004994, {1: 6.8338, 2: 6.8420}),
    ],
)
def test_folds_and_losses_of_stability(p, n, high, fold, headings):
    branch = branch_from_sphere(p, "v_p0", Window(0.0, high), options=STEPS, n=n)
    assert branch.message == ""
    assert [f.value for f in branch.folds] == [pytest.approx(fold, abs=6e-7)]
    bifurcations = {c.m: c.at.value for c in branch.bifurcations}
    assert set(headings) <= set(bifurcations)
    for m, value in headings.items():
        assert bifurcations[m] == pytest.approx(value, abs=6e-5)


def test_deformation_at_physical_and_at_high_pressure():
    cells = [steady_solutions(q.replace(v_p0=6.0), (1,))[-1] for q in (SOFT, Parameters(D=0.4))]
    assert cells[0].deformation == pytest.approx(0.0227, abs=5e-5)
    assert cells[1].deformation == pytest.approx(0.00097, abs=5e-6)


def test_a_cell_without_pressure_polarizes_and_deforms():
    p = Parameters(D=0.4, delta_P=0.0)
    points = []
    for point in follow(branch_tangent(p, "v_p0", onset_speed(p), STEPS), STEPS):
        points.extend(branch_points([point], p, "v_p0"))
        if point.parameter > 6.5:
            break
    assert points[-1].value > 6.5
    assert len(points) > 5
    assert max(strong_residual(b.state) for b in points) < 1e-8
    speeds = [b.state.max_retrograde_speed for b in points]
    assert np.all(np.diff(speeds) > 0)
    assert points[-1].state.deformation > 0.02


@pytest.mark.parametrize("words", [("steady",), ("branch", "--to", "6.2", "--max-step", "0.4")])
def test_counts_of_modes_without_pressure_come_with_a_warning(capsys, words):
    assert main([*words, "--set", "D=0.4", "--set", "delta_P=0", "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)
    assert "delta_P = 0" in err
    assert "raise delta_P" in err
    assert main([*words, "--set", "D=0.4", "--json"]) == 0
    assert "delta_P = 0" not in capsys.readouterr().err

"""The lines that a user types first, from `import amoeboid` to a cell in physical units."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import amoeboid as am


def test_the_first_lines_of_a_user(tmp_path):
    p = am.Parameters(D=0.4, v_p0=6.0)
    assert repr(p) == "Parameters(D=0.4, v_p0=6.0)"

    # on 642 nodes: steady at t = 10.94, 48 steps; the axisymmetric solver gives 1.834173
    sol = am.simulate(p, mesh=am.Icosphere(2), until=am.steady())
    assert repr(sol) == "Solution(steady at t = 9.223, 45 steps, 162 nodes)"
    speed = sol["max_retrograde_speed"]
    assert speed.shape == sol.t.shape == (46,)
    assert speed[-1] == pytest.approx(1.834173, rel=0.01)
    assert sol.final.c.shape == (162,)
    assert sol.final.c.max() == pytest.approx(13.138, rel=0.01)
    assert sol.stability == "stable"
    assert sol.growth_rate == pytest.approx(-1.0, abs=0.01)

    stored = sol.save(tmp_path / "fig3d")
    assert repr(stored).endswith("steady at t = 9.223, 45 steps, 162 nodes)")
    resumed = am.load(tmp_path / "fig3d").resume(until=am.time(10))
    assert "end of time at t = 10" in repr(resumed)
    assert resumed.final.max_retrograde_speed == pytest.approx(speed[-1], rel=1e-4)
    axes = Figure().add_subplot()
    assert sol.plot(ax=axes) is axes

    states = am.steady_states(am.Parameters(D=0.4, v_p0=5.5))
    assert repr(states).startswith("3 steady states, complete; D = 0.4, v_p0 = 5.5")
    assert states.complete
    assert states.problems == ()
    s = states.fastest_stable
    assert repr(s).startswith("SteadyState(max_retrograde_speed = 1.45368, c_front = 0.87452")
    assert np.all(s.growth_rates(m=1).real < 0)
    start = s.as_initial(am.Icosphere(2))
    assert repr(start).startswith("InitialCell(162 nodes, c = ")
    on_mesh = am.simulate(s.parameters, initial=start, until=am.time(0.1)).final
    assert on_mesh.max_retrograde_speed == pytest.approx(s.max_retrograde_speed, rel=0.02)

    br = am.branch(am.Parameters(D=0.4), "v_p0", 0, 8)
    assert repr(br).splitlines()[0] == "Branch in v_p0: threshold 6.02566, fold 5.20960, complete"
    # in units c_r = beta = R0 = 1: v_p^c = (e^c0 / c0) (1/2 + D) at c0 = 3
    assert br.thresholds[0] == pytest.approx(np.exp(3) / 3 * 0.9, rel=1e-6)
    assert len(br.v_p0) == len(br.max_retrograde_speed) == len(br.stable)
    assert br.folds[0].state.max_retrograde_speed == pytest.approx(0.944, abs=0.001)
    assert len(br.to_pandas()) == len(br)
    axes = Figure().add_subplot()
    assert br.plot(ax=axes) is axes

    table = am.sweep(am.grid(base=p, D=[0.1, 0.4], v_p0=[5, 6]), am.theory)
    assert repr(table).startswith("Sweep of theory at 4 points (2 x 2)")
    assert table.dataset.threshold.sel(D=0.4, v_p0=5) == am.theory(p).threshold

    cell = am.Parameters.physical(R0="10 um", v_p0="1.7 um/s")
    assert repr(cell) == "Parameters.physical(D='0.03 um^2/s', v_p0='1.7 um/s')"
    assert str(am.theory(cell).threshold) == "1.4606 µm/s"
    run = am.simulate(cell, mesh=am.Icosphere(1))
    found = run.final.max_retrograde_speed.to("um/s")
    exact = am.steady_states(cell, (1,)).fastest_stable.max_retrograde_speed
    assert found.magnitude == pytest.approx(exact.to("um/s").magnitude, rel=0.1)


@pytest.mark.parametrize("study", [am.steady_states, am.branch, am.phase_diagram, am.theory])
def test_a_study_of_what_are_no_parameters_is_refused(study):
    with pytest.raises(am.InvalidInput, match=r"p must be amoeboid.Parameters\(...\), got 0.4"):
        study(0.4)


def test_an_event_without_its_brackets_is_named():
    with pytest.raises(am.InvalidInput, match=r"write amoeboid.steady\(...\)"):
        am.simulate(until=am.steady)


def test_plots_take_axes_alone():
    with pytest.raises(am.InvalidInput, match="ax must be Axes of matplotlib"):
        am.simulate(mesh=am.Icosphere(1), until=am.time(0.01)).plot("c_rear")


def test_a_spectrum_of_a_coarse_mesh_has_fewer_degrees():
    run = am.simulate(mesh=am.Icosphere(1), until=am.time(0.01))
    assert list(run.spectrum().l) == [0, 1, 2, 3]
    with pytest.raises(am.InvalidInput, match="l_max must be at most 3"):
        run.spectrum("c", l_max=4)

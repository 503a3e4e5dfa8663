"""Steady states, branches, phase diagrams and theory as users see them."""

import pickle
import sys
from html.parser import HTMLParser

import numpy as np
import pytest
from matplotlib.figure import Figure

import amoeboid as am
from amoeboid.axisymmetric.search import steady_solutions
from amoeboid.axisymmetric.stability import growth_rates, unstable_modes
from amoeboid.closed_forms.linear import critical_speed

BISTABLE = am.Parameters(D=0.4, v_p0=5.5)
CELL = am.Parameters.physical(D="1 um^2/s", v_p0="2 um/s")  # smooth: few modes
PAPER_CELL = am.Parameters.physical()
MAX_REPR = 1000


@pytest.fixture(scope="module")
def states():
    return am.steady_states(BISTABLE)


@pytest.fixture(scope="module")
def branch():
    return am.branch(BISTABLE, "v_p0", 0, 6.5, max_step=0.4)


@pytest.fixture(scope="module")
def diagram():
    return am.phase_diagram(BISTABLE, "D", 0.3, 0.4, speeds=(5.0, 5.6), columns=2, rows=2)


@pytest.fixture(scope="module")
def cell_states():
    return am.steady_states(CELL, (1,))


@pytest.fixture(scope="module")
def cell_branch():
    return am.branch(CELL, "v_p0", 0, "2.2 um/s", max_step=0.4)


@pytest.fixture(scope="module")
def results(states, branch, diagram, cell_states, cell_branch):
    """One of every public result, in plain numbers and with units."""
    return [
        BISTABLE,
        CELL,
        states,
        states[1],
        states[2].as_initial(2),
        branch,
        branch.folds[0],
        diagram,
        am.theory(BISTABLE),
        am.theory(am.Parameters(law="1 + 0*c")),
        am.theory(PAPER_CELL),
        cell_states,
        cell_states[1],
        cell_branch,
    ]


class Balanced(HTMLParser):
    """Raises for a tag that is closed out of order or never."""

    def __init__(self, text):
        super().__init__()
        self.open = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        if tag != "img":
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_every_result_pickles_is_short_and_has_well_formed_html(results):
    for result in results:
        text = repr(result)
        assert 0 < len(text) < MAX_REPR, type(result)
        assert repr(pickle.loads(pickle.dumps(result))) == text  # noqa: S301
        if hasattr(result, "_repr_html_"):
            Balanced(result._repr_html_())


def test_results_show_what_was_found(states, branch, diagram):
    lines = repr(states).splitlines()
    assert lines[0].startswith("3 steady states, complete; D = 0.4, v_p0 = 5.5")
    assert len(lines) == 1 + 2 + 3
    assert lines[4].endswith("1 0 0 0")
    assert lines[5].endswith("stable")
    first, second = repr(branch).splitlines()
    assert first == "Branch in v_p0: threshold 6.02566, fold 5.20960, complete"
    assert second == "12 states from v_p0 = 6.02056 to 6.50000, 6 of them stable"
    assert repr(branch.folds[0]) == "fold at v_p0 = 5.20959845"
    assert repr(diagram).splitlines()[0] == "Phase diagram in D and v_p0: 2 x 2 cells, complete"
    assert repr(am.Parameters(v_p0=6.0)) == "Parameters(D=0.03, v_p0=6.0)"


def test_the_repr_of_parameters_makes_them_again():
    for p in (am.Parameters(), am.Parameters(alpha=0.5, law="inverse"), BISTABLE):
        assert eval(repr(p), {"Parameters": am.Parameters}) == p  # noqa: S307
    cell = am.Parameters.physical(v_p0="2 um/s", law="inverse")
    assert eval(repr(cell), {"Parameters": am.Parameters}) == cell  # noqa: S307


def test_long_results_say_what_their_text_leaves_out(states):
    many = am.SteadyStates(BISTABLE, states.states * 20, False, ("it stalled " * 40,) * 30)
    text = repr(many)
    assert len(text) < MAX_REPR
    assert "states may be missing" in text
    shown = sum(line.endswith(("stable", "1 0 0 0")) for line in text.splitlines())
    assert f"... and {60 - shown} more states" in text
    assert "... and 28 more problems" in text
    assert "more rows" not in many._repr_html_()


def test_stability_is_that_of_the_solver(states):
    for state, solution in zip(states, steady_solutions(BISTABLE), strict=True):
        assert state.unstable_modes == unstable_modes(solution)
        assert state.stable == (not any(unstable_modes(solution).values()))
        np.testing.assert_array_equal(state.growth_rates(m=2), growth_rates(solution, 2))
    assert states.fastest_stable is states[2]
    for m in (-1, 1.5, True):
        with pytest.raises(am.InvalidInput, match="azimuthal number m"):
            states[0].growth_rates(m)


def test_growth_rates_stay_known_in_a_pickle(states, monkeypatch):
    rates = states[1].growth_rates(1)
    again = pickle.loads(pickle.dumps(states[1]))  # noqa: S301
    monkeypatch.setattr("amoeboid.studies.states.growth_rates_of", None)
    np.testing.assert_array_equal(again.growth_rates(1), rates)


def test_without_a_stable_state_there_is_no_fastest(states):
    with pytest.raises(am.InvalidInput, match="none of the steady states"):
        _ = am.SteadyStates(BISTABLE, (states[1],), True, ()).fastest_stable


def test_observables_are_arrays_along_a_branch(branch):
    assert branch.v_p0 is not None
    np.testing.assert_array_equal(branch.v_p0, branch.values)
    assert len(branch) == branch.v_p0.size == branch.stable.size == branch.piece.size
    for name in ("max_retrograde_speed", "c_front", "zeta0", "polarity", "deformation"):
        expected = [getattr(state, name) for state in branch.states]
        np.testing.assert_array_equal(getattr(branch, name), expected)
        assert name in dir(branch)
        assert name in dir(branch.states[0])
    # on the upper part of a branch in v_p0 the speed grows, and it is stable beyond the fold
    upper = np.flatnonzero(branch.stable)
    assert np.all(np.diff(branch.max_retrograde_speed[upper]) > 0)
    assert branch.v_p0[upper[0]] > branch.folds[0].value == pytest.approx(5.20959845, abs=1e-8)
    assert branch.thresholds == pytest.approx(critical_speed(BISTABLE))
    with pytest.raises(AttributeError, match="is constant along it"):
        _ = branch.D
    with pytest.raises(AttributeError, match="no attribute 'speed'"):
        _ = branch.speed


def test_tables_hold_the_numbers_of_the_results(states, branch, diagram):
    table = states.to_pandas()
    assert list(table["stable"]) == [True, False, True]
    assert list(table["unstable_m0"]) == [0, 1, 0]
    assert table.attrs["units"]["c_rear"] == "N/L^2"
    data = branch.to_xarray()
    np.testing.assert_array_equal(data["v_p0"], branch.v_p0)
    np.testing.assert_array_equal(data["c_rear"], branch.c_rear)
    assert data["zeta0"].attrs["units"] == "M/T^2"
    assert "v_p0" in data.coords
    assert len(branch.to_pandas()) == len(branch)
    assert set(states.to_xarray().sizes) == {"state"}
    grid = diagram.to_xarray()
    assert grid.sizes == {"v_p0": 2, "D": 2}
    assert grid["region_name"].sel(D=0.4, v_p0=5.6) == "bistable"
    assert len(diagram.to_pandas()) == 4


def test_a_missing_package_is_named(states, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(am.InvalidInput, match=r"needs pandas.*amoeboid\[data\]"):
        states.to_pandas()
    with pytest.raises(am.InvalidInput, match="needs xarray"):
        states.to_xarray()


def test_plots_draw_on_given_axes_and_return_them(results):
    for result in results:
        if hasattr(result, "plot"):
            axes = Figure().add_subplot()
            assert result.plot(ax=axes) is axes
            assert axes.has_data()


@pytest.mark.parametrize("growing", [0, 1])
def test_a_branch_is_drawn_dashed_where_it_is_unstable(branch, growing):
    """At the fold itself a mode is neutral, and rounding decides in which way it counts."""
    branch = pickle.loads(pickle.dumps(branch))  # noqa: S301
    branch.folds[0].state.unstable_modes[0] = growing
    axes = branch.plot(ax=Figure().add_subplot(), observable="c_rear")
    curves = {
        line.get_linestyle(): line.get_xydata() for line in axes.lines if len(line.get_xdata()) > 2
    }
    assert set(curves) == {"-", "--"}
    assert curves["-"][-1, 0] == 6.5
    assert len(curves["-"]) + len(curves["--"]) == len(branch) + 2  # the fold is on both
    assert curves["--"][-1, 0] == pytest.approx(branch.folds[0].value)
    assert curves["--"][-1, 1] == pytest.approx(branch.folds[0].state.c_rear)
    with pytest.raises(am.InvalidInput, match="observable must be one of"):
        branch.plot(observable="speed")


def test_diagrams_know_their_edges(diagram):
    values, v_p0 = diagram.threshold
    np.testing.assert_allclose(
        v_p0, [critical_speed(BISTABLE.replace(D=D)) for D in values], rtol=1e-9
    )
    # thresholds 5.356 and 6.026, folds 4.845 and 5.210
    assert diagram.bistable.tolist() == [[True, False], [False, True]]
    assert diagram.complete
    fastest = am.steady_states(BISTABLE.replace(v_p0=5.6), (1,)).fastest_stable
    assert diagram.max_retrograde_speed[1, 1] == pytest.approx(fastest.max_retrograde_speed)
    assert diagram.max_retrograde_speed[0, 1] == 0.0


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("D2", 0, 1), "name must be one of R0"),
        (("v_p0", 0, "8 um/s"), "start from Parameters.physical"),
        (("v_p0", 0, np.nan), "end must be a finite number"),
        (("v_p0", 3, 3), "must differ, both are 3"),
        (("v_p0", 0), "end must be given"),
        (("D", -1, 1), "D must be"),
        (("v_p0", 0, 2), "does not enter"),
    ],
)
def test_branches_that_cannot_be_are_refused(arguments, says):
    with pytest.raises(am.InvalidInput, match=says):
        am.branch(BISTABLE, *arguments)


def test_physical_cells_give_quantities_that_agree_with_plain_numbers(cell_states, cell_branch):
    state, expected = cell_states[1], steady_solutions(CELL, (1,))[1]
    speed = state.max_retrograde_speed
    assert f"{speed.units:~P}" == "µm/s"
    # the units of the cell: R0 = 10 um, 1/beta = 10 s
    assert speed.to("um/s").magnitude == pytest.approx(expected.max_retrograde_speed * 10 / 10)
    assert speed.to("nm/s").magnitude == pytest.approx(293.92, abs=0.01)
    assert state.c_rear.to("1/um^2").magnitude == pytest.approx(2556.84, abs=0.01)
    assert state.deformation == pytest.approx(expected.deformation)
    rate = state.growth_rates(1)[0]
    assert rate.to("1/s").magnitude == pytest.approx(growth_rates(expected, 1)[0] / 10)
    assert cell_branch.v_p0[-1].to("um/s").magnitude == pytest.approx(2.2)
    # the threshold of the paper's cell, 1.46060025 um/s, is proportional to D/R0 + beta R0/2
    assert cell_branch.thresholds[0].to("um/s").magnitude == pytest.approx(
        1.46060025 * (0.1 + 0.5) / (0.003 + 0.5), rel=1e-8
    )
    assert "threshold 1.74227 um/s" in repr(cell_branch)
    assert state.outline(3)[0].to("um").magnitude.max() == pytest.approx(10, rel=0.05)
    assert cell_states.to_pandas().attrs["units"]["max_retrograde_speed"] == "um/s"
    with pytest.raises(am.InvalidInput, match="end must be a number with a unit"):
        am.branch(CELL, "v_p0", 0, 1.6)
    with pytest.raises(am.InvalidInput, match="end must have the dimension L/T"):
        am.branch(CELL, "v_p0", 0, "1.6 um")


def test_theory_of_a_physical_cell_has_units():
    found = am.theory(PAPER_CELL)
    assert found.threshold.to("um/s").magnitude == pytest.approx(1.46060025, rel=1e-8)
    assert found.thresholds.to("um/s").magnitude == pytest.approx([1.46060025], rel=1e-8)
    assert found.growth_rates[1].check("1/[time]")
    assert found.delta_P_star.check("[pressure]")
    assert found.nu.check("[length]**4/[time]")
    assert found.bifurcation == "supercritical"
    # the same numbers in the units of the paper's table
    plain = am.theory(am.Parameters())
    assert plain.threshold == pytest.approx(float(critical_speed(am.Parameters())))
    assert plain.max_retrograde_speed == pytest.approx(0.4282514, abs=1e-6)
    assert am.theory(am.Parameters(law="1 + 0*c")).threshold is None
    assert "no threshold" in repr(am.theory(am.Parameters(law="1 + 0*c")))


@pytest.mark.parametrize("function", [am.theory, am.steady_states, am.branch, am.phase_diagram])
def test_what_is_no_cell_is_refused_with_the_remedy(function):
    with pytest.raises(am.InvalidInput, match=r"p must be amoeboid.Parameters\(...\), got None"):
        function(None)
    with pytest.raises(am.InvalidInput, match=r"give its .parameters"):
        function(am.Config())


@pytest.mark.parametrize("degrees", [(), (0,), (-1,), (1.5,), ("1",), (True,), 1])
def test_a_search_in_no_mode_is_not_called_complete(degrees):
    with pytest.raises(am.InvalidInput, match="degrees must be one or more whole numbers >= 1"):
        am.steady_states(BISTABLE, degrees)


@pytest.mark.parametrize(
    ("function", "keywords", "says"),
    [
        (am.branch, {"end": 6.5, "max_step": "a"}, "max_step must be"),
        (am.branch, {"end": 6.5, "max_points": 1.5}, "max_points must be a whole number"),
        (am.phase_diagram, {"columns": "a"}, "columns must be a whole number"),
        (am.phase_diagram, {"rows": 2.5}, "rows must be a whole number"),
        (am.phase_diagram, {"speeds": (1.0,)}, "speeds must be"),
        (am.phase_diagram, {"speeds": 3.0}, "speeds must be"),
    ],
)
def test_options_of_another_type_are_refused(function, keywords, says):
    with pytest.raises(am.InvalidInput, match=says):
        function(BISTABLE, **keywords)


def test_a_diagram_of_a_physical_cell_has_units():
    found = am.phase_diagram(CELL, "D", "1 um^2/s", "1.2 um^2/s", speeds=("1.6 um/s", "2.2 um/s"),
                             columns=2, rows=2)  # fmt: skip
    assert found.speeds.to("um/s").magnitude == pytest.approx([1.6, 2.2])
    assert found.values.to("um^2/s").magnitude == pytest.approx([1.0, 1.2])
    assert found.to_xarray()["D"].attrs["units"] == "um^2/s"
    assert found.regions.tolist() == [[0, 0], [1, 1]]
    assert len(repr(found)) < MAX_REPR
    Balanced(found._repr_html_())


def test_the_state_at_a_fold_is_neither_stable_nor_unstable(branch):
    (fold,) = branch.folds
    assert fold.state.stability == "neutral"
    assert not fold.state.stable
    assert repr(fold.state).endswith("neutral)")
    assert fold.state._repr_html_().count("Neutral steady state") == 1
    assert {state.stability for state in branch.states} == {"stable", "unstable"}

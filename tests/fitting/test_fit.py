"""Parameters from measurements: found again, with errors that hold, and told where they do not."""

import pickle
from dataclasses import dataclass

import numpy as np
import pytest
from matplotlib.figure import Figure

import amoeboid as am
from amoeboid.fitting.followed import FollowedState
from amoeboid.fitting.predictions import angles, arclengths, prediction
from amoeboid.fitting.synthetic import polarized_state
from amoeboid.model.natural_units import in_units
from unit_systems import SI

P = am.Parameters(D=0.4, v_p0=6.0)
NAMES = ("D", "v_p0", "c0", "beta")
START = P.replace(D=0.35, v_p0=6.3, beta=1.05)
BOTH = {"u": 0.04, "c": 0.3}  # 2.3 % of the largest value


@pytest.fixture(scope="module")
def state():
    return polarized_state(P, NAMES)


@pytest.fixture(scope="module")
def found():
    return am.fit(am.synthetic(P, BOTH), NAMES, START, starts=1)


@pytest.fixture(scope="module")
def of_speed():
    """The speed alone, from flow and concentration."""
    return am.fit(am.synthetic(P, BOTH), ["v_p0"], P, starts=1)


@pytest.mark.parametrize("name", ["u", "c", "zeta0", "max_retrograde_speed", "deformation"])
def test_sensitivities_are_those_of_states_solved_anew(state, name):
    theta = np.deg2rad([0, 20, 70, 110, 160, 180]) if name in ("u", "c") else None
    slopes = prediction(state, name, theta).slopes
    for k in range(len(NAMES)):
        step = 1e-3 * np.eye(len(NAMES))[k]
        values = [prediction(state.at(m * step), name, theta).values for m in (1, -1, 2, -2)]
        expected = (8 * (values[0] - values[1]) - (values[2] - values[3])) / 12e-3
        np.testing.assert_allclose(slopes[:, k], expected, atol=1e-6 * np.abs(slopes).max())


def test_theta_is_the_angle_at_the_center_of_volume_from_the_front(state):
    solution = state.solution
    theta = np.deg2rad([0, 1, 50, 90, 130, 179, 180])
    np.testing.assert_allclose(angles(solution, arclengths(solution, theta)), theta, atol=1e-11)
    c = prediction(state, "c", np.array([0.0, np.pi])).values
    assert c == pytest.approx([solution.c_front, solution.c_rear], rel=1e-9)
    x, points = solution.cell.shape.grid.x, solution.cell.x
    expected = np.arctan2(points[:, 0], -points[:, 2])
    np.testing.assert_allclose(angles(solution, x), expected, atol=1e-11)


def test_no_state_is_found_beyond_the_fold(state):
    fold = 5.20960  # of am.branch(P, "v_p0", 0, 8)
    of_speed = FollowedState(P, ("v_p0",), np.zeros(1), state.solution)
    assert of_speed.at(np.log([1.01 * fold / P.v_p0])) is not None
    assert of_speed.at(np.log([0.999 * fold / P.v_p0])) is None


@pytest.mark.parametrize("free", [["D"], pytest.param(NAMES, marks=pytest.mark.slow)])
def test_parameters_are_found_again_without_noise(free):
    data = {k: v for k, v in am.synthetic(P, {"u": 1e-9, "c": 1e-9}).items() if "error" not in k}
    start = P.replace(**{name: START.value(name) for name in free})
    found = am.fit(data, free, start, starts=1)
    for name in NAMES:
        assert found.parameters.value(name) == pytest.approx(P.value(name), rel=1e-6)
    assert found.errors_estimated == ("u", "c")
    assert "estimated from the residuals" in repr(found.problems)


def test_flow_and_concentration_fix_four_parameters(found):
    assert found.converged
    assert found.problems == ()
    assert found.undetermined == ()
    assert 0.01 < found.p_value < 0.99
    interval = found.interval("D")
    assert interval.low < found.parameters.D < interval.high
    assert interval.holds(P.D)
    for name, error in found.relative_errors.items():
        assert error < 0.2
        assert abs(np.log(found.parameters.value(name) / P.value(name))) < 3 * error
    assert np.all(np.linalg.eigvalsh(found.correlation) > 0)


def test_the_fit_is_at_the_minimum(found):
    gradient = found.point.jacobian.T @ found.point.residuals
    assert np.abs(gradient / np.linalg.norm(found.point.jacobian, axis=0)).max() < 1e-2
    assert found.chi2 < found.point.residuals.size


def test_flow_alone_does_not_fix_D():
    p = am.Parameters()  # D = 0.03
    data = am.synthetic(p, {"u": 1e-9})
    data["u_error"][:] = 0.024 * 0.34  # of the largest flow
    found = am.fit(data, NAMES, p, starts=1)
    (open_,) = found.undetermined
    assert max(open_.powers, key=lambda name: abs(open_.powers[name])) == "D"
    assert open_.relative_sd > 3
    assert "D is not determined by these data" in open_.text
    assert found.interval("D").high is None


def test_a_change_of_units_is_named_as_such():
    found = am.fit(am.synthetic(P, {"u": 0.04}), ["v_p0", "c0", "c_r"], P, starts=1)
    (exact,) = found.undetermined
    assert exact.exact
    assert exact.powers == {"c0": 1.0, "c_r": 1.0}
    assert exact.text.startswith("multiplying c0 by 2 and c_r by 2 changes no predicted value")
    assert np.isinf(found.relative_errors["c0"])
    assert found.relative_errors["v_p0"] < 1
    assert np.isfinite(found.correlation).all()


@pytest.mark.slow
def test_all_intervals_hold_the_truth(found):
    for name, interval in found.intervals().items():
        assert interval.low < found.parameters.value(name) < interval.high
        assert interval.holds(P.value(name))


def test_arbitrary_units_have_a_factor_of_their_own(of_speed):
    data = am.synthetic(P, BOTH)
    data["c [a.u.]"], data["c_error [a.u.]"] = 7.0 * data.pop("c"), 7.0 * data.pop("c_error")
    found = am.fit(data, ["v_p0"], P, starts=1)
    assert found.unknowns[-1] == "factor of c"
    assert found.interval("factor of c", 0.999).holds(7.0)
    assert found.relative_errors["v_p0"] > of_speed.relative_errors["v_p0"]


def test_the_orientation_is_found():
    data = am.synthetic(P, BOTH)
    data["theta [deg]"] = 180 - data["theta [deg]"]
    found = am.fit(data, ["v_p0"], P, theta_from="unknown", starts=1)
    assert found.orientation[0] == "rear"
    same = am.fit(data, ["v_p0"], P, theta_from="rear", starts=1)
    assert found.chi2 == pytest.approx(same.chi2, rel=1e-9)
    with pytest.raises(am.InvalidInput, match="theta_from must be one of front, rear, unknown"):
        am.fit(data, ["v_p0"], P, theta_from="left")


def test_errors_are_estimated_from_the_residuals():
    data = am.synthetic(P, BOTH, theta=np.linspace(2, 178, 60))
    known = am.fit(data, ["v_p0"], P, starts=1)
    plain = {k: v for k, v in data.items() if "error" not in k}
    found = am.fit(plain, ["v_p0"], P, starts=1)
    assert found.p_value is None
    assert found.relative_errors["v_p0"] == pytest.approx(known.relative_errors["v_p0"], rel=0.25)
    for k, error in enumerate(BOTH.values()):
        # the standard deviation of an estimated error is 1/sqrt(2 * 60) = 9 %
        assert found.problem.targets[k].errors[0] == pytest.approx(error, rel=0.3)


@pytest.mark.parametrize("free", [["v_p0"], pytest.param(NAMES, marks=pytest.mark.slow)])
def test_the_fit_does_not_depend_on_units(free):
    begin = P.replace(**{name: START.value(name) for name in free})
    found = am.fit(am.synthetic(P, BOTH), free, begin, starts=1)
    there, start = in_units(P, SI).replace(law=P.law), in_units(begin, SI).replace(law=P.law)
    sizes = {"u": SI.of("L/T"), "c": SI.of("N/L^2")}
    data = am.synthetic(P, BOTH)
    moved = {k: v / sizes[k[0]] if k[0] in sizes else v for k, v in data.items()}
    again = am.fit(moved, free, start, starts=1)
    for name in free:
        ratio = again.parameters.value(name) / there.value(name)
        assert ratio == pytest.approx(found.parameters.value(name) / P.value(name), rel=1e-6)
    for name, error in found.relative_errors.items():
        assert again.relative_errors[name] == pytest.approx(error, rel=1e-5)


def test_cells_that_differ_are_told_apart():
    one, other = am.synthetic(P, BOTH), am.synthetic(P.replace(v_p0=6.6), BOTH, seed=1)
    same = am.synthetic(P, BOTH, seed=1)

    def together(a, b):
        count = len(a["u"])
        joined = {k: np.concatenate([a[k], b[k]]) for k in a}
        return am.fit(joined | {"cell": ["A"] * count + ["B"] * count}, ["v_p0"], P, starts=1)

    assert any("the cells differ" in text for text in together(one, other).problems)
    assert not any("the cells differ" in text for text in together(one, same).problems)


def test_a_model_that_does_not_fit_is_told():
    data = am.synthetic(P, BOTH)
    data["u"] = data["u"] * 1.3
    found = am.fit(data, ["v_p0"], P, starts=1)
    assert found.p_value < 1e-3
    assert "does not describe the data" in found.problems[0]


def test_a_best_fit_at_the_fold_is_told():
    slow = {"max_retrograde_speed": [0.5], "max_retrograde_speed_error": [0.01]}  # fold: 0.944
    found = am.fit(slow, ["v_p0"], P, starts=1)
    assert found.found.edge
    assert "where the polarized state ends" in found.problems[0]
    assert "there are as many unknowns as values" in found.problems[1]
    assert found.parameters.v_p0 == pytest.approx(5.2096, rel=5e-3)
    interval = found.interval("v_p0")
    assert interval.low is None
    assert "the polarized state ends before chi2 has risen enough" in interval.notes


def test_a_value_far_from_all_others_is_named(of_speed):
    data = am.synthetic(P, BOTH)
    data["u"][4] += 1.0
    found = am.fit(data, ["v_p0"], P, starts=1)
    (told,) = [text for text in found.problems if "look for outliers" in text]
    value = f"u = {data['u'][4]:.4g} at theta = 45 deg from the front is 24"  # 1.0/0.04 is 25
    assert told.startswith(value)
    assert not any("outliers" in text for text in of_speed.problems)


def test_data_that_depend_on_nothing_end_the_search_at_once():
    tried = []
    pole = {"theta [deg]": [0, 180], "u": [0.3, 0.3], "u_error": [0.04, 0.04]}  # it is 0 there
    found = am.fit(pole, ["v_p0"], P, starts=1, watch=lambda progress: tried.append(progress))
    assert len(tried) <= 2
    assert "v_p0 is not determined by these data" in found.undetermined[0].text
    assert found.interval("v_p0").notes == ("the data do not determine it",)


def test_a_bound_is_told():
    found = am.fit(am.synthetic(P, BOTH), ["v_p0"], START, bounds={"v_p0": (6.2, 7.0)}, starts=1)
    assert found.at_bounds == ("v_p0",)
    assert found.parameters.v_p0 == pytest.approx(6.2, rel=1e-12)


def test_the_result_shows_itself_and_pickles(found):
    assert len(repr(found)) < 1000
    assert repr(pickle.loads(pickle.dumps(found))) == repr(found)  # noqa: S301
    table = found.to_pandas()
    assert list(table.index) == list(NAMES)
    axes = Figure().add_subplot()
    assert found.plot(axes, "c") is axes
    assert found._repr_html_().count("<img") == 2
    band = found.profile("u", [30, 90])
    assert band["u"].values.shape == band["u_error"].values.shape == (2,)
    assert np.all(band["u_error"].values < 0.04)


def test_the_same_fit_has_the_same_bits(of_speed):
    again = am.fit(am.synthetic(P, BOTH), ["v_p0"], P, starts=1)
    assert of_speed.parameters == again.parameters
    assert of_speed.chi2 == again.chi2


@pytest.mark.slow
def test_further_starts_are_the_same_each_time():
    one, other = (am.fit(am.synthetic(P, BOTH), ["v_p0"], P, starts=2) for _ in range(2))
    assert one.parameters == other.parameters
    assert one.chi2 == other.chi2


@pytest.mark.parametrize(
    ("free", "start", "message"),
    [
        (["Dd"], P, "unknown parameter 'Dd'; did you mean D. allowed: "),
        ([], P, "free must name at least one parameter"),
        (["D", "D"], P, "free must name each parameter once"),
        (
            ["alpha"],
            P,
            "a free parameter must not start at 0 because it is varied by a factor, alpha does",
        ),
        (
            ["D"],
            P.replace(v_p0=2.0),
            r"v_p0 = 2 has none \(threshold 6.02566\); choose v_p0 slightly above",
        ),
        (["D"], am.Parameters.physical(), "u must have a unit because the parameters have"),
        (["D"], 0.4, "p must be amoeboid.Parameters"),
        (NAMES, P, "data must hold at least 4 values for D, v_p0, c0, beta, got 3"),
    ],
)
def test_what_cannot_be_fitted_is_refused(free, start, message):
    data = am.synthetic(P, {"u": 0.04}, theta=[30, 90, 150])
    with pytest.raises(am.InvalidInput, match=message):
        am.fit(data, free, start)


def test_values_beyond_all_measure_are_refused():
    with pytest.raises(am.InvalidInput, match="values must be within 150 orders of magnitude"):
        am.fit({"theta [deg]": [90, 100], "u": [1e200, 1], "u_error": [1, 1]}, ["D"], P)


def test_a_flow_of_the_other_sign_is_told():
    data = am.synthetic(P, {"u": 0.04})
    data["u"] = -data["u"]
    assert "u is negative on average" in repr(am.fit(data, ["v_p0"], P, starts=1).problems)


def test_a_parameter_of_a_law_is_found():
    hill = am.Parameters(D=0.4, v_p0=9.5, law=am.Custom("v_p0/(1 + (c/c_r)**n)", n=3.0))
    data = am.synthetic(hill, {"c": 0.05})
    found = am.fit(data, ["law.n"], hill.replace(**{"law.n": 2.9}), starts=1)
    assert found.parameters.value("law.n") == pytest.approx(
        3.0, rel=3.5 * found.relative_errors["law.n"]
    )


@dataclass(frozen=True)
class Saturating(am.Stress):
    """A stress of a user, whose parameters are fitted."""

    strength: float = 0.4
    half: float = 3.0
    name = "saturating"

    def value(self, c, c_r):
        """It grows with c, and no further than strength*half."""
        return self.strength * c / (1 + c / (self.half * c_r))


def power(c, v_p0, c_r, m=1.2):
    """A law of a user."""
    return v_p0 * (1 + c / c_r) ** -m


OWN = {
    "chi": P.replace(v_p0=4.5, chi=0.3),
    "gamma_t": P.replace(v_p0=6.5, gamma_t=5.0),
    "law.m": P.replace(v_p0=8.5, law=power),
    "stress.strength": P.replace(v_p0=5.0, stress=Saturating()),
}


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) for n in OWN])
def test_intervals_of_forces_and_of_laws_of_a_user_hold_the_truth(name):
    p = OWN[name]
    held = 0
    for seed in range(6):
        found = am.fit(am.synthetic(p, BOTH, seed=seed), [name, "D"], p, starts=1)
        assert found.converged
        held += found.interval(name).holds(p.value(name))
    assert held >= 4  # of intervals of 95 %, fewer in 1 of 450 tests


@pytest.mark.parametrize("name", OWN)
def test_parameters_of_forces_and_of_laws_of_a_user_are_found(name):
    p = OWN[name]
    exact = {k: v for k, v in am.synthetic(p, {"c": 1e-9}).items() if "error" not in k}
    found = am.fit(exact, [name], p.replace(**{name: 0.97 * p.value(name)}), starts=1)
    assert found.parameters.value(name) == pytest.approx(p.value(name), rel=1e-5)


def test_a_range_of_what_the_data_do_not_determine_ends_where_it_was_sought():
    p = P.replace(kappa=1.0)
    found = am.fit(am.synthetic(p, {"c": 0.3}), ["kappa"], p, starts=1)
    assert found.relative_errors["kappa"] > 1000
    assert found.text("kappa") == "0.001 to 1e+03"


def test_a_fraction_is_not_sought_above_1():
    p = P.replace(v_p0=6.5, gamma_t=1.0, gamma_share=0.5)
    found = am.fit(am.synthetic(p, {"c": 0.3}), ["gamma_share"], p, starts=1)
    assert found.text("gamma_share").endswith(" to 1")
    with pytest.raises(am.InvalidInput, match="below its largest value, 1 of gamma_share, got 1;"):
        am.fit(am.synthetic(P, {"c": 0.3}), ["gamma_share"], p.replace(gamma_share=1.0))


def test_progress_tells_values_in_the_units_of_the_user():
    told = []
    cell = am.Parameters.physical(v_p0="2 um/s")
    data = am.synthetic(cell, {"u": "0.01 um/s"}, theta=[45, 90, 135])
    am.fit(data, ["D"], cell, starts=1, watch=lambda progress: told.append(progress))
    assert told[0].value == pytest.approx(cell.quantity(cell.D, "L^2/T").to("um^2/s").magnitude)


def test_units_need_parameters_with_units():
    with pytest.raises(am.InvalidInput, match="start must have units because the data have"):
        am.fit({"theta [deg]": [30, 90], "u [um/s]": [0.1, 0.2]}, ["D"], P)

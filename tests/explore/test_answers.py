"""What the page shows of a parameter point: curves, states, verdicts, and the page in one file."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

import amoeboid as am
from amoeboid.explorer.along import curves, nearest_window, states_at
from amoeboid.explorer.answers import Answers, Kept
from amoeboid.explorer.files import content, live_page, offline_page
from amoeboid.explorer.point import parameters_of
from amoeboid.explorer.presets import PRESETS, SLIDERS, offered
from amoeboid.explorer.words import verdict
from amoeboid.studies.theory import theories

P = am.Parameters(D=0.4, v_p0=5.5)


@pytest.fixture(scope="module")
def branch():
    return am.branch(P, "v_p0", 0, 9, max_step=0.3)


def test_states_between_the_points_are_those_of_the_search(branch):
    for v_p0 in (5.5, 5.25):  # 5.25 is near the fold at 5.20960
        searched = am.steady_states(P.replace(v_p0=v_p0), (1,))[1:]
        found, problems = states_at(branch, v_p0)
        assert problems == []
        for a, b in zip(found, searched, strict=True):
            assert a.number("c_rear") == pytest.approx(b.number("c_rear"), rel=1e-8)
            assert a.stable == b.stable
    assert states_at(branch, 5.0) == ([], [])


def test_curves_pass_through_the_states_and_are_cut_at_folds(branch):
    found = curves(branch, ("max_retrograde_speed",))
    assert [curve.stable for curve in found] == [False, True]
    unstable, stable = found
    assert unstable.x[-1] == pytest.approx(branch.folds[0].number, rel=1e-12)
    assert stable.x[0] == unstable.x[-1]
    # it begins at the threshold, on the sphere
    assert unstable.x[0] == pytest.approx(branch.thresholds[0], rel=1e-9)
    assert unstable.y["max_retrograde_speed"][0] == pytest.approx(0.0, abs=1e-9)
    state = states_at(branch, 7.0)[0][0]
    speed = np.interp(7.0, stable.x, stable.y["max_retrograde_speed"])
    assert speed == pytest.approx(state.number("max_retrograde_speed"), rel=2e-3)


@pytest.mark.parametrize(("v_p0", "threshold", "end"), [(5.0, 6.0, 9.0), (9.0, 6.0, 14.0)])
def test_the_window_shows_the_point_and_stays_while_it_is_inside(v_p0, threshold, end):
    assert nearest_window(P.replace(v_p0=v_p0), threshold) == pytest.approx(end, abs=0.5)
    with pytest.raises(am.InvalidInput, match="v_p0 must be > 0"):
        nearest_window(P.replace(v_p0=0.0), None)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"D": 0.4, "v_p0": 6.5}, "A resting cell polarizes"),
        ({"D": 0.4, "v_p0": 4.0}, "stays at rest"),
        ({"D": 0.4, "v_p0": 4.0, "delta_P": 2.0}, r"(stays at rest|deforms)"),
    ],
)
def test_the_verdict_is_that_of_the_theory(values, words):
    assert re.search(words, " ".join(verdict(am.theory(am.Parameters(**values)))))


@pytest.mark.slow
def test_answers_are_the_same_in_other_units():
    cell = am.Parameters.physical(
        D="4 um^2/s", v_p0="5.5 um/s", delta_P="8100 Pa", c0="2917.7272 / um^2"
    )
    plain = replace(cell, units=None)
    one, other = (
        {a["kind"]: a for a in Answers().of(p, "v_p0", lambda _: None)} for p in (cell, plain)
    )
    factor = float(cell.quantity(1.0, "L/T").magnitude)
    for name in ("max_retrograde_speed", "cortex_drag_speed"):
        a, b = ([s["numbers"][name] for s in found["states"]["states"]] for found in (one, other))
        assert np.allclose(a, factor * np.array(b), rtol=1e-4)
    assert one["branch"]["unit"] == "um/s"


@pytest.mark.slow
def test_a_branch_in_another_parameter_and_its_refusal():
    found = {a["kind"]: a for a in Answers().of(P.replace(v_p0=7.0), "alpha", lambda _: None)}
    assert "alpha must be > 0" in found["branch"]["problems"][0]
    assert found["states"]["states"][0]["rest"]


def test_only_the_latest_results_are_kept():
    kept, made = Kept(2), []
    for key in (1, 2, 1, 3, 1, 2):
        kept.get(key, lambda key=key: made.append(key))
    assert len(kept) == 2
    assert made == [1, 2, 3, 2]  # 1 was used in between


def test_a_computation_ends_by_an_exception_of_its_watch():
    class Stop(Exception):
        pass

    def watch(_):
        raise Stop

    answers = Answers().of(P, "v_p0", watch)
    assert next(answers)["kind"] == "theory"
    with pytest.raises(Stop):
        next(answers)


@pytest.mark.parametrize(
    "p",
    [
        am.Parameters.physical(D="0.3 um^2/s"),
        P.replace(gamma_t=0.3, delta_P=8.0),
        P.replace(law="v_p0/(1 + (c/c_r)**2)", kappa=0.1),
    ],
    ids=["physical", "friction", "law"],
)
def test_the_theory_at_several_speeds_is_that_of_each(p):
    speeds = [p.v_p0 * factor for factor in (0.5, 1.6)]
    for found, v_p0 in zip(theories(p, speeds), speeds, strict=True):
        alone = am.theory(p.replace(v_p0=v_p0))
        assert found.parameters == alone.parameters
        assert found.parameters.units == p.units
        assert repr(found.summary) == repr(alone.summary)


def test_presets_and_sliders_are_parameters():
    for preset in PRESETS:
        p = parameters_of(preset.units, preset.values)
        assert all(slider.low <= p.value(slider.name) <= slider.high for slider in SLIDERS), preset
    json.dumps(offered(), allow_nan=False)


def test_the_page_names_no_host_and_data_cannot_end_its_element():
    page, _ = live_page(1)
    assert b"http" not in page
    for name in ("app.js", "plots.js", "sources.js", "cell.js", "style.css"):
        links = re.findall(rb"https?://[^\"'` )]+", content(name))
        assert set(links) <= {b"http://www.w3.org/2000/svg"}  # the name of SVG, not an address
    hostile = offline_page({"title": "</script><script>alert(1)</script>"})
    assert b"</script><script>alert" not in hostile

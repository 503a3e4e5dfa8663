"""The stages of a step: those that the code calls, in the order of the paper's algorithm."""

import inspect
import sys

import pytest

from amoeboid import Parameters, figures
from amoeboid.figures.gallery import s_procedure
from amoeboid.surface import explicit, stepping
from figures.drawn import drawn


@pytest.fixture(scope="module")
def stages():
    """Those of both schemes, on 42 nodes."""
    return {name: s_procedure.measured(Parameters(), name, 1) for name in s_procedure.SCHEMES}


def names(part, within):
    return [s["function"] for s in part["stages"] if s["within"] == within]


def test_explicit_stages_follow_the_algorithm_of_the_paper(stages):
    """SI sec_numerics_supplement: geometry, v_p, force balance, concentration, redistribution."""
    found = names(stages["explicit"], "explicit_step")
    order = ["geometry", "Model.v_p", "constrained_flow", "lagrangian_rate", "redistribution"]
    assert [name for name in found if name in order] == order
    assert found.index("interpolated") > found.index("redistribution")


@pytest.mark.parametrize(
    ("scheme", "step"),
    [("explicit", explicit.explicit_step), ("semi-implicit", stepping.semi_implicit_step)],
)
def test_every_stage_is_called_by_the_step(stages, scheme, step):
    source = inspect.getsource(step)
    found = names(stages[scheme], step.__name__)
    assert len(found) >= 9
    for name in found:
        assert f"{name.rpartition('.')[2]}(" in source


def test_implicit_equations_are_solved_in_an_iteration(stages):
    iterated = {s["function"] for s in stages["semi-implicit"]["stages"] if s["iterated"]}
    assert {"force_balance", "area_preserving_move", "_concentration", "_converged"} <= iterated
    assert "factorized_cortex" not in iterated
    assert not any(s["iterated"] for s in stages["explicit"]["stages"])
    (balance,) = (s for s in stages["semi-implicit"]["stages"] if s["function"] == "force_balance")
    assert balance["calls"] >= 2


def test_a_stage_gives_what_its_line_assigns(stages):
    gives = {s["function"]: s["gives"] for s in stages["explicit"]["stages"]}
    assert gives["constrained_flow"] == "v_c, zeta0"
    assert gives["geometry"] == "g"
    assert gives["check_step"] == ""


def test_times_of_stages_are_within_that_of_the_step(stages):
    for part in stages.values():
        shares = [s["share"] for s in part["stages"]]
        assert all(0 < share < 1 for share in shares)
        assert sum(shares) < 1.05  # medians need not add up exactly
        assert part["step"] > 0


def test_watching_a_step_leaves_no_profiler_behind():
    def fails():
        raise ValueError
        yield

    before = sys.getprofile()
    watch = s_procedure.Watch()
    with pytest.raises(ValueError):  # noqa: PT011
        watch.step(fails())
    assert sys.getprofile() is before


def test_figure_lists_both_schemes(monkeypatch):
    monkeypatch.setattr(s_procedure, "SUBDIVISIONS", 1)
    data = figures.s_procedure.data()
    assert set(data["stages"]["scheme"]) == set(s_procedure.SCHEMES)
    assert data["stages"].unit("time") == "ms"
    assert "differ from run to run" in data.notes[-1]
    panels = drawn(figures.s_procedure, data)
    for panel, scheme in zip(panels, s_procedure.SCHEMES, strict=True):
        rows = data["stages"]["scheme"] == scheme
        boxes = [text.get_text() for text in panel.texts if text.get_family() == ["monospace"]]
        names_ = [name.lstrip("_") for name in data["stages"]["function"][rows]]
        assert [words.split(" ")[0] for words in boxes] == names_
        words = {text.get_text() for text in panel.texts}
        assert ("iteration" in words) == (scheme == "semi-implicit")
        assert "time step" in words

"""What long computations report while they run, and where the commands show it."""

import sys

import numpy as np
import pytest

from amoeboid.axisymmetric.branches import branch_from_sphere
from amoeboid.axisymmetric.phase_diagram import fold_line, phase_column
from amoeboid.axisymmetric.search import steady_solutions
from amoeboid.axisymmetric.window import Window
from amoeboid.cli.main import main
from amoeboid.cli.progress import shown
from amoeboid.model.parameters import Parameters
from amoeboid.numerics.branch_points import Options, through
from amoeboid.numerics.continuation import follow


def test_a_branch_reports_every_point_and_then_its_stability():
    steps = []
    options = Options(parameter_scale=5.0, max_step=0.4)
    p, window = Parameters(D=0.4), Window(0.0, 6.5)
    branch = branch_from_sphere(p, "v_p0", window, options=options, watch=steps.append)
    followed = [s for s in steps if s.task == "branch"]
    assert [s.points for s in followed] == list(range(1, len(followed) + 1))
    assert {s.name for s in steps} == {"v_p0"}
    values = [b.value for b in branch.points]
    assert set(values[:-1]) <= {s.value for s in followed}
    assert [s.value for s in steps if s.task == "stability"] == values[1:]
    assert steps[-1].modes == branch.points[-1].state.n


def test_a_search_reports_each_branch_it_follows():
    steps = []
    steady_solutions(Parameters(), watch=steps.append)
    assert {s.task for s in steps} == {f"searching along l = {k}" for k in (1, 2, 3)}


def test_the_fold_line_reports_its_points():
    p, values = Parameters(D=0.4), np.array([0.3, 0.4])
    column = phase_column(p, 0.4, np.array([4.5, 5.5]))
    steps = []
    pairs, _ = fold_line(p, "D", values, column, steps.append)
    line = {value for value, _ in pairs}
    reported = {s.value for s in steps if s.task == "fold line" and s.name == "D"}
    assert len(line - reported) == 1  # the point it starts from
    assert len(line) > 2


COMMANDS = [
    ("steady",),
    ("branch", "--set", "D=0.4", "--to", "6", "--max-step", "0.4"),
    ("branch", "--set", "D=0.4", "--set", "v_p0=6", "--vary", "delta_P", "--to", "250"),
]


@pytest.mark.parametrize("words", COMMANDS)
def test_a_terminal_sees_progress_and_a_file_does_not(capsys, monkeypatch, words):
    assert main([*words, "--json"]) == 0
    plain = capsys.readouterr()
    assert plain.err == ""
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    assert main([*words, "--json"]) == 0
    seen = capsys.readouterr()
    assert seen.out == plain.out
    assert "v_p0 = " in seen.err or "delta_P = " in seen.err
    assert "modes" in seen.err


def test_nothing_is_shown_without_a_terminal(capsys):
    from amoeboid.axisymmetric.progress import unwatched

    with shown() as watch:
        assert watch is unwatched
    assert capsys.readouterr() == ("", "")


class Hyperbola:
    """x q = 1: as q tends to zero the solution grows without bound."""

    weights = scale = np.ones(1)

    def residual(self, x, q):
        return x * q - 1.0

    def residual_and_jacobian(self, x, q):
        return self.residual(x, q), np.array([[q[0]]])

    def resolved(self, x, q):
        return True


def test_steps_grow_with_the_state():
    options = Options(max_step=0.1, max_points=200)
    start = through(Hyperbola(), np.ones(1), 1.0, -1.0, options)
    values = [point.parameter for point in follow(start, options)]
    assert min(values) < 1e-3  # at steps of 0.1 throughout, 200 of them end at x = 21
    lengths = np.diff([point.length for point in follow(start, options)][:5])
    assert lengths.max() < 0.2

"""Lines of progress: on a terminal, in a notebook, and nowhere else."""

import sys

import amoeboid as am
from amoeboid import terminal


def short_run(**keywords):
    p = am.Parameters(D=0.4, v_p0=6.0)
    return am.simulate(p, mesh=am.Icosphere(1), until=am.time(0.3), observe="c_rear", **keywords)


def on_a_terminal(monkeypatch):
    """The standard error that a test has now is a terminal."""
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)


def test_a_run_is_quiet_where_there_is_no_terminal(capsys):
    for progress in (None, True, False):
        short_run(progress=progress)
    assert capsys.readouterr() == ("", "")


def test_a_terminal_sees_a_line_and_a_short_run_shows_none(capsys, monkeypatch):
    on_a_terminal(monkeypatch)
    monkeypatch.setattr(terminal, "BETWEEN", 0.0)
    short_run(progress=True)
    shown = capsys.readouterr().err
    assert "t = " in shown
    assert "of at most 0.3" in shown
    assert shown.endswith(terminal.ERASE)
    for progress in (None, False):
        short_run(progress=progress)
        assert "t = " not in capsys.readouterr().err


class Display:
    """What IPython's `display` does, on a list."""

    def __init__(self):
        self.lines, self.pages = [], []

    def __call__(self, text, **_):
        self.update(text)
        return self

    def update(self, text, **_):
        self.lines.append(text["text/plain"])
        self.pages.append(text["text/html"])


def test_a_notebook_sees_one_line_that_is_replaced_and_erased(capsys, monkeypatch):
    display = Display()
    monkeypatch.setattr(terminal, "_notebook", lambda: display)
    monkeypatch.setattr(terminal, "BETWEEN", 0.0)
    short_run(progress=True)
    assert len(display.lines) > 2
    assert display.lines[0].startswith("t = ")
    assert display.lines[-1] == ""
    assert capsys.readouterr() == ("", "")


def test_a_line_of_a_notebook_leaves_no_empty_box_and_shows_its_text_as_it_is(monkeypatch):
    display = Display()
    monkeypatch.setattr(terminal, "_notebook", lambda: display)
    with terminal.shown_line() as show:
        show(["c < 2"])
    assert display.lines == ["c < 2", ""]
    assert display.pages == ["<pre>c &lt; 2</pre>", ""]  # HTML of nothing takes no room


def test_a_function_of_your_own_gets_the_rows():
    rows = []
    run = short_run(progress=rows.append)
    assert rows == list(run.rows[1:])
    assert "c_rear" in rows[-1]
    assert "c_front" not in rows[-1]

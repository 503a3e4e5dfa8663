"""What all figures share: names, tables as files, results that are kept."""

import csv
import functools
import importlib
import json
import pickle
import sys
from pathlib import Path

import numpy as np
import pytest

from amoeboid import InvalidInput, Parameters, figures
from amoeboid.cli.main import main
from amoeboid.figures.figure import Figure, checked_formats
from amoeboid.figures.results import Results
from amoeboid.figures.tables import FigureData, Table, column_of, label, unit_of
from amoeboid.identity.sources import used_files

calls = []


def squares(p, count):
    calls.append(count)
    return {"v": [p.v_p0 * k * k for k in range(count)]}


def compute(p, results):
    v = results.of(squares, p, 4, task="squares")["v"]
    table = Table("squares", {"k": column_of(p, range(4)), "v": column_of(p, v, "L/T")})
    return FigureData(p, {"squares": table}, ("four of them",))


def draw(data, axes):
    axes.plot(data["squares"]["k"], data["squares"]["v"])


OWN = Figure("own", "squares", "not in the paper", Parameters(), compute, draw)


@pytest.fixture(autouse=True)
def _no_calls():
    calls.clear()


def rows(path):
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return list(csv.reader(lines))


def test_every_figure_has_the_name_of_its_module_and_says_what_it_shows():
    for name in figures.names():
        found = figures.named(name)
        assert found is getattr(figures, name)
        assert found.name == name
        assert found.title
        assert found.source
        assert len(found.title) <= 70, name


def test_figures_of_the_main_text_are_listed_first():
    names = [name for name in figures.names() if name.startswith("fig")]
    assert list(figures.names())[: len(names)] == names


def test_an_unknown_figure_is_rejected_with_the_nearest_name():
    with pytest.raises(InvalidInput, match="did you mean fig3a"):
        figures.named("fig3A")
    with pytest.raises(AttributeError):
        figures.fig77  # noqa: B018


def test_a_table_is_written_with_its_units_and_read_back_exactly(tmp_path):
    written = OWN.save(tmp_path, parameters=Parameters(v_p0=0.1))
    assert [path.name for path in written] == ["own.csv", "own.png"]
    titles, *values = rows(written[0])
    assert titles == ["k", "v [R0 beta]"]
    assert [float(v) for _, v in values] == [0.1 * k * k for k in range(4)]
    assert "four of them" in written[0].read_text()


def test_a_result_is_computed_once(tmp_path):
    first = OWN.save(tmp_path)[0].read_bytes()
    assert OWN.save(tmp_path)[0].read_bytes() == first
    assert calls == [4]
    OWN.save(tmp_path, parameters=Parameters(v_p0=2.0))
    assert calls == [4, 4]
    OWN.data(results=Results(tmp_path, again=True))
    assert calls == [4, 4, 4]


def test_a_damaged_result_is_computed_again(tmp_path):
    OWN.save(tmp_path)
    (kept,) = (tmp_path / ".computed").iterdir()
    for text in ("", "{", "[]", json.dumps({"key": "another", "result": 1})):
        calls.clear()
        kept.write_text(text)
        assert OWN.data(results=Results(tmp_path))["squares"]["v"][3] == 9 * 3.8
        assert calls == [4]


def test_a_function_of_a_notebook_is_computed_each_time(tmp_path):
    # It has the name of the one before, and no file tells them apart.
    for value in (1, 2):
        cell = {"__name__": "no_file_holds_this"}
        exec(f"def answer():\n    return {value}", cell)  # noqa: S102
        assert Results(tmp_path).of(cell["answer"], task="answer") == value
        assert Results().of(cell["answer"], task="answer") == value


def made_by(value):
    def made():
        return value

    return made


class Holder:
    def __init__(self, value):
        self.value = value

    def method(self):
        return self.value


def test_a_function_that_its_name_does_not_tell_from_others_is_computed_each_time(tmp_path):
    for first, second in (
        (made_by(1), made_by(2)),
        (lambda: 1, lambda: 2),
        (Holder(1).method, Holder(2).method),
        (functools.partial(int, 1), functools.partial(int, 2)),
    ):
        for results in (Results(), Results(tmp_path)):
            assert results.of(first, task="first") == 1
            assert results.of(second, task="second") == 2


@pytest.fixture
def own_package(tmp_path, monkeypatch):
    """A package of the user: figures, what they import, and what they do not."""
    texts = {
        "__init__": "",
        "model": "from .numbers import N\n\ndef answer():\n    return N\n",
        "numbers": "N = 1\n",
        "figures": "def f():\n    from ownlab import model\n    return model.answer()\n",
        "other": "M = 1\n",
    }
    folder = tmp_path / "code" / "ownlab"
    folder.mkdir(parents=True)
    for name, text in texts.items():
        (folder / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(folder.parent)
    monkeypatch.setattr("sys.dont_write_bytecode", True)
    yield folder
    for name in [name for name in sys.modules if name.partition(".")[0] == "ownlab"]:
        del sys.modules[name]


def test_a_result_depends_on_what_its_file_imports_directly_or_not(own_package, tmp_path):
    from ownlab import figures as own

    assert Results(tmp_path).of(own.f, task="f") == 1
    (own_package / "other.py").write_text("M = 2\n")
    before = sorted((tmp_path / ".computed").iterdir())
    assert Results(tmp_path).of(own.f, task="f") == 1
    assert sorted((tmp_path / ".computed").iterdir()) == before
    (own_package / "numbers.py").write_text("N = 22\n")
    for name in ("numbers", "model"):
        importlib.reload(sys.modules[f"ownlab.{name}"])
    assert Results(tmp_path).of(own.f, task="f") == 22


def test_kept_results_of_figures_depend_on_the_modules_of_figures_that_they_import():
    from amoeboid.figures import computed
    from amoeboid.figures.gallery import extra_pressure

    def files(module):
        return {path.name for path in used_files(Path(module.__file__).resolve(), module.__name__)}

    assert {"extra_pressure.py", "computed.py"} < files(extra_pressure)
    assert "tables.py" in files(computed)
    assert "drawing.py" not in files(computed)
    assert "fig3c.py" not in files(extra_pressure)


def test_results_of_cells_in_other_units_are_kept_apart(tmp_path):
    p = Parameters.physical()
    first = OWN.data(p, Results(tmp_path))
    second = OWN.data(p.replace(v_p0=2 * p.v_p0), Results(tmp_path))
    assert first["squares"].unit("v") == "um/s"
    np.testing.assert_allclose(second["squares"]["v"], 2 * first["squares"]["v"], rtol=1e-15)


def test_pictures_are_the_same_bytes_each_time(tmp_path):
    one = OWN.save(tmp_path / "a", ("png", "pdf", "svg"))[1:]
    two = OWN.save(tmp_path / "b", ("png", "pdf", "svg"))[1:]
    assert [path.read_bytes() for path in one] == [path.read_bytes() for path in two]


def test_a_figure_draws_on_axes_of_the_user():
    from matplotlib.figure import Figure as Canvas

    axes = Canvas().subplots()
    assert OWN(ax=axes) is axes
    assert len(axes.lines) == 1
    with pytest.raises(InvalidInput, match="axes of matplotlib"):
        OWN(ax=3)
    with pytest.raises(InvalidInput, match="parameters"):
        OWN(ax=axes, parameters=3)
    with pytest.raises(InvalidInput, match="png, pdf, svg"):
        OWN.save(formats=["jpg"])


def test_formats_of_pictures_may_be_capitals():
    assert checked_formats(["PNG", "png", "Svg"]) == ["png", "svg"]
    assert checked_formats("PDF") == ["pdf"]
    with pytest.raises(InvalidInput, match="must be one of png, pdf, svg, got 3"):
        checked_formats([3])


def test_units_are_those_of_the_paper_only_where_they_hold():
    assert unit_of(Parameters(), "L/T") == "R0 beta"
    assert unit_of(Parameters(beta=0.5), "L/T") == "L/T"
    assert unit_of(Parameters.physical(), "L/T") == "um/s"
    assert label("v", "um^2/s") == "v [µm$^{2}$/s]"


def test_list_of_figures_fits_a_terminal_of_80_columns(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["figure"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == len(figures.names()) + 2
    assert max(map(len, lines)) <= 80


def test_a_grid_of_axes_is_taken_as_subplots_gives_it():
    from matplotlib.figure import Figure as Canvas

    axes = Canvas().subplots(2, 2)
    assert figures.fig1(ax=axes) == list(axes.flat)
    with pytest.raises(InvalidInput, match="4 axes"):
        figures.fig1(ax=axes[:1])


def test_figures_and_their_numbers_pickle_and_have_short_texts():
    data = figures.fig1.data()
    again = pickle.loads(pickle.dumps(data))  # noqa: S301  (our own)
    for name, table in data.items():
        assert again[name].csv([]) == table.csv([])
        assert len(repr(table)) < 1000
    assert "cell" in repr(data)
    assert "v_laboratory_x [R0 beta]" in repr(data["cell"])
    assert len(repr(data)) < 1000
    assert pickle.loads(pickle.dumps(figures.fig1)).name == "fig1"  # noqa: S301  (our own)

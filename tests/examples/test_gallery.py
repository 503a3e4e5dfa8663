"""The scripts of the gallery run without a warning, draw, and check what they show."""

import re

import pytest

from examples.execution import SCRIPTS, assertions, run_script

QUICK = ("plot_02_growth_rates",)
NEEDS = {"plot_13_sweep": "xarray", "plot_15_paraview": "pyvista", "plot_16_many_cells": "jax"}
MAX_LINES = 100


def test_the_gallery_is_complete():
    names = [path.stem for path in SCRIPTS]
    assert len(names) >= 14
    assert [name[:8] for name in names] == [f"plot_{k:02}_" for k in range(1, len(names) + 1)]
    assert set(QUICK) | set(NEEDS) <= set(names)


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_has_a_title_a_figure_and_ends_in_a_check(path):
    text = path.read_text(encoding="utf-8")
    title, rule = text.splitlines()[1:3]
    assert set(rule) == {"="}
    assert len(rule) >= len(title)
    assert "plt.show()" in text
    *_, check = text.split("# %%\n")
    assert check.startswith("# **Check.**")
    assert assertions(check) > 0
    assert len(text.splitlines()) <= MAX_LINES


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_a_figure_is_made_and_shown_in_one_cell(path):
    """The site takes the figures of a cell when the cell ends: what follows would not be seen."""
    cells = path.read_text(encoding="utf-8").split("# %%\n")
    made = [k for k, cell in enumerate(cells) if re.search(r"plt\.(subplots|figure)\(", cell)]
    shown = [k for k, cell in enumerate(cells) if "plt.show()" in cell]
    assert made == shown


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_names_no_place_of_a_machine(path):
    assert not re.search(r"/(home|tmp|work|Users)/", path.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, id=path.stem, marks=() if path.stem in QUICK else (pytest.mark.slow,))
        for path in SCRIPTS
    ],
)
def test_a_script_runs_and_what_it_checks_holds(path, tmp_path):
    needed = NEEDS.get(path.stem)
    if needed is not None:
        pytest.importorskip(needed, reason=f"{needed} is not installed")
    run_script(path, tmp_path)


def test_a_check_that_does_not_hold_fails(tmp_path):
    wrong = tmp_path / "wrong.py"
    wrong.write_text("assert 1 == 2\n")
    with pytest.raises(AssertionError, match="assert 1 == 2"):
        run_script(wrong, tmp_path)
    wrong.write_text("import warnings\nwarnings.warn('old')\n")
    with pytest.raises(AssertionError, match="UserWarning: old"):
        run_script(wrong, tmp_path)

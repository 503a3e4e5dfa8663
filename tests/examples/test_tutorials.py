"""The tutorials run as notebooks without a warning, show pictures, and check what they say."""

import pytest

from examples.execution import TUTORIALS, assertions, cells_of, run_tutorial

QUICK = ("first-cell",)
NAMES = (
    "bifurcations", "extending", "first-cell", "fit", "microscopy", "migration", "physical-units",
    "sweep",
)  # fmt: skip


def test_the_tutorials_are_complete():
    assert tuple(path.stem for path in TUTORIALS) == NAMES


@pytest.mark.parametrize("path", TUTORIALS, ids=lambda path: path.stem)
def test_a_tutorial_says_what_is_learned_checks_it_and_ends_in_exercises(path):
    text = path.read_text(encoding="utf-8")
    assert "**You will learn**" in text.split("```")[0]
    assert "## Exercises" in text
    assert sum(assertions(cell) for cell in cells_of(path)) >= 3


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, id=path.stem, marks=() if path.stem in QUICK else (pytest.mark.slow,))
        for path in TUTORIALS
    ],
)
def test_a_tutorial_runs_and_what_it_checks_holds(path, tmp_path):
    found = run_tutorial(path, tmp_path)
    cells = [cell.source for cell in found.cells if cell.cell_type == "code"][1:]
    assert [cell.strip() for cell in cells] == [cell.strip() for cell in cells_of(path)]
    outputs = [output for cell in found.cells for output in cell.get("outputs", ())]
    assert any("image/png" in output.get("data", {}) for output in outputs)

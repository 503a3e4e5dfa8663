"""The tutorials run as notebooks without a warning, show pictures, and check what they say."""

import pytest

from examples.execution import TUTORIALS, assertions, cells_of, run_tutorial

NEEDS = {"microscopy": "pyvista", "sweep": "xarray", "first-cell": "pandas"}
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


@pytest.mark.slow
@pytest.mark.parametrize("path", TUTORIALS, ids=lambda path: path.stem)
def test_a_tutorial_runs_and_what_it_checks_holds(path, tmp_path):
    needed = NEEDS.get(path.stem)
    if needed is not None:
        pytest.importorskip(needed, reason=f"{needed} is not installed")
    found = run_tutorial(path, tmp_path)
    cells = [cell.source for cell in found.cells if cell.cell_type == "code"][1:]
    assert [cell.strip() for cell in cells] == [cell.strip() for cell in cells_of(path)]
    outputs = [output for cell in found.cells for output in cell.get("outputs", ())]
    assert any("image/png" in output.get("data", {}) for output in outputs)


def test_a_check_of_a_notebook_that_does_not_hold_fails(tmp_path):
    exceptions = pytest.importorskip("nbclient.exceptions", reason="nbclient is not installed")
    head, _, _ = TUTORIALS[0].read_text(encoding="utf-8").partition("# Bifurcations")
    page = tmp_path / "page.md"
    page.write_text(head + "# A page\n\n```{code-cell} ipython3\nassert 1 == 2\n```\n")
    assert cells_of(page) == ["assert 1 == 2\n"]
    with pytest.raises(exceptions.CellExecutionError, match="AssertionError"):
        run_tutorial(page, tmp_path)

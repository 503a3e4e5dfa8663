"""docs/paper.md is complete and true: it has a row for every item of the paper (items.toml), its
numbers are those that the code gives (ours.py), and all that it names exists.
"""

import ast
import math
import re
import tomllib
from importlib import import_module, util
from pathlib import Path

import pytest

from amoeboid import figures
from paper import ours

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGE = (DOCS / "paper.md").read_text(encoding="utf-8")
SOURCE = Path(ours.__file__).read_text(encoding="utf-8")
ITEMS = tomllib.loads((Path(__file__).parent / "items.toml").read_text(encoding="utf-8"))["item"]
NUMBERS = {item["id"]: item for item in ITEMS if item["kind"] == "number"}
ANSWERED = [name for name in NUMBERS if hasattr(ours, name)]
SLOW = {  # each solves for steady states or a branch, for seconds
    "fig3A_agreement", "fig3B_fold", "fig3B_branches", "fig3D_speed", "fig3D_speed_3D",
    "fig3D_rear", "fig3D_deformation", "flow_speed_exact",
}  # fmt: skip
VERDICTS = (
    "agrees", "as eta_s", "c_r = mu h", "corrected: ", "definition", "differs: ", "input",
    "no number printed", "not a claim of the model", "own figure",
)  # fmt: skip
FIGURES = re.findall(r"`amoeboid figure (\w+)`", PAGE)
NOTHING = ("picture", "none")  # what the paper gives where it prints no number


def rows():
    """The rows of tables with a column `where`, in order: dicts by heads, and their `section`."""
    found, heads, section = [], None, ""
    for line in PAGE.splitlines():
        if line.startswith("## "):
            section, heads = line[3:], None
        elif not line.startswith("|"):
            heads = None
        elif heads is None:
            heads = cells(line)
        elif not line.startswith("|---") and "where" in heads:
            found.append(dict(zip(heads, cells(line), strict=True), section=section))
    return found


def cells(line):
    return [cell.strip() for cell in line.strip("|").split("|")]


ROWS = rows()


def place(entry):
    return entry["section"], entry["where"], entry["what"], entry.get("printed", entry.get("paper"))


ROW_AT = {place(row): row for row in ROWS}


def row_of(name):
    return ROW_AT[place(NUMBERS[name])]


def numbered(text):
    """(value, half of its last digit, rest) of a text that begins with a number."""
    found = re.match(r"(-?\d+(?:\.(\d*))?(?:e(-?\d+))?)(?: |$)", text)
    if found is None:
        return None
    last = 10.0 ** (int(found[3] or 0) - len(found[2] or ""))
    return float(found[1]), 0.5 * last, text[found.end() :]


def computed(name):
    """What the code gives for a number of the page, in the unit of its cell."""
    value = getattr(ours, name)()
    if hasattr(value, "m_as"):
        unit = numbered(row_of(name)["here"])[2].replace("%", "")
        return float(value.m_as(unit.replace("1/", "1 / ")))
    return value if isinstance(value, str) else float(value)


def test_every_item_of_the_paper_has_its_row_and_every_row_is_an_item():
    assert sorted(map(place, ROWS), key=str) == sorted(map(place, ITEMS), key=str)
    assert len(set(map(place, ITEMS))) == len(ITEMS)


@pytest.mark.parametrize(("start", "count"), [("Main text", 5), ("SI", 85)])
def test_equations_are_numbered_without_a_gap_and_every_label_is_there_once(start, count):
    """The paper has 5 equations in the main text and 85 in the supplement, 4 without a label."""
    equations = [
        i["where"] for i in ITEMS if i["kind"] == "equation" and i["section"].startswith(start)
    ]
    assert [int(re.match(r"\((\d+)\)", where)[1]) for where in equations] == [*range(1, count + 1)]
    labels = [where for where in equations if "`" in where]
    assert len(labels) == len(set(labels)) == count - (4 if start == "SI" else 0)


def test_every_figure_and_panel_of_the_paper_has_a_row():
    wanted = [f"`fig1` {panel}" for panel in "ABCD"] + ["`fig2` A", "`fig2` B"]
    wanted += [f"`fig3` {panel}" for panel in "ABCD"]
    wanted += ["`fig_cyliner`", "`fig_flow_chart_numerical_procedure`", "`tab_params`"]
    wanted += ["`fig_beta_zero`", "`fig_compare_inverse_law`"]
    found = [i["where"] for i in ITEMS if i["kind"] == "figure" and i["where"].startswith("`")]
    assert sorted(found) == sorted(wanted)


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) if n in SLOW else n for n in ANSWERED]
)
def test_number_of_the_page_is_what_the_code_gives_and_earns_its_verdict(name):
    row, value = row_of(name), computed(name)
    here = numbered(row["here"])
    if here is None:
        assert row["here"] == value
        assert (row["here"] == row["paper"]) == row["verdict"].startswith("agrees")
        return
    assert value == pytest.approx(here[0], abs=here[1] * (1 + 1e-9))
    printed = numbered(row["paper"])
    if printed is None:
        assert row["paper"] in {*NOTHING, "reasonable", "noticeable", "below the exponential one"}
        return
    low, slack, rest = printed
    if "significant" in NUMBERS[name]:
        slack = 0.5 * 10.0 ** (math.floor(math.log10(low)) + 1 - NUMBERS[name]["significant"])
    high = low
    if rest.startswith("to "):
        high, _, rest = numbered(rest[3:])
        slack = 0.0
    assert here[2] == rest, "another unit"
    agrees = low - slack * (1 + 1e-9) <= value <= high + slack * (1 + 1e-9)
    assert agrees == row["verdict"].startswith(("agrees", "input")), value


def test_the_python_line_of_a_number_is_the_one_that_computes_it():
    functions = {n.name: n.body for n in ast.parse(SOURCE).body if isinstance(n, ast.FunctionDef)}
    assert set(functions) == set(ANSWERED)
    for name, (line,) in functions.items():
        shown = ast.parse(row_of(name)["made by"].strip("`"), mode="eval").body
        assert ast.dump(shown) == ast.dump(line.value), name


def test_the_page_sets_the_names_that_its_lines_use():
    (block,) = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
    assert block in SOURCE.partition("\ndef ")[0]


def test_a_number_without_a_line_is_an_input_or_is_shown_by_a_test():
    for name in set(NUMBERS) - set(ANSWERED):
        row = row_of(name)
        assert numbered(row["here"]) is None, name
        assert row["made by"] or row["verdict"].startswith("input"), name


def test_verdicts_are_those_that_the_page_explains():
    for row in ROWS:
        assert row["verdict"].startswith(VERDICTS), row
        if row["verdict"].startswith(("corrected", "differs")):
            assert "](" in row["verdict"] or row.get("made by"), row


def test_the_page_begins_with_the_equations_that_it_corrects():
    (told,) = re.findall(r"equations ([(), 0-9]+) of the SI", PAGE)
    corrected = [
        i["where"].partition(" ")[0]
        for i in ITEMS
        if i["kind"] == "equation" and ROW_AT[place(i)]["verdict"].startswith("corrected")
    ]
    assert told.split(", ") == corrected


def test_links_lead_to_headings():
    for name, anchor in re.findall(r"\]\(([\w-]+\.md)(?:#([\w-]+))?\)", PAGE):
        text = (DOCS / name).read_text(encoding="utf-8")
        headings = re.findall(r"^#+ (.*)$", text, flags=re.MULTILINE)
        known = {re.sub(r"[^\w -]", "", h.lower()).replace(" ", "-") for h in headings}
        assert not anchor or anchor in known, f"{name}#{anchor}"


def test_tests_that_the_page_names_exist():
    code = "\n".join(p.read_text(encoding="utf-8") for p in (ROOT / "tests").rglob("test_*.py"))
    for name in re.findall(r"`(test_\w+)`", PAGE):
        assert f"def {name}(" in code, name


def test_code_that_the_page_names_exists():
    names = {r["here"].strip("`") for r in ROWS if r["here"].startswith("`")}
    assert len(names) > 20
    for name in names:
        home, _, last = f"amoeboid.{name}".rpartition(".")
        found = import_module(home)
        assert hasattr(found, last) or util.find_spec(f"amoeboid.{name}"), name


def test_every_figure_but_own_ones_is_on_the_page_with_its_command():
    of_the_paper = {name for name in figures.names() if not name.startswith("extra_")}
    assert of_the_paper == set(FIGURES)

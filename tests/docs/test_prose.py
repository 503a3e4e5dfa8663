"""The pages of docs/ can be read once: titles, short paragraphs, terms of the field."""

import ast
import itertools
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs").glob("*.md"))
GENERATED = {"comparison-3d.md"}  # written by a script
MAX_COLUMNS = 100
MAX_LINES = 460  # of a page
MAX_PARAGRAPH = 8  # lines
# Terms that readers had to read twice, and what is said instead.
BANNED = {
    r"disturbances?": "perturbation",
    r"foreseen?": "predicted",
    r"in vain": "the predicted growth did not appear",
    r"a unit of time": "per unit time",
    r"meets? (?:itself|themselves)": "self-intersects",
    r"goes on|go on|went on": "continues",
    r"(?:is|are) refused": "raises, is rejected",
    r"is no (?:parameter|field|key|observable|number)": "unknown parameter 'x', is not a number",
    r"(?:stands|stand) in": "is in",
    r"by itself alone|that alone": "only",
    r"settles|settled": "converged, no longer changes",
    r"whatever becomes": "what happens to",
}
ANY_BANNED = re.compile("|".join(rf"\b(?:{banned})\b" for banned in BANNED))

# between two lines of one string, whichever its quotes and its letters
JOINT = re.compile(r"""["']\s*[rbfu]*["']""", re.IGNORECASE)


def prose(text):
    """(number, line) of the lines that are neither code nor tables nor front matter."""
    fence, front = "", text.startswith("---\n")
    for number, line in enumerate(text.splitlines(), 1):
        if front:
            front = not (number > 1 and line == "---")
        elif fence:
            fence = "" if line.strip().startswith(fence) else fence
        elif match := re.match(r" *(`{3,}|~{3,}|:{3,}|\$\$)(?!.*\$\$)", line):
            fence = match[1]
        elif not line.startswith(("|", "    ", "<")):
            yield number, line


def paragraphs(text):
    """The paragraphs of a page, and the items of its lists, as lists of numbered lines."""
    found, last = [], -1
    for number, line in prose(text):
        begins = re.match(r"\s*(?:[-*]|\d+\.) ", line)
        if line.strip() and not line.startswith("#"):
            if begins or number != last + 1 or not found:
                found.append([])
            found[-1].append((number, line))
            last = number
    return found


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_page_has_one_title_and_headings_in_order(path):
    headings = [m for _, line in prose(path.read_text()) if (m := re.match(r"(#+) \S", line))]
    levels = [len(match[1]) for match in headings]
    if not levels:  # the page is another file
        assert "{include}" in path.read_text()
        return
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(b <= a + 1 for a, b in itertools.pairwise(levels))


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_page_begins_with_a_sentence(path):
    lines = [line for _, line in prose(path.read_text()) if line.strip()]
    after_title = lines[1:2]
    assert not after_title or not after_title[0].startswith(("#", "-", "*  ", "1."))


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_page_is_short_in_lines_and_paragraphs(path):
    text = path.read_text()
    assert path.name in GENERATED or len(text.splitlines()) <= MAX_LINES
    wide = [n for n, line in prose(text) if len(line) > MAX_COLUMNS and "](" not in line]
    assert not wide
    assert [p[0] for p in paragraphs(text) if len(p) > MAX_PARAGRAPH] == []


@pytest.mark.parametrize("path", [*PAGES, ROOT / "README.md"], ids=lambda path: path.name)
def test_page_uses_the_terms_of_the_field(path):
    for number, line in prose(path.read_text()):
        for banned, better in BANNED.items():
            assert not re.search(rf"\b(?:{banned})\b", line), f"line {number}: say {better!r}"


def test_messages_use_the_terms_of_the_field():
    """In what the package says: strings of the code that are no docstrings."""
    for path in sorted((ROOT / "src").rglob("*.py")):
        text = path.read_text()
        if not ANY_BANNED.search(JOINT.sub("", text)):
            continue  # nor in any of its strings
        tree = ast.parse(text)
        told = [n for n in ast.walk(tree) if isinstance(n, ast.Constant)]
        docs = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
        for node in told:
            if not isinstance(node.value, str) or id(node) in docs:
                continue
            if ANY_BANNED.search(node.value):
                for banned, better in BANNED.items():
                    where = f"{path.name}:{node.lineno}: say {better!r}"
                    assert not re.search(rf"\b(?:{banned})\b", node.value), where

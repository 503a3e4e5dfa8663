"""Links between pages of the repository lead where they should, also on the site.

The site itself is built and checked by continuous integration; here are the pages as files.
"""

import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CHECK = ROOT / "tools" / "check_links.py"
PAGES = sorted(
    path
    for path in [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    if not {"_build", "gallery"} & set(path.relative_to(ROOT).parts)
)
LINK = re.compile(r"\]\(([^)\s]+)\)")
FENCE = re.compile(r"^(```|~~~).*?^\1", flags=re.DOTALL | re.MULTILINE)


@cache
def anchors(path):
    """The anchors of the headings of a page, as GitHub and MyST make them."""
    text = FENCE.sub("", path.read_text(encoding="utf-8"))
    found = []
    for title in re.findall(r"^#+ (.*)$", text, flags=re.MULTILINE):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)|[`*]", r"\1", title)
        found.append(re.sub(r"[^\w\- ]", "", plain.lower()).replace(" ", "-"))
    return set(found)


@pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_of_a_page_lead_to_files_and_headings(path):
    problems = []
    for link in LINK.findall(FENCE.sub("", path.read_text(encoding="utf-8"))):
        if re.match(r"\w+:", link):
            continue
        name, _, anchor = link.partition("#")
        target = (path.parent / name).resolve() if name else path
        if not target.exists():
            problems.append(f"{link}: no such file")
        elif anchor and target.suffix == ".md" and anchor not in anchors(target):
            problems.append(f"{link}: no such heading")
    assert not problems, "\n".join(problems)


def site(folder, link):
    (folder / "index.html").write_text(f'<p id="here"><a href="{link}">a link</a></p>')
    (folder / "other.html").write_text('<h1 id="there">another page</h1>')
    return subprocess.run(
        [sys.executable, CHECK, folder], capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize("link", ["#here", "other.html", "other.html#there", "https://a.b/c#d"])
def test_links_of_a_site_that_lead_somewhere_are_good(link, tmp_path):
    done = site(tmp_path, link)
    assert done.returncode == 0
    assert "links of 2 pages" in done.stdout


@pytest.mark.parametrize("link", ["#there", "none.html", "other.html#here"])
def test_links_of_a_site_into_nothing_are_named(link, tmp_path):
    done = site(tmp_path, link)
    assert done.returncode == 1
    assert f"index.html: no {'file' if 'none' in link else 'id'} {link}" in done.stdout

"""The lines of docs/running.md, From Python, do what they say."""

import re
from pathlib import Path

import pytest

import amoeboid as am

PAGE = (Path(__file__).parents[2] / "docs/running.md").read_text(encoding="utf-8")
LINES = PAGE.partition("## From Python")[2]


@pytest.mark.slow
def test_the_lines_of_the_page_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    saved, names = dict(am.OBSERVABLES), {}
    try:
        for block in re.findall(r"```python\n(.*?)```", LINES, flags=re.DOTALL):
            exec(compile(block, "docs/running.md", "exec"), names)  # noqa: S102  (our own file)
    finally:
        am.OBSERVABLES.clear()
        am.OBSERVABLES.update(saved)
    out = capsys.readouterr().out
    said = [line.partition("# ")[2] for line in LINES.splitlines() if "# Solution" in line]
    assert len(said) == 1
    assert said[0] in out
    assert "Solution(dense_rear at t = " in out

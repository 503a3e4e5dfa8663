"""The Python lines of docs/studies.md do what they say."""

import re
from pathlib import Path

import pytest

PAGE = (Path(__file__).parents[2] / "docs/studies.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_lines_of_the_page_run(capsys):
    names = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL):
        exec(compile(block, "docs/studies.md", "exec"), names)  # noqa: S102  (our own file)
    out = capsys.readouterr().out
    said = [
        line.partition("# ")[2] for line in PAGE.splitlines() if re.search(r"# (Branch|1\.)", line)
    ]
    assert len(said) == 2
    assert all(text in out for text in said)

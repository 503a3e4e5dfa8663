"""The examples of docs/motility.md run as they stand and print what their comments say."""

import re
from pathlib import Path

PAGE = (Path(__file__).parents[2] / "docs/motility.md").read_text(encoding="utf-8")


def test_every_example_prints_what_the_page_says(capsys):
    names = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL):
        exec(compile(block, "docs/motility.md", "exec"), names)  # noqa: S102  (our own file)
        stated = re.findall(r"print\(.*\)  # (.*)$", block, flags=re.MULTILINE)
        assert capsys.readouterr().out.splitlines() == stated


def test_every_test_that_the_page_names_exists():
    here = "".join(path.read_text() for path in Path(__file__).parent.glob("test_*.py"))
    for name in re.findall(r"`(test_\w+?)(?:_?\.\.\.)?`", PAGE):
        assert f"def {name}" in here

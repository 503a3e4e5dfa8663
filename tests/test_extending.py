"""The examples of docs/extending.md: each runs as it stands and prints what its comments say."""

import re
import shlex
from pathlib import Path

import pytest

import amoeboid as am
from amoeboid.cli.main import main
from amoeboid.studies.theory import Theory

PAGE = (Path(__file__).parents[1] / "docs/extending.md").read_text(encoding="utf-8")
SECTIONS = [section for section in re.split(r"^## ", PAGE, flags=re.MULTILINE) if "```" in section]


def blocks(section, kind):
    return re.findall(rf"```{kind}\n(.*?)```", section, flags=re.DOTALL)


def printed(block):
    """The comments that state what is printed: those after a print, or alone on their lines."""
    stated = [re.search(r"(?:^\s*|print\(.*\)  )# (.*)$", line) for line in block.splitlines()]
    return [found[1] for found in stated if found]


@pytest.fixture
def registries():
    """What the page adds to the package is taken out again."""
    observables, entries = dict(am.OBSERVABLES), set(vars(Theory))
    yield
    am.OBSERVABLES.clear()
    am.OBSERVABLES.update(observables)
    for name in set(vars(Theory)) - entries:
        delattr(Theory, name)


def test_every_example_prints_what_the_page_says(registries, capsys):
    names = {}
    for section in SECTIONS:
        for block in blocks(section, "python"):
            exec(compile(block, "docs/extending.md", "exec"), names)  # noqa: S102  (our own file)
            assert capsys.readouterr().out.splitlines() == printed(block), section[:40]


def test_the_commands_of_the_page_run(capsys):
    commands = [line for block in blocks(PAGE, "sh") for line in block.splitlines()]
    assert commands
    for line in commands:
        assert main(shlex.split(line, comments=True)[1:]) == 0
        assert "8.71111" in capsys.readouterr().out

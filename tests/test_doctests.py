"""The examples in docstrings print what they say."""

import doctest
import importlib
from pathlib import Path

import pytest

import amoeboid

ROOT = Path(amoeboid.__file__).parent
WITH_EXAMPLES = sorted(
    ".".join(("amoeboid", *path.relative_to(ROOT).with_suffix("").parts))
    for path in ROOT.rglob("*.py")
    if ">>> " in path.read_text(encoding="utf-8")
)


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_examples_of_a_module_print_what_they_say(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = doctest.testmod(importlib.import_module(name.removesuffix(".__init__")))
    assert found.attempted > 0
    assert found.failed == 0

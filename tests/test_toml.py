"""Texts of TOML that the package writes, read back by Python."""

import math
import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from amoeboid.toml import toml_text

TEXTS = st.text(st.characters(exclude_categories=["Cs"]))
NUMBERS = st.floats(allow_nan=False) | st.integers(-(2**63), 2**63 - 1)
VALUES = st.recursive(
    TEXTS | NUMBERS | st.booleans(),
    lambda inner: st.lists(inner) | st.dictionaries(TEXTS, inner),
    max_leaves=8,
)


@settings(max_examples=40, deadline=None)
@given(st.dictionaries(TEXTS, VALUES))
def test_tables_are_read_back_equal(tables):
    text = toml_text(tables)
    assert tomllib.loads(text) == tables
    assert repr(tomllib.loads(text)).count("True") == repr(tables).count("True")


def test_text_is_that_of_earlier_runs():
    """The bytes of a file: hashes of stored sweeps depend on them."""
    tables = {"a": {"x": 1.0, "law.n": 2, "on": True, "name": 'a "b"'}, "none": {},
              "b": {"rows": [[2, 0, 0.1]], "empty": []}}  # fmt: skip
    assert toml_text(tables) == (
        '[a]\nx = 1.0\n"law.n" = 2\non = true\nname = "a \\"b\\""\n\n[none]\n\n'
        "[b]\nrows = [\n    [\n        2,\n        0,\n        0.1,\n    ],\n]\nempty = []\n"
    )


def test_numbers_that_are_not_finite_are_read_back():
    found = tomllib.loads(toml_text({"a": math.inf, "b": -math.inf, "c": math.nan}))
    assert (found["a"], found["b"]) == (math.inf, -math.inf)
    assert math.isnan(found["c"])


def test_what_toml_cannot_hold_is_rejected():
    with pytest.raises(TypeError, match="TOML has no NoneType"):
        toml_text({"a": None})

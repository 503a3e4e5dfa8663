"""The text of a value differs where results computed with it may, and only there."""

import functools
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import amoeboid as am
from amoeboid.config import Config, Initial
from amoeboid.identity.content import Unidentified, content


@dataclass(frozen=True)
class Choice:
    a: int
    b: tuple


@dataclass(frozen=True)
class Other:
    a: int
    b: tuple


def function(x, y=0):
    return x + y


VALUES = [
    None, True, 1, 1.0, 1 + 0j, "1", Path("1"), np.float64(0.1), np.float32(0.1),
    np.array([1.0, 2.0]), np.array([[1.0, 2.0]]), np.array([1, 2]), np.array([2.0, 1.0]),
    (1, 2), [1, 2], [2, 1], {"a": 1}, {"a": 2}, {"b": 1},
    Choice(1, (2,)), Choice(2, (2,)), Choice(1, (3,)), Other(1, (2,)),
    function, functools.partial(function, 1), functools.partial(function, 2),
    functools.partial(function, y=1),
    am.Parameters(), am.Parameters(D=0.4), am.Parameters(law="inverse"),
    am.Parameters.physical(), am.Parameters.physical().quantity(1.0, "L"),
    am.Parameters.physical().quantity(1.0, "T"), Config(), Config(parameters=am.Parameters(D=0.4)),
]  # fmt: skip


def test_different_values_have_different_texts():
    texts = [content(value) for value in VALUES]
    for (one, a), (other, b) in combinations(zip(VALUES, texts, strict=True), 2):
        assert a != b, (one, other)


def test_equal_values_have_the_same_text():
    assert content(am.Parameters(D=0.4)) == content(am.Parameters().replace(D=0.4))
    assert content(np.array([1.0, 2.0])) == content(np.array([0.5, 1.0]) * 2)
    one, other = (functools.partial(function, **values) for values in ({"x": 1, "y": 2},) * 2)
    assert content(one) == content(other)


def test_a_file_that_a_configuration_names_is_told_by_its_content(tmp_path):
    path = tmp_path / "a.stl"
    texts = []
    for data in (b"one", b"other", b"one"):
        path.write_bytes(data)
        texts.append(content(Config(initial=Initial(surface=str(path)))))
    assert texts[0] == texts[2] != texts[1]


def test_what_no_text_can_tell_from_others_is_refused():
    def inner():
        return 1

    for value in (inner, lambda: 1, object(), functools.partial(inner)):
        with pytest.raises(Unidentified):
            content(value)

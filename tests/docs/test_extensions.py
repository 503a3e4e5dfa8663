"""What the site makes of docstrings, formulas and names (docs/_ext)."""

import sys
from pathlib import Path

import pytest

pytest.importorskip("sphinx", reason="needs the extra docs")
sys.path.insert(0, str(Path(__file__).parents[2] / "docs" / "_ext"))

import declared_fields
import mathml
import plain_docstrings
import public_names
from docutils import nodes
from sphinx.errors import ExtensionError

import amoeboid


def restructured(text):
    return "\n".join(plain_docstrings.restructured(text.split("\n")))


def test_signs_of_a_docstring_stand_for_themselves():
    assert restructured("|a| is 2*b of v_") == r"\|a\| is 2\*b of v\_"
    assert restructured("`|a|` and\n>>> 2*b") == "`|a|` and\n>>> 2*b"


@pytest.mark.parametrize(("block", "language"), [("a' = |b| + ...", "text"), ("f(2*x)", "python")])
def test_indented_blocks_of_a_docstring_are_formulas_or_code(block, language):
    found = restructured(f"Then\n\n    {block}\n\nholds.")
    assert found == f"Then\n\n.. code-block:: {language}\n\n    {block}\n\nholds."


def test_lists_of_a_docstring_stay_lists():
    text = "Two:\n\n- one\n  line\n- two"
    assert restructured(text) == text


@pytest.mark.parametrize("display", [True, False])
def test_formulas_become_mathml(display):
    found = mathml.mathml(nodes.math("", r"\lambda_l = -\frac{D}{R_0^2} - \beta"), display)
    assert found.startswith("<math")
    assert "<mfrac>" in found
    assert ('display="block"' in found) is display


def test_aligned_formulas_become_tables():
    lines = nodes.math_block("", "\\begin{align*}\na &= b \\\\\nc &= d\n\\end{align*}")
    assert mathml.mathml(lines, display=True).count("<mtr>") == 2


@pytest.mark.parametrize("formula", [r"\nosuchcommand", r"\\dot{a} = 1"])
def test_formula_that_cannot_be_shown_ends_the_build(formula):
    with pytest.raises(ExtensionError, match="no MathML for the formula"):
        mathml.mathml(nodes.math("", formula), display=False)


@pytest.mark.parametrize(
    ("text", "target"),
    [
        ("Branch", "amoeboid.Branch"),
        ("am.load", "amoeboid.load"),
        ("steps((5, 0))", "amoeboid.steps"),
        ("Parameters.physical", "amoeboid.Parameters.physical"),
        ("time", None),
        ("v_p0*exp(-c)", None),
        ("NoSuchClass", None),
    ],
)
def test_names_in_docstrings_link_where_they_are_public(text, target):
    assert public_names.target_of(text) == target


def test_declared_fields_of_a_class_are_a_table():
    text = "\n".join(declared_fields.table(amoeboid.Parameters))
    assert "* - ``D``\n     - L^2/T\n     - ``0.03``\n     - a finite number >= 0" in text
    assert declared_fields.table(amoeboid.State) == []

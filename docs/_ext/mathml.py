"""Formulas as MathML, which browsers draw without a script, from a file and without a network."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from docutils.utils.math import MathError, latex2mathml
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

ENVIRONMENT = re.compile(r"\\(begin|end)\{(align|equation|gather|multline)\*?\}")


def mathml(node: nodes.Element, display: bool) -> str:
    """The formula of a node. Raises ExtensionError for one that cannot be converted."""
    text = ENVIRONMENT.sub("", node.astext()).strip()
    if display and (r"\\" in text or "&" in text) and r"\begin" not in text:
        text = rf"\begin{{aligned}}{text}\end{{aligned}}"
    try:
        return str(latex2mathml.tex2mathml(text, as_block=display))
    except (MathError, AttributeError) as error:  # the latter where a line break ends no line
        raise ExtensionError(f"no MathML for the formula {node.astext()!r}: {error}") from error


def inline(self: Any, node: nodes.math) -> None:
    """A formula in a line."""
    self.body.append(mathml(node, display=False))
    raise nodes.SkipNode


def block(self: Any, node: nodes.math_block) -> None:
    """A formula of its own, with its number."""
    label = f' id="{node["ids"][0]}"' if node.get("ids") else ""
    number = f'<span class="eqno">({node["number"]})</span>' if node.get("number") else ""
    self.body.append(f'<div class="math"{label}>{mathml(node, display=True)}{number}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Add the renderer `mathml`."""
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}

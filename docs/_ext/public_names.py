"""Public names in docstrings and signatures link to their pages.

`Branch`, `simulate(...)` and `am.load` in single backticks are code, and a link where they are
names of the package. A lower-case word alone is code and no link: `time` is an argument more often
than the event.
"""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

import amoeboid

NAME = re.compile(r"(?:am\.|amoeboid\.)?([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)(?:\(.*\))?", re.DOTALL)
MODULES = {f"amoeboid.{home}.{name}": name for name, home in amoeboid._HOMES.items()}


def target_of(text: str) -> str | None:
    """The public name that a text in backticks means, or None."""
    found = NAME.fullmatch(text)
    if found is None:
        return None
    name = found[1]
    plain = name == text and name[0].islower()
    public = name.split(".")[0] in amoeboid.__all__
    return f"amoeboid.{name}" if public and not plain else None


def name_role(
    role: str, rawtext: str, text: str, lineno: int, inliner: Any, options: Any = None,
    content: Any = (),
) -> tuple[list[nodes.Node], list[nodes.system_message]]:  # fmt: skip
    """Code; a link where it is a public name."""
    text = nodes.unescape(text)
    code = nodes.literal(text, text, classes=["py"])
    target = target_of(text)
    if target is None:
        return [code], []
    link = addnodes.pending_xref(
        rawtext, code, refdomain="py", reftype="obj", reftarget=target, refwarn=False
    )
    return [link], []


def public_home(
    app: Sphinx, env: BuildEnvironment, node: addnodes.pending_xref, content: nodes.Element
) -> nodes.Node | None:
    """The page of a name that a signature gives with the module that defines it."""
    name = MODULES.get(node.get("reftarget", ""))
    if node.get("refdomain") != "py" or name is None:
        return None
    domain = env.get_domain("py")
    return domain.resolve_xref(
        env, node["refdoc"], app.builder, "obj", f"amoeboid.{name}", node, content
    )


def anchor_homes(app: Sphinx, tree: nodes.document) -> None:
    """Give each public name the anchor of the module that defines it, for links from its source."""
    for signature in tree.findall(addnodes.desc_signature):
        name = signature.get("fullname", "")
        if signature.get("module") == "amoeboid" and name in amoeboid._HOMES:
            home = f"amoeboid.{amoeboid._HOMES[name]}.{name}"
            signature["ids"] += [home] if home not in signature["ids"] else []


def setup(app: Sphinx) -> dict[str, bool]:
    """Add the role, and the resolver of names."""
    app.add_role("name", name_role)
    app.connect("missing-reference", public_home)
    app.connect("doctree-read", anchor_homes)
    return {"parallel_read_safe": True, "parallel_write_safe": True}

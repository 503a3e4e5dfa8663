"""The files of the page, and the page that they make: from the server, or in one file."""

from __future__ import annotations

import base64
import json
import re
import secrets
from functools import cache
from html import escape
from importlib.resources import files
from typing import Any

from amoeboid.explorer.presets import offered
from amoeboid.explorer.recipe import STARTS
from amoeboid.extras import needed
from amoeboid.plotting import palette

MODULES = {"amoeboid/plots": "plots.js", "amoeboid/sources": "sources.js"}
LIVE_MODULES = {"amoeboid/cell": "cell.js", "three": "three.js"}
CONTENT_TYPES = {".js": "text/javascript", ".css": "text/css", ".txt": "text/plain"}
COLORS = 32


def content(name: str) -> bytes | None:
    """A file of the page; None if there is no such file."""
    return _contents().get(name)


@cache
def _contents() -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in _folder().iterdir() if path.is_file()}


def _folder() -> Any:
    return files("amoeboid.explorer") / "page"


def live_page(port: int) -> tuple[bytes, str]:
    """The page from the server, and the policy that lets it load nothing from elsewhere."""
    nonce = secrets.token_urlsafe(16)
    modules = {name: f"./{file}" for name, file in (MODULES | LIVE_MODULES).items()}
    words = {
        "style": '<link rel="stylesheet" href="style.css">',
        "imports": _import_map(modules, f' nonce="{nonce}"'),
        "data": _json(_common() | {"mode": "live", "starts": STARTS}),
        "main": '<script type="module" src="app.js"></script>',
        "policy": "",
    }
    hosts = " ".join(f"ws://{name}:{port}" for name in ("127.0.0.1", "localhost"))
    policy = (
        f"default-src 'none'; script-src 'self' 'nonce-{nonce}'; style-src 'self'; "
        f"connect-src 'self' {hosts}; img-src 'self' data:; "
        "base-uri 'none'; form-action 'none'"
    )
    return _filled(words), policy


def offline_page(data: dict[str, Any]) -> bytes:
    """The page in one file, which shows `data` and asks no host."""
    modules = {name: _data_url(file) for name, file in MODULES.items()}
    policy = (
        "default-src 'none'; script-src data: 'unsafe-inline'; style-src 'unsafe-inline'; "
        "img-src data:"
    )
    words = {
        "style": f"<style>{_text('style.css')}</style>",
        "imports": _import_map(modules),
        "data": _json(_common() | {"mode": "file"} | data),
        "main": f'<script type="module">{_text("app.js")}</script>',
        "policy": f'<meta http-equiv="Content-Security-Policy" content="{escape(policy)}">',
    }
    return _filled(words)


def _import_map(modules: dict[str, str], attributes: str = "") -> str:
    return f'<script type="importmap"{attributes}>{_json({"imports": modules})}</script>'


def _common() -> dict[str, Any]:
    needed("matplotlib", "the explorer needs")
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    steps = [k / (COLORS - 1) for k in range(COLORS)]
    names = ("BLUE", "ORANGE", "GREEN", "PURPLE", "SKY", "YELLOW", "INK", "GRAY", "PALE")
    return offered() | {
        "palette": {name.lower(): getattr(palette, name) for name in names},
        "colors": [to_hex(colormaps[palette.COLOR_MAP](step)) for step in steps],
    }


def _filled(words: dict[str, str]) -> bytes:
    filled = re.sub(r"\{\{(\w+)\}\}", lambda found: words[found.group(1)], _text("index.html"))
    return filled.encode()


def _text(name: str) -> str:
    return (_folder() / name).read_text(encoding="utf-8")


def _json(data: Any) -> str:
    """JSON that may stand in a page: it cannot end the element that it stands in."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")


def _data_url(name: str) -> str:
    return "data:text/javascript;base64," + base64.b64encode(_text(name).encode()).decode()

"""Links inside a built site: `python tools/check_links.py docs/_build/html`.

Every local address of every page must be a file of the site, and its fragment an id on that page.
Pages that nothing leads to are named, too. Addresses of other sites are not fetched.
"""

from __future__ import annotations

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

REFERENCES = {"a": "href", "link": "href", "img": "src", "script": "src", "source": "src"}


class Page(HTMLParser):
    """The addresses and the ids of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.ids: set[str] = set()
        self.addresses: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note ids and addresses of an element."""
        given = dict(attrs)
        self.ids.update(value for value in (given.get("id"), given.get("name")) if value)
        address = given.get(REFERENCES.get(tag, ""))
        if address:
            self.addresses.append(address)


def broken(site: Path) -> list[str]:
    """What is wrong, a line each."""
    pages = {
        path: Page(path) for path in sorted(site.rglob("*.html")) if "_static" not in path.parts
    }
    problems = []
    for path, page in pages.items():
        for address in dict.fromkeys(page.addresses):
            parts = urlsplit(address)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            fragment = unquote(parts.fragment)
            known = pages.get(target)
            if not target.is_file():
                problems.append(f"{path.relative_to(site)}: no file {address}")
            elif known is not None and fragment and fragment not in known.ids:
                problems.append(f"{path.relative_to(site)}: no id {address}")
    return problems


def main() -> int:
    """Print what is wrong; 1 if anything is."""
    site = Path(sys.argv[1]).resolve()
    problems = broken(site)
    count = len(list(site.rglob("*.html")))
    print("\n".join(problems) or f"links of {count} pages lead where they should")
    return 1 if problems or not count else 0


if __name__ == "__main__":
    sys.exit(main())

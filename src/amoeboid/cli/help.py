"""Help texts that fit the terminal: paragraphs and two-column entries wrap at its width."""

from __future__ import annotations

import argparse
import re
import textwrap

ENTRY = re.compile(r"(?P<term> *\S.*?\S? {2,})(?P<meaning>\S(?:(?! {2}).)*)")
MIN_MEANING = 30  # columns; where fewer remain beside the term, the meaning is set below it
BELOW = 4  # further indent of a meaning below its term
EXAMPLE = "  amoeboid "  # a line that begins so can be pasted: it is left as it is


class HelpFormatter(argparse.RawDescriptionHelpFormatter):
    """Wraps each line of a description or an epilog by itself.

    A line with a gap of two or more blanks is an entry: the text behind its last gap continues
    below itself, or on lines of its own where the terminal is narrow.
    """

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return "\n".join(wrapped(line, width - len(indent), indent) for line in text.splitlines())


def wrapped(line: str, width: int, indent: str = "") -> str:
    """One line of a help text within `width` columns.

    >>> print(wrapped("  a     its meaning in a few words, which continue below themselves", 40))
      a     its meaning in a few words,
            which continue below themselves
    """
    if line.startswith(EXAMPLE):
        return indent + line
    entry = ENTRY.fullmatch(line)
    if entry is None:
        own = indent + line[: len(line) - len(line.lstrip())]
        return _filled(line.strip(), width, own, own)
    term, meaning = entry["term"], entry["meaning"]
    if width - len(term) >= MIN_MEANING:
        return _filled(meaning, width, indent + term, indent + " " * len(term))
    below = indent + " " * (len(term) - len(term.lstrip()) + BELOW)
    return f"{indent}{term.rstrip()}\n{_filled(meaning, width, below, below)}"


def _filled(text: str, width: int, first: str, others: str) -> str:
    return textwrap.fill(
        text,
        width,
        initial_indent=first,
        subsequent_indent=others,
        break_long_words=False,
        break_on_hyphens=False,
    )

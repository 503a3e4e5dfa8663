"""`python -m amoeboid`: the command `amoeboid`."""

from __future__ import annotations

import sys

from amoeboid.cli.program import program

if __name__ == "__main__":
    sys.exit(program())

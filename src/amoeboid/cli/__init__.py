"""The command line: parses, calls, prints; no physics. One module for each command."""

import os

from amoeboid.threads import VARIABLES

# Threads hurt on matrices of this size; one run is one thread, and many runs go in parallel.
for _name in VARIABLES:
    os.environ.setdefault(_name, "1")

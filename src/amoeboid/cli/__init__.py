"""The command line: parses, calls, prints; no physics. One module a command."""

import os

# Threads hurt on matrices of this size; one run is one thread, and many runs go in parallel.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

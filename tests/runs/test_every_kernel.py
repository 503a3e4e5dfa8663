"""The runs by which the build compiles the kernels."""

import os
import subprocess
import sys

import pytest

RUN = """
import hashlib, sys
from pathlib import Path
from amoeboid.numerics import kept
from amoeboid.numerics.compiled import ENTRIES
from amoeboid.runs.every_kernel import call_every_kernel
kept.BUILT = Path(sys.argv[1])
last = call_every_kernel()
print([k.py_func.__name__ for k in ENTRIES if not k.dispatcher.overloads])
print(sum(sum(k.stats.cache_misses.values()) for k in ENTRIES))
print(hashlib.sha256(last.state.r.tobytes() + last.state.c.tobytes()).hexdigest(), last.growth)
"""


def run(*command, **environment):
    done = subprocess.run(
        [sys.executable, *command],
        env=os.environ | environment,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.splitlines()


@pytest.mark.slow
def test_every_kernel_is_called_and_those_of_the_build_give_the_same_bits(tmp_path):
    """Built for every processor with AVX2, and compiled here for this one when first called."""
    built = str(tmp_path / "built")
    many = {"NUMBA_CPU_NAME": "x86-64-v3", "NUMBA_CPU_FEATURES": "+avx2,+fma"}
    run("-m", "amoeboid.runs.every_kernel", built, **many)
    loaded = run("-c", RUN, built, NUMBA_CACHE_DIR=str(tmp_path / "unused"))
    compiled = run("-c", RUN, "none", NUMBA_CACHE_DIR=str(tmp_path / "here"))
    assert loaded[0] == compiled[0] == "[]"
    assert loaded[1] == "0"
    assert int(compiled[1]) > 40
    assert loaded[2] == compiled[2]

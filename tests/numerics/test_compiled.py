import subprocess
import sys

import numpy as np

from amoeboid.numerics.compiled import compiled


def double(x):
    return 2 * x


def test_kernels_compile_where_nothing_can_be_written():
    """A program of its own, in which numba is left no place for its cache."""
    code = (
        "from numba.core.caching import CacheImpl\n"
        "CacheImpl._locator_classes = []\n"
        "from amoeboid.surface.geometry import geometry\n"
        "from amoeboid.surface.mesh import icosphere\n"
        "assert abs(geometry(*icosphere(1)).area - 11.666) < 1e-3\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_kernels_are_kept_on_disk(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    kernel = compiled(double)
    assert kernel(np.float64(3.0)) == 6.0
    assert kernel.stats.cache_path

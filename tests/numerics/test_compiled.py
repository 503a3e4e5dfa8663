import errno
import os
import subprocess
import sys
import warnings

import numba.core.caching
import numba.core.config
import numpy as np
import pytest

from amoeboid.numerics import compiled as module
from amoeboid.numerics.compiled import compiled


def double(x):
    return 2 * x


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Where numba keeps kernels."""
    monkeypatch.setattr(numba.core.config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(module, "_said", set())
    return tmp_path


def kept(folder):
    return sorted(p for p in folder.rglob("*") if p.suffix in (".nbi", ".nbc"))


def test_kernels_compile_where_nothing_can_be_written():
    """A program of its own, in which numba is left no place for its cache."""
    code = (
        "from numba.core.caching import CacheImpl\n"
        "CacheImpl._locator_classes = []\n"
        "from amoeboid.meshes.geometry import geometry\n"
        "from amoeboid.meshes.connectivity import icosphere\n"
        "assert abs(geometry(*icosphere(1)).area - 11.666) < 1e-3\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("compiled kernels cannot be kept in '") == 1
    assert "set NUMBA_CACHE_DIR" in done.stderr


def test_kernels_are_kept_on_disk(folder):
    kernel = compiled(double)
    assert kernel(np.float64(3.0)) == 6.0
    assert kernel.stats.cache_path.startswith(str(folder))
    again = compiled(double)
    assert again(np.float64(3.0)) == 6.0
    assert sum(again.stats.cache_hits.values()) == 1


@pytest.mark.parametrize("content", [b"", b"\x80", "half", b"not a pickle"], ids=str)
@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
def test_damaged_files_are_compiled_anew_and_replaced(suffix, content, folder):
    assert compiled(double)(np.float64(3.0)) == 6.0
    (damaged,) = (p for p in kept(folder) if p.suffix == suffix)
    whole = damaged.read_bytes()
    damaged.write_bytes(whole[: len(whole) // 2] if content == "half" else content)
    with pytest.warns(RuntimeWarning, match="cannot be read .*compiled anew") as told:
        assert compiled(double)(np.float64(3.0)) == 6.0
    assert str(folder) in str(told[0].message)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = compiled(double)
        assert again(np.float64(3.0)) == 6.0
    assert sum(again.stats.cache_hits.values()) == 1


def test_a_full_disk_is_reported_once_and_costs_time_only(folder, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(numba.core.caching.IndexDataCacheFile, "_save_data", full)
    kernel = compiled(double)
    with pytest.warns(RuntimeWarning, match=r"cannot be kept .*No space left") as told:
        assert [kernel(np.float64(3.0)), kernel(np.int64(3))] == [6.0, 6]
    assert len(told) == 1
    assert str(folder) in str(told[0].message)


def test_a_folder_that_cannot_be_read_costs_time_only(folder, monkeypatch):
    def refused(*_):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    for name in ("_load_index", "_save_index"):
        monkeypatch.setattr(numba.core.caching.IndexDataCacheFile, name, refused)
    with pytest.warns(RuntimeWarning, match=r"Permission denied") as told:
        assert compiled(double)(np.float64(3.0)) == 6.0
    assert len(told) == 1


def test_kernels_are_compiled_where_numba_is_switched_off():
    """Some exist as compiled code only."""
    code = (
        "from amoeboid import Config, Mesh, start\n"
        "assert start(Config(mesh=Mesh(subdivisions=1))).rate > 0\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")

"""What other systems lack or have elsewhere: branches that this one does not take by itself."""

import sys
from pathlib import Path

import numba
import pytest

from amoeboid import locks
from amoeboid.meshes import vtk_process
from amoeboid.numerics import kept


@pytest.mark.parametrize(
    ("system", "variables", "parent"),
    [
        ("win32", {"LOCALAPPDATA": "caches"}, Path("caches")),
        ("win32", {"LOCALAPPDATA": ""}, Path.home() / "AppData" / "Local"),
        ("darwin", {}, Path.home() / "Library" / "Caches"),
    ],
)
def test_kernels_are_kept_where_the_system_has_its_caches(system, variables, parent, monkeypatch):
    monkeypatch.setattr(numba.core.config, "CACHE_DIR", "")
    monkeypatch.setattr(sys, "platform", system)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    found = kept.folder()
    assert found.parents[1] == parent
    assert found.parent.name == "amoeboid"


def test_a_system_without_locks_of_files_says_that_none_is_held(tmp_path, monkeypatch):
    monkeypatch.setattr(locks, "fcntl", None)
    first, second = (locks.FileLock(tmp_path / "lock") for _ in range(2))
    assert not first.take()
    assert not second.take()  # nobody notices two at the same work
    first.release()
    assert not list(tmp_path.iterdir())


def test_a_system_without_limits_of_memory_reads_surfaces_all_the_same(monkeypatch):
    monkeypatch.setitem(sys.modules, "resource", None)
    vtk_process._limit_memory()


def test_linear_algebra_without_threadpoolctl_keeps_its_threads(monkeypatch):
    from amoeboid import threads

    for name in threads.VARIABLES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(threads, "controllable", lambda: False)
    limiter = threads._OneThread()
    with limiter, limiter:
        assert limiter._limits == []
    assert limiter._count == 0

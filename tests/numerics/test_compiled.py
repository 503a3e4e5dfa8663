import errno
import os
import shutil
import subprocess
import sys
import tempfile
import warnings

import numba.core.config
import numpy as np
import pytest

from amoeboid.meshes.connectivity import icosphere
from amoeboid.meshes.geometry import _geometry
from amoeboid.numerics import dispatchers, kept
from amoeboid.numerics.compiled import compiled, nested
from amoeboid.numerics.kernel_identity import identity


def double(x):
    return 2 * x


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Where kernels are kept."""
    monkeypatch.setattr(numba.core.config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(dispatchers, "_said", set())
    return tmp_path


def kernels(folder):
    return sorted(folder.rglob("*.kernel"))


def program(code, **environment):
    return subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | environment,
        capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_kernels_compile_where_nothing_can_be_written():
    """A program of its own, which is left no place for its kernels."""
    code = (
        "from amoeboid.meshes.geometry import area\n"
        "from amoeboid.meshes.connectivity import icosphere\n"
        "assert abs(area(*icosphere(1)) - 11.666) < 1e-3\n"
    )
    done = program(code, NUMBA_CACHE_DIR=os.devnull)
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("compiled kernels cannot be stored in '") == 1
    assert "set NUMBA_CACHE_DIR" in done.stderr


def test_kernels_are_kept_on_disk(folder):
    kernel = compiled(double)
    assert kernel(np.float64(3.0)) == 6.0
    assert kernel.stats.cache_path.startswith(str(folder))
    again = compiled(double)
    assert again(np.float64(3.0)) == 6.0
    assert sum(again.stats.cache_hits.values()) == 1


def test_a_kept_kernel_is_compiled_into_those_that_call_it(folder):
    """Of a kept kernel its machine code is loaded; what others are compiled with lies beside it."""
    called = compiled(double)
    assert called(np.float64(3.0)) == 6.0
    again = compiled(double)

    def twice(x):
        return again(again(x))

    assert compiled(twice)(np.float64(3.0)) == 12.0
    assert sum(again.stats.cache_hits.values()) == 1
    assert not sum(again.stats.cache_misses.values())


@pytest.mark.parametrize("content", [b"", b"\x80", "half", b"not a pickle", "one bit"], ids=str)
def test_damaged_files_are_compiled_anew_and_replaced(content, folder):
    assert compiled(double)(np.float64(3.0)) == 6.0
    (damaged,) = kernels(folder)
    whole = damaged.read_bytes()
    one_bit = whole[:-1000] + bytes([whole[-1000] ^ 1]) + whole[-999:]
    damaged.write_bytes(
        {"half": whole[: len(whole) // 2], "one bit": one_bit}.get(content, content)
    )
    with pytest.warns(RuntimeWarning, match="cannot be read .*compiled again") as told:
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

    monkeypatch.setattr(kept, "_write", full)
    kernel = compiled(double)
    with pytest.warns(RuntimeWarning, match=r"cannot be stored .*No space left") as told:
        assert [kernel(np.float64(3.0)), kernel(np.int64(3))] == [6.0, 6]
    assert len(told) == 1
    assert str(folder) in str(told[0].message)


def test_a_folder_that_cannot_be_read_costs_time_only(folder, monkeypatch):
    def refused(*_):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    for name in ("load", "_write"):
        monkeypatch.setattr(kept, name, refused)
    with pytest.warns(RuntimeWarning, match=r"Permission denied") as told:
        assert compiled(double)(np.float64(3.0)) == 6.0
    assert len(told) == 1


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="no owners and modes of files")
@pytest.mark.parametrize("mode", [0o770, 0o707], ids=oct)
def test_kernels_in_a_folder_that_others_can_write_to_are_not_executed(mode, folder):
    assert compiled(double)(np.float64(3.0)) == 6.0
    (name,) = kernels(folder)
    assert kept.folder().stat().st_mode & 0o777 == 0o700
    before = name.read_bytes()
    kept.folder().chmod(mode)
    again = compiled(double)
    with pytest.warns(RuntimeWarning, match="other users can write to it") as told:
        assert again(np.float64(3.0)) == 6.0
    assert len(told) == 1
    assert sum(again.stats.cache_hits.values()) == 0
    assert name.read_bytes() == before


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="no owners of files")
def test_kernels_in_a_folder_of_another_user_are_not_executed(folder, monkeypatch):
    assert compiled(double)(np.float64(3.0)) == 6.0
    owner = kept.folder().stat().st_uid
    if owner == 0:
        os.chown(kept.folder(), 12345, 12345)
    else:
        monkeypatch.setattr(os, "geteuid", lambda: owner + 1)
    again = compiled(double)
    with pytest.warns(RuntimeWarning, match="it belongs to another user"):
        assert again(np.float64(3.0)) == 6.0
    assert sum(again.stats.cache_hits.values()) == 0


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="these tell the folder of a user")
def test_a_user_without_a_home_keeps_kernels_among_temporary_files(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.core.config, "CACHE_DIR", "")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    monkeypatch.setattr(tempfile, "gettempdir", lambda: str(tmp_path))
    assert kept.folder().parents[1] == tmp_path / f"cache-{os.geteuid()}"


@pytest.mark.slow
def test_kernels_are_compiled_where_numba_is_switched_off():
    """Some exist as compiled code only."""
    code = (
        "from amoeboid import Config, Mesh, start\n"
        "assert start(Config(mesh=Mesh(subdivisions=1))).rate > 0\n"
    )
    done = program(code, NUMBA_DISABLE_JIT="1")
    assert (done.returncode, done.stderr) == (0, "")


def test_a_kernel_is_compiled_anew_once_what_it_calls_or_uses_has_changed():
    """numba by itself looks at the file of the kernel only."""

    def made(factor, called):
        inner = nested(called)

        def outer(x):
            return factor * inner(x)

        return identity(outer)

    same = made(2.0, lambda x: x + 1)
    assert made(2.0, lambda x: x + 1) == same
    others = made(3.0, lambda x: x + 1), made(2.0, lambda x: x - 1), made(2.0, lambda x: x + 2)
    assert len({same, *others}) == 4


def test_a_kept_kernel_is_loaded_without_what_numba_compiles_arrays_with(folder):
    """Its import takes longer than to load all kernels of a run."""
    code = (
        "import sys\n"
        "import numpy as np\n"
        "from amoeboid.meshes.operators import normal_projection\n"
        "from amoeboid.meshes.connectivity import connectivity, icosahedron\n"
        "r, faces = icosahedron()\n"
        "mesh = connectivity(faces)\n"
        "found = normal_projection(np.ones(len(mesh.columns)), r, mesh)\n"
        "print('numba.np.arrayobj' in sys.modules, found.sum().hex())\n"
    )
    first, second = (program(code, NUMBA_CACHE_DIR=str(folder)) for _ in range(2))
    assert first.stdout.split()[0] == "True", first.stderr
    assert second.stdout.split() == ["False", first.stdout.split()[1]], second.stderr


def test_names_of_kernels_are_the_same_in_every_program():
    code = (
        "from amoeboid.numerics.sparse.cholesky import _factorized\n"
        "kernel = _factorized.dispatcher\n"
        "print(kernel._cache._name('signature', kernel.targetctx))\n"
    )
    names = [program(code, PYTHONHASHSEED=seed).stdout for seed in ("1", "2")]
    assert names[0] == names[1] != ""


def test_programs_that_start_together_compile_a_kernel_once(folder):
    code = (
        "from amoeboid.meshes.geometry import area\n"
        "from amoeboid.meshes.connectivity import icosphere\n"
        "from amoeboid.meshes import geometry\n"
        "area(*icosphere(1))\n"
        "kernels = [k for k in vars(geometry).values() if hasattr(k, 'stats')]\n"
        "print(sum(sum(k.stats.cache_misses.values()) for k in kernels))\n"
    )
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder)}
    start = [
        subprocess.Popen(
            [sys.executable, "-c", code],
            env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )
        for _ in range(2)
    ]  # fmt: skip
    said = [process.communicate() for process in start]
    assert [err for _, err in said] == [""] * 2
    assert sum(int(out) for out, _ in said) == len(kernels(folder))


def test_a_program_that_is_killed_while_it_compiles_leaves_its_turn_to_others(folder):
    kept.folder().mkdir(parents=True)
    code = (
        "import fcntl, os, signal\n"
        f"file = open({str(kept.folder() / kept.LOCK)!r}, 'ab')\n"
        "fcntl.flock(file, fcntl.LOCK_EX)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    assert program(code).returncode == -9
    assert compiled(double)(np.float64(3.0)) == 6.0


@pytest.mark.slow
def test_kernels_of_the_build_are_used_and_give_the_same_bits(folder, tmp_path, monkeypatch):
    """Compiled for processors with AVX2 and no more, as for a wheel that is to run on many."""
    r, faces = icosphere(2)
    built = tmp_path / "built"
    code = (
        "from amoeboid.meshes.geometry import geometry\n"
        "from amoeboid.meshes.connectivity import icosphere\n"
        "r, faces = icosphere(2)\n"
        "geometry(r * [1.0, 1.2, 0.9], faces)\n"
    )
    many = {"NUMBA_CPU_NAME": "x86-64-v3", "NUMBA_CPU_FEATURES": "+avx2,+fma"}
    done = program(code, NUMBA_CACHE_DIR=str(built), **many)
    assert done.returncode == 0, done.stderr
    (made,) = built.glob("amoeboid/*")
    monkeypatch.setattr(kept, "BUILT", made)
    kept._runs.cache_clear()
    again = compiled(_geometry.py_func)
    there = again(r * [1.0, 1.2, 0.9], faces)
    assert sum(again.stats.cache_hits.values()) == 1
    assert not kernels(folder / "amoeboid")
    monkeypatch.setattr(kept, "BUILT", tmp_path / "none")
    kept._runs.cache_clear()
    anew = compiled(_geometry.py_func)
    for a, b in zip(there, anew(r * [1.0, 1.2, 0.9], faces), strict=True):
        assert np.array_equal(a, b)
    assert sum(anew.stats.cache_hits.values()) == 0
    kept._runs.cache_clear()


def test_kernels_for_other_processors_are_left_alone(folder, tmp_path, monkeypatch):
    kernel = compiled(double)
    assert kernel(np.float64(3.0)) == 6.0
    built = tmp_path / "built"
    shutil.move(kernels(folder)[0].parent, built)
    (built / kept.PROCESSOR).write_text("x86_64 other\n+avx2,+of-a-later-year\n")
    monkeypatch.setattr(kept, "BUILT", built)
    kept._runs.cache_clear()
    again = compiled(double)
    assert again(np.float64(3.0)) == 6.0
    assert sum(again.stats.cache_hits.values()) == 0
    kept._runs.cache_clear()


def test_old_versions_of_a_kernel_are_removed(folder, monkeypatch):
    monkeypatch.setattr(kept, "MAX_VERSIONS", 2)
    kernel = compiled(double)
    for number in (np.float64(1.0), np.int64(1), np.float32(1.0), np.int32(1)):
        kernel(number)
    assert len(kernels(folder)) == 2

import gc
import os
from functools import cache

# Tests print for no terminal, whatever the one is that they are started from.
for _name in ("COLUMNS", "LINES"):
    os.environ.pop(_name, None)

# One thread a process: the matrices are small, and results must not depend on the machine's cores.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import pytest  # noqa: E402  (after the thread settings)
from hypothesis import HealthCheck, settings  # noqa: E402

# deterministic examples, no deadline: the machine may be busy
settings.register_profile(
    "amoeboid",
    derandomize=True,
    deadline=None,
    database=None,
    max_examples=50,
    suppress_health_check=[HealthCheck.too_slow],
)
# .ci/run --slow: pytest --hypothesis-profile=thorough
settings.register_profile("thorough", settings.get_profile("amoeboid"), max_examples=300)
settings.load_profile("amoeboid")


def pytest_configure():
    gc.disable()  # what the imports of all test files make stays, and is looked through in vain


def pytest_collection_finish():
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)  # the default looks for garbage some hundred times a second
    gc.enable()


@pytest.fixture
def theory_once(monkeypatch):
    """`amoeboid theory` computes a point once, in how many ways it may be printed."""
    from amoeboid.studies import theory

    monkeypatch.setattr(theory, "theory", cache(theory.theory))


@pytest.fixture
def without_pictures(monkeypatch):
    """Runs in this process write an empty picture of the cell, and start no process for it.

    test_drawing.py, test_output.py and test_units_on_pictures.py look at real ones.
    """
    monkeypatch.setattr("amoeboid.plotting.cell_painter.CellPainter.__enter__", lambda self: self)
    monkeypatch.setattr(
        "amoeboid.plotting.cell.save_cell_picture", lambda path, *_: path.write_bytes(b"")
    )

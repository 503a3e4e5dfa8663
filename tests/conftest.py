import gc
import os

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
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("amoeboid")


def pytest_configure():
    gc.disable()  # what the imports of all test files make stays, and is looked through in vain


def pytest_collection_finish():
    gc.freeze()
    gc.enable()


@pytest.fixture
def without_pictures(monkeypatch):
    """Runs in this process write an empty picture of the cell, and start no process for it.

    test_drawing.py, test_output.py and test_units_on_pictures.py look at real ones.
    """
    monkeypatch.setattr("amoeboid.plotting.cell_painter.CellPainter.__enter__", lambda self: self)
    monkeypatch.setattr(
        "amoeboid.plotting.cell.save_cell_picture", lambda path, *_: path.write_bytes(b"")
    )

"""What the timings were measured on."""

from __future__ import annotations

import os
import platform
from typing import Any

from amoeboid.output.versions import installed_versions

THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def machine() -> dict[str, Any]:
    """System, processor, versions, and the threads that linear algebra may use."""
    return {
        "platform": platform.platform(),
        "processor": platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "packages": installed_versions(),
        "threads": {name: os.environ.get(name) for name in THREAD_VARIABLES},
    }

"""Compiles the numerical kernels when a wheel is built, so that a first run need not.

numba writes machine code without a C compiler. The wheel is then one for this Python and this
platform. Where it cannot be done, the wheel has no kernels, and they are compiled when they are
first used. So it is in an editable installation, whose sources will change.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

MAX_COMPILATION = 900.0  # seconds
OMIT = "AMOEBOID_WITHOUT_KERNELS"  # of the environment: for a wheel that fits every platform


class KernelHook(BuildHookInterface):
    """Adds amoeboid/built_kernels to a wheel."""

    _made = ""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile the kernels, and have them included."""
        if version == "editable" or os.environ.get(OMIT):
            return
        self._made = mkdtemp()
        source, target = Path(self.root) / "src", Path(self._made) / "built_kernels"
        paths = [str(source), *filter(None, [os.environ.get("PYTHONPATH")])]
        environment = {"PYTHONPATH": os.pathsep.join(paths), "OPENBLAS_NUM_THREADS": "1"}
        self.app.display_waiting("Compiling the numerical kernels")
        try:
            subprocess.run(  # noqa: S603  (our own program)
                [sys.executable, "-m", "amoeboid.runs.every_kernel", str(target)],
                env=os.environ | environment,
                check=True, capture_output=True, text=True, timeout=MAX_COMPILATION,
            )  # fmt: skip
        except (OSError, subprocess.SubprocessError) as error:
            said = (getattr(error, "stderr", None) or str(error)).strip().splitlines()
            self.app.display_warning(
                f"the kernels were not compiled ({' '.join(said[-1:])}); the first run will do it"
            )
            return
        build_data["force_include"][str(target)] = "amoeboid/built_kernels"
        build_data["pure_python"], build_data["infer_tag"] = False, True

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove what was compiled: it is in the wheel."""
        if self._made:
            rmtree(self._made, ignore_errors=True)

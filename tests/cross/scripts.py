"""Scripts of benchmarks/, loaded from their files: what they publish is what is tested."""

import importlib.util
import sys
from functools import cache
from pathlib import Path


@cache
def script(name):
    path = Path(__file__).parents[2] / "benchmarks" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(f"benchmarks_{name}", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module

"""The installed command as a process, and settings of a short run."""

import sys
import tomllib
from pathlib import Path

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]
MODULE, FUNCTION = PROJECT["scripts"]["amoeboid"].split(":")
COMMAND = [
    sys.executable,
    "-c",
    f"import sys; from {MODULE} import {FUNCTION}; sys.exit({FUNCTION}())",
]
SHORT = [
    "--set",
    "mesh.subdivisions=1",
    "--set",
    "initial.perturbation=1",
    "--set",
    "time.end=0.01",
]

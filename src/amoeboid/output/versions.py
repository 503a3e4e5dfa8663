"""Versions of the packages that results or timings depend on."""

from __future__ import annotations

from functools import cache
from importlib.metadata import PackageNotFoundError, version

# What is recorded with every run and every timing; those not installed are left out.
PACKAGES = ("amoeboid", "numpy", "scipy", "numba", "vtk", "pyvista", "llvmlite")


def installed_versions() -> dict[str, str]:
    """Versions of those of `PACKAGES` that are installed, by name."""
    found = {name: _version(name) for name in PACKAGES}
    return {name: text for name, text in found.items() if text}


@cache
def _version(name: str) -> str:
    """Empty for what is not installed. Reading it takes 15 ms, and a run asks twice for seven."""
    try:
        return version(name)
    except PackageNotFoundError:
        return ""

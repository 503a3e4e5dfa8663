"""Versions of the packages that results or timings depend on."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

# What is recorded with every run and every timing; those not installed are left out.
PACKAGES = ("amoeboid", "numpy", "scipy", "numba", "vtk", "pyvista", "llvmlite")


def installed_versions() -> dict[str, str]:
    """Versions of those of `PACKAGES` that are installed, by name."""
    versions = {}
    for name in PACKAGES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            continue
    return versions

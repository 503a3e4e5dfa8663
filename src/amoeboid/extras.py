"""Optional packages, and the extra of amoeboid that installs each.

The package needs NumPy and SciPy. What else a result needs is imported where it is used, by
`needed` or behind `check`, so that a missing package is one message with its remedy. The extras of
pyproject.toml hold the same packages.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from amoeboid.validation import InvalidInput

# By extra: the modules that are imported, each with the name by which its project is known.
EXTRAS: dict[str, dict[str, str]] = {
    "surface": {"numba": "Numba", "PIL": "Pillow"},
    "plot": {"matplotlib": "matplotlib"},
    "units": {"pint": "Pint"},
    "vtk": {"vtkmodules": "VTK"},
    "data": {"pandas": "pandas", "xarray": "xarray", "h5netcdf": "h5netcdf", "h5py": "h5py"},
    "dask": {"distributed": "distributed"},
    "posterior": {"emcee": "emcee"},
    "movie": {"imageio_ffmpeg": "imageio-ffmpeg"},
    "explore": {"websockets": "websockets"},
    "gpu": {"jax": "JAX"},
}


def installed(module: str) -> bool:
    """Whether an optional module is there; it is not imported."""
    return find_spec(module) is not None


def check(who: str, *modules: str) -> None:
    """Raise InvalidInput for the first of the optional modules that is not installed.

    `who` begins the sentence, as in "a picture needs". Nothing is imported.

    >>> check("a picture needs", "matplotlib")
    """
    for module in modules:
        if not installed(module):
            raise _missing(who, module, "is not installed")


def needed(module: str, who: str) -> Any:
    """An optional module, imported. Raises InvalidInput as `check`, also where it is broken."""
    check(who, module)
    try:
        return import_module(module)
    except ImportError as error:
        raise _missing(who, module, f"cannot be imported ({error})") from None


def remedy(extra: str) -> str:
    """The command that installs an extra.

    >>> remedy("plot")
    "pip install 'amoeboid[plot]'"
    """
    return f"pip install 'amoeboid[{extra}]'"


def _missing(who: str, module: str, why: str) -> InvalidInput:
    extra = next(extra for extra, modules in EXTRAS.items() if module in modules)
    return InvalidInput(f"{who} {EXTRAS[extra][module]}, which {why}; {remedy(extra)}")

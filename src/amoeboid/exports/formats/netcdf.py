"""One file of NetCDF for xarray: the time series, and all frames as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.config import config_to_toml
from amoeboid.exports.job import Format, Job, Write
from amoeboid.observables import retrograde_flow
from amoeboid.simulation.rows import WHOLE
from amoeboid.surface.cell import SurfaceCell

CHUNK = 2**17  # numbers that are compressed together
EMPTY = {"f": np.nan, "i": -1}  # in place of nodes and triangles that a frame does not have

# Variables over the frames: their further dimensions, dimension of the unit, and meaning.
FIELDS: dict[str, tuple[tuple[str, ...], str | None, str]] = {
    "frame_t": ((), "T", "time of the frame"),
    "n_nodes": ((), None, "number of nodes of the frame"),
    "n_triangles": ((), None, "number of triangles of the frame"),
    "center": (("xyz",), "L", "center of volume"),
    "x": (("node", "xyz"), "L", "nodes relative to the center of volume"),
    "c": (("node",), "N/L^2", "filament concentration"),
    "v": (("node", "xyz"), "L/T", "full velocity in the frame of the nodes, in the axes of x"),
    "retrograde_flow": (
        ("node", "xyz"),
        "L/T",
        "tangential velocity in the frame of the cell, same axes",
    ),
    "triangles": (("triangle", "corner"), None, "numbers of the nodes, outward"),
}
WHOLE_NUMBERS = {"n_nodes", "n_triangles", "triangles"}


def write(job: Job, path: Path) -> None:
    """Write the file, frame by frame.

    Where the mesh changes, frames have different numbers of nodes: behind those of a frame are NaN,
    and -1 behind its triangles.
    """
    sizes = np.array([(len(cell.c), len(cell.faces)) for _, cell in job.cells("sizes")])
    n_nodes, n_triangles = (int(n) for n in sizes.reshape(-1, 2).max(axis=0, initial=0))
    lengths = {"step": len(job.run.rows)} if job.has_series else {}
    if len(job.numbers):
        lengths |= {"frame": len(job.numbers), "node": n_nodes, "triangle": n_triangles}
        lengths |= {"xyz": 3, "corner": 3}
    with import_module("h5netcdf").File(path, "w") as file:
        file.attrs.update(_about(job))
        file.dimensions = lengths
        _add_series(job, file)
        if not len(job.numbers):
            return
        found = {name: _declared(job, file, name) for name in FIELDS}
        numbers = file.create_variable("frame", ("frame",), "i8")
        numbers[:] = np.array(job.numbers)
        for count, (_, cell) in enumerate(job.cells("netcdf")):
            for name, values in _values(job, cell).items():
                variable = found[name]
                filled = np.full(variable.shape[1:], EMPTY[variable.dtype.kind], variable.dtype)
                filled[tuple(slice(0, n) for n in values.shape)] = values
                variable[count] = filled


def _about(job: Job) -> dict[str, Any]:
    run = job.run
    return {
        "title": f"run {job.name}: {run.parameters.description}",
        "source": f"amoeboid {version('amoeboid')}",
        "path": job.path_words,
        "status": run.status,
        "ended": run.ended,
        "configuration": config_to_toml(run.config),
    }


def _add_series(job: Job, file: Any) -> None:
    """The time series over the dimension `step`."""
    for name, column in (job.run.columns if job.has_series else {}).items():
        kind = "i8" if name in WHOLE else "f8"
        own = f"series_{name}" if name in FIELDS else name
        variable = file.create_variable(own, ("step",), kind)
        variable[:] = column.values.astype(kind)
        variable.attrs["units"] = column.unit or "1"


def _declared(job: Job, file: Any, name: str) -> Any:
    dimensions, dimension, meaning = FIELDS[name]
    whole = name in WHOLE_NUMBERS
    sizes = [file.dimensions[d].size for d in dimensions]
    count = len(job.numbers)
    per_chunk = int(np.clip(CHUNK // max(1, int(np.prod(sizes))), 1, count))
    variable = file.create_variable(
        name, ("frame", *dimensions), "i8" if whole else "f8",
        chunks=(per_chunk, *sizes), compression="gzip", compression_opts=4, shuffle=True,
    )  # fmt: skip
    if not whole:
        variable.attrs["units"] = job.unit(dimension) or "1"
    variable.attrs["long_name"] = meaning
    return variable


def _values(job: Job, cell: SurfaceCell) -> dict[str, Array]:
    place = job.place(cell)
    found = {
        "frame_t": np.array(cell.t),
        "n_nodes": np.array(len(cell.c)),
        "n_triangles": np.array(len(cell.faces)),
        "center": place.center,
        "x": place.turned(cell.x),
        "c": cell.c,
        "v": place.turned(cell.v),
        "retrograde_flow": place.turned(retrograde_flow(cell)),
        "triangles": cell.faces,
    }
    return {
        name: values if FIELDS[name][1] is None else np.asarray(job.shown(values, FIELDS[name][1]))
        for name, values in found.items()
    }


def files(job: Job) -> Mapping[str, Write]:
    """One file."""
    return {f"{job.name}.nc": lambda path: write(job, path)}


FORMAT = Format(
    "one file for xarray with the time series and all frames as arrays",
    ".nc",
    files,
    packages=("h5netcdf", "h5py"),
    frames=False,
    series=True,
)

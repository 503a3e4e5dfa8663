"""The trajectory and the surfaces as napari takes them: tracks.csv and surface.npz."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.exports.job import Format, Job, Write
from amoeboid.exports.tables import write_rows

TRACK = 0
NEVER = (1980, 1, 1, 0, 0, 0)  # the date in an archive, so that the same run is the same file


def tracks(job: Job, path: Path) -> None:
    """Columns of a tracks layer: the track, the count of the frame, and z, y, x."""

    def rows() -> Iterator[list[Any]]:
        for count, (_, cell) in enumerate(job.cells("tracks")):
            x, y, z = (float(a) for a in job.center(cell))
            yield [TRACK, count, z, y, x]

    write_rows(path, [["track_id", "t", "z", "y", "x"]], rows())


def surface(job: Job, path: Path) -> None:
    """Arrays of a surface layer in four dimensions: vertices (N, 4), faces (M, 3), values (N,).

    Columns of the vertices are the count of the frame, and z, y, x; values are c.
    """
    sizes = np.array([(len(cell.c), len(cell.faces)) for _, cell in job.cells("sizes")])
    starts = np.concatenate([[0], np.cumsum(sizes[:, 0])])

    def vertices() -> Iterator[Array]:
        for count, (_, cell) in enumerate(job.cells("vertices")):
            nodes = job.nodes(cell)[:, ::-1]
            yield np.column_stack([np.full(len(nodes), float(count)), nodes])

    def faces() -> Iterator[Array]:
        for count, (_, cell) in enumerate(job.cells("faces")):
            # outward in the order z, y, x of the vertices, which mirrors the cell
            yield cell.faces[:, ::-1] + starts[count]

    def values() -> Iterator[Array]:
        for _, cell in job.cells("values"):
            yield np.asarray(job.shown(cell.c, "N/L^2"))

    n_nodes, n_faces = (int(n) for n in sizes.sum(axis=0))
    with zipfile.ZipFile(path, "w") as archive:
        _add(archive, "vertices", "<f8", (n_nodes, 4), vertices)
        _add(archive, "faces", "<i8", (n_faces, 3), faces)
        _add(archive, "values", "<f8", (n_nodes,), values)


def _add(
    archive: zipfile.ZipFile,
    name: str,
    kind: str,
    shape: tuple[int, ...],
    parts: Callable[[], Iterator[Array]],
) -> None:
    """Add an array to an archive of NumPy, part by part."""
    entry = zipfile.ZipInfo(f"{name}.npy", NEVER)
    with archive.open(entry, "w", force_zip64=True) as file:
        about = {"descr": kind, "fortran_order": False, "shape": shape}
        np.lib.format.write_array_header_1_0(file, about)
        for part in parts():
            file.write(np.ascontiguousarray(part, kind).tobytes())


def files(job: Job) -> Mapping[str, Write]:
    """A table and an archive."""
    return {
        "tracks.csv": lambda path: tracks(job, path),
        "surface.npz": lambda path: surface(job, path),
    }


FORMAT = Format(
    "tracks.csv and surface.npz, for layers of tracks and surfaces", ".npz", files,
    frozenset({"follow"}),
)  # fmt: skip

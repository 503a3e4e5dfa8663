"""Reads one .vtp file with VTK; a program of its own, see `files`.

Arguments: the file and where to write an .npz archive of plain arrays: `points` (V, 3), `faces`
(F, 3) with polygons and strips cut into triangles, what the file holds of `c`, `t`, `zeta0`, and
`vectors NAME` (V, 3) at the points; or only `problem`, a text.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

MAX_MEMORY = 2**33  # bytes of address space, some of which libraries take and never use


def main(path: str, answer: str) -> None:
    """Read the file, write the archive."""
    _limit_memory()
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

    reader = vtkXMLPolyDataReader()
    reader.SetFileName(path)
    reader.Update()
    np.savez(answer, **_contents(reader.GetOutput()))


def _limit_memory() -> None:
    """Let a file that announces more than it has end this process, not all others."""
    try:
        import resource
    except ImportError:  # only on POSIX
        return
    most = resource.getrlimit(resource.RLIMIT_AS)[1]
    limit = MAX_MEMORY if most == resource.RLIM_INFINITY else min(MAX_MEMORY, most)
    resource.setrlimit(resource.RLIMIT_AS, (limit, most))


def _contents(surface: Any) -> dict[str, Any]:
    from vtkmodules.util.numpy_support import vtk_to_numpy

    n_points = surface.GetNumberOfPoints()
    if n_points == 0 or surface.GetNumberOfPolys() + surface.GetNumberOfStrips() == 0:
        return {"problem": "no triangles were found in it"}
    # readers do not check the numbers of points, and what follows would read past the end
    for cells in (surface.GetPolys(), surface.GetStrips()):
        used = vtk_to_numpy(cells.GetConnectivityArray())
        if len(used) and not 0 <= used.min() <= used.max() < n_points:
            return {
                "problem": f"its triangles use points {used.min()} to {used.max()} of {n_points}"
            }
    contents = {
        "points": vtk_to_numpy(surface.GetPoints().GetData()).astype(np.float64),
        "faces": vtk_to_numpy(_triangles(surface).GetConnectivityArray()).reshape(-1, 3),
    }
    for name, data in (
        ("c", surface.GetPointData()),
        ("t", surface.GetFieldData()),
        ("zeta0", surface.GetFieldData()),
    ):
        array = data.GetArray(name)
        if array is not None:
            contents[name] = vtk_to_numpy(array).astype(np.float64)
    at_points = surface.GetPointData()
    for k in range(at_points.GetNumberOfArrays()):
        array = at_points.GetArray(k)
        if array is not None and array.GetNumberOfComponents() == 3 and array.GetName():
            contents[f"vectors {array.GetName()}"] = vtk_to_numpy(array).astype(np.float64)
    return contents


def _triangles(surface: Any) -> Any:
    """The polygons and strips of the surface as triangles, points as they are."""
    polygons = surface.GetPolys()
    if surface.GetNumberOfStrips() == 0 and polygons.IsHomogeneous() == 3:
        return polygons
    from vtkmodules.vtkFiltersCore import vtkTriangleFilter

    filter_ = vtkTriangleFilter()
    filter_.SetInputData(surface)
    filter_.PassVertsOff()
    filter_.PassLinesOff()
    filter_.Update()
    return filter_.GetOutput().GetPolys()


if __name__ == "__main__":
    main(*sys.argv[1:])

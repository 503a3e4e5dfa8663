"""Reads one surface file with VTK; a program of its own, see `files`.

Arguments: the file and its format (stl, ply, obj, vtp). Writes an .npz archive to standard output:
`points` (V, 3), `faces` (F, 3) with polygons cut into triangles, and what the file holds of
`c`, `t`, `zeta0`; or only `problem`, a text.
"""

from __future__ import annotations

import io
import sys
from typing import Any

import numpy as np


def main(path: str, kind: str) -> None:
    """Read the file, write the archive."""
    surface = _read(path, kind)
    archive = io.BytesIO()
    np.savez(archive, allow_pickle=False, **_contents(surface))
    sys.stdout.buffer.write(archive.getvalue())


def _read(path: str, kind: str) -> Any:
    reader: Any
    if kind == "stl":
        from vtkmodules.vtkIOGeometry import vtkSTLReader

        reader = vtkSTLReader()
        reader.MergingOff()
    elif kind == "obj":
        from vtkmodules.vtkIOGeometry import vtkOBJReader

        reader = vtkOBJReader()
    elif kind == "ply":
        from vtkmodules.vtkIOPLY import vtkPLYReader

        reader = vtkPLYReader()
    else:
        from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

        reader = vtkXMLPolyDataReader()
    reader.SetFileName(path)
    reader.Update()
    return reader.GetOutput()


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

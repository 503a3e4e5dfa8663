"""Surfaces as arrays and as files in the formats that can be imported."""

import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkIOGeometry import vtkOBJWriter, vtkSTLWriter
from vtkmodules.vtkIOPLY import vtkPLYWriter
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

from amoeboid.meshes.connectivity import icosphere

WRITERS = {
    "stl": vtkSTLWriter,
    "ply": vtkPLYWriter,
    "obj": vtkOBJWriter,
    "vtp": vtkXMLPolyDataWriter,
}


def write_surface(path, r, faces, point_data=(), field_data=()):
    """Write nodes (V, 3) and polygons (F, k) in the format of the file's name."""
    surface = vtkPolyData()
    points = vtkPoints()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(r, dtype=float), deep=True))
    surface.SetPoints(points)
    polygons = vtkCellArray()
    sizes = np.full(len(faces), faces.shape[1])
    numbers = np.column_stack([sizes, faces]).ravel().astype(np.int64)
    polygons.ImportLegacyFormat(numpy_to_vtkIdTypeArray(numbers, deep=True))
    surface.SetPolys(polygons)
    for data, fields in (
        (surface.GetPointData(), dict(point_data)),
        (surface.GetFieldData(), dict(field_data)),
    ):
        for name, values in fields.items():
            array = numpy_to_vtk(np.array(values, dtype=float, ndmin=1), deep=True)
            array.SetName(name)
            data.AddArray(array)
    writer = WRITERS[path.suffix[1:]]()
    writer.SetFileName(str(path))
    writer.SetInputData(surface)
    assert writer.Write() == 1
    return path


def ellipsoid(subdivisions=2):
    r, faces = icosphere(subdivisions)
    return r * [1.0, 1.25, 1.5], faces


def cube(n=4):
    """The cube [-1, 1]^3 in n x n squares a side: nodes, quadrilaterals."""
    u, v = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, n + 1), indexing="ij")
    number = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    square = np.stack(
        [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1
    ).reshape(-1, 4)
    nodes, quads = [], []
    for axis in range(3):
        for side in (1, -1):
            quads.append((square if side > 0 else square[:, ::-1]) + len(nodes) * u.size)
            nodes.append(np.roll(np.stack([0 * u + side, u, v], axis=-1), axis, axis=2))
    r, which = np.unique(np.concatenate(nodes).reshape(-1, 3), axis=0, return_inverse=True)
    return r, which.reshape(-1)[np.concatenate(quads)]


def torus(n=20, m=10):
    u, v = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.arange(m) * 2 * np.pi / m, indexing="ij")
    ring = 3 + np.cos(v)
    r = np.stack([ring * np.cos(u), ring * np.sin(u), np.sin(v)], axis=-1).reshape(-1, 3)
    number = np.arange(n * m).reshape(n, m)
    a, b = number, np.roll(number, -1, axis=0)
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    return r, np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])


def hemisphere():
    r, faces = icosphere(2)
    upper = faces[np.all(r[faces][:, :, 2] > -1e-9, axis=1)]
    used, which = np.unique(upper, return_inverse=True)
    return r[used], which.reshape(-1, 3)


def two_spheres(shift=(5.0, 0.0, 0.0)):
    r, faces = icosphere(2)
    return np.vstack([r, r + shift]), np.vstack([faces, faces + len(r)])


def pinched():
    """Two spheres that share one node and nothing else."""
    r, faces = icosphere(2)
    top, bottom = np.argmax(r[:, 2]), np.argmin(r[:, 2])
    second = faces + len(r)
    second[faces == bottom] = top
    used, which = np.unique(np.vstack([faces, second]), return_inverse=True)
    return np.vstack([r, r + r[top] - r[bottom]])[used], which.reshape(-1, 3)


def crossing():
    """A sphere whose north pole is pulled out through the south pole."""
    r, faces = icosphere(2)
    r[np.argmax(r[:, 2])] = [0.1, 0.05, -1.5]
    return r, faces


def inside_out():
    r, faces = ellipsoid()
    return r, faces[:, ::-1]


def with_fin():
    """A third triangle, on a node of its own, at one edge."""
    r, faces = ellipsoid()
    return np.vstack([r, [2.0, 2.0, 2.0]]), np.vstack([faces, [*faces[0, :2], len(r)]])


def one_turned():
    r, faces = ellipsoid()
    faces[7] = faces[7, ::-1]
    return r, faces


def seam():
    """A T-junction: a node in the middle of an edge, which only one of the two triangles has."""
    r, faces = ellipsoid()
    a, b, c = faces[0]
    r, middle = np.vstack([r, (r[a] + r[b]) / 2]), len(r)
    return r, np.vstack([faces[1:], [[a, middle, c], [middle, b, c]]])


def sliver():
    r, faces = ellipsoid()
    a, b, c = faces[0]
    r[a] = 0.999 * r[b] + 0.001 * r[c] + [0, 0, 1e-9]
    return r, faces


def unused():
    r, faces = ellipsoid()
    return np.vstack([r, [9.0, 9.0, 9.0]]), faces


def flat():
    """A surface with every node in one plane."""
    r, faces = ellipsoid()
    return r * [1.0, 1.0, 0.0], faces


BAD = {
    hemisphere: "be closed",
    seam: "be closed",
    with_fin: "be a manifold: two triangles",
    pinched: "be a manifold: one fan",
    one_turned: "consistently oriented",
    two_spheres: "be one piece, got 2",
    torus: r"deformed sphere \(Euler characteristic 2\), got 0",
    sliver: "degenerate triangles",
    crossing: "not intersect",
    inside_out: "oriented inward",
}

"""Files that are missing, damaged or hostile: one message, whatever the reader does with them."""

import gzip
import os
import struct
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from amoeboid.meshes import files
from amoeboid.meshes.checks import joined
from amoeboid.meshes.files import FORMATS, surface_file
from amoeboid.meshes.geometry import face_vectors, volume
from amoeboid.validation import InvalidInput
from surface.dialects import dialects, obj_text, ply_header, ply_text, stl_binary, stl_text
from surface.written import cube, ellipsoid, write_surface

PLY = (
    "ply\nformat {format} 1.0\nelement vertex {n}\nproperty float x\nproperty float y\n"
    "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n0 1 0\n3 0 1 {last}\n"
)
VTP = (
    '<?xml version="1.0"?><VTKFile type="PolyData" version="1.0" byte_order="LittleEndian">'
    '<PolyData><Piece NumberOfPoints="{n}" NumberOfVerts="0" NumberOfLines="0" '
    'NumberOfStrips="0" NumberOfPolys="1"><Points><DataArray type="Float64" '
    'NumberOfComponents="3" format="ascii">0 0 0 1 0 0 0 1 0</DataArray></Points><Polys>'
    '<DataArray type="Int64" Name="connectivity" format="ascii">0 1 {last}</DataArray>'
    '<DataArray type="Int64" Name="offsets" format="ascii">3</DataArray></Polys></Piece>'
    "</PolyData></VTKFile>"
)
HOSTILE = {
    # some of these end the process of the reader: it reads past the end, or finds no memory
    "many.ply": PLY.format(format="ascii", n=10**12, last=2),
    "binary.ply": PLY.format(format="binary_little_endian", n=2 * 10**9, last=2),
    "far.ply": PLY.format(format="ascii", n=3, last=99999999),
    "negative.ply": PLY.format(format="ascii", n=3, last=-9),
    "far.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 999999\n",
    "negative.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -99\n",
    "two.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n",
    "far.vtp": VTP.format(n=3, last=99999999),
    "many.vtp": VTP.format(n=3 * 10**12, last=2),
    "short.stl": b"\0" * 80 + struct.pack("<I", 10) + b"\0" * 120,
    "words.stl": "these are only words\n",
    "words.vtp": "these are only words\n",
    "empty.obj": "",
    "empty.ply": "",
}


@pytest.mark.parametrize("name", HOSTILE)
def test_damaged_files_are_rejected_and_do_not_end_the_program(name, tmp_path, capfd):
    content = HOSTILE[name]
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InvalidInput, match=rf"^initial\.surface must hold a surface in .*{name}"):
        surface_file(str(tmp_path / name), "initial.surface")
    assert capfd.readouterr() == ("", "")


@settings(max_examples=8)
@given(st.sampled_from(FORMATS), st.integers(0, 2**32))
def test_a_file_with_changed_bytes_is_read_or_rejected(tmp_path_factory, kind, seed):
    path = write_surface(tmp_path_factory.mktemp("files") / f"cell.{kind}", *ellipsoid(1))
    content = bytearray(path.read_bytes())
    rng = np.random.default_rng(seed)
    for place in rng.integers(0, len(content), size=5):
        content[place] = rng.integers(0, 256)
    path.write_bytes(content)
    try:
        file = surface_file(str(path), "initial.surface")
    except InvalidInput as refusal:
        assert "initial.surface must" in str(refusal)  # noqa: PT017
    else:
        assert file.r.shape[1] == file.faces.shape[1] == 3
        assert 0 <= file.faces.min() <= file.faces.max() < len(file.r)


def test_a_path_that_is_no_file_is_rejected_by_name(tmp_path):
    (tmp_path / "folder.stl").mkdir()
    os.mkfifo(tmp_path / "pipe.stl")
    for name, says in (
        ("missing.stl", "there is none"),
        ("folder.stl", "not a regular file"),
        ("pipe.stl", "not a regular file"),
        ("cell.step", r"of type \.stl, \.ply, \.obj, \.vtp, got"),
        ("cell", "of type"),
        ("n" * 5000 + ".stl", "readable file"),
    ):
        with pytest.raises(InvalidInput, match=rf"^initial\.surface must be a .*{says}"):
            surface_file(str(tmp_path / name), "initial.surface")


def test_the_type_may_be_in_capitals(tmp_path):
    path = write_surface(tmp_path / "cell.stl", *ellipsoid())
    path = path.rename(tmp_path / "CELL.STL")
    assert len(surface_file(str(path), "initial.surface").faces) == 320


CELL = ellipsoid()
DIALECTS = dialects(*CELL)


@pytest.mark.parametrize("name", DIALECTS)
def test_every_dialect_gives_the_same_surface(name, tmp_path):
    (tmp_path / name).write_bytes(DIALECTS[name])
    file = surface_file(str(tmp_path / name), "initial.surface")
    # what was written, in its order; text has nine digits, binary is in single precision
    np.testing.assert_allclose(file.r[file.faces], CELL[0][CELL[1]], atol=1e-7)


@pytest.mark.parametrize("kind", ["obj", "ply"])
def test_polygons_of_any_size_are_cut_into_triangles_inside_them(kind, tmp_path):
    """A prism whose ends are concave, of 9 corners: its volume is their area times the height."""
    angle = np.linspace(0, 2 * np.pi, 9, endpoint=False)
    radius = np.where(np.arange(9) % 3 == 0, 0.35, 1.0)
    flat = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    r = np.concatenate([np.column_stack([flat, z + 0 * angle]) for z in (0.0, 2.0)])
    sides = [(k, (k + 1) % 9, (k + 1) % 9 + 9, k + 9) for k in range(9)]
    polygons = [tuple(range(8, -1, -1)), tuple(range(9, 18)), *sides]
    (tmp_path / f"prism.{kind}").write_bytes({"obj": obj_text, "ply": ply_text}[kind](r, polygons))
    file = surface_file(str(tmp_path / f"prism.{kind}"), "initial.surface")
    assert len(file.faces) == 2 * 7 + 9 * 2
    x, y = flat.T
    polygon = 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    assert volume(file.r, file.faces) == pytest.approx(2.0 * polygon, rel=1e-7)
    # and none reaches out of it: the areas of the ends are no larger than theirs
    ends = file.faces[:14]
    areas = np.linalg.norm(face_vectors(file.r, ends), axis=1)
    assert areas.sum() == pytest.approx(2 * polygon, rel=1e-7)


def test_quadrilaterals_are_cut_along_the_diagonal_that_keeps_them_sound(tmp_path):
    """An arrowhead has one diagonal inside; a rectangle's triangles are as good either way."""
    r = np.array([(0, 0, 0), (2, 1, 0), (0, 0.5, 0), (-2, 1, 0), (0, 0, -1.0)])
    (tmp_path / "arrow.obj").write_bytes(obj_text(r, [(0, 1, 2, 3)]))
    faces = surface_file(str(tmp_path / "arrow.obj"), "initial.surface").faces
    assert all({0, 2} <= set(face) for face in faces.tolist())
    r, quads = cube()
    (tmp_path / "cube.obj").write_bytes(obj_text(r, quads))
    file = surface_file(str(tmp_path / "cube.obj"), "initial.surface")
    assert volume(file.r, file.faces) == pytest.approx(8.0, rel=1e-12)


TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
REFUSED = {
    "comma.stl": (stl_text(*CELL).replace(b".", b","), r"decimal comma.* with decimal points"),
    "words.obj": (
        TRIANGLE.replace("v 1 0", "v one 0"),
        "line 2: 'one' is in the place of a number",
    ),
    "cut.stl": (stl_text(*CELL)[:20000], "truncated"),
    "none.stl": (stl_binary(*CELL)[:80] + b"\0" * 4 + stl_binary(*CELL)[84:], "length fits 320"),
    "empty.stl": (b"", "it is empty"),
    "packed.stl": (gzip.compress(stl_text(*CELL)), r"packed \(gzip\); unpack it"),
    "wide.obj": (("\ufeff" + TRIANGLE).encode("utf-16-le"), "UTF-16; save it as plain text"),
    "other.stl": (ply_text(*CELL), r"begins like a file of type \.ply; rename it if it is one"),
    "reference.stl": (b"version https://git-lfs.github.com/spec/v1\n", "fetch the file"),
    "zero.obj": (TRIANGLE.replace("f 1", "f 0"), "line 4: no point has the number '0'"),
    "weight.obj": (TRIANGLE.replace("v 1 0 0", "v 1 0 0 2"), "weight of a point must be 1, got 2"),
    "short.obj": (TRIANGLE.replace("v 1 0 0", "v 1 0"), "three coordinates, got 2"),
    "points.obj": (TRIANGLE[:24], "no triangles were found"),
    "large.obj": (obj_text(*CELL) + b"f" + b" 1" * 100, "3 to 64 corners, .* cut them"),
    "cut.ply": (ply_text(*CELL)[:-400], "ends before the 320 elements 'face'"),
    "half.ply": (ply_text(*CELL).replace(b"3 1 ", b"3 1.5 "), "must be whole numbers"),
    "type.ply": (ply_text(*CELL).replace(b"float x", b"real x"), "line 'property real x'"),
    "points.ply": (ply_header("ascii", 0, 0).replace(b"_indices", b"s"), "lacks property"),
    "length.ply": (ply_text(*CELL).replace(b"\n3 ", b"\n-3 "), "length of a list"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_unreadable_files_are_rejected_with_the_reason(name, tmp_path):
    content, says = REFUSED[name]
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InvalidInput, match=f"^initial.surface must hold .*{name}' does.*{says}"):
        surface_file(str(tmp_path / name), "initial.surface")


def test_compressed_and_too_large_files_are_rejected(tmp_path, monkeypatch):
    (tmp_path / "cell.stl.gz").write_bytes(b"")
    with pytest.raises(InvalidInput, match=r"of type \.stl, .*cell\.stl\.gz'; unpack it"):
        surface_file(str(tmp_path / "cell.stl.gz"), "initial.surface")
    monkeypatch.setattr(files, "MAX_FILE_SIZE", 1000)
    (tmp_path / "cell.stl").write_bytes(bytes(1001))
    with pytest.raises(InvalidInput, match=r"larger than .* MiB; export it with fewer triangles"):
        surface_file(str(tmp_path / "cell.stl"), "initial.surface")


LONG = {
    # each would take hours or all memory if it were searched or counted again and again
    "spaces.stl": b"solid\nfacet vertex " + b" " * 2**22,
    "word.stl": b"solid\nfacet vertex 1 2" + b"3" * 2**22,
    "vertex.stl": b"solid\nfacet " + b"vertex " * 2**19,
    "word.obj": b"v " + b"1" * 2**22,
    "backslashes.obj": b"v \\\n" * 2**19,
    "list.ply": ply_header("ascii", 0, 2**30) + b"0 " * 2**20,
    "long.ply": ply_header("binary_little_endian", 0, 1, index="double") + b"\xff" * 2**21,
    "header.ply": b"ply\n" + b"comment\n" * 2**19,
}


@pytest.mark.parametrize("name", LONG)
def test_no_file_takes_long(name, tmp_path):
    (tmp_path / name).write_bytes(LONG[name])
    began = time.process_time()
    with pytest.raises(InvalidInput, match="must hold a surface"):
        surface_file(str(tmp_path / name), "initial.surface")
    assert time.process_time() - began < 20  # measured: less than 1


@pytest.mark.parametrize("name", ["a b/cell.stl", "ä-细胞/zelle ü.obj", "CELL.PLY", "-o.stl"])
def test_any_name_of_a_file_will_do(name, tmp_path, monkeypatch):
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    kind = path.suffix.lower()
    data = {".stl": stl_binary, ".obj": obj_text, ".ply": ply_text}[kind](*CELL)
    path.write_bytes(data)
    monkeypatch.chdir(tmp_path)
    for given_as in (str(path), name):
        assert len(surface_file(given_as, "initial.surface").faces) == 320


@pytest.mark.parametrize("kind", FORMATS)
def test_programs_that_print_when_python_starts_do_no_harm(kind, tmp_path, monkeypatch, capfd):
    (tmp_path / "sitecustomize.py").write_text(
        "import sys\nprint('hello')\nprint('there', file=sys.stderr, flush=True)\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    path = write_surface(tmp_path / f"cell.{kind}", *CELL)
    r, faces, _ = joined(*_arrays(path))
    assert (len(r), len(faces)) == (162, 320)
    assert capfd.readouterr() == ("", "")


def _arrays(path):
    file = surface_file(str(path), "initial.surface")
    return file.r, file.faces

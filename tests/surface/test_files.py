"""Files that are missing, damaged or hostile: one message, whatever the reader does with them."""

import os
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from amoeboid.surface.files import FORMATS, surface_file
from amoeboid.validation import InvalidInput
from surface.written import ellipsoid, write_surface

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
def test_damaged_files_are_refused_and_end_nothing(name, tmp_path, capfd):
    content = HOSTILE[name]
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InvalidInput, match=rf"^initial\.surface must hold a surface in .*{name}"):
        surface_file(str(tmp_path / name), "initial.surface")
    assert capfd.readouterr() == ("", "")


@settings(max_examples=8)
@given(st.sampled_from(FORMATS), st.integers(0, 2**32))
def test_a_file_with_changed_bytes_is_read_or_refused(tmp_path_factory, kind, seed):
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


def test_what_is_no_file_is_named(tmp_path):
    (tmp_path / "folder.stl").mkdir()
    os.mkfifo(tmp_path / "pipe.stl")
    for name, says in (
        ("missing.stl", "there is none"),
        ("folder.stl", "no regular file"),
        ("pipe.stl", "no regular file"),
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

"""The files of frames: what is written is read, also as version 0.1 wrote it, and no more."""

import base64
import re

import numpy as np
import pytest
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader, vtkXMLPolyDataWriter

from amoeboid.meshes.connectivity import icosphere
from amoeboid.meshes.vtp import UNREADABLE, frame_bytes, vtp_arrays

R, FACES = icosphere(1)
FIELDS = {"c": np.linspace(1.0, 2.0, len(R)), "v_c": R**2}
NUMBERS = {"t": np.array([0.25]), "zeta0": np.array([155.0])}
NEW = frame_bytes(R, FACES, FIELDS, NUMBERS)
BODY = b'<AppendedData encoding="base64">'


@pytest.fixture(scope="module")
def old(tmp_path_factory):
    """The same frame in base64 of zlib, in blocks of 320 bytes."""
    folder = tmp_path_factory.mktemp("frames")
    (folder / "new.vtp").write_bytes(NEW)
    reader = vtkXMLPolyDataReader()
    reader.SetFileName(str(folder / "new.vtp"))
    writer = vtkXMLPolyDataWriter()
    writer.SetInputConnection(reader.GetOutputPort())
    writer.SetFileName(str(folder / "old.vtp"))
    writer.SetDataModeToAppended()
    writer.EncodeAppendedDataOn()
    writer.SetHeaderTypeToUInt32()
    writer.SetBlockSize(320)
    assert writer.Write() == 1
    return (folder / "old.vtp").read_bytes()


def check(arrays):
    np.testing.assert_array_equal(arrays["Points"].reshape(-1, 3), R)
    np.testing.assert_array_equal(arrays["connectivity"].reshape(-1, 3), FACES)
    for name, values in (FIELDS | NUMBERS).items():
        np.testing.assert_array_equal(arrays[name], np.ravel(values))


def test_a_frame_is_read_as_it_was_written():
    check(vtp_arrays(NEW))


def test_a_frame_of_version_0_1_is_read_without_vtk(old):
    assert BODY in old
    check(vtp_arrays(old))


def with_header(data, place, number):
    """The file with another number in the header of its points: blocks, their size, the last."""
    offset = int(re.search(rb'Name="Points".*?offset="(\d+)"', data, re.DOTALL)[1])
    start = data.index(b"_", data.index(BODY)) + 1 + offset
    header = bytearray(base64.b64decode(data[start : start + 16]))
    header[4 * place : 4 * place + 4] = number.to_bytes(4, "little")
    return data[:start] + base64.b64encode(header) + data[start + 16 :]


@pytest.mark.parametrize(
    "damaged",
    [
        lambda data: data[: data.index(BODY) + 200],
        lambda data: with_header(data, 0, 2**31),
        lambda data: with_header(data, 1, 2**31),
        lambda data: with_header(data, 1, 336),
        lambda data: with_header(data, 2, 5),
        lambda data: data.replace(b"UInt32", b"UInt64", 1),
        lambda data: re.sub(rb'offset="\d+"', b'offset="99999999"', data, count=1),
    ],
    ids=["ends early", "blocks", "size", "other size", "last size", "header", "offset"],
)
def test_a_damaged_frame_of_version_0_1_is_rejected(old, damaged):
    with pytest.raises(UNREADABLE):
        vtp_arrays(damaged(old))


@pytest.mark.parametrize(
    "damaged", [NEW[:-1000], NEW.replace(b"UInt64", b"UInt32", 1), NEW.replace(b"\x3f", b"\x3e", 1)]
)
def test_a_damaged_frame_is_rejected(damaged):
    with pytest.raises(UNREADABLE):
        vtp_arrays(damaged)


def test_a_file_that_is_no_frame_is_rejected():
    with pytest.raises(ValueError, match="damaged or of another type"):
        vtp_arrays(b"no frame")

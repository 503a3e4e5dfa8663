"""One surface as programs write it: dialects of STL, OBJ and PLY."""

import struct

import numpy as np

BOM = b"\xef\xbb\xbf"


def stl_text(r, faces, name="cell", end="endsolid cell"):
    lines = [f"solid {name}"]
    for corners in r[faces]:
        lines += ["  facet normal 0 0 0", "    outer loop"]
        lines += [f"      vertex {x:.9g} {y:.9g} {z:.9g}" for x, y, z in corners]
        lines += ["    endloop", "  endfacet"]
    return "\n".join([*lines, end, ""]).encode()


def stl_binary(r, faces, header=b"", tail=b""):
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    data = np.zeros(len(faces), record)
    data["corners"] = r[faces]
    return header.ljust(80, b"\0") + struct.pack("<I", len(faces)) + data.tobytes() + tail


def obj_text(r, faces, point="v {:.9g} {:.9g} {:.9g}", corner="{}", first=1):
    lines = [point.format(*x) for x in r]
    lines += ["f " + " ".join(corner.format(i + first) for i in f) for f in faces]
    return "\n".join([*lines, ""]).encode()


def ply_header(kind, n, m, *, vertex="", face="", index="int", extra=""):
    points = "".join(f"property {vertex or 'float'} {axis}\n" for axis in "xyz")
    return (
        f"ply\nformat {kind} 1.0\ncomment made by a test\nelement vertex {n}\n{points}"
        f"{extra}element face {m}\nproperty list uchar {index} vertex_indices\n{face}end_header\n"
    ).encode()


def ply_text(r, faces):
    lines = [f"{x:.9g} {y:.9g} {z:.9g}" for x, y, z in r]
    lines += [f"{len(f)} " + " ".join(map(str, f)) for f in faces]
    return ply_header("ascii", len(r), len(faces)) + "\n".join([*lines, ""]).encode()


def ply_face_first(r, faces):
    lines = [f"3 {a} {b} {c}" for a, b, c in faces]
    lines += [f"{x:.9g} {y:.9g} {z:.9g}" for x, y, z in r]
    header = (
        f"ply\nformat ascii 1.0\nelement face {len(faces)}\nproperty list uchar int vertex_index\n"
        f"element vertex {len(r)}\nproperty float x\nproperty float y\nproperty float z\n"
        "end_header\n"
    )
    return (header + "\n".join([*lines, ""])).encode()


def ply_binary(r, faces, order="<"):
    kind = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    record = np.dtype([("n", "u1"), ("corners", order + "i4", (3,))])
    data = np.zeros(len(faces), record)
    data["n"], data["corners"] = 3, faces
    header = ply_header(kind, len(r), len(faces), vertex="double")
    return header + r.astype(order + "f8").tobytes() + data.tobytes()


def ply_with_more(r, faces):
    """Binary, with colors, flags, a list at every vertex, and an element that means nothing."""
    header = (
        f"ply\r\nformat binary_little_endian 1.0\r\nobj_info x\r\nelement vertex {len(r)}\r\n"
        "property uchar red\r\nproperty float32 x\r\nproperty float32 y\r\nproperty float32 z\r\n"
        "property list uint8 int16 neighbours\r\nelement camera 1\r\nproperty double angle\r\n"
        f"element face {len(faces)}\r\nproperty list uint8 uint32 vertex_indices\r\n"
        "property uchar flags\r\nend_header\r\n"
    ).encode()
    body = b"".join(
        struct.pack("<B3fB", 7, *x, k % 3) + struct.pack("<h", 5) * (k % 3) for k, x in enumerate(r)
    )
    body += struct.pack("<d", 1.0)
    body += b"".join(struct.pack("<B3IB", 3, *f, 1) for f in faces)
    return header + body


def continued(text):
    """Every line of faces broken in the middle."""
    return b"\n".join(
        line if not line.startswith(b"f") else line.replace(b" ", b" \\\n ", 1)
        for line in text.split(b"\n")
    )


def dialects(r, faces):
    """{name of a file: its bytes}."""
    text, binary = stl_text(r, faces), stl_binary(r, faces)
    obj, n = obj_text(r, faces), len(r)
    return {
        "text.stl": text,
        "upper.stl": text.upper(),
        "end_solid.stl": stl_text(r, faces, end="end solid cell"),
        "no_end.stl": stl_text(r, faces, end=""),
        "words.stl": stl_text(r, faces, "a vertex, a facet and 1 outer loop", "endsolid vertex 1"),
        "crlf.stl": text.replace(b"\n", b"\r\n"),
        "cr.stl": text.replace(b"\n", b"\r"),
        "tabs.stl": b"  \n" + text.replace(b"  ", b"\t"),
        "one_line.stl": b"solid\n" + b" ".join(text.split(b"\n", 1)[1].split()[:-2]),
        "bom.stl": BOM + text,
        "binary.stl": binary,
        "solid.stl": stl_binary(r, faces, b"solid cell, a facet of it"),
        "tail.stl": stl_binary(r, faces, tail=b"\0" * 7),
        "words_behind.stl": stl_binary(r, faces, b"solid", b"exported by a program"),
        "text.obj": obj,
        "bom.obj": BOM + obj,
        "crlf.obj": b"# cell\r\nmtllib x.mtl\r\no cell\r\n" + obj.replace(b"\n", b"\r\n"),
        "backwards.obj": obj_text(r, faces, first=-n),
        "colors.obj": obj_text(r, faces, point="v {:.9g} {:.9g} {:.9g} 0.5 0.5 1"),
        "weights.obj": obj_text(r, faces, point="v {:.9g} {:.9g} {:.9g} 1.0  # a point"),
        "normals.obj": b"vn 0 0 1\nvt 0 0\n" + obj_text(r, faces, corner="{}/1/1"),
        "normals_only.obj": b"vn 0 0 1\n" + obj_text(r, faces, corner="{}//1"),
        "continued.obj": continued(obj),
        "faces_first.obj": b"\n".join(obj.split(b"\n")[n:] + obj.split(b"\n")[:n]),
        "text.ply": ply_text(r, faces),
        "crlf.ply": ply_text(r, faces).replace(b"\n", b"\r\n"),
        "face_first.ply": ply_face_first(r, faces),
        "little.ply": ply_binary(r, faces, "<"),
        "big.ply": ply_binary(r, faces, ">"),
        "more.ply": ply_with_more(r, faces),
    }

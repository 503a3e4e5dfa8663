"""Random damage to the folder of a run, by its files and by what is in them.

As a program it damages copies of a folder, uses each as people do, and prints what goes wrong:

    python damage.py FOLDER FIRST COUNT
"""

import json
import os
import random
import re
import resource
import shutil
import sys
import tempfile
import traceback
import warnings
from pathlib import Path

import numpy as np

import amoeboid as am
from amoeboid.meshes.vtp import frame_bytes, vtp_arrays

WORDS = [
    float("nan"), float("inf"), -1, 0, 1e308, 1e-308, 10**400, -(10**18), "", "x" * 5000, "\0", "∞",
    None, True, [], {}, [[[]]], {"a": {"b": []}}, [1] * 1000, "../../etc/passwd", 1.5, "nan",
]  # fmt: skip
MAX_MEMORY = 6 * 2**30  # bytes of address space; libraries alone take some
FILES = ("manifest.json", "config.toml", "timeseries.csv", "frames.pvd", "checkpoint.npz",
         "frames/frame_00001.vtp")  # fmt: skip


def damaged(folder, rng):
    """Damage a folder in one way; says how."""
    way = rng.choice([in_bytes, in_bytes, in_json, in_table, in_checkpoint, in_frame, in_text,
                      in_links, in_list])  # fmt: skip
    return f"{way.__name__}: {way(folder, rng)}"


def in_bytes(folder, rng):
    path = folder / rng.choice(FILES)
    data = bytearray(path.read_bytes())
    a, b = sorted(rng.randrange(len(data) + 1) for _ in range(2))
    way = rng.randrange(7)
    if way == 0:
        for _ in range(rng.randrange(1, 20)):
            data[rng.randrange(len(data))] = rng.randrange(256)
    elif way == 1:
        del data[a:]
    elif way == 2:
        data[a:a] = rng.randbytes(rng.randrange(1, 2000))
    elif way == 3:
        del data[a:b]
    elif way == 4:
        data[a:a] = data[a:b]
    elif way == 5:
        data[a:b] = bytes(b - a)
    else:
        data = bytearray(rng.choice([b"", b"\xff\xfe\0", b"[" * 10**6, b'{"a":' * 10**5]))
    path.write_bytes(data)
    return f"{path.name}, way {way}, {a} to {b}"


def in_json(folder, rng):
    path = folder / "manifest.json"
    document = json.loads(path.read_text())
    inside, way = document, []
    while True:
        names = list(inside) if isinstance(inside, dict) else list(range(len(inside)))
        name = rng.choice(names)
        way.append(name)
        if not isinstance(inside[name], dict | list) or not inside[name] or rng.random() < 0.3:
            break
        inside = inside[name]
    if rng.random() < 0.2 and isinstance(inside, dict):
        inside["format"] = document["format"] = rng.choice(WORDS)
    inside[name] = rng.choice(WORDS)
    sys.set_int_max_str_digits(0)
    path.write_text(json.dumps(document))
    sys.set_int_max_str_digits(4300)
    return way


def in_table(folder, rng):
    path = folder / "timeseries.csv"
    rows = [line.split(",") for line in path.read_text().splitlines()]
    row = rng.choice(rows)
    cell = rng.randrange(len(row))
    row[cell] = rng.choice(["nan", "inf", "", "1e999", "9" * 5000, "-1", "a", "1e308", '"', "0x1",
                            str(10**300), "1_0", "\0", "step"])  # fmt: skip
    if rng.random() < 0.2:
        rng.shuffle(rows)
    path.write_text("\n".join(map(",".join, rows)) + "\n")
    return f"{cell}: {row[cell][:20]}"


def changed(array, rng):
    """An array with other numbers, of another type or shape."""
    array = array.copy()
    way = rng.randrange(8)
    flat = array.reshape(-1) if array.ndim else array.reshape(1)
    place = rng.randrange(max(1, flat.size))
    if way == 0 and array.dtype.kind == "f" and flat.size:
        flat[place] = rng.choice([np.nan, np.inf, -np.inf, 1e308, -1e308, 1e-308, 0.0, -1.0, 1e20])
    elif way == 1 and array.dtype.kind == "i" and flat.size:
        flat[place] = rng.choice([-1, 0, 2**31, 2**62, -(2**62), 41, 42, 7])
    elif way == 2:
        kind = rng.choice(["f4", "i8", "f8", "u1", "c16", ">f8", "U3", "?"])
        array = array.astype("U3" if array.dtype.kind == "U" else kind)  # no text is a number
    elif way == 3:
        array = array[:0] if array.ndim else array.reshape(1)
    elif way == 4:
        array = np.concatenate([flat, flat])
    elif way == 5:
        array = np.zeros_like(array)
    elif way == 6 and array.dtype.kind == "f":
        array = array * rng.choice([1e150, -1.0, 1e-150, 1e6])
    else:
        array = np.asarray(np.random.default_rng(place).permutation(flat)).reshape(array.shape)
    return array, way


def in_checkpoint(folder, rng):
    path = folder / "checkpoint.npz"
    with np.load(path) as archive:
        arrays = dict(archive)
    name = rng.choice(list(arrays))
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        arrays[name], way = changed(arrays[name], rng)
    np.savez(path, **arrays)
    return f"{name}, way {way}"


FIELDS = ("c", "v_p", "v_c", "v", "retrograde_flow", "normal")
NUMBERS = ("t", "zeta0", "cortex_drag_position")


def in_frame(folder, rng):
    """With the right checksum."""
    path = folder / "frames/frame_00001.vtp"
    arrays = vtp_arrays(path.read_bytes())
    n = len(arrays["c"])
    arrays = {k: v.reshape(n, 3) if v.size == 3 * n else v for k, v in arrays.items()}
    name = rng.choice(["Points", "connectivity", *FIELDS, *NUMBERS])
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        arrays[name], way = changed(arrays[name], rng)
    for key, array in arrays.items():
        if array.dtype.kind not in "if" or not array.size:
            arrays[key] = np.zeros(1)
    path.write_bytes(
        frame_bytes(arrays["Points"], arrays["connectivity"].reshape(-1, 1),
                    {k: arrays[k] for k in FIELDS}, {k: arrays[k] for k in NUMBERS})
    )  # fmt: skip
    return f"{name}, way {way}"


def in_text(folder, rng):
    path = folder / "config.toml"
    lines = path.read_text().splitlines()
    k = rng.randrange(len(lines))
    value = rng.choice(["nan", "inf", "-1", "0", "1e308", '"x"', "[]", "{}", "true", "[[1,2,3]]",
                        "9" * 500, '"../../../etc/passwd"', "[" * 5000, '"c**c**c"'])  # fmt: skip
    lines[k] = f"{lines[k].partition('=')[0]}= {value}" if "=" in lines[k] else value
    path.write_text("\n".join(lines))
    return lines[k][:60]


def in_links(folder, rng):
    name = rng.choice([*FILES, "frames"])
    path, way = folder / name, rng.randrange(5)
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    if way == 0:
        path.symlink_to("/etc/passwd")
    elif way == 1:
        path.symlink_to(path.name)
    elif way == 2:
        path.mkdir(exist_ok=True)
    elif way == 3:
        os.mkfifo(path)
    return f"{name}, way {way}"


def in_list(folder, rng):
    path = folder / "frames.pvd"
    text = path.read_text()
    place = rng.choice(list(re.finditer(r'"([^"]*)"', text)))
    new = rng.choice(["nan", "-1", "1e400", "", "../../x", "frames/../../frame_00000.vtp", "1e9",
                      "frames/frame_00000.vtp", "9" * 400, "inf"])  # fmt: skip
    path.write_text(f"{text[: place.start(1)]}{new}{text[place.end(1) :]}")
    return f"{place.group(1)} -> {new[:30]}"


def used(folder, out):
    """Use a folder as people do; every step may be refused, none may fail otherwise."""
    run = am.load(folder)
    k = 0
    for act in (
        lambda: repr(run),
        lambda: run._repr_html_(),
        lambda: (run["t"], run.to_pandas()),
        lambda: [repr(frame) for frame in run.frames],
        lambda: run.final.max_retrograde_speed,
        lambda: repr(run.show()),
        lambda: run.export(out / "csv", "csv"),
        lambda: run.export(out / "vtp", "vtp"),
        lambda: run.export(out / "npz", "napari"),
        lambda: run.export(out / "x.nc"),
        lambda: run.export(out / "x.html"),
        lambda: run.export(out / "x.gif", frames=1),
        lambda: run.resume(until=am.time(0.5), progress=False),
    ):
        try:
            act()
            k += 1
        except am.InvalidInput as problem:
            if "\n" in str(problem) or len(str(problem)) > 5000:
                raise ValueError("a message of several lines, or a long one") from problem
    return k


def peak_memory():
    """Of this program [MB]; that of getrusage begins with that of the program that started it."""
    status = Path("/proc/self/status")
    if not status.exists():
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    return int(re.search(r"VmHWM:\s+(\d+) kB", status.read_text())[1]) // 1024


def main(source, first, count):
    """Damage and use; prints what went wrong, and the peak of memory."""
    resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY, MAX_MEMORY))
    warnings.simplefilter("ignore")
    import amoeboid.exports.summary as summary

    summary.save_picture = lambda path, cell: path.write_bytes(b"")
    whole = 0
    for seed in range(first, first + count):
        rng = random.Random(seed)  # noqa: S311  (tests)
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place) / "run"
            shutil.copytree(source, folder)
            how = damaged(folder, rng)
            try:
                whole += used(folder, Path(place) / "out") > 0
            except am.InvalidInput:
                pass
            except OSError as error:  # in the way of a file stands a folder: told in a line too
                if error.errno is None or error.filename is None:
                    print(f"seed {seed}, {how}: {error!r}")
            except Exception:
                print(f"seed {seed}, {how}: {traceback.format_exc(limit=-4)}")
    print(f"{count} folders, {whole} of use, peak {peak_memory()} MB")


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))

"""`amoeboid export`: a stored run in the formats of other programs, and as a movie."""

from __future__ import annotations

import argparse

from amoeboid.cli.output import say
from amoeboid.cli.settings import add_json, path, print_json, real

MANY = 4  # files that are named one by one


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of `export`."""
    from amoeboid.exports import names

    parser.add_argument("run", type=path, metavar="RUN", help="folder of a run")
    parser.add_argument(
        "--to",
        metavar="FORMAT",
        help=f"{', '.join(names())} (default: by the extension of -o)",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=path,
        metavar="PATH",
        help="file, if it has the extension of the format, else folder (default: named after RUN)",
    )
    parser.add_argument(
        "--frames",
        metavar="A:B:C",
        help="frames A, A + C, ... before B, as a Python slice (0:100:10, ::2), or one frame (7, "
        "--frames=-1 for the last); default: all",
    )
    parser.add_argument(
        "--follow",
        action="store_true",
        help="keep the cell in the center (default: it moves along its path in the environment "
        "of the run, which is drag on the cortex if none is set)",
    )
    parser.add_argument("--fps", type=real, help="frames per second of a movie (default: 25)")
    parser.add_argument("--force", action="store_true", help="replace existing files")
    add_json(parser)
    parser.epilog = (
        "Numbers are in the units of the run: um, s, ... if its parameters have physical "
        "units. Each file is written under a temporary name and then renamed. "
        "docs/folders.md describes the formats.\n"
        "example:\n"
        "  amoeboid export amoeboid-run --to csv"
    )


def execute(args: argparse.Namespace) -> int:
    """Export, and say where the files are."""
    from amoeboid.exports.export import export
    from amoeboid.runs.stored import load

    files = export(
        load(args.run),
        args.output,
        args.to,
        frames=args.frames,
        force=args.force,
        follow=args.follow,
        fps=args.fps,
    )
    sizes = [file.stat().st_size for file in files]
    if args.json:
        print_json({"files": [str(file) for file in files], "bytes": sizes})
    elif len(files) <= MANY:
        say(*(f"{file}: {size_text(size)}" for file, size in zip(files, sizes, strict=True)))
    else:
        say(f"{len(files)} files in {files[0].parent}, {files[0].name} to {files[-1].name}: "
            f"{size_text(sum(sizes))}")  # fmt: skip
    return 0


def size_text(size: int) -> str:
    """A number of bytes as people read it."""
    for power, name in ((2, "MB"), (1, "kB")):
        if size >= 1000**power:
            return f"{size / 1000**power:.3g} {name}"
    return f"{size} bytes"

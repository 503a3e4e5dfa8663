"""Files that a command reads its input from, and what to do with those of another kind."""

from __future__ import annotations

import shlex
from pathlib import Path

from amoeboid.assignments import SECTIONS
from amoeboid.validation import InvalidInput, toml_document

SURFACES = (".stl", ".ply", ".obj", ".vtp")
OF_A_SWEEP = {"solver", "vary"}


def text_for(path: Path, command: str) -> str:
    """The text of a TOML file for `run` or `sweep`. Raises InvalidInput, OSError."""
    from amoeboid.output.atomic import text_of

    name = repr(str(path))
    _refuse_other_kinds(path, name, command)
    text = text_of(path)
    found = toml_document(text, name).keys()
    others = OF_A_SWEEP if command == "run" else SECTIONS.keys()
    if others & found and (command == "run" or not OF_A_SWEEP & found):
        kind, other = ("a sweep", "sweep") if command == "run" else ("a run", "run")
        raise InvalidInput(
            f"{command} needs its own kind of file, {name} describes {kind}; use amoeboid {other} "
            f"{shlex.quote(str(path))}"
        )
    return text


def _refuse_other_kinds(path: Path, name: str, command: str) -> None:
    """Raise InvalidInput for a surface and for a folder."""
    shown = shlex.quote(str(path))
    if not path.exists():
        raise InvalidInput(f"No such file {name}; {command} needs the path of a TOML file")
    if path.is_dir():
        remedy = "give the TOML file in it"
        if command == "run" and (path / "config.toml").is_file():
            inside = shlex.quote(str(path / "config.toml"))
            remedy = f"continue its run with --resume {shown}, or repeat it with {inside}"
        raise InvalidInput(f"{command} needs a TOML file, {name} is a folder; {remedy}")
    if path.suffix.lower() in SURFACES:
        remedy = "start a run from it with amoeboid run"
        raise InvalidInput(
            f"{command} needs a TOML file, {name} is a surface; {remedy} --set initial.surface="
            f"{shown} (with --set initial.repair=true for one from microscopy)"
        )

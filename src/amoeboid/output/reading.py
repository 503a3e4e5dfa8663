"""Files of a folder that somebody else may have made: none leads out of it, none is too large."""

from __future__ import annotations

from pathlib import Path

from amoeboid.validation import InvalidInput

MiB = 2**20
# Larger than what the longest runs write: 1e6 steps, 1e5 frames, the largest mesh.
MAX_SIZES = {
    "manifest.json": 32 * MiB,
    "config.toml": 16 * MiB,
    "timeseries.csv": 1024 * MiB,
    "frames.pvd": 64 * MiB,
    "checkpoint.npz": 64 * MiB,
}
MAX_FRAME_SIZE = 32 * MiB


def checked(folder: Path, name: str) -> Path:
    """The path of a file of a folder: a regular file inside it, and not larger than runs write.

    Raises InvalidInput for another, and OSError, where there is none for one.
    """
    path = within(folder, name)
    size, most = path.stat().st_size, MAX_SIZES.get(name, MAX_FRAME_SIZE)
    if not path.is_file():
        raise InvalidInput(f"{name} in {str(folder)!r} must be a file; remove it")
    if size > most:
        raise InvalidInput(
            f"{name} in {str(folder)!r} must have at most {most // MiB} MiB, got {size / MiB:.4g}"
        )
    return path


def within(folder: Path, name: str) -> Path:
    """The path of a name in a folder. Raises InvalidInput if it leads out of it, by a link."""
    path = folder / name
    try:
        inside = path.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError) as error:  # a loop of links
        raise InvalidInput(f"{name} in {str(folder)!r} must be a file: {error}") from None
    if not inside:
        raise InvalidInput(
            f"{name} in {str(folder)!r} must lie in that folder, but is a link to "
            f"{str(path.resolve())[:200]!r}; replace the link by a copy"
        )
    return path


def text_in(folder: Path, name: str) -> str:
    """The text of such a file, in UTF-8 with or without byte order mark.

    Raises InvalidInput, OSError.
    """
    path = checked(folder, name)
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise InvalidInput(f"{str(path)!r} must be a text file in UTF-8") from None

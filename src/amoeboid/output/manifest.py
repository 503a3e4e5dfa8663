"""The manifest of a stored run, as it is read: whatever a file may hold."""

from __future__ import annotations

import json
import math
from dataclasses import fields
from pathlib import Path
from typing import Any

from amoeboid.model.units import Units
from amoeboid.output.reading import text_in
from amoeboid.validation import InvalidInput

FORMAT = 1
"""Version of what a folder holds, as its manifest tells. It rises when an older program would read
something wrong, or not at all; folders without it are of version 1."""

MAX_WORDS = 2000
"""Characters of a text of the manifest."""


def stored_manifest(folder: Path) -> dict[str, Any]:
    """What the manifest of a stored run says, empty if it is missing or damaged.

    Raises InvalidInput for a folder of a newer version, and for a manifest that is too large or
    leads out of the folder.
    """
    try:
        text = text_in(folder, "manifest.json")
    except OSError:
        return {}
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    found = found if isinstance(found, dict) else {}
    _check_format(folder, found)
    return found


def _check_format(folder: Path, manifest: dict[str, Any]) -> None:
    given = manifest.get("format", 1)
    if isinstance(given, bool) or not isinstance(given, int) or given < 1:
        raise InvalidInput(
            f"the format in the manifest of {str(folder)!r} must be a whole number >= 1, got "
            f"{str(given)[:40]}"
        )
    if given > FORMAT:
        versions = manifest.get("versions")
        by = versions.get("amoeboid") if isinstance(versions, dict) else None
        raise InvalidInput(
            f"the format of a run must be at most {FORMAT} for this version of amoeboid, that of "
            f"{str(folder)!r} is {str(given)[:40]}, written by amoeboid {str(by)[:40]}; install "
            "that version, or a newer one"
        )


def told(manifest: dict[str, Any], name: str, instead: str) -> str:
    """A text of a manifest, as files and terminals take it; `instead` where it has none."""
    found = manifest.get(name)
    if not isinstance(found, str):
        return instead
    return found[:MAX_WORDS].replace("\0", "").encode(errors="replace").decode()


def stored_units(manifest: dict[str, Any]) -> dict[str, str | None]:
    """Dimensions of the columns of a stored time series, as far as its manifest has them."""
    found = manifest.get("units")
    found = found if isinstance(found, dict) else {}
    return {str(name): unit for name, unit in found.items() if isinstance(unit, str)}


def unit_sizes(manifest: dict[str, Any]) -> Units | None:
    """Size of the units of a stored run, if its parameters had been given in physical ones."""
    sizes = manifest.get("unit_sizes")
    names = [f.name for f in fields(Units)]
    if not isinstance(sizes, dict) or set(sizes) != set(names):
        return None
    numbers = [sizes[name] for name in names]
    known = all(isinstance(x, float) and 0.0 < x < math.inf for x in numbers)
    return Units(**sizes) if known else None


def adapted_shape(manifest: dict[str, Any]) -> dict[str, Any] | None:
    """What was done to the initial shape of a stored run, if its manifest has it."""
    shape = manifest.get("initial_shape")
    if not isinstance(shape, dict) or not {"repairs", "scaling"} <= shape.keys():
        return None
    repairs, scaling = shape["repairs"], shape["scaling"]
    texts = [*repairs, scaling or ""] if isinstance(repairs, list) else [None]
    whole = all(isinstance(value, str) for value in texts)
    return {"repairs": repairs, "scaling": scaling} if whole else None

"""What the formats with one file of a surface for each frame share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from amoeboid.exports.job import Format, Job, Write
from amoeboid.output.frames import frame_name
from amoeboid.surface.cell import SurfaceCell

FIELDS = {
    "c": "N/L^2",
    "v_p": "L/T",
    "v_c": "L/T",
    "v": "L/T",
    "retrograde_flow": "L/T",
    "normal": "1",
}
"""Dimensions of the fields of frames."""

Bytes = Callable[[Job, SurfaceCell], bytes]


def one_each(job: Job, suffix: str, encoded: Bytes) -> Mapping[str, Write]:
    """A file for each frame, with the number that the frame has in the run."""

    def writer(count: int, number: int) -> Write:
        def write(path: Path) -> None:
            job.tell((f"{suffix[1:]}: frame {count} of {len(job.numbers)}",))
            path.write_bytes(encoded(job, job.cell(number)))

        return write

    return {
        frame_name(number).replace(".vtp", suffix): writer(count, number)
        for count, number in enumerate(job.numbers, 1)
    }


def surface_format(doc: str, suffix: str, encoded: Bytes) -> Format:
    """The format that has such a file for each frame, and nothing else."""
    return Format(
        doc,
        suffix,
        partial(one_each, suffix=suffix, encoded=encoded),
        frozenset({"follow"}),
        one_per_frame=True,
    )


def unit_text(job: Job) -> str:
    """What numbers are in, for the comment of a file."""
    return f"length {job.unit('L')}, c {job.unit('N/L^2')}, speed {job.unit('L/T')}"

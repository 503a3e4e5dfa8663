"""A movie as MP4 (H.264), by ffmpeg."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from amoeboid.exports.job import Format, Job, Write
from amoeboid.exports.movie import WINDOW, pictures
from amoeboid.extras import installed, needed, remedy
from amoeboid.validation import InvalidInput

QUALITY = 18  # of libx264: 0 loses nothing, 51 nearly all
MAX_WORDS = 300  # characters of what ffmpeg says


def program() -> str:
    """The ffmpeg of imageio-ffmpeg, or that of the system. Raises InvalidInput without both."""
    found = shutil.which("ffmpeg")
    if found is not None and not installed("imageio_ffmpeg"):
        return found
    try:
        encoder = needed("imageio_ffmpeg", "an export to mp4 needs ffmpeg or")
        return str(encoder.get_ffmpeg_exe())
    except RuntimeError as error:
        if found is None:
            raise InvalidInput(
                f"an export to mp4 needs ffmpeg, which was not found ({error}); {remedy('movie')}, "
                "or export to gif"
            ) from None
        return found


def write(job: Job, path: Path, ffmpeg: str) -> None:
    """Draw the frames and pass them on, one by one. Raises OSError if ffmpeg fails."""
    size = f"{WINDOW[0]}x{WINDOW[1]}"
    command = [
        ffmpeg, "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size,
        "-r", f"{job.fps:g}", "-i", "-", "-an", "-c:v", "libx264", "-crf", str(QUALITY),
        "-pix_fmt", "yuv420p", "-threads", "1", "-fflags", "+bitexact", "-flags:v", "+bitexact",
        "-movflags", "+faststart", "-f", "mp4", str(path.absolute()),
    ]  # fmt: skip
    process = subprocess.Popen(  # noqa: S603  (a known program; the path is one argument)
        command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    try:
        with suppress(BrokenPipeError):  # it has ended early, and says why
            for canvas in pictures(job, "mp4"):
                process.stdin.write(canvas.image().tobytes())  # type: ignore[union-attr]
        _, said = process.communicate()
    except BaseException:
        process.kill()
        process.communicate()
        raise
    if process.returncode != 0:
        words = " ".join(said.decode(errors="replace").split())[-MAX_WORDS:]
        raise OSError(f"ffmpeg could not write {str(path)!r}: {words}")


def files(job: Job) -> Mapping[str, Write]:
    """One movie."""
    ffmpeg = program()
    return {f"{job.name}.mp4": lambda path: write(job, path, ffmpeg)}


FORMAT = Format(
    "a movie (H.264) with time, scale bar and colors",
    ".mp4",
    files,
    frozenset({"follow", "fps"}),
    ("PIL",),
)

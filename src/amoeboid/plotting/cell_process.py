"""Draws one cell; a program of its own, see `cell_painter`.

Standard input: an .npz archive of a scene, see `cell_picture`; standard output: the PNG file. It is
ready to draw before there is a cell, and ends if none comes: with the program that started it, or
with the exit code LEFT when it has waited for the seconds that are its argument.
"""

from __future__ import annotations

import io
import os
import signal
import sys
import threading

LEFT = 3  # exit code


def main(seconds: str) -> None:
    """Wait for a scene, write the picture."""
    # of the terminal, meant for the run, which ends with a picture
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    import numpy as np

    from amoeboid.plotting.cell_picture import drawn

    _get_ready()
    leaving = threading.Timer(float(seconds), os._exit, [LEFT])
    leaving.daemon = True
    leaving.start()
    begin = sys.stdin.buffer.read(1)
    leaving.cancel()
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if begin:
        file = io.BytesIO(begin + sys.stdin.buffer.read())
        with np.load(file, allow_pickle=False) as archive:
            canvas = drawn(dict(archive))
        sys.stdout.buffer.write(canvas.png())


def _get_ready() -> None:
    """Draw something small: Pillow then has imported what it needs."""
    import numpy as np

    from amoeboid.plotting.canvas import Canvas

    canvas = Canvas(8, 8, (*np.eye(3),), np.zeros(3), 1.0)
    canvas.text(np.zeros(2), "t", "black", 8.0)
    canvas.png()


if __name__ == "__main__":
    main(*sys.argv[1:])

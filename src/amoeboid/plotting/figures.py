"""What all figures share: settings of their own, and how they are written."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from amoeboid.extras import needed
from amoeboid.output.atomic import write_atomically
from amoeboid.validation import InvalidInput

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DRAWING = "a picture needs"
# The same figure is the same file: no dates, no random names of parts.
METADATA = {
    ".png": {},
    ".pdf": {"CreationDate": None},
    ".svg": {"Date": None},
}
HASH_SALT = "amoeboid"


@contextmanager
def own_settings() -> Iterator[None]:
    """matplotlib's own defaults, whatever the user's matplotlibrc says (text.usetex, fonts)."""
    matplotlib = needed("matplotlib", DRAWING)
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams["svg.hashsalt"] = HASH_SALT
        yield


def new_figure(width: float, height: float, layout: Any = "constrained") -> Figure:
    """An empty figure, in inches, that is drawn into memory only: no window, no backend.

    `layout`: what finds the places of its parts; None leaves them where they are put.
    """
    needed("matplotlib", DRAWING)
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout=layout)
    FigureCanvasAgg(figure)
    return figure


def write_figure(figure: Figure, path: Path, dpi: int) -> None:
    """Write a figure in the format that the ending of `path` names: .png, .pdf, .svg."""
    suffix = path.suffix.lower()

    def write(temporary: Path) -> None:
        figure.savefig(temporary, dpi=dpi, format=suffix[1:], metadata=METADATA.get(suffix))

    write_atomically(path, write)


def with_unit(words: str, unit: str) -> str:
    """The label of an axis: what it shows, and in which unit."""
    return f"{words} [{as_drawn(unit or '1')}]"


def as_drawn(text: str) -> str:
    """A text with units as pictures show them: um^2 with its micro sign and a raised power."""
    text = re.sub(r"\bum\b", "\N{MICRO SIGN}m", text)
    return re.sub(r"\^([0-9]+)", r"$^{\1}$", text)


def axes_for(ax: Any = None) -> Any:
    """The axes to draw on: those given, or those of a new figure of pyplot.

    Raises InvalidInput for what are no axes.
    """
    if ax is not None and not hasattr(ax, "plot"):
        raise InvalidInput(f"ax must be Axes of matplotlib or None, got {ax!r}")
    if ax is not None:
        return ax
    needed("matplotlib", DRAWING)
    from matplotlib import pyplot

    return pyplot.subplots(layout="constrained")[1]


@own_settings()
def write_drawing(
    result: Any, draw: Callable[..., Any], path: Path, width: float, height: float
) -> None:
    """Write what `draw(result, axes)` draws as a figure of this size, in inches, to a file."""
    figure = new_figure(width, height)
    draw(result, figure.add_subplot())
    write_figure(figure, path, dpi=150)


def html_picture(result: Any, draw: Callable[..., Any], **options: Any) -> str:
    """An image of HTML, 4 by 3 inches, of what `draw(result, axes)` draws."""
    with own_settings():
        figure = new_figure(4.0, 3.0)
        draw(result, figure.add_subplot(), **options)
        data = BytesIO()
        figure.savefig(data, format="png", dpi=100, metadata=METADATA[".png"])
    return f'<img src="data:image/png;base64,{b64encode(data.getvalue()).decode()}">'

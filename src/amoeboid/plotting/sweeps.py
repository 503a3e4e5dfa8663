"""A recorded number of a sweep over the one or two parameters that vary."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from amoeboid.plotting.figures import axes_for, new_figure, own_settings, with_unit, write_figure
from amoeboid.plotting.palette import COLOR_MAP, INK, STABLE, UNSTABLE
from amoeboid.studies.columns import shown_number
from amoeboid.sweeps.evaluation import FAILED
from amoeboid.sweeps.meanings import TEXT
from amoeboid.sweeps.result import Sweep
from amoeboid.validation import InvalidInput

MAX_LABELS = 12


def draw(sweep: Sweep, ax: Any = None, observable: str | None = None) -> Any:
    """A recorded number or text over the parameters that vary; failures are crosses.

    Over two parameters, of several states the one with the largest number. Returns the axes.
    Raises InvalidInput for more than two parameters, or words in their place.
    """
    names = list(sweep.layout.coordinates)
    words = [
        n for n in names if any(isinstance(v, str) for v in sweep.layout.coordinates[n].values)
    ]
    if not 1 <= len(names) <= 2 or words:
        raise InvalidInput(
            f"a picture of a sweep needs one or two varied numbers, got {', '.join(names)}; "
            "select a slice of its dataset"
        )
    axes = axes_for(ax)
    shown = sweep.telling(observable)
    (_draw_line if len(names) == 1 else _draw_map)(axes, sweep, shown)
    return axes


@own_settings()
def write_sweep(sweep: Sweep, path: Path, observable: str | None = None) -> None:
    """A file with the picture of a sweep."""
    figure = new_figure(6.0, 4.2)
    draw(sweep, figure.add_subplot(), observable)
    write_figure(figure, path, 150)


def _draw_line(axes: Any, sweep: Sweep, name: str) -> None:
    x = _along(sweep, next(iter(sweep.layout.coordinates)))
    column = sweep.columns[name]
    values = column.values.reshape(len(x), -1)
    stable = sweep.columns.get("stable")
    if column.meaning.kind == TEXT:
        labels, codes = _coded(values[:, 0])
        axes.plot(x, codes, "o", color=STABLE)
        axes.set_yticks(range(len(labels)), labels)
    elif stable is not None and stable.values.shape == column.values.shape:
        is_stable = stable.values.reshape(values.shape)
        for wanted, color, fill in ((1.0, STABLE, STABLE), (0.0, UNSTABLE, "none")):
            at = is_stable == wanted
            places = np.broadcast_to(x[:, None], values.shape)[at]
            label = "stable" if wanted else "unstable"
            axes.plot(places, values[at], "o", ms=4, color=color, mfc=fill, label=label)
        axes.legend()
    else:
        axes.plot(x, values, "o-", ms=4, color=STABLE)
    failed = _failed(sweep)
    if failed.any():
        axes.plot(x[failed], np.zeros(failed.sum()), "x", color=INK, clip_on=False,
                  transform=axes.get_xaxis_transform())  # fmt: skip
    axes.set_xlabel(_label(sweep, next(iter(sweep.layout.coordinates))))
    axes.set_ylabel(with_unit(name, column.meaning.unit) if column.meaning.unit else name)


def _draw_map(axes: Any, sweep: Sweep, name: str) -> None:
    first, second = sweep.layout.coordinates
    x, y = _along(sweep, first), _along(sweep, second)
    column = sweep.columns[name]
    values = column.values.reshape(len(x), -1)
    labels: list[str] = []
    if column.meaning.kind == TEXT:
        labels, numbers = _coded(values[:, 0])
    else:
        numbers = np.array([np.nanmax(row) if np.isfinite(row).any() else np.nan for row in values])
    if len(sweep.layout.shape) == 2:
        shape = sweep.layout.shape
        table = [array.reshape(shape) for array in (x, y, numbers)]
        image = axes.pcolormesh(*table, shading="nearest", cmap=COLOR_MAP)
    else:
        image = axes.scatter(x, y, c=numbers, s=14, cmap=COLOR_MAP, ec=INK, lw=0.3)
    bar = axes.figure.colorbar(image, ax=axes)
    unit = column.meaning.unit
    bar.set_label(with_unit(name, unit) if unit else name)
    if labels:
        bar.set_ticks(range(len(labels)), labels=labels)
    failed = _failed(sweep)
    axes.plot(x[failed], y[failed], "x", color=INK)
    axes.set_xlabel(_label(sweep, first))
    axes.set_ylabel(_label(sweep, second))


def _along(sweep: Sweep, name: str) -> Any:
    """The values of what varies, at every point."""
    return np.array([sweep.layout.values(k)[name] for k in range(len(sweep))], dtype=float)


def _failed(sweep: Sweep) -> Any:
    return sweep.columns["status"].values.ravel() == FAILED


def _label(sweep: Sweep, name: str) -> str:
    unit = sweep.layout.coordinates[name].unit
    return with_unit(name, unit) if unit else name


def _coded(values: Any) -> tuple[list[str], Any]:
    """Texts as numbers: what is shown for each, and the numbers."""
    found = sorted({shown_number(v) for v in values})[:MAX_LABELS]
    codes = {text: float(k) for k, text in enumerate(found)}
    return found, np.array([codes.get(shown_number(v), np.nan) for v in values])

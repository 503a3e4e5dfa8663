"""What holds for the drawing of every figure: its text can be read, and it changes no number."""

import pickle
from itertools import combinations

from matplotlib.axis import Axis, Tick
from matplotlib.text import Text

from amoeboid.figures.style import print_style
from amoeboid.plotting.figures import new_figure

OFF_PAGE, OVERLAP = 1.0, 0.2  # at most: pixels; share of the smaller one of two texts


def drawn(figure, data):
    """Draw numbers of a figure as its command does; returns its axes, a list.

    Text lies on the page, and no text on another one.
    """
    before = pickle.dumps(data)
    with print_style():
        page = new_figure(*figure.size)
        axes = list(page.subplots(*figure.panels, squeeze=False, **figure.layout).flat)
        figure.draw(data, axes[0] if len(axes) == 1 else axes)
        page.draw_without_rendering()
    assert pickle.dumps(data) == before
    boxes = [(text.get_text(), text.get_window_extent()) for text in shown_texts(page)]
    for words, box in boxes:
        assert min(box.x0, box.y0, *(page.bbox.max - box.max)) > -OFF_PAGE, f"{words!r} is cut off"
    for (one, a), (other, b) in combinations(boxes, 2):
        common = a.intersection(a, b)
        share = 0.0 if common is None else area(common) / min(area(a), area(b))
        assert share < OVERLAP, f"{one!r} and {other!r} overlap"
    return axes


def area(box):
    return box.width * box.height


def shown_texts(page):
    """All texts that are drawn."""
    ticks = {text for tick in page.findobj(Tick) for text in tick.findobj(Text)}
    hidden = {axis.label for axis in page.findobj(Axis) if not axis.axes.axison}
    found = [text for text in page.findobj(Text) if text not in ticks | hidden]
    for axis in page.findobj(Axis):
        low, high = sorted(axis.get_view_interval())
        if axis.axes.axison:
            numbers = zip(axis.get_majorticklocs(), axis.get_majorticklabels(), strict=False)
            found += [text for at, text in numbers if low <= at <= high]
    return [text for text in found if text.get_visible() and text.get_text().strip()]


def lines(axes):
    """The lines of axes by their labels, as arrays of x and y."""
    return {line.get_label(): line.get_data() for line in axes.lines}

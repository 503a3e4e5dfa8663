"""Speed of the polarized cell in its surroundings against v_p0, beside measured speeds."""

from __future__ import annotations

from typing import Any

import numpy as np

from amoeboid.closed_forms.linear import critical_speed
from amoeboid.figures.drawing import SYMBOLS
from amoeboid.figures.figure import Figure
from amoeboid.figures.results import Results
from amoeboid.figures.tables import FigureData, Table, column_of, label
from amoeboid.model.parameters import Parameters
from amoeboid.model.units import measured
from amoeboid.motility.words import environment
from amoeboid.plotting.palette import BLUE, GRAY, GREEN, INK, ORANGE, PALE, PURPLE, SKY, YELLOW
from amoeboid.studies.branch import branch
from amoeboid.studies.columns import quantity, text
from amoeboid.studies.migration import migrations

HIGHEST = 1.4  # end of the window of v_p0, in thresholds
STATES = 14  # along the branch, at most
FLOW = "max_retrograde_speed"

ENVIRONMENTS = {
    "matrix:normal=0": ("matrix, tangential drag", ORANGE, "-"),
    "patch:30": ("patch of 30°, plates", GREEN, "-"),
    "channel:30": ("channel of 30°", SKY, "-"),
    "fluid": ("fluid", BLUE, "-"),
    "matrix": ("matrix, isotropic drag", YELLOW, "--"),
    "matrix:per_filament=true": ("matrix, drag on filaments", PURPLE, "-"),
    "fluid:coupled=0.3": ("fluid, 30 % coupled", BLUE, ":"),
}
"""Environments with their words, colors and lines, from fast to slow."""

PUBLISHED = (
    ("amoeboid cells", 5.0, 20.0, "Aoun et al., Biophys. J. 119, 1157 (2020): typically"),
    ("neutrophils", 11.0, 23.0, "Butler et al., PLoS ONE 5, e11921 (2010): 17 +- 6 um/min"),
    (
        "Dictyostelium,\nswimming",
        4.2,
        4.2,
        "Barry and Bretscher, PNAS 107, 11376 (2010), as quoted by Bae and Bodenschatz, PNAS 107, "
        "E165 (2010)",
    ),
    (
        "Dictyostelium,\ncrawling",
        3.8,
        3.8,
        "Barry and Bretscher, PNAS 107, 11376 (2010), as quoted by Bae and Bodenschatz, PNAS 107, "
        "E165 (2010)",
    ),
)
"""Cells, lowest and highest speed [um/min], and where they are published."""


def compute(p: Parameters, results: Results) -> FigureData:
    """Speeds along the branch of the polarized cell in all environments."""
    threshold = float(critical_speed(p))
    found = results.of(speeds, p, HIGHEST * threshold, task="speeds in all environments")
    problems = found.pop("problems")
    columns = {"v_p0": column_of(p, found.pop("v_p0"), "L/T")}
    columns |= {
        "stable": column_of(p, np.array(found.pop("stable"), dtype=object)),
        **{name: column_of(p, values, "L/T") for name, values in found.items()},
    }
    tables = {"speeds": Table("speeds towards the front along the branch in v_p0", columns)}
    last = {name: float(values[-1]) for name, values in found.items()}
    notes = [
        f"threshold v_p^c = {text(p, threshold, 'L/T', '#.5g')}",
        f"of {FLOW} at the end of the window: "
        + ", ".join(f"{name} {last[name] / last[FLOW]:.3f}" for name in ENVIRONMENTS),
    ]
    if p.units is not None:
        tables["published"] = _published(p)
        notes += [f"{name.replace(chr(10), ' ')}: {about}" for name, _, _, about in PUBLISHED]
    return FigureData(p, tables, tuple(notes), tuple(problems))


def speeds(p: Parameters, end: float) -> dict[str, Any]:
    """Speeds in `ENVIRONMENTS` along the branch from the sphere, where they are 0, up to `end`."""
    found = branch(p, "v_p0", 0.0, quantity(p, end, "L/T"))
    piece = max(found.pieces, key=lambda states: states[-1].number(FLOW))
    chosen = np.unique(np.linspace(0, len(piece) - 1, STATES).round().astype(int))
    states = [piece[k] for k in chosen]
    rows = []
    for state in states:
        moving = migrations(state, [environment(name) for name in ENVIRONMENTS])
        rows.append([float(m.plain("speed")) for m in moving])
    return {
        "v_p0": [float(critical_speed(p)), *(s.parameters.v_p0 for s in states)],
        "stable": [None, *(bool(s.stable) for s in states)],
        FLOW: [0.0, *(s.number(FLOW) for s in states)],
        **{name: [0.0, *(row[k] for row in rows)] for k, name in enumerate(ENVIRONMENTS)},
        "problems": list(found.problems),
    }


def _published(p: Parameters) -> Table:
    """The measured speeds in the units of the cell."""
    assert p.units is not None  # noqa: S101
    unit = p.units.of("L/T")
    low, high = (
        [measured("speed", f"{row[k]} um/min", "L/T", "1 um/s") / unit for row in PUBLISHED]
        for k in (1, 2)
    )
    columns = {
        "cell": column_of(p, np.array([row[0].replace("\n", " ") for row in PUBLISHED])),
        "lowest": column_of(p, low, "L/T"),
        "highest": column_of(p, high, "L/T"),
        "source": column_of(p, np.array([row[3] for row in PUBLISHED])),
    }
    return Table("published speeds of cells", columns)


def draw(data: FigureData, panels: Any) -> None:
    """Speeds over v_p0, and beside them the published ones."""
    left, right = panels
    table = data["speeds"]
    x = table["v_p0"]
    left.plot(x, table[FLOW], color=INK, lw=0.9, label="retrograde flow $v_0$")
    for name, (words, color, style) in ENVIRONMENTS.items():
        left.plot(x, table[name], color=color, ls=style, label=words)
    left.set_xlabel(label(SYMBOLS["v_p0"], table.unit("v_p0")))
    left.set_ylabel(label("speed towards the front", table.unit(FLOW)))
    highest = float(table[FLOW].max())
    if "published" in data:
        highest = max(highest, float(data["published"]["highest"].max()))
    left.set_ylim(0.0, 1.08 * highest)
    left.set_xlim(float(x.min()), float(x.max()))
    left.legend(loc="upper left", fontsize=6.0, borderpad=0.0, labelspacing=0.25)
    right.sharey(left)
    right.tick_params(labelleft=False, bottom=False, labelbottom=False)
    right.set_title("published", fontsize=7.0)
    if "published" not in data:
        right.set_axis_off()
        return
    published = data["published"]
    count, gap = len(PUBLISHED), 0.015 * left.get_ylim()[1]
    for k, (low, high) in enumerate(zip(published["lowest"], published["highest"], strict=True)):
        style_of_text: dict[str, Any] = {"rotation": 90, "ha": "center", "fontsize": 6.0}
        if high == low:
            right.plot([k - 0.35, k + 0.35], [low, low], color=INK, lw=1.2)
            right.text(k, high + gap, PUBLISHED[k][0], va="bottom", **style_of_text)
        else:
            right.bar(k, high - low, 0.7, bottom=low, color=PALE, edgecolor=GRAY, lw=0.5)
            right.text(k, 0.5 * (low + high), PUBLISHED[k][0], va="center", **style_of_text)
    right.set_xlim(-0.6, count - 0.4)


FIGURE = Figure(
    name="extra_motility",
    title="migration speed in all environments",
    source="not in the paper",
    parameters=Parameters.physical(),
    compute=compute,
    draw=draw,
    size=(4.6, 3.2),
    panels=(1, 2),
    layout={"gridspec_kw": {"width_ratios": (3.2, 1.0)}},
    varies=frozenset({"v_p0"}),
)

"""What the page offers: sliders with their ranges, and parameter points to begin with."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

from amoeboid.explorer.point import PHYSICAL, SIMULATION, parameters_of
from amoeboid.model.parameters import Parameters
from amoeboid.studies.columns import magnitude, unit


@dataclass(frozen=True, kw_only=True)
class Slider:
    """A parameter that can be dragged from `low` to `high`, in simulation units."""

    name: str
    low: float
    high: float
    logarithmic: bool = False
    rare: bool = False  # shown among the further parameters


SLIDERS = (
    Slider(name="v_p0", low=0.0, high=12.0),
    Slider(name="D", low=0.003, high=2.0, logarithmic=True),
    Slider(name="delta_P", low=3.0, high=1000.0, logarithmic=True),
    Slider(name="c0", low=1.0, high=8.0),
    Slider(name="beta", low=0.1, high=10.0, logarithmic=True),
    Slider(name="eta_b", low=0.1, high=10.0, logarithmic=True),
    Slider(name="alpha", low=0.0, high=2.0, rare=True),
    Slider(name="chi", low=0.0, high=1.0, rare=True),
    Slider(name="kappa", low=0.0, high=1.0, rare=True),
    Slider(name="gamma_t", low=0.0, high=2.0, rare=True),
    Slider(name="gamma_n", low=0.0, high=2.0, rare=True),
    Slider(name="gamma_c", low=0.0, high=2.0, rare=True),
    Slider(name="gamma_share", low=0.0, high=1.0, rare=True),
)
"""All parameters but R0, eta_s and c_r, which set the units, and those of law and stress."""


@dataclass(frozen=True, kw_only=True)
class Preset:
    """A parameter point with a title, and what there is to see.

    `pace` is the place of the slider *Pace*: two more are twice as fast.
    """

    name: str
    title: str
    note: str
    units: str = SIMULATION
    values: dict[str, Any] = field(default_factory=dict)
    start: str = "noise"
    pace: int = 2


PRESETS = (
    Preset(
        name="polarizes",
        title="A cell that polarizes",
        note="Small noise grows, and the cell finds one front and one rear.",
        values={"D": 0.4, "v_p0": 7.5},
    ),
    Preset(
        name="polarized",
        title="A polarized cell (figure 3D)",
        note="Just below the threshold: a cell that starts polarized stays so.",
        values={"D": 0.4, "v_p0": 6.0},
        start="polarization",
    ),
    Preset(
        name="smooth",
        title="Smooth onset (figure 3A)",
        note="Above the threshold the flow grows gradually from zero.",
        values={"D": 0.03, "v_p0": 3.8},
    ),
    Preset(
        name="hysteresis",
        title="Hysteresis (figure 3B)",
        note="Two states last: at rest, and polarized. The start decides, or a strong poke.",
        values={"D": 0.4, "v_p0": 5.5},
        start="polarization",
    ),
    Preset(
        name="rest",
        title="Below the fold: back to rest",
        note="Every polarization decays. Raise v_p0 to see it survive.",
        values={"D": 0.4, "v_p0": 4.5},
        start="polarization",
    ),
    Preset(
        name="inverse",
        title="Another law, v_p ~ 1/c",
        note="The cell polarizes for other laws of polymerization as well.",
        values={"law": "inverse", "D": 0.03, "v_p0": 1.7},
    ),
    Preset(
        name="soft",
        title="A soft cell",
        note="At a low pressure the flow deforms the cell.",
        values={"D": 0.4, "v_p0": 6.0, "delta_P": 11.0},
        start="polarization",
    ),
    Preset(
        name="circling",
        title="A circling cell",
        note="A soft, fast cell bends: it loses its axis and runs in circles, one in about 35 "
        "units of time. A poke from the side begins it.",
        values={"D": 0.4, "v_p0": 8.0, "delta_P": 20.0},
        start="turned",
        pace=4,
    ),
    Preset(
        name="helix",
        title="A cell on a helix",
        note="Faster still, the circle itself is lost to a helix.",
        values={"D": 0.4, "v_p0": 10.0, "delta_P": 30.0},
        start="turned",
        pace=4,
    ),
    Preset(
        name="physical",
        title="The paper's cell, in micrometers",
        note="10 µm, 300 Pa, a turnover of 10 s: as estimated in the paper.",
        units=PHYSICAL,
        start="polarization",
    ),
)


def offered() -> dict[str, Any]:
    """Sliders and presets as the page gets them, with units, ranges and values for both units."""
    return {
        "sliders": {units: _sliders(units) for units in (SIMULATION, PHYSICAL)},
        "presets": [
            {f.name: getattr(preset, f.name) for f in fields(Preset) if f.name != "values"}
            | {"values": shown_values(parameters_of(preset.units, preset.values))}
            for preset in PRESETS
        ],
    }


def shown_values(p: Parameters) -> dict[str, Any]:
    """The values of the sliders, law and stress at a parameter point, as numbers in its units."""
    return {name: shown_value(p, name) for name in p.as_dict()}


def shown_value(p: Parameters, name: str) -> Any:
    """One of them."""
    value = p.as_dict()[name]
    return value if isinstance(value, str) else shown(p, value, p.dimension(name))


def shown(p: Parameters, value: float, dimension: str | None) -> float:
    """A number in the units of the page, without the rounding of its conversion."""
    return float(f"{float(magnitude(p, value, dimension)):.10g}")


def _sliders(units: str) -> list[dict[str, Any]]:
    p = parameters_of(units, {})
    meanings = {f.name: f.metadata.get("doc", "") for f in fields(Parameters)}
    found = []
    for slider in SLIDERS:
        dimension = p.dimension(slider.name)
        low, high = (shown(p, v, dimension) for v in (slider.low, slider.high))
        found.append(
            {
                "name": slider.name,
                "meaning": meanings[slider.name],
                "unit": unit(p, dimension),
                "low": low,
                "high": high,
                "logarithmic": slider.logarithmic,
                "rare": slider.rare,
            }
        )
    return found

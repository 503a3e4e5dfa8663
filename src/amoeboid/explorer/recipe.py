"""How a cell that was played with came about: enough to make the same run again, bit for bit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from amoeboid.config import Config, polarization
from amoeboid.meshes.cells import InitialCell
from amoeboid.model.changes import Changes, Steps
from amoeboid.model.cues import Cue
from amoeboid.model.inputs import Inputs
from amoeboid.model.parameters import Parameters
from amoeboid.runs.meshes import Surface, placed_on
from amoeboid.sections import Initial, Mesh, Time
from amoeboid.simulation.loop import start
from amoeboid.simulation.step import Step
from amoeboid.validation import InvalidInput

NOISE, POLARIZATION, ELONGATED, SURFACE = "noise", "polarization", "elongated", "surface"
TURNED = "turned"  # polarized, and poked from the side at once
STARTS = (NOISE, POLARIZATION, TURNED, ELONGATED, SURFACE)

MAX_STEP = 0.1
"""Longest step in units of 1/rate: what is changed acts after the present one."""

GRID = 0.01
"""Changes are at multiples of this time, in units of 1/rate, so that few digits write them."""

ROUNDING = 1e-12
"""Of a time that is written with its unit; no step is as short."""

MAX_CHANGES, MAX_POKES = 300, 100
NOISE_SIZE, STRETCH = 0.1, 1.5
POKE_DURATION = 1.0
"""Of a poke, in units of 1/rate."""


@dataclass(frozen=True)
class Recipe:
    """Parameters, start, and what was changed at which time.

    `jumps`: {name: ((t, value), ...)} in the units of the solver; `surface`: the path of a file.
    """

    parameters: Parameters
    subdivisions: int = 3
    start: str = NOISE
    seed: int = 0
    surface: str | None = None
    jumps: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    pokes: tuple[tuple[float, ...], ...] = ()

    def __post_init__(self) -> None:
        if self.start not in STARTS:
            raise InvalidInput(f"start must be one of {', '.join(STARTS)}, got {self.start!r:.80}")
        if self.start == SURFACE and self.surface is None:
            raise InvalidInput("a start from a surface needs a file (stl, ply, obj, vtp): open one")

    @property
    def rate(self) -> float:
        """The unit of its times [1/T]: that of the parameters that it begins with."""
        return self.parameters.rate

    @property
    def initial(self) -> Initial:
        """The section [initial]."""
        p = self.parameters
        size = NOISE_SIZE * p.c0
        if self.start == NOISE:
            return Initial(perturbation=0.0, noise=size, seed=self.seed)
        if self.start in (POLARIZATION, TURNED):
            return Initial(perturbation=polarization(p))
        if self.start == ELONGATED:
            return Initial(perturbation=0.2 * p.c0)
        return Initial(perturbation=0.2 * p.c0, surface=self.surface, repair=True)

    @property
    def inputs(self) -> Inputs:
        """What has acted on the cell, and still will."""
        return Inputs(self.parameters, self._changes, self._cue)

    @property
    def _changes(self) -> Changes:
        return Changes({name: Steps(points) for name, points in self.jumps.items()})

    @property
    def _cue(self) -> Cue:
        return Cue(pokes=self.pokes)

    def time(self, end: float) -> Time:
        """The section [time] of a run that stops with the step that reaches `end`.

        No step is made shorter to end there, so that all are those of the cell that went on.
        """
        return Time(
            end=2.0 * end + 1.0 / self.rate,
            max_step=MAX_STEP / self.rate,
            stop_when_steady=False,
            until=(f"t >= {self._written(end)}",),
        )

    def _written(self, t: float) -> str:
        """A time as conditions read it; in seconds less what reading it back may round."""
        units = self.parameters.units
        return repr(t) if units is None else f"'{t * (1.0 - ROUNDING) * units.of('T')!r} s'"

    def config(self, end: float) -> Config:
        """The configuration of the run until `end`."""
        return Config(
            parameters=self.parameters,
            mesh=Mesh(subdivisions=self.subdivisions),
            initial=self.initial,
            time=self.time(end),
            changes=self._changes,
            cue=self._cue,
        )

    def shape(self) -> Surface | None:
        """The surface that it starts as, if it is neither the sphere nor one from a file."""
        if self.start != ELONGATED:
            return None
        sphere = start(Config(mesh=Mesh(subdivisions=self.subdivisions))).cell
        return Surface(sphere.r * np.array([1.0, 1.0, STRETCH]), sphere.faces)

    def begin(self) -> Step:
        """The initial step. Raises InvalidInput."""
        config, cell = replace(self, jumps={}, pokes=()).config(1.0), None
        shape = self.shape()
        if shape is not None:
            cell = _cell(shape, config)
        return start(config, cell)

    def next_time(self, t: float) -> float:
        """The first time after t that a change may have."""
        grid = GRID / self.rate
        count = math.floor(t / grid * (1 + 1e-12)) + 1
        return float(f"{count * grid:.12g}")

    def changed_to(self, p: Parameters, t: float) -> Recipe:
        """With the parameters p from the next time after t on. Raises InvalidInput."""
        before = self._at(t)
        now = {name: _value(p, name, self.parameters) for name in p.names}
        fixed = [
            kind for kind in ("law", "stress")
            if getattr(p, kind).name != getattr(self.parameters, kind).name
        ]  # fmt: skip
        if fixed or set(now) != set(before):
            raise InvalidInput(
                f"the {(fixed or ['law'])[0]} must stay while a cell lives; restart it to change it"
            )
        at, jumps = self.next_time(t), dict(self.jumps)
        for name, value in now.items():
            if value == before[name]:
                continue
            points = [point for point in jumps.get(name, ()) if point[0] < at]
            jumps[name] = (*points, (at, value))
        if sum(map(len, jumps.values())) > MAX_CHANGES:
            raise InvalidInput(
                f"a run takes at most {MAX_CHANGES} changes of parameters, these are more; save "
                "it if you like, and restart the cell"
            )
        return replace(self, jumps=jumps)

    def poked(self, direction: tuple[float, float, float], strength: float, t: float) -> Recipe:
        """With a poke from the next time after t on. Raises InvalidInput."""
        if len(self.pokes) >= MAX_POKES:
            raise InvalidInput(
                f"a run takes at most {MAX_POKES} pokes; save it if you like, and restart the cell"
            )
        x, y, z = (round(float(component), 3) for component in direction)
        at, duration = self.next_time(t), float(f"{POKE_DURATION / self.rate:.6g}")
        return replace(self, pokes=(*self.pokes, (at, duration, x, y, z, round(strength, 3))))

    def _at(self, t: float) -> dict[str, float]:
        """The latest value of every parameter, also of those that are to come."""
        latest = {name: points[-1][1] for name, points in self.jumps.items()}
        return {
            name: latest.get(name, self.parameters.value(name)) for name in self.parameters.names
        }


def _value(p: Parameters, name: str, of: Parameters) -> float:
    """A parameter of p in the units of the cell `of`, without the rounding of the conversion."""
    value, dimension = p.value(name), p.dimension(name)
    if p.units is None or of.units is None or not dimension:
        return value
    converted = value * (p.units.of(dimension) / of.units.of(dimension))
    own = of.value(name)
    return own if abs(converted - own) <= 1e-12 * abs(own) else converted


def _cell(shape: Surface, config: Config) -> InitialCell | None:
    return placed_on(shape, config)[1]

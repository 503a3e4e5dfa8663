"""The cell that lives beside the page: it is simulated as fast as the page shows time to pass."""

from __future__ import annotations

import json
import math
import struct
import time
from dataclasses import replace
from typing import Any

import numpy as np

from amoeboid.arrays import Array
from amoeboid.explorer.recipe import TURNED, Recipe
from amoeboid.model.parameters import Parameters
from amoeboid.observables import OBSERVABLES, polarization, retrograde_flow
from amoeboid.simulation.dense_output import between
from amoeboid.simulation.step import Step
from amoeboid.simulation.step_length import Diverged, next_step
from amoeboid.studies.columns import magnitude, text, unit
from amoeboid.threads import one_thread
from amoeboid.validation import InvalidInput

SHOWN = (
    "max_retrograde_speed",
    "cortex_drag_speed",
    "polarity",
    "c_front",
    "c_rear",
    "deformation",
)
"""The observables beside the cell."""

BETWEEN = 0.2
"""Seconds between two frames that have the observables too."""

FOREVER = 1e7
MAX_PACE, MAX_POKE = 50.0, 5.0

TRIAL = 1.01
"""The longest trial of a step, in units of `max_step`; a little more, to end at a stop."""

FROM_THE_SIDE = (1.0, 0.2, 0.0), 3.0
"""Direction and strength of the poke that a cell which turns starts with: the front is at z."""


class LiveCell:
    """A run that continues, and may be changed.

    `shown_t` is the time that is shown, never behind by more than one step; `pace` the simulated
    time in a second, in units of 1/rate.
    """

    def __init__(self, recipe: Recipe) -> None:
        self.recipe = recipe
        self.pace, self.paused, self.problem = 1.0, False, ""
        self._before = self._step = recipe.begin()
        self._time = recipe.time(FOREVER / recipe.rate)
        self.shown_t = 0.0
        self._faces_sent: Any = None
        self._observed = -math.inf
        if recipe.start == TURNED:
            self.poke(*FROM_THE_SIDE)

    @property
    def step(self) -> Step:
        """The latest step."""
        return self._step

    @property
    def going(self) -> bool:
        """Whether time passes."""
        return not self.paused and not self.problem

    def pass_time(self, seconds: float, budget: float = 0.05) -> None:
        """Let so many seconds of the page pass, or as many as steps of `budget` seconds reach."""
        if not self.going:
            return
        wanted = self.shown_t + seconds * self.pace / self.recipe.rate
        began = time.monotonic()
        while wanted > self._step.state.t and self.going:
            try:
                with one_thread:
                    self._before, self._step = self._step, next_step(self._step, self._time)
            except (Diverged, InvalidInput, ArithmeticError, np.linalg.LinAlgError) as error:
                self.problem = f"the run cannot continue: {error}"
            if time.monotonic() - began > budget:
                break
        self.shown_t = min(wanted, self._step.state.t)

    def change_to(self, p: Parameters) -> None:
        """Change to other parameters from the first time that no step has looked at.

        Raises InvalidInput.
        """
        self._follow(self.recipe.changed_to(p, self._looked_until))

    def poke(self, direction: Any, strength: Any) -> None:
        """Poke the cell in a direction (3,) from its center. Raises InvalidInput."""
        try:
            x, y, z = (float(value) for value in direction)
            strength = float(strength)
        except (TypeError, ValueError):
            raise InvalidInput(
                "a poke must have a direction of three numbers, and a strength"
            ) from None
        if not 1e-3 < math.hypot(x, y, z) < 1e3 or not -1.0 <= strength <= MAX_POKE:
            raise InvalidInput(
                f"a poke must have a direction that is not zero and a strength from -1 to "
                f"{MAX_POKE:g}, got {strength:g}"
            )
        self._follow(self.recipe.poked((x, y, z), strength, self._looked_until))

    @property
    def _looked_until(self) -> float:
        """The latest time [T] that a step made so far can have depended on.

        A trial that was too long, and was made again shorter, has seen the inputs at its end: what
        is changed before it would have changed the length of the step.
        """
        t = self._step.state.t
        if self._before is self._step:
            return t
        return max(t, self._before.state.t + TRIAL * self._time.max_step)

    def _follow(self, recipe: Recipe) -> None:
        model = replace(self._step.model, inputs=recipe.inputs)
        self.recipe, self._step = recipe, replace(self._step, model=model)

    def frame(self) -> bytes:
        """The cell at `shown_t`: the length of a header, the header as JSON, arrays of float32.

        The header says which arrays follow, with their shapes: x (V, 3) [R0] about the center, c
        (V,), flow (V, 3), both as the page shows them, and faces (F, 3) as uint32 if they are new.
        """
        step = self._shown()
        cell, p = step.cell, step.model.parameters
        arrays: dict[str, Array] = {
            "x": (cell.x / p.R0).astype("<f4"),
            "c": np.asarray(magnitude(p, cell.c, "N/L^2")).astype("<f4"),
            "flow": np.asarray(magnitude(p, retrograde_flow(cell), "L/T")).astype("<f4"),
        }
        faces = cell.faces
        if faces is not self._faces_sent:
            arrays["faces"], self._faces_sent = faces.astype("<u4"), faces
        header = {
            "kind": "frame",
            "t": float(magnitude(p, step.state.t, "T")),
            "time": text(p, step.state.t, "T", ".4g"),
            "position": (step.state.position / p.R0).tolist(),
            "polarity": float(np.linalg.norm(polarization(cell))),
            "unit": unit(p, "N/L^2"),
            "steady": self._words(),
            "problem": self.problem,
            "paused": self.paused,
            "arrays": [[name, list(a.shape), a.dtype.kind] for name, a in arrays.items()],
        }
        now = time.monotonic()
        if now - self._observed > BETWEEN:
            self._observed = now
            header["observables"] = {
                name: text(
                    p, OBSERVABLES[name].value(name, cell), OBSERVABLES[name].dimension, ".4g"
                )
                for name in SHOWN
            }
        words = json.dumps(header, allow_nan=False).encode()
        words += b" " * (-len(words) % 4)
        return b"".join(
            [struct.pack("<I", len(words)), words, *(a.tobytes() for a in arrays.values())]
        )

    def show_all(self) -> None:
        """Send the faces again with the next frame."""
        self._faces_sent = None

    def _shown(self) -> Step:
        before, after = self._before, self._step
        inside = after is not before and before.state.t <= self.shown_t < after.state.t
        return between(before, after, self.shown_t) if inside else after

    def _words(self) -> str:
        step = self._step
        return "" if step.rest is None else f"steady, {step.stability}"

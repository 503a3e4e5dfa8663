"""The cell at any time within a step, and the times at which frames are due."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from amoeboid.meshes.geometry import area, geometry, node_areas, volume_centroid
from amoeboid.numerics.multistep import extrapolated
from amoeboid.simulation.step import Step
from amoeboid.surface.equilibrium import flow_of
from amoeboid.surface.state import Flow, State
from amoeboid.validation import InvalidInput

# Times that differ by less than this share of the interval between two frames are one time.
SAME_TIME = 1e-9


def between(before: Step, after: Step, t: float) -> Step:
    """The cell at a time t within the step from `before` to `after`.

    Of second order, as the step: nodes and numbers of filaments at the nodes lie on the polynomial
    through the states that the step was made from (on the line between the last two where that
    would make c negative), velocities and tension on the line between the two flows. Area and
    number of filaments are those of the states. The run does not depend on it. Raises InvalidInput
    for another time.
    """
    model, faces, past = after.model, after.model.mesh.faces, after.history
    if not past[-1].t <= past[1].t <= t <= past[0].t:
        raise InvalidInput(f"t must be {past[1].t:g} to {past[0].t:g}, got {t:g}")
    numbers = [s.c * node_areas(s.r, faces) for s in past]
    for count in (len(past), 2):
        times = [s.t for s in past[:count]]
        r = extrapolated(times, [s.r for s in past[:count]], t)
        wanted = extrapolated(times, [np.asarray(area(s.r, faces)) for s in past[:count]], t)
        center = volume_centroid(r, faces)
        r = center + np.sqrt(wanted / area(r, faces)) * (r - center)
        c = extrapolated(times, numbers[:count], t) / node_areas(r, faces)
        if c.min() >= 0.0:
            break
    position = extrapolated(times, [s.position for s in past[:count]], t)
    begins = past[1].t
    known = before.model.mesh is model.mesh and begins not in model.breaks
    begun = before.flow if known else flow_of(model.at(begins, begins), past[1], after.dt)
    share, g = (t - past[1].t) / after.dt, geometry(r, faces)
    v_c, v_p = (
        (1.0 - share) * a + share * b
        for a, b in ((begun.v_c, after.flow.v_c), (begun.v_p, after.flow.v_p))
    )
    zeta0 = (1.0 - share) * begun.zeta0 + share * after.flow.zeta0
    state = State(t, r, np.maximum(c, 0.0), zeta0, position)
    flow = Flow(v_c, v_p, zeta0, g.normals, g.node_areas)
    return replace(after, model=model.at(t, begins), history=(state, *past[1:]), flow=flow)


def due_times(after: float, until: float, interval: float) -> Iterator[float]:
    """Multiples of `interval` beyond `after`, up to `until`; one that is `until` but for rounding
    is given as that."""
    count = math.floor(after / interval + SAME_TIME) + 1
    while (t := count * interval) <= until + SAME_TIME * interval:
        yield until if t >= until - SAME_TIME * interval else t
        count += 1


class Schedule:
    """Times at which something is due: multiples of an interval, or `times` where there are any.

    `latest` is the time up to which it has been done, None before the first.
    """

    def __init__(self, interval: float, times: Sequence[float] = (), latest: float | None = None):
        self.interval, self.times, self.latest = interval, tuple(times), latest

    def due(self, t: float) -> list[float]:
        """The times after `latest` up to t; of an interval t itself if there was none before."""
        if self.times:
            after = -math.inf if self.latest is None else self.latest
            return list(self.times[bisect_right(self.times, after) : bisect_right(self.times, t)])
        return [t] if self.latest is None else list(due_times(self.latest, t, self.interval))

"""The verdict on a parameter point, in sentences."""

from __future__ import annotations

from collections.abc import Sequence

from amoeboid.studies.columns import text
from amoeboid.studies.states import SteadyState
from amoeboid.studies.theory import Theory


def verdict(found: Theory, states: Sequence[SteadyState] = ()) -> list[str]:
    """What becomes of the cell: by the closed forms alone, or with its steady states.

    The first of `states` is the homogeneous sphere.
    """
    p, s = found.parameters, found.summary
    growth = text(p, s.growth_rates[1], "1/T", ".3g")
    others = [l for l, (slow, _) in s.finite_pressure_rates.items() if slow.real > 0]
    if s.growth_rates[1] > 0:
        sentences = [f"A resting cell polarizes: the mode l = 1 grows at {growth}."]
    elif others:
        listed = ", ".join(map(str, others))
        sentences = [f"A resting cell does not polarize, but it deforms: l = {listed} grows."]
    else:
        sentences = [f"A resting cell stays at rest: the mode l = 1 decays ({growth})."]
    if s.thresholds.v_p0.size:
        threshold = text(p, float(s.thresholds.v_p0[0]), "L/T", ".4g")
        kind = f", {s.weakly.bifurcation}" if s.weakly else ""
        sentences.append(f"Threshold: v_p0 = {threshold}{kind}.")
    return [*sentences, *_of_states(states)]


def _of_states(states: Sequence[SteadyState]) -> list[str]:
    if not states:
        return []
    rest, polarized = states[0], states[1:]
    moving = [state for state in polarized if state.stable]
    if not polarized:
        return ["No polarized steady state is known here."]
    speed = polarized[-1].text("max_retrograde_speed")
    if rest.stable and moving:
        return [
            "Two states last, at rest and polarized: the start decides (hysteresis). The polarized "
            f"cell flows at {moving[-1].text('max_retrograde_speed')}."
        ]
    if moving:
        fastest = moving[-1].text("max_retrograde_speed")
        return [f"The polarized cell is stable, with a retrograde flow of {fastest}."]
    bends = any(state.unstable_modes.get(1, 0) for state in polarized)
    lost = "it bends and leaves its axis, as cells that circle do" if bends else "it does not last"
    return [f"The polarized cell (flow {speed}) is unstable: {lost}."]

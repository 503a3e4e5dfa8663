"""Competition of filaments for monomers: what the paper infers from an in-vitro experiment.

A comet grows at B exp(-C t) while it uses up the monomers of its microwell, so that its speed is
proportional to what is left (SI `eq_vp_lit` to `eqRatioInVivo`). Any consistent units;
concentrations as numbers per volume or area.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from amoeboid.arrays import Array
from amoeboid.validation import InvalidInput, number, validate


@dataclass(frozen=True, kw_only=True)
class ExponentialDecay:
    """The fit v_p(t) = B exp(-C t) with mu_0 monomers per volume at the start; SI `eq_vp_lit`."""

    B: float = number(1.0, "growth speed at the start", "L/T", gt=0)
    C: float = number(1.0, "rate at which the growth slows down", "1/T", gt=0)
    mu_0: float = number(1.0, "monomers at the start", "N/L^3", gt=0)

    def __post_init__(self) -> None:
        validate(self)


def growth_speed(decay: ExponentialDecay, t: ArrayLike) -> Array:
    """v_p(t) [L/T], of the shape of t [T]; SI `eq_vp_lit`."""
    return decay.B * np.exp(-decay.C * np.asarray(t, dtype=float))


def monomers(decay: ExponentialDecay, t: ArrayLike) -> Array:
    """Monomers left [N/L^3], of the shape of t [T]; SI `eq_cmono_lit`, `eq_cmono_lit2`."""
    grown = decay.B * -np.expm1(-decay.C * np.asarray(t, dtype=float)) / decay.C
    return decay.mu_0 - consumption(decay) * grown


def consumption(decay: ExponentialDecay) -> float:
    """gamma = mu_0 C/B, monomers used per grown length so that none is left in the end [N/L^4]."""
    return decay.mu_0 * decay.C / decay.B


def speed_at(decay: ExponentialDecay, mu: ArrayLike) -> Array:
    """Growth speed B mu/mu_0 [L/T], of the shape of mu [N/L^3]; SI `eq_vp_monomer`."""
    return decay.B / decay.mu_0 * np.asarray(mu, dtype=float)


def monomer_ratio(mu: ArrayLike, h: ArrayLike, c: ArrayLike) -> Array:
    """mu_bar = mu h/c, monomers per filament in a layer of thickness h [1]; main text.

    mu [N/L^3], h [L] and c [N/L^2] broadcast. Raises InvalidInput unless c > 0.
    """
    c = np.asarray(c, dtype=float)
    if not np.all(c > 0):
        raise InvalidInput(f"c must be > 0, got {c.min():.6g}")
    return np.asarray(mu, dtype=float) * h / c


def speed_coefficients(decay: ExponentialDecay, h: float, c: float) -> tuple[float, float]:
    """(V_0, V_1) of v_p = V_0 + V_1 mu_bar [L/T]; SI `eqV1`.

    The straight line through the speeds at two monomer concentrations; V_0 vanishes because the
    growth stops when the monomers are used up. Raises InvalidInput unless c > 0 and h > 0.
    """
    if not h > 0:
        raise InvalidInput(f"h must be > 0, got {h!r}")
    V_0 = float(speed_at(decay, 0.0))
    full = float(speed_at(decay, decay.mu_0))
    return V_0, (full - V_0) / float(monomer_ratio(decay.mu_0, h, c))

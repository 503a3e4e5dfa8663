"""Fixed-point iteration x = G(x): how far it still is from the solution, and a shorter way there.

Both follow from the last two passes. The shorter way is Anderson acceleration of depth one (D. G.
Anderson, J. ACM 12, 547, 1965; H. F. Walker, P. Ni, SIAM J. Numer. Anal. 49, 1715, 2011).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from amoeboid.arrays import Array

# Longest step back or ahead, in units of the last change of G(x).
LONGEST = 1.0


@dataclass(frozen=True, eq=False)
class Pass:
    """One evaluation of G, of unknowns (n,) scaled to about 1: x and G(x)."""

    x: Array
    g: Array

    @cached_property
    def change(self) -> float:
        """Largest change by the pass."""
        return float(np.abs(self.g - self.x).max())


def left_to_come(before: Pass, last: Pass) -> float:
    """How far last.g is from the solution: G brings two points nearer to each other by one rate."""
    apart = np.abs(last.x - before.x).max()
    rate = np.abs(last.g - before.g).max() / apart if apart > 0.0 else 0.0
    return float(last.change * rate / (1.0 - rate)) if rate < 1.0 else np.inf


def overshoot(before: Pass, last: Pass) -> float:
    """The number a for which x = last.g + a (last.g - before.g) is next to the solution.

    It is where x - G(x), linear between and beyond the two, is least.
    """
    change = last.g - last.x
    bend = change - (before.g - before.x)
    square = bend @ bend
    return float(np.clip(-(change @ bend) / square, -LONGEST, LONGEST)) if square > 0.0 else 0.0

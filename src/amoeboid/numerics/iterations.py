"""Fixed-point iteration x = G(x): the remaining error, and a step that accelerates it.

Both follow from the last two iterations. The step is Anderson acceleration of depth one (D. G.
Anderson, J. ACM 12, 547, 1965; H. F. Walker, P. Ni, SIAM J. Numer. Anal. 49, 1715, 2011).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from amoeboid.arrays import Array

# Longest Anderson step, forward or backward, in units of the last change of G(x).
MAX_ANDERSON_STEP = 1.0


@dataclass(frozen=True, eq=False)
class Iteration:
    """One evaluation of G, for unknowns (n,) scaled to about 1: x and G(x)."""

    x: Array
    g: Array

    @cached_property
    def change(self) -> float:
        """Largest component of |G(x) - x|."""
        return float(np.abs(self.g - self.x).max())


def remaining_error(before: Iteration, last: Iteration) -> float:
    """Estimated distance of last.g from the solution, infinite if the iteration diverges.

    The contraction factor of G is estimated from the two iterations.
    """
    apart = np.abs(last.x - before.x).max()
    contraction = np.abs(last.g - before.g).max() / apart if apart > 0.0 else 0.0
    return float(last.change * contraction / (1.0 - contraction)) if contraction < 1.0 else np.inf


def anderson_step(before: Iteration, last: Iteration) -> float:
    """The factor a for which x = last.g + a (last.g - before.g) is the best next x.

    It minimizes |x - G(x)| on the line through the two iterations, along which G is taken as
    linear.
    """
    change = last.g - last.x
    bend = change - (before.g - before.x)
    square = bend @ bend
    if not square > 0.0:
        return 0.0
    return float(np.clip(-(change @ bend) / square, -MAX_ANDERSON_STEP, MAX_ANDERSON_STEP))

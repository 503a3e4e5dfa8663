"""
A polymerization law of your own
================================

The law that tells how growth slows down with crowding is one line. Theory, branches and 3D runs
take it at once.
"""

import matplotlib.pyplot as plt
import numpy as np

import amoeboid as am
from amoeboid.plotting.palette import BLUE, GREEN, ORANGE, PURPLE

# %%
# A Hill function: growth stops where filaments are denser than ``c_r``.


def hill(c, v_p0, c_r, n=2.0):
    """Polymerization speed that falls with the power n of the concentration."""
    return v_p0 / (1 + (c / c_r) ** n)


laws = {
    "exponential": (am.Exponential(), ORANGE),
    "inverse": (am.Inverse(), PURPLE),
    "Hill, $n = 2$": (hill, BLUE),
    "Hill, $n = 3$": (am.Custom("v_p0/(1 + (c/c_r)**n)", n=3), GREEN),
}

# %%
# Left: the laws. Right: what they do to the onset.
fig, (left, right) = plt.subplots(1, 2, figsize=(9.5, 3.9), layout="constrained")
c = np.linspace(0.2, 8, 200)
branches = {}
for name, (law, color) in laws.items():
    cell = am.Parameters(D=0.1, law=law)
    threshold = am.theory(cell).threshold
    left.plot(c, cell.replace(v_p0=1.0).v_p(c), color=color, lw=2, label=name)
    branches[name] = am.branch(cell, "v_p0", 0, 1.15 * threshold)
    x = branches[name].v_p0 / threshold
    right.plot(x, branches[name].max_retrograde_speed, color=color, lw=2)
left.axvline(3, color="0.6", lw=0.8, ls=":")
left.set(xlabel="filament concentration $c$ [$c_r$]", ylabel="$v_p/v_p^0$", ylim=(0, 1.5))
left.legend(frameon=False)
right.axvline(1, color="0.6", lw=0.8, ls=":")
right.set(xlabel="$v_p^0$ over its threshold", ylabel="retrograde flow $v_0$ [$R_0 β$]")
plt.show()

# %%
# **Check.** The sphere becomes unstable where
# :math:`v_p'(c_0) = -(2 D/R_0 + β R_0)/(2 c_0)`. For the Hill law the derivative is known.
cell = am.Parameters(D=0.1, law=hill)
n, c0 = 2.0, cell.c0
slope = -n * c0 ** (n - 1) / (1 + c0**n) ** 2  # for v_p0 = c_r = 1
by_hand = -(2 * cell.D + cell.beta) / (2 * c0) / slope
print(f"threshold {am.theory(cell).threshold:.6f}, by hand {by_hand:.6f}")
assert abs(am.theory(cell).threshold / by_hand - 1) < 1e-10
assert all(branch.complete for branch in branches.values())

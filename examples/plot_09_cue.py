"""
A cue turns a cell
==================

A polarized cell moves along z. Then filaments grow a little faster on the side of x. The cell turns
there.
"""

import matplotlib.pyplot as plt
import numpy as np

import amoeboid as am
from amoeboid.plotting.palette import BLUE, GRAY, ORANGE

# %%
# The cell is first brought to its steady state. Two strengths of the cue act from there.
cell = am.Parameters(D=0.4, v_p0=6.0)
polarized = am.steady_states(cell).fastest_stable
runs = {
    strength: am.simulate(
        cell,
        mesh=am.Icosphere(1),
        initial=polarized,
        cue=am.Cue(strength=strength, direction=(1, 0, 0)),
        until=am.time(25),
    )
    for strength in (0.05, 0.1)
}

# %%
# The angle between the heading of the cell and the direction of the cue.
fig, ax = plt.subplots(figsize=(6.4, 4), layout="constrained")
angles = {}
for (strength, run), color in zip(runs.items(), (BLUE, ORANGE), strict=True):
    heading = run["cortex_drag_heading"]
    angles[strength] = np.degrees(np.arccos(np.clip(heading[:, 0], -1, 1)))
    ax.plot(run.t, angles[strength], color=color, lw=2, label=f"strength {strength}")
ax.axhline(0, color=GRAY, lw=0.8)
ax.set(xlabel="time $t$ [$1/β$]", ylabel="angle from the cue [deg]", yticks=range(0, 91, 15))
ax.legend(frameon=False)
plt.show()

# %%
# **Check.** The cell turns from 90 degrees to the cue, and twice the cue turns it twice as fast:
# for a weak cue the angle obeys :math:`\dot{θ} = -k \sin θ` with :math:`k` in proportion to the
# strength.


def time_to(degrees, strength):
    """When the angle passes a value."""
    return np.interp(-degrees, -angles[strength], runs[strength].t)


ratio = time_to(45, 0.05) / time_to(45, 0.1)
print(f"half of the strength takes {ratio:.2f} times as long")
assert angles[0.1][0] > 80
assert angles[0.1][-1] < 10
assert abs(ratio - 2) < 0.4

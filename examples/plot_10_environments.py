"""
How fast in which surroundings
==============================

The model gives the flow of a cell. How fast the cell migrates depends on what resists it: a fluid,
a matrix of fibers, a flat substrate or the walls of a channel.
"""

import matplotlib.pyplot as plt

import amoeboid as am
from amoeboid.plotting.palette import BLUE, GRAY

# %%
# The paper's cell in micrometers and seconds, and six surroundings.
cell = am.Parameters.physical(v_p0="1.7 um/s")
state = am.steady_states(cell).fastest_stable
surroundings = {
    "matrix, tangential drag": am.Matrix(normal=0),
    "patch of ±30°": am.Patch(30),
    "channel of ±30°": am.Channel(30),
    "fluid": am.Fluid(),
    "matrix, isotropic drag": am.Matrix(),
    "matrix, drag follows $c$": am.Matrix(per_filament=True),
}
moves = {name: am.migrate(state, where) for name, where in surroundings.items()}

# %%
fig, ax = plt.subplots(figsize=(7, 3.6), layout="constrained")
speeds = [move.speed.to("um/min").magnitude for move in moves.values()]
bars = ax.barh(list(moves), speeds, color=BLUE, height=0.65)
flow = state.max_retrograde_speed.to("um/min").magnitude
ax.axvline(flow, color=GRAY, ls="--", lw=1.2)
ax.annotate("retrograde flow", (flow, -0.75), ha="right", color=GRAY, annotation_clip=False)
ax.bar_label(bars, fmt="%.1f", padding=-28, color="w")
ax.set(xlabel="migration speed [µm/min]")
ax.invert_yaxis()
ax.spines[["top", "right"]].set_visible(False)
plt.show()

# %%
# **Check.** A sphere with a flow in proportion to the sine of the angle from its axis swims at 2/3
# of the flow in a fluid, and moves with the flow where drag is tangential alone. This cell is
# close to that, and no surroundings make it faster than its flow.
print({name: round(move.velocity_over_max_retrograde_speed, 3) for name, move in moves.items()})
assert abs(moves["fluid"].velocity_over_max_retrograde_speed - 2 / 3) < 0.03
assert abs(moves["matrix, tangential drag"].velocity_over_max_retrograde_speed - 1) < 0.03
assert max(speeds) < flow

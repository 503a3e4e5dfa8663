"""
A soft cell that moves in circles
=================================

At low pressure the straight path becomes unstable. A cell that is pushed once bends its shape, and
moves on a circle from then on.
"""

import matplotlib.pyplot as plt
import numpy as np

import amoeboid as am

# %%
# The straight cell is a steady state. It is not stable.
cell = am.Parameters(D=0.4, v_p0=8.0, delta_P=20.0)
straight = am.steady_states(cell, (1,))[-1]
straight

# %%
# A 3D cell starts as this state, and is poked from the side. Its path is recorded in a matrix that
# drags along the surface.
run = am.simulate(
    cell,
    mesh=am.Icosphere(2),
    initial=straight,
    cue=am.Cue(pokes=[(0.5, 1.0, 1, 0, 0, 0.8)]),
    environment="matrix:normal=0",
    until=am.time(80),
)
run

# %%
fig, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
run.plot_trajectory(left)
run.final.plot(right)
plt.show()

# %%
# **Check.** The circling cell is also solved for, without a run. The path of the run has the radius
# speed/turning, and both agree.
circling = am.steady_state(cell, start=run.final)
speed = run["migration_speed"][-1]
turning = np.linalg.norm(run["migration_turning"][-1])
print(f"{circling.path} of radius {circling.radius_of_curvature:.2f}, run {speed / turning:.2f}")
assert not straight.stable
assert circling.path == "circle"
assert circling.stability == "stable"
assert abs(speed / turning / circling.radius_of_curvature - 1) < 0.05

"""
A soft cell that moves in circles
=================================

At low pressure the straight path becomes unstable. The cell bends its shape and moves on a circle.
"""

import matplotlib.pyplot as plt
import numpy as np

import amoeboid as am

# %%
# A soft 3D cell, above the onset of turning. It starts straight, with a small push to one side.
cell = am.Parameters(D=0.4, v_p0=9.0, delta_P=20.0)
run = am.simulate(
    cell,
    mesh=am.Icosphere(2),
    initial=am.Initial(perturbation=2.5, harmonics=((1, 1, 0.3),)),
    environment="matrix:normal=0",
    until=am.time(40),
)
run

# %%
# It is solved for as well: the path is part of the answer.
circling = am.steady_state(cell, start=run.final)
print(circling.path, "of radius", f"{circling.radius_of_curvature:.3f} R0")

# %%
fig, (left, right) = plt.subplots(1, 2, figsize=(9.5, 4), layout="constrained")
run.plot_trajectory(left)
run.final.plot(right)
plt.show()

# %%
# **Check.** Speed over turning rate is the radius of the circle.
turning = np.linalg.norm(run["migration_turning"][-1])
speed = run["migration_speed"][-1]
way = run.trajectory[run.t > 25]
center = way.mean(axis=0)
print(f"radius {speed / turning:.3f}")
assert circling.path == "circle"

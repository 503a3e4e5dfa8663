"""
A soft cell
===========

The pressure difference keeps the cell round. The lower it is, the more the flow deforms the cell.
"""

import matplotlib.pyplot as plt
import numpy as np

import amoeboid as am
from amoeboid.plotting.palette import BLUE, INK, ORANGE

# %%
# One cell at six pressures.
cell = am.Parameters(D=0.4, v_p0=6.0)
pressures = np.array([300.0, 100.0, 30.0, 20.0, 12.0, 7.0])
states = [am.steady_states(cell.replace(delta_P=P), (1,)).fastest_stable for P in pressures]
deformation = np.array([state.deformation for state in states])

# %%
# Left: outlines, front up, with the change of the distance from the center enlarged ten times.
# Right: how large that change is.
fig, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
angle = np.linspace(0, 2 * np.pi, 200)
left.plot(np.sin(angle), np.cos(angle), ":", color="0.4", label="sphere")
for k, color in ((2, INK), (3, BLUE), (5, ORANGE)):
    r, z = states[k].outline(300)
    enlarged = 1 + 10 * (np.hypot(r, z) - 1)
    x, y = enlarged * r / np.hypot(r, z), -enlarged * z / np.hypot(r, z)
    label = f"$ΔP$ = {pressures[k]:g}"
    left.plot(np.r_[x, -x[::-1]], np.r_[y, y[::-1]], color=color, lw=1.8, label=label)
left.set_aspect("equal")
left.set_axis_off()
left.legend(frameon=False, loc="center")
right.loglog(pressures, deformation, "o-", color=BLUE, lw=1.8, label="axisymmetric solver")
right.loglog(pressures, deformation[0] * 300 / pressures, ":", color="0.4", label="slope $-1$")
right.set(xlabel="pressure difference $ΔP$ [$η_s β/R_0$]", ylabel=r"deformation max $|r/R_0-1|$")
right.legend(frameon=False)
plt.show()

# %%
# **Check.** As long as the deformation is small it is inversely proportional to the pressure. The
# area of the membrane is kept at any pressure.
slope = np.log(deformation[1] / deformation[0]) / np.log(pressures[1] / pressures[0])
print(f"slope between 300 and 100: {slope:.3f}")
assert abs(slope + 1) < 0.05
assert np.all(np.diff(deformation) > 0)
assert max(state.area_error for state in states) < 1e-10

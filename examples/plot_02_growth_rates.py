"""
Which mode of the sphere grows first
====================================

A small perturbation of the sphere is a sum of modes :math:`P_l(\\cos θ)`. Each grows or decays at a
rate of its own. The mode :math:`l = 1` is the polarization.
"""

import matplotlib.pyplot as plt
import numpy as np

import amoeboid as am
from amoeboid.plotting.palette import BLUE, GREEN, INK, ORANGE, PURPLE

# %%
# Closed forms take many points of parameters at once.
cell = am.Parameters(D=0.4)
speeds = np.linspace(0, 12, 121)
threshold = am.theory(cell).threshold
print(f"the sphere is unstable from v_p0 = {threshold:.4f} on")

# %%
# The rates rise with the polymerization speed. :math:`l = 1` reaches zero first, because diffusion
# acts more strongly on the finer patterns.
fig, ax = plt.subplots(figsize=(6.4, 4), layout="constrained")
for l, color in zip((1, 2, 3, 4), (BLUE, ORANGE, GREEN, PURPLE), strict=True):
    rates = am.growth_rate(am.points(cell, v_p0=speeds), l=l)
    ax.plot(speeds, rates, color=color, lw=2)
    ax.annotate(f"$l = {l}$", (12.1, rates[-1]), color=color, va="center", annotation_clip=False)
ax.axhline(0, color="0.6", lw=0.8)
ax.plot(threshold, 0, "o", color=INK, label="threshold")
ax.set(xlabel="polymerization speed $v_p^0$ [$R_0 β$]", ylabel="growth rate $λ_l$ [$β$]")
ax.set(xlim=(0, 12), ylim=(-9, 3))
ax.legend(frameon=False)
plt.show()

# %%
# **Check.** At the threshold the growth rate is zero. Above it, the axisymmetric solver finds the
# same rate as an eigenvalue of its own equations, linearized about the sphere.
assert abs(am.growth_rate(cell.replace(v_p0=threshold), l=1)) < 1e-10
above = cell.replace(v_p0=7.0)
sphere = am.steady_states(above)[0]
leading = sphere.growth_rates(m=0)[0].real
print(f"closed form {am.growth_rate(above, l=1):.6f}, eigenvalue {leading:.6f}")
assert abs(leading - am.growth_rate(above, l=1)) < 1e-6

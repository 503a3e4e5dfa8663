"""
Smooth or sudden: the kind of the onset
=======================================

With little diffusion the flow sets in smoothly at the threshold. With more diffusion it jumps. The
sign of one coefficient, :math:`ν` in :math:`\\dot{a} = λ_1 a + ν a^3`, tells which.
"""

import matplotlib.pyplot as plt
import numpy as np

import amoeboid as am
from amoeboid.closed_forms.amplitude import cubic_coefficient
from amoeboid.closed_forms.points import infinite_pressure
from amoeboid.plotting.palette import BLUE, INK, ORANGE

# %%
# :math:`ν` is a closed form of all parameters. Here it is taken at the threshold, for a cell of
# high pressure, which stays round.
D = np.linspace(0.002, 0.16, 159)
nu = cubic_coefficient(infinite_pressure(am.points(am.Parameters(), D=D)))

# %%
# The branches show what its sign means. Each is followed from its threshold.
branches = {}
for value in (0.03, 0.15):
    cell = am.Parameters(D=value)
    branches[value] = am.branch(cell, "v_p0", 0, 1.1 * am.theory(cell).threshold, max_step=0.1)

# %%
# Left: the coefficient. Right: one branch of each kind.
fig, (left, right) = plt.subplots(1, 2, figsize=(9.5, 3.8), layout="constrained")
left.axhline(0, color="0.6", lw=0.8)
left.plot(D, np.where(nu < 0, nu, np.nan), color=BLUE, lw=2.2, label="supercritical: smooth")
left.plot(D, np.where(nu > 0, nu, np.nan), color=ORANGE, lw=2.2, label="subcritical: a jump")
left.plot(1 / 22, 0, "o", color=INK, label="$D = 1/22$")
left.set(xlabel="diffusion coefficient $D$ [$R_0^2 β$]", ylabel="$ν$ [$β/c_r^2$]")
left.legend(frameon=False)
right.axhline(0, color="0.6", lw=0.8)
right.axvline(1, color="0.6", lw=0.8, ls=":")
for (value, branch), color in zip(branches.items(), (BLUE, ORANGE), strict=True):
    order = branch.v_p0 / am.theory(am.Parameters(D=value)).threshold
    right.plot(order, branch.max_retrograde_speed, color=color, lw=2, label=f"$D = {value}$")
right.set(xlabel="$v_p^0$ over its threshold", ylabel="retrograde flow $v_0$ [$R_0 β$]")
right.legend(frameon=False)
plt.show()

# %%
# **Check.** The paper's theory has :math:`ν = 0` at :math:`D = 1/22`. The exact branches have a
# fold, where the cell jumps, only on the subcritical side.
zero = np.interp(0.0, nu, D)
print(f"nu = 0 at D = {zero:.5f}; 1/22 = {1 / 22:.5f}")
assert abs(zero - 1 / 22) < 1e-5
assert len(branches[0.03].folds) == 0
assert len(branches[0.15].folds) == 1

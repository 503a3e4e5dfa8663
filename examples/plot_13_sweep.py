"""
A sweep as a labeled table
==========================

One call evaluates a solver at many points. The answer is a dataset of xarray: numbers have names,
units and coordinates.
"""

from functools import partial

import matplotlib.pyplot as plt
import numpy as np

import amoeboid as am
from amoeboid.plotting.palette import COLOR_MAP, ORANGE

# %%
# Steady states of 36 cells.
points = am.grid(am.Parameters(), D={"linspace": [0.05, 0.4, 6]}, v_p0={"linspace": [3.0, 6.5, 6]})
table = am.sweep(points, partial(am.steady_states, degrees=(1,)))
table

# %%
# ``dataset`` selects by value, and keeps the unit.
fastest = table.dataset["max_retrograde_speed"].max("state")
print(fastest.sel(D=0.4, method="nearest").values.round(3), table["max_retrograde_speed"].units)

# %%
fig, ax = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
image = ax.pcolormesh(fastest.D, fastest.v_p0, fastest.T, cmap=COLOR_MAP, shading="nearest")
fig.colorbar(image, label="retrograde flow $v_0$ [$R_0 β$]")
D = np.linspace(0.015, 0.435, 50)
ax.plot(D, [am.theory(am.Parameters(D=d)).threshold for d in D], color=ORANGE, lw=2)
ax.annotate("threshold of the sphere", (0.2, 4.15), color=ORANGE, rotation=24)
ax.set(xlabel="diffusion coefficient $D$ [$R_0^2 β$]", ylim=(2.65, 6.85), xlim=(0.015, 0.435))
ax.set(ylabel="polymerization speed $v_p^0$ [$R_0 β$]")
plt.show()

# %%
# **Check.** Every point was computed. Above the threshold all cells move; where two cells are
# stable at one point, that point lies below the threshold.
thresholds = np.array([am.theory(am.Parameters(D=D)).threshold for D in fastest.D.values])
above = fastest.v_p0.values > thresholds[:, None]
assert set(table["status"].values.ravel()) == {"ok"}
assert np.all(fastest.values[above] > 0)
assert not np.any(table["n_stable"].values[above] > 1)

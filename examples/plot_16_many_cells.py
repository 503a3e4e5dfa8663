"""
Many cells at once
==================

With JAX (``pip install 'amoeboid[gpu]'``) the polarized states of many cells are solved for side by
side, on a processor or a GPU.
"""

from functools import partial

import matplotlib.pyplot as plt
import numpy as np

import amoeboid as am
from amoeboid.plotting.palette import COLOR_MAP, UNSTABLE

# %%
cells = am.grid(am.Parameters(), D={"linspace": [0.3, 0.5, 9]}, v_p0={"linspace": [4.6, 6.0, 15]})
table = am.sweep(cells, partial(am.many_steady_states, max_modes=32))
table

# %%
# Where there is a polarized cell, how strong is its flow? Cells move below the threshold as
# well, down to the fold.
flow = table["max_retrograde_speed"]
fig, ax = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
ax.set_facecolor("#f2f2f2")
image = ax.pcolormesh(flow.D, flow.v_p0, flow.T, cmap=COLOR_MAP, shading="nearest")
fig.colorbar(image, label="retrograde flow $v_0$ [$R_0 β$]")
D = np.linspace(0.2875, 0.5125, 10)
ax.plot(
    D, [am.theory(am.Parameters(D=d)).threshold for d in D], color=UNSTABLE, lw=2, label="threshold"
)
ax.legend(frameon=False, loc="lower right")
ax.set(xlabel="diffusion coefficient $D$ [$R_0^2 β$]", xlim=(D[0], D[-1]))
ax.set(ylabel="polymerization speed $v_p^0$ [$R_0 β$]", ylim=(4.55, 6.05))
plt.show()

# %%
# **Check.** A cell by itself is the same as beside the others.
one = am.steady_states(am.Parameters(D=0.4, v_p0=6.0)).fastest_stable
beside = flow.sel(D=0.4, v_p0=6.0, method="nearest").item()
print(f"alone {one.max_retrograde_speed:.9f}, beside others {beside:.9f}")
assert abs(beside / one.max_retrograde_speed - 1) < 1e-6

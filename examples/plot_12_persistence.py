"""
Noise of the filaments, and how long a cell keeps its heading
=============================================================

Filaments come and go at random. Their number sets how strong this noise is, and how soon the cell
forgets where it went.
"""

import matplotlib.pyplot as plt
import numpy as np

import amoeboid as am
from amoeboid.plotting.palette import BLUE, ORANGE

# %%
# The cell of figure 3D with few and with many filaments. Each run has a seed: the same seed gives
# the same run, bit for bit.
cell = am.Parameters(D=0.4, v_p0=6.0)
polarized = am.steady_states(cell).fastest_stable


def noisy(filaments, seed, end=20.0):
    """A run with shot noise."""
    return am.simulate(
        cell,
        mesh=am.Icosphere(1),
        initial=polarized,
        noise=am.Noise(filaments=filaments, seed=seed),
        time=am.Time(max_step=0.1),
        until=am.time(end),
    )


runs = {3e3: [noisy(3e3, 1), noisy(3e3, 2)], 3e4: [noisy(3e4, 3), noisy(3e4, 4)]}

# %%
# Paths with all drag on the cortex, seen along the first heading.
fig, ax = plt.subplots(figsize=(6, 5), layout="constrained")
for (filaments, group), color in zip(runs.items(), (ORANGE, BLUE), strict=True):
    for k, run in enumerate(group):
        way = run.trajectory
        label = f"{filaments:g} filaments" if k == 0 else None
        ax.plot(way[:, 0], -way[:, 2], color=color, lw=1.8, label=label)
ax.plot(0, 0, "o", color="k")
ax.set_aspect("equal", adjustable="datalim")
ax.set(xlabel="$x$ [$R_0$]", ylabel="along the first heading [$R_0$]")
ax.legend(frameon=False)
plt.show()

# %%
# **Check.** Ten times as many filaments turn the cell ten times as slowly, within the errors of
# these short runs.
found = {n: am.persistence(group, lag=1.0) for n, group in runs.items()}
for n, result in found.items():
    print(f"{n:g} filaments: D_r = {result.rotational_diffusion:.4f}")
few, many = found.values()
ratio = few.rotational_diffusion / many.rotational_diffusion
assert 4 < ratio < 25
again = noisy(3e3, 1, end=2.0)
same = again.t < 1.9
assert np.array_equal(again.trajectory[same], runs[3e3][0].trajectory[: same.sum()])

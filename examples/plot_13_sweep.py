"""
A sweep as a labeled table
==========================

One call evaluates a solver at many points. The answer is a dataset of xarray: numbers have names,
units and coordinates.
"""

import matplotlib.pyplot as plt
import numpy as np

import amoeboid as am
from amoeboid.plotting.palette import INK

# %%
# The question, as a function of a cell. What it returns are the columns of the table.


def polarization(cell):
    """Growth rate of a small polarization, and the threshold of the cell."""
    return {
        "growth_rate": cell.quantity(am.growth_rate(cell, l=1), "1/T"),
        "threshold": cell.quantity(am.thresholds(cell).v_p0[0], "L/T"),
    }


# %%
# It is asked to 400 cells, which differ in radius and in the speed of polymerization.
points = am.grid(
    am.Parameters.physical(),
    R0={"linspace": ["4 um", "16 um", 20]},
    v_p0={"linspace": ["0.4 um/s", "2.6 um/s", 20]},
)
table = am.sweep(points, polarization)
table

# %%
# ``table[...]`` is an array of xarray. It selects by name and value, and knows its unit.
rate = table["growth_rate"]
print(rate.sel(R0=10, v_p0=2, method="nearest").item(), rate.units)

# %%
# Where a polarization grows, and how fast. The black line is the threshold.
fig, ax = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
size = float(np.abs(rate).max())
shades = ax.pcolormesh(rate.R0, rate.v_p0, rate.T, cmap="RdBu_r", vmin=-size, vmax=size)
fig.colorbar(shades, label="growth rate of a polarization [1/s]")
ax.plot(rate.R0, table["threshold"].isel(v_p0=0), color=INK, lw=2)
ax.annotate("threshold", (11, 1.75), color=INK, rotation=33, ha="center", va="center")
ax.set(xlabel="radius $R_0$ [µm]", ylabel="polymerization speed $v_p^0$ [µm/s]")
ax.set(xlim=(4, 16), ylim=(0.4, 2.6))
plt.show()

# %%
# **Check.** Every point was computed. A polarization grows exactly where the cell polymerizes
# faster than its threshold.
assert set(table["status"].values.ravel()) == {"ok"}
assert ((rate > 0) == (rate.v_p0 > table["threshold"])).all()

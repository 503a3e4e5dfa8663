"""
Friction with the surroundings
==============================

Friction that acts back on the cell can raise the threshold. Whether it does, depends on its
direction.
"""

import matplotlib.pyplot as plt
import numpy as np

import amoeboid as am
from amoeboid.axisymmetric.onset import onset_speed
from amoeboid.plotting.palette import BLUE, GREEN, INK, ORANGE

# %%
# Three kinds of friction.
cell = am.Parameters(D=0.4)
kinds = {
    "along the surface": ({"gamma_t": 1.0}, GREEN),
    "in all directions alike": ({"gamma_t": 1.0, "gamma_n": 1.0}, BLUE),
    "4 times as much along the normal": ({"gamma_t": 1.0, "gamma_n": 4.0}, ORANGE),
}


def with_friction(kind, size):
    """The cell with friction of a kind."""
    return cell.replace(**{name: size * share for name, share in kinds[kind][0].items()})


# %%
# Two thresholds from the axisymmetric solver: where its equations, linearized about the sphere,
# become singular.
measured = {
    kind: onset_speed(with_friction(kind, 2.5))
    for kind in ("along the surface", "in all directions alike")
}

# %%
# Lines are the closed form.
gamma = np.linspace(0, 4, 41)
fig, ax = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
for kind, (_, color) in kinds.items():
    line = [am.theory(with_friction(kind, size)).threshold for size in gamma]
    ax.plot(gamma, line, color=color, lw=2, label=kind)
for kind, value in measured.items():
    ax.plot(2.5, value, "o", color=kinds[kind][1], mec="w", ms=8)
ax.plot([], [], "o", color=INK, label="axisymmetric solver")
ax.set(xlabel="friction $γ$ [$η_s/R_0^2$]", ylabel="threshold $v_p^c$ [$R_0 β$]", xlim=(0, 4))
ax.legend(frameon=False)
plt.show()

# %%
# **Check.** Closed form and solver agree. Friction that is the same in all directions raises the
# threshold by :math:`γ R_0^2/(6 S)`, friction along the surface not at all: a round cell slips
# through it as a whole.
S = cell.eta_s + cell.eta_b
free = am.theory(cell).threshold
for kind, value in measured.items():
    assert abs(value / am.theory(with_friction(kind, 2.5)).threshold - 1) < 1e-6
assert abs(measured["along the surface"] / free - 1) < 1e-6
assert abs(measured["in all directions alike"] / (free * (1 + 2.5 / (6 * S))) - 1) < 1e-6

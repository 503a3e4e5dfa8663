"""
Flow and concentration from front to rear
=========================================

Far from the threshold filaments crowd at the rear. The flow keeps almost the shape that it has at
the threshold, a sine of the angle.
"""

import matplotlib.pyplot as plt
import numpy as np

import amoeboid as am
from amoeboid.plotting.palette import BLUE, GREEN, ORANGE

# %%
# Three cells at one diffusion coefficient, at growing distance from the threshold. A steady state
# gives its profiles at arclengths from 0 at the rear to :math:`π` at the front.
cell = am.Parameters(D=0.03)
threshold = am.theory(cell).threshold
x = np.linspace(0, np.pi, 181)
from_front = np.degrees(np.pi - x)
profiles = {}
for share in (1.001, 1.05, 1.3):
    state = am.steady_states(cell.replace(v_p0=share * threshold)).fastest_stable
    profiles[share] = state.concentration(x), -state.flow(x)

# %%
fig, (left, right) = plt.subplots(1, 2, figsize=(9.5, 3.8), layout="constrained")
for (share, (c, u)), color in zip(profiles.items(), (BLUE, GREEN, ORANGE), strict=True):
    left.plot(from_front, c, color=color, lw=2, label=f"{share:g} $v_p^c$")
    right.plot(from_front, u / u.max(), color=color, lw=2)
sine = np.sin(x)
right.plot(from_front[::12], sine[::12], "o", ms=4, mfc="none", color="0.4", label="sine")
left.set_yscale("log")
left.minorticks_off()
left.set_yticks((2, 3, 5, 10, 15), labels=("2", "3", "5", "10", "15"))
left.set(xlabel="angle from the front [deg]", ylabel="filament concentration $c$ [$c_r$]")
right.set(xlabel="angle from the front [deg]", ylabel="retrograde flow over its maximum")
for ax in (left, right):
    ax.set(xlim=(0, 180), xticks=range(0, 181, 45))
    ax.legend(frameon=False)
plt.show()

# %%
# **Check.** Just above the threshold the flow is a sine, with the amplitude that the closed form
# predicts. The concentration is that of the homogeneous cell plus a cosine there; farther out it is
# not.
c, u = profiles[1.001]
predicted = am.theory(cell.replace(v_p0=1.001 * threshold)).max_retrograde_speed
print(f"flow {u.max():.5f}, predicted {predicted:.5f}")
print(f"distance from a sine {np.abs(u / u.max() - sine).max():.4f}")
assert abs(u.max() / predicted - 1) < 0.03
assert np.abs(u / u.max() - sine).max() < 0.03


def lean(c):
    """How far the middle of the range of c is from c at the equator."""
    return abs(c[90] - 0.5 * (c[0] + c[-1])) / np.ptp(c)


print("lean:", *(f"{lean(c):.3f}" for c, _ in profiles.values()))
assert lean(profiles[1.001][0]) < 0.05
assert lean(profiles[1.3][0]) > 0.25

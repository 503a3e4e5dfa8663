"""
Phase diagram: rest, motion, and both
=====================================

The plane of diffusion and polymerization speed has three regions. Two lines bound them: the
threshold, where the sphere becomes unstable, and the fold, where motion ends.
"""

import matplotlib.pyplot as plt
import numpy as np

import amoeboid as am
from amoeboid.closed_forms.amplitude import cubic_coefficient
from amoeboid.plotting.palette import INK, STABLE, UNSTABLE

# %%
# Both lines are followed by the axisymmetric solver.
diagram = am.phase_diagram(am.Parameters(), "D", 0.02, 0.5, columns=12, rows=12)
diagram

# %%
D, threshold = diagram.threshold
D_fold, fold = (np.asarray(line) for line in diagram.folds[0])
order = np.argsort(D_fold)
meeting = diagram.boundary[0][0]
lower = np.where(meeting < D, np.interp(D, D_fold[order], fold[order]), threshold)

fig, ax = plt.subplots(figsize=(6.4, 4.2), layout="constrained")
low, high = 3.0, 7.5
ax.fill_between(D, threshold, high, color=STABLE, alpha=0.18, lw=0)
ax.fill_between(D, lower, threshold, color=UNSTABLE, alpha=0.18, lw=0)
ax.plot(D, threshold, color=STABLE, lw=2, label="threshold")
ax.plot(D_fold, fold, color=UNSTABLE, lw=2, ls="--", label="fold")
ax.plot(*diagram.boundary, "o", color=INK, label="they meet")
for x, y, words in ((0.15, 6.3, "motion"), (0.447, 5.83, "rest or\nmotion"), (0.35, 3.9, "rest")):
    ax.text(x, y, words, ha="center", va="center", fontsize=12)
ax.set(xlim=(0.02, 0.5), ylim=(low, high))
ax.set(xlabel="diffusion coefficient $D$ [$R_0^2 β$]")
ax.set(ylabel="polymerization speed $v_p^0$ [$R_0 β$]")
ax.legend(frameon=False, loc="upper left")
plt.show()

# %%
# **Check.** The threshold is known in closed form. The lines meet where the cubic coefficient of
# the theory is zero.
exact = [am.theory(am.Parameters(D=value)).threshold for value in D]
assert np.allclose(threshold, exact, rtol=1e-8)
print(f"the lines meet at D = {meeting:.5f}")
assert diagram.complete
assert abs(cubic_coefficient(am.points(am.Parameters(), D=meeting))) < 1e-5

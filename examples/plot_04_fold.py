"""
Bistability: rest or motion
===========================

Between a fold and the threshold a cell can rest or move. Which it does depends on where it starts.
"""

import matplotlib.pyplot as plt

import amoeboid as am
from amoeboid.plotting.palette import GREEN, PURPLE

# %%
# The axisymmetric solver follows the branch of polarized cells through its fold.
cell = am.Parameters(D=0.4)
branch = am.branch(cell, "v_p0", 0, 8)
branch

# %%
# Two 3D cells between fold and threshold, with the same parameters: one starts almost uniform, the
# other one polarized.
between = cell.replace(v_p0=5.5)
weak, strong = (
    am.simulate(
        between,
        mesh=am.Icosphere(2),
        initial=am.Initial(perturbation=amplitude),
        until=am.time(15),
    )
    for amplitude in (0.3, 2.5)
)

# %%
# Left: the branch, and where the two cells end. Right: the way there.
fig, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
branch.plot(left)
for run, color, label in ((weak, GREEN, "weak start"), (strong, PURPLE, "strong start")):
    left.plot(5.5, run.final.max_retrograde_speed, "o", ms=9, mec="w", color=color, zorder=5)
    right.plot(run.t, run["max_retrograde_speed"], color=color, lw=2, label=f"3D, {label}")
left.set_xlim(5, 8)
left.get_legend().set_loc("center right")
right.set(xlabel="time $t$ [$1/β$]", ylabel="maximal retrograde speed $v_0$ [$R_0 β$]")
right.legend(frameon=False)
plt.show()

# %%
# **Check.** The two cells end on the two stable states that the axisymmetric solver knows, up to
# the error of the mesh.
states = am.steady_states(between)
print(states)
assert [state.stable for state in states] == [True, False, True]
assert weak.final.max_retrograde_speed < 0.02
error = strong.final.max_retrograde_speed / states[-1].max_retrograde_speed - 1
assert abs(error) < 0.02
assert branch.folds[0].value < 5.5 < am.theory(cell).threshold

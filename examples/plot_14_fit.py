"""
A fit, and what the data leave open
===================================

Parameters of a cell from a measured profile of its flow. The fit tells how well each is known, and
which combination the data cannot tell.
"""

import matplotlib.pyplot as plt

import amoeboid as am

# %%
# Data that a known cell would give, with errors of measurement: flow and concentration at 18
# angles.
truth = am.Parameters.physical(D="2 um^2/s", v_p0="3 um/s")
data = am.synthetic(truth, {"u": "0.02 um/s", "c": "60 / um^2"}, seed=1)
start = am.Parameters.physical(D="1 um^2/s", v_p0="2.5 um/s")
found = am.fit(data, ["D", "v_p0", "c0", "beta"], start)
found

# %%
# Points with their errors, the fit, and a band of one standard error.
fig, axes = plt.subplots(1, 2, figsize=(9.5, 3.6), layout="constrained")
for ax, name in zip(axes, ("u", "c"), strict=True):
    found.plot(ax, name=name)
plt.show()

# %%
# Intervals at 95 % by profile likelihood.
interval = found.interval("D")
interval

# %%
# The flow alone does not know the unit of concentration.
flow = am.synthetic(am.Parameters(D=0.4, v_p0=6.0), {"u": 0.04})
open_ = am.fit(flow, ["v_p0", "c0", "c_r"], am.Parameters(D=0.4, v_p0=6.0)).undetermined
print(open_[0].text)

# %%
# **Check.** The interval holds the value that made the data, and the residuals are those of the
# errors.
assert interval.holds(truth.quantity(truth.D, "L^2/T"))
assert found.p_value > 0.01
assert open_[0].text.startswith("multiplying c0 by 2 and c_r by 2 changes no predicted value")

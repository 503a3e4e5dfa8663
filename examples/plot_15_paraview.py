"""
A run in PyVista and ParaView
=============================

A run is exported as surfaces with their fields. ParaView opens ``frames.pvd``; PyVista reads the
same files in Python.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pyvista

import amoeboid as am
from amoeboid.plotting.palette import COLOR_MAP

# %%
# A short run, in micrometers and seconds, written as VTK files. With ``follow`` the cell stays in
# the middle.
cell = am.Parameters.physical(D="2 um^2/s", v_p0="3 um/s")
run = am.simulate(cell, mesh=am.Icosphere(3), until=am.time("40 s"), times=["40 s"])
folder = Path(tempfile.mkdtemp())
files = run.export(folder / "frames", "vtp", follow=True)
print([file.name for file in files])

# %%
# The last frame. Concentration is the color, arrows are the retrograde flow.
surface = pyvista.read(next(file for file in reversed(files) if file.suffix == ".vtp"))
print(surface.array_names)
plotter = pyvista.Plotter(off_screen=True, window_size=(900, 700))
plotter.add_mesh(
    surface,
    scalars="c",
    cmap=COLOR_MAP,
    smooth_shading=True,
    ambient=0.45,
    diffuse=0.6,
    scalar_bar_args={
        "title": "filaments per um^2\n",  # a line of its own above the numbers
        "fmt": "%.0f",
        "title_font_size": 20,
        "label_font_size": 18,
    },
)
arrows = surface.glyph(orient="retrograde_flow", scale="retrograde_flow", factor=4, tolerance=0.06)
plotter.add_mesh(arrows, color="#1b1b1b")
plotter.camera_position = [(0, -60, 0), (0, 0, 0), (-1, 0, 0)]  # front to the left
picture = plotter.screenshot(return_img=True)
plotter.close()

fig, ax = plt.subplots(figsize=(7, 5.4), layout="constrained")
ax.imshow(picture)
ax.set_axis_off()
plt.show()

# %%
# **Check.** The file holds the cell of the run: its area is that of the membrane, its largest
# concentration that of the time series.
area = 4 * np.pi * 10.0**2
print(f"area {surface.area:.2f} um^2; c up to {surface['c'].max():.1f} /um^2")
assert abs(surface.area / area - 1) < 1e-6

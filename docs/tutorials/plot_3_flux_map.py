"""
3. Bring your flux map
======================

A bench or finite elements give the flux linkages of a motor over a grid of currents: a *flux map*. This page writes such a map
as a CSV file, puts a motor's file beside it, and runs an estimator on this motor.
"""

# %%
# A map
# -----
# Here a formula makes the map; yours comes from a bench or from finite elements. The file has the columns ``i_d`` and ``i_q`` (A),
# ``psi_d`` and ``psi_q`` (Wb). Each row is one current. Here the currents form a rectangular grid; a map with holes or with scattered
# points is read, too. So are MATLAB files (``.mat``) and NumPy files (``.npz``). :doc:`/reference/files` lists what may differ.
#
# The formula is the gradient of one function of the currents, so that the map is reciprocal, as every motor without losses is.

import csv
import tempfile
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

from sandbox import Scenario, Segment, audit, compare, load_motor

i_d, i_q = np.meshgrid(np.linspace(-12, 12, 25), np.linspace(-12, 12, 25))
l_d, l_q, cross = 9e-3, 20e-3, 0.012  # H, H, 1/A
x = (i_d + 8) / 15  # the magnet saturates the d axis as 8 A would
bend_d, bend_q = np.sqrt(1 + x**2), np.sqrt(1 + (i_q / 14) ** 2)
psi_d = 0.05 + l_d * 15 * x / bend_d - cross * l_q * 14**2 * (bend_q - 1)
psi_q = l_q * i_q / bend_q * (1 - cross * i_d)

folder = Path(tempfile.mkdtemp())
with open(folder / "my_map.csv", "w", newline="") as file:
    rows = zip(*(x.ravel() for x in (i_d, i_q, psi_d, psi_q)), strict=True)
    csv.writer(file).writerows(
        [["i_d", "i_q", "psi_d", "psi_q"], *([f"{v:.9g}" for v in row] for row in rows)]
    )

figure, panels = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained")
panels[0].plot(i_q[:, 0], psi_q[:, ::6])
panels[0].set(xlabel="i_q (A)", ylabel="psi_q (Wb)", title="five currents i_d")
panels[1].plot(i_d[0], psi_d[12::4].T)
panels[1].set(xlabel="i_d (A)", ylabel="psi_d (Wb)", title="four currents i_q")

# %%
# The motor's file
# ----------------
# A motor is a TOML file. With a table ``[flux_map]`` it needs no inductances, magnet flux or alphas: they come from the
# map. ``magnet`` says on which axis of the map the magnet lies (``d``, ``-d``, ``q`` or ``-q``).

motor = folder / "my_motor.toml"
motor.write_text("""
[motor]
name = "my_motor"
pole_pairs = 4
resistance = 0.4            # ohm
inertia = 0.002             # kg m^2
rated_current = 6.0         # A, peak
rated_torque = 3.4          # N m
rated_speed_rpm = 3000.0

[flux_map]
file = "my_map.csv"
magnet = "d"
cells = [10, 10]            # of the spline that is fitted to the map
smooth = 1e-5

[drive]
sampling_period = 0.000125  # s
dc_bus_voltage = 320.0      # V
current_resolution = 0.003  # A per count
current_noise = 0.006       # A rms

[injection]
waveform = "square"
frequency = 1000.0          # Hz
amplitude = 30.0            # V
""")
print(load_motor(motor).motor.inductance_q, "H along q at zero current")

# %%
# Is it valid?
# ------------
# ``audit`` checks that the model is valid and that the difference of inductances keeps its sign. It also draws the angle by which
# an estimator with a linear belief will err.

found = audit(motor, radius=10.0)
print(found)
found.plot()

# %%
# Run it
# ------
# *Saturated belief* now means the spline that was fitted to the map; *linear belief* means its inductances at zero current.

loaded = Scenario(
    "loaded",
    tuple(Segment(0.4, load=x, ramp=0.1, settle=0.2) for x in (0.0, 0.5, 1.0, 1.5)),
    rotor="locked",
)
both = compare(motor, loaded, ["qnull"])
print(both)
both.plot()

# %%
# The same on the command line: ``sensorless compare --motor my_motor.toml --estimators qnull``. Three motors with maps of other
# groups are known by name: ``brusa_hsm1`` and ``baldor_pmsyrm`` (measured; their maps are downloaded when first used) and
# ``thor_fea`` (finite elements; its file has to lie in ``SENSORLESS_DATA``, a sentence says which).

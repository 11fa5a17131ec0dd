"""
4. Identify a motor from a standstill test
==========================================

The saturated model of a motor has eight parameters: resistance, two inductances, five alphas. A test with the rotor locked shows
them all. This page makes the recordings of such a test by simulation and identifies the motor from them.
"""

# %%
# The test
# --------
# The rotor is locked. The drive holds a constant current, adds the injection, and goes on to the next current: a *staircase*.
# It does so along d with injection along d, and along q with injection along d and along q. ``paper_campaign`` simulates these recordings for a motor; on a
# bench, record the same.

import numpy as np
from matplotlib import pyplot as plt

from sandbox import identify, load_motor
from sandbox.replay.identification.locked_test import paper_campaign

truth = load_motor("ipm_exchanged")
campaign = paper_campaign(truth, levels=np.linspace(-2.1, 2.1, 9))  # A
print([recording.file for recording in campaign.recordings])

figure, panel = plt.subplots(figsize=(8, 3), layout="constrained")
first = campaign.recordings[0]
panel.plot(first.t, first["i_a"], linewidth=0.6)
panel.set(
    xlabel="time (s)",
    ylabel="i_a (A)",
    title=f"{first.file}: bias in steps, ripple of the injection on top",
)

# %%
# The fit
# -------
# Two methods are applied to the same levels of current. ``first_order`` is the least squares of the paper, whose formulas are of
# first order in the alphas. ``exact`` compares with what the full model would show.

found = identify(campaign)
print(f"{'parameter':13} {'truth':>9} {'first_order':>12} {'exact':>9}")
for name, exact in found.identification.fits["exact"].values.items():
    first_order = found.identification.fits["first_order"].values[name]
    print(
        f"{name:13} {getattr(truth.motor, name):9.4g} {first_order:12.4g} {exact:9.4g}"
    )

# %%
# ``exact`` finds the true values. ``first_order`` is right about resistance and inductances and wrong about the alphas, by up to a third: its
# formulas leave out terms that matter at these currents. No amount of averaging removes this error.
#
# The figure shows what was measured at each current, and both fits through it.
found.plot()

# %%
# From your bench
# ---------------
# ``sensorless identify FOLDER`` does the same with recordings of yours; :doc:`plot_6_log` shows how to name their columns. Read the remarks
# that it prints: they say what is suspicious. If the levels differ from the model by much more than their noise, something outside the
# model acts, for example the inverter or iron losses, and the intervals may be too narrow.
#
# ``found.identification.motor()`` is the motor with the identified values, ready for ``audit`` or ``simulate``.

"""
8. Write your own effect
========================

An effect is something that a real drive has and the model lacks. This page adds a fan to the load's shaft. The torque of a fan grows with
the square of speed.
"""

# %%
# The card and its equation
# -------------------------
# Effects of your own are in a Python file that defines ``EFFECTS``:
#
# .. literalinclude:: ../stored/my_effects.py
#    :language: python
#    :lines: 3-
#
# - ``drag`` is the equation, a function of numbers. The decorator ``@inlined`` compiles it into the plant.
# - ``At("load", drag, ("coefficient",))`` says at which *port* of the plant the equation enters, and which parameters it is handed before the
#   quantities of the port. The port ``load`` hands over the speed of the load and takes a torque. :doc:`/explanation/plant` lists all ports.
# - ``Parameter("coefficient", unit, neutral, low, high, typical)``: at the neutral value the effect must do nothing.
# - The other fields are text for people. ``confused_with`` and ``separated_by`` are printed by a diagnosis.
#
# What else a card can say
# ------------------------
# The bounds of a ``Parameter`` are fixed numbers. If a bound depends on the drive, give ``limits``: a function that yields every size with
# its bound. If the effect is fast, ``longest`` says which step (s) the plant may take at most in a closed loop, at a speed ``omega`` (rad/s,
# electrical):
#
# .. code-block:: python
#
#     from model.effects.card import Limit
#
#     def limits(values, motor, converter):
#         speed = motor.rated_omega / motor.pole_pairs
#         torque = values["fan.coefficient"] * speed**2
#         yield Limit("fan.coefficient", torque, motor.rated_torque, "N m, rated torque, at rated speed")
#
#     FAN = Effect(..., limits=limits, longest=lambda values, motor, omega: 1e-4)
#
# A coefficient of 1e-3 is then refused on ``ipm_exchanged`` in one sentence: *fan.coefficient: 35.5306 is out of range; it must stay below
# 1.06 N m, rated torque, at rated speed*. ``model/effects/README.md`` lists all fields of a card, and which ports are asked once when a run
# begins, such as ``delay`` for late pulses or ``filter`` for a low-pass of the readings.
#
# Use it
# ------
# On the command line, give the file; then the effect has a name like any other::
#
#     sensorless list effects fan --effects-from my_effects.py
#     sensorless simulate --effects-from my_effects.py --effects fan.coefficient=2e-5
#     sensorless diagnose CAMPAIGN --effects-from my_effects.py
#
# In Python, add it before the first run, because the equations are compiled into the plant:
#
# .. code-block:: python
#
#     from sandbox import simulate, use_effects
#
#     use_effects("my_effects.py")
#     run = simulate("ipm_exchanged", "speed_steps", "ekf", effects={"fan.coefficient": 2e-5})
#
# What it does
# ------------
# Compiling the plant anew takes a minute or two, so this page shows numbers that the script ``docs/stored/effect.py`` has kept: a drive
# under speed control holds five speeds, with and without the fan.

import json
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

kept = json.loads((Path("..") / "stored" / "effect.json").read_text())
speed = np.array(kept["speed"])
more = np.array(kept["i_q"]["with"]) - np.array(kept["i_q"]["without"])

omega_mech = speed * 1800 * 2 * np.pi / 60
torque = kept["coefficient"] * omega_mech**2
expected = torque / (
    1.5 * 6 * 0.0981
)  # A: current along q for this torque, without saturation

figure, panel = plt.subplots(figsize=(6.5, 3.4), layout="constrained")
panel.plot(100 * speed, 1e3 * more, "o", label="run with the fan less run without")
panel.plot(100 * speed, 1e3 * expected, "-", label="k ω² over the torque constant")
panel.set(
    xlabel="speed (% of rated)",
    ylabel="more current along q (mA)",
    title=f"kept on {kept['date']}",
)
panel.legend()

# %%
# Can a diagnosis find it?
# ------------------------
# An effect of your own is a candidate like those of the library. In our test, ``diagnose`` names the fan with probability 1.00 once it
# knows the card, and says *unknown* without it; the same holds for a resolver's error (:doc:`/results/made/own_effects`). Whether an effect
# can be found depends on the recordings. If they do not show it, the field ``separated_by`` of the card says which recording is missing.

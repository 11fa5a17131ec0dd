"""
1. Linear against saturated belief
==================================

An estimator works with a model of the motor, its *belief*. This page runs the same estimator twice on the same motor: once
it believes that the motor is linear, once it believes the saturated model. Then it explains the difference.
"""

# %%
# The motor
# ---------
# ``ipm_exchanged`` is a 200 W motor with interior magnets. ``maps`` computes its incremental inductances over the plane of
# currents. The middle panel of the upper row, :math:`L_{dq}`, is zero without load and grows with the current along q: the axes are
# coupled by saturation.

from matplotlib import pyplot as plt

from sandbox import Scenario, Segment, audit, compare, maps, simulate

shown = maps("ipm_exchanged", points=31).maps
figure, panels = plt.subplots(1, 3, figsize=(10, 3.2), layout="constrained")
for panel, name in zip(panels, ("l_dd", "l_dq", "l_qq"), strict=True):
    drawn = panel.contourf(
        shown.i_d, shown.i_q, 1e3 * getattr(shown, name).T, levels=12
    )
    figure.colorbar(drawn, ax=panel, label="mH")
    panel.set(title=name.replace("l_", "L_"), xlabel="i_d (A)", ylabel="i_q (A)")

# %%
# One run
# -------
# A scenario is a list of segments. Here the rotor is locked, and the load goes to 60 and 120 % of rated current. ``settle``
# is the time in each segment that is not counted.

steps = Scenario(
    "steps",
    (
        Segment(0.3),
        Segment(0.4, load=0.6, ramp=0.1, settle=0.2),
        Segment(0.4, load=1.2, ramp=0.1, settle=0.2),
    ),
)
linear = simulate("ipm_exchanged", steps, "qnull", belief="linear")
saturated = simulate("ipm_exchanged", steps, "qnull", belief="saturated")
print(linear)
print(saturated)

# %%
# The position error over time. It is *true minus estimated*, in electrical degrees. The first 0.13 s are the start-up: the
# estimator looks for the d axis and then for the north pole.

figure, panel = plt.subplots(figsize=(8, 3.2), layout="constrained")
for run, colour in ((linear, "tab:orange"), (saturated, "tab:blue")):
    recording = run.recording
    error = 180 / 3.14159 * recording.error
    started = recording.t > 0.14
    panel.plot(
        recording.t[started],
        error[started],
        color=colour,
        label=run.run.belief,
        linewidth=0.8,
    )
panel.set(xlabel="time (s)", ylabel="position error (°)")
panel.legend(title="belief")

# %%
# The theory
# ----------
# ``audit`` computes the cross-saturation angle from the model alone, without any run. With the estimate in control the
# linear belief stands at this angle.

theory = audit("ipm_exchanged")
angles = dict(
    zip(theory.audit.load.round(2), theory.as_json()["angle_closed_deg"], strict=True)
)
for row in linear.rows:
    print(
        f"load {row.load:4.0%}: theory {angles[round(row.load, 2)]:+.2f}°, run {row.error_deg.mean:+.2f}°"
    )

# %%
# Three estimators
# ----------------
# ``compare`` does this for several estimators, both beliefs, and both ways of control. Its figure shows mean errors against load.

both = compare("ipm_exchanged", steps, ["qnull", "inversion", "ekf"])
both.plot()

# %%
# All three err alike with a linear belief, since all three read the same ripple. The command line does the same with
# ``sensorless compare --motor ipm_exchanged --estimators qnull,inversion,ekf``.
print(both)

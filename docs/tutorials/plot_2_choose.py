"""
2. Choose an estimator for your motor
=====================================

Twenty estimators come with the package: eighteen kinds, two of which also come as readable twins in Python (``ekf_filterpy``,
``ukf_filterpy``). Which one suits a drive depends on the motor, the speed range and the
inverter. This page lists them, measures four of them on one motor, and says how to decide.
"""

# %%
# What there is
# -------------
from matplotlib import pyplot as plt

from sandbox import Scenario, Segment, list_estimators, protocol, simulate

for name, summary in list_estimators().items():
    print(f"{name:15} {summary}")

# %%
# Three questions
# ---------------
# **Does the motor have saliency?** Injection needs inductances that differ along d and q, at every current you use.
# ``sensorless audit MOTOR`` says up to which current the difference keeps its sign. Without saliency only ``active_flux`` is
# left, and it needs speed.
#
# **Standstill, or only speed?** Estimators with injection work at standstill. ``active_flux`` does not. ``hybrid`` injects
# at low speed and stops injecting at high speed.
#
# **How good is the inverter's voltage?** The Kalman filters rely on the commanded voltage. If dead time is not compensated
# they err. Injection that reads where the ripple is zero, or the ratio of its two parts (``qnull``, ``inversion``), hardly notices dead
# time. Injection that reads a *phase* (``rotating``) errs, because dead time delays its carrier: +4.2° with 2 µs. This run shows it.

loaded = Scenario(
    "loaded", (Segment(0.2), Segment(0.4, load=1.0, ramp=0.1, settle=0.2))
)
names = ("qnull", "inversion", "rotating", "ekf")
times = (0.0, 1e-6, 2e-6)
errors = {
    name: [
        simulate("ipm_exchanged", loaded, name, effects={"dead_time.time": t})
        .rows[-1]
        .error_deg.mean
        for t in times
    ]
    for name in names
}
figure, panel = plt.subplots(figsize=(7, 3.4), layout="constrained")
for name, found in errors.items():
    panel.plot([1e6 * t for t in times], found, marker="o", label=name)
panel.set(
    xlabel="dead time that nobody compensates (µs)",
    ylabel="mean error at rated load (°)",
)
panel.legend()

# %%
# A fair test
# -----------
# ``protocol`` runs the same tests with every estimator and states the goal of each. ``load_step`` is one of its twelve tests: steps of load at
# standstill. The whole protocol over four motors takes some minutes; its table is under *Results*.

done = protocol(["qnull", "ekf"], ["ipm_exchanged"], ["load_step"])
for row in done.protocol.rows:
    found = row.outcome.metrics
    said = f"{found['mean_deg']:5.2f}° ({found['p95_deg']:4.1f}°)"
    said += f"  {row.outcome.said()}"
    print(f"{row.unit.estimator:6} {row.unit.belief:9} {said}")

# %%
# Worst mean error, in brackets the worst 95th percentile, and whether the goal was met. The goal of the saturated belief is 1° (3°).
# The linear belief of ``qnull`` is judged against theory, which predicts its error by the cross-saturation angle: *passed* says that the error
# is as large as predicted, not that it is small. For the filter's linear belief there is no theory, so it has no goal. The page that
# ``sensorless protocol`` writes shows the same with marks.
#
# What to take
# ------------
# .. list-table::
#    :header-rows: 1
#
#    * - your drive
#      - begin with
#    * - standstill and low speed, inverter not known well
#      - ``qnull`` or ``inversion``
#    * - inductances known, fast load steps
#      - ``pll3`` (its loop follows acceleration without lag)
#    * - inverter compensated, resistance known
#      - ``ekf``
#    * - standstill to full speed
#      - ``hybrid``
#    * - speed only, no injection wanted
#      - ``active_flux``
#    * - no injection allowed at standstill
#      - ``pwm_ripple`` (reads the current inside the PWM period)
#
# The card of an estimator names its source and where it may be used: :doc:`/reference/made/estimators`, or ``sensorless list estimators hybrid``. Where each breaks, with
# figures: :doc:`/results/made/estimator_limits`.

"""
9. Sweep
========

A sweep makes many runs: every combination of some values, and random draws of others. This page asks how many motors of a production run are estimated well,
when each motor differs a little from the data sheet.
"""

# %%
# The plan
# --------
# A plan is a TOML file, or the same tables in Python. ``run`` is the same in all runs. ``grid`` makes every combination.
# ``random`` draws points, and each point runs the whole grid. ``true_factor`` multiplies a parameter of the *plant*; the estimator goes on to believe the data
# sheet.

import tempfile
from pathlib import Path

from matplotlib import pyplot as plt

from sandbox import sweep

plan = {
    "run": {"motor": "ipm_exchanged", "estimator": "qnull", "seed": 1},
    "scenario": {"name": "one_load", "start_up": False},
    "segment": [{"duration": 0.25, "load": 1.2, "settle": 0.15}],
    "grid": {"belief": ["linear", "saturated"]},
    "random": {
        "design": "sobol",
        "points": 64,
        "draw": {
            "true_factor": {
                "inductance_d": {"uniform": [0.9, 1.1]},
                "inductance_q": {"uniform": [0.9, 1.1]},
                "alpha_12": {"uniform": [0.8, 1.2]},
            }
        },
    },
}
folder = Path(tempfile.mkdtemp()) / "production"
done = sweep(plan, folder, jobs=1)
print(done)

# %%
# The result
# ----------
# One row is one run. ``mean_deg`` is the mean position error.

table = done.to_dataframe()
print(
    table[["belief", "true_factor.inductance_d", "true_factor.alpha_12", "mean_deg"]]
    .head(4)
    .round(3)
    .to_string()
)

# %%
# Each combination of the grid is a group. ``p95_deg`` is the error that 95 % of the motors stay below.

for group in done.groups:
    print(
        f"{group.name}: half below {group.median_deg:.2f}°, 95 % below {group.p95_deg:.2f}°"
    )
done.plot()

# %%
# What matters
# ------------
# With a linear belief all motors err by about the cross-saturation angle. With a saturated belief what is left comes from the inductance along d and from
# ``alpha_12``.

saturated = table[table["belief"] == "saturated"]
figure, panels = plt.subplots(1, 3, figsize=(9, 3), sharey=True, layout="constrained")
for panel, name in zip(
    panels, ("inductance_d", "inductance_q", "alpha_12"), strict=True
):
    panel.plot(saturated[f"true_factor.{name}"], saturated["mean_deg"], ".")
    panel.set(xlabel=f"true {name} / believed")
panels[0].set(ylabel="mean error (°)")

# %%
# Long sweeps
# -----------
# The folder keeps finished blocks of runs. If a sweep is interrupted, run the same command again: it goes on. ``sensorless sweep plan.toml --jobs 8``
# uses eight processes, ``--dask tcp://...`` a cluster; the results are the same to the last bit. All keys: :doc:`/reference/made/sweeps`. A
# sweep of 100 000 runs: :doc:`/results/made/yield`.

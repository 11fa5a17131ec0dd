"""
6. Bring your own log
=====================

A log from another program has other names, other units and often only two currents. This page writes such a log, describes it in a
small TOML file, and reads it. Then it makes a typical mistake, to show what happens.
"""

# %%
# A log of another program
# ------------------------
# To have something to read, this first simulates a turning motor and writes what a drive's logger could write: time in
# milliseconds, two phase currents in milliampere, duties in percent, the mechanical angle in degrees.

import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib import pyplot as plt

from model.frames import phases
from sandbox import BadInput, Scenario, Segment, read_campaign, simulate

folder = Path(tempfile.mkdtemp())
turning = Scenario(
    "turning",
    (Segment(0.4, load=0.5, speed=0.3, ramp=0.1),),
    rotor="driven",
    start_up=False,
)
run = simulate("ipm_exchanged", turning, "ekf", record=folder / "bench")
bench = read_campaign(folder / "bench").recordings[0]

u = np.array(phases.py_func(bench["u_alpha"], bench["u_beta"]))
duties = 0.5 + (u - 0.5 * (u.max(axis=0) + u.min(axis=0))) / bench["u_dc"]
log = pd.DataFrame(
    {
        "Time": 1e3 * bench.t,
        "Ia": 1e3 * bench["i_a"],
        "Ib": 1e3 * bench["i_b"],
        "DutyA": 100 * duties[0],
        "DutyB": 100 * duties[1],
        "DutyC": 100 * duties[2],
        "Udc": bench["u_dc"],
        "Pos": np.degrees(bench.theta / 6) % 360,
    }
)
(folder / "log").mkdir()
log.to_csv(folder / "log" / "run.csv", index=False)
print(log.head(3).round(2).to_string())

figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3), layout="constrained")
log.plot("Time", ["Ia", "Ib"], ax=left, ylabel="current (mA)")
log.plot("Time", "Pos", ax=right, ylabel="mechanical angle (°)")

# %%
# Describe it
# -----------
# ``[columns]`` says for each quantity which column it is and in which unit. The other tables describe the drive, its nominal motor
# and the recording.

description = """
[columns]
t = {column = "Time", unit = "ms"}
i_a = {column = "Ia", unit = "mA"}
i_b = {column = "Ib", unit = "mA"}                  # the third phase follows from two
d_a = {column = "DutyA", unit = "%"}                # duties instead of voltages
d_b = {column = "DutyB", unit = "%"}
d_c = {column = "DutyC", unit = "%"}
u_dc = {column = "Udc"}
theta = {column = "Pos", unit = "deg", mechanical = true}

[drive]
sampling_period = 0.00025
pwm_frequency = 4000.0
dc_bus_voltage = 400.0
current_resolution = 0.0024
current_noise = 0.002
encoder_counts = 4096                               # else its steps could be taken for lost rows

[motor]
pole_pairs = 6
resistance = 12.15
magnet_flux = 0.0981
inductance_d = 0.0458
inductance_q = 0.0919
inertia = 0.0011

[injection]
frequency = 500.0
amplitude = 30.0

[[recording]]
file = "run.csv"
rotor = "driven"                                    # somebody else turned the shaft
injection_axis = "d"
"""
columns = folder / "columns.toml"
columns.write_text(description)
read = read_campaign(folder / "log", columns)
print(read)
print(
    "currents differ by at most",
    float(np.abs(read["run.csv"]["i_b"] - bench["i_b"]).max()),
    "A",
)
for finding in read.findings:
    print("-", finding.text)

# %%
# A mistake
# ---------
# Suppose the angle had been described as electrical although the log has the mechanical one. The reader checks whether voltages,
# currents and angle fit together; they do not, and the sentence says what to try.

columns.write_text(description.replace(", mechanical = true", ""))
try:
    read_campaign(folder / "log", columns)
except BadInput as refusal:
    print(refusal)

# %%
# All keys, formats and checks: :doc:`/reference/files`. Then ``sensorless identify FOLDER --columns columns.toml`` or ``sensorless diagnose
# FOLDER --columns columns.toml``.

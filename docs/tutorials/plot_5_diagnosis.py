"""
5. Diagnose a campaign
======================

``sensorless diagnose`` reads recordings of a drive and says where simulation and recordings differ, which effect causes it, and how far the gap
shrinks. This page walks through its answer, sentence by sentence.
"""

# %%
# The recordings
# --------------
# To follow this page with a drive whose truth is known to nobody, let the package make one. This draws two drives, seals what is wrong with them in a file, and
# then records a *campaign* of each: twelve recordings, some with the rotor locked, some turning::
#
#     sensorless withheld make drill --count 2 --seed 7 --maps 0
#     sensorless diagnose drill/campaigns/w001
#
# A diagnosis takes half a minute to some minutes, so this page reads the result that the script ``docs/stored/diagnosis.py`` has kept. Its page for people is
# here: :download:`report.html <../stored/report.html>`. Open it beside this text.

import json
from pathlib import Path

from matplotlib import pyplot as plt

kept = json.loads((Path("..") / "stored" / "diagnosis.json").read_text())
print("kept on", kept["date"], "by version", kept["version"])

# %%
# "Ambiguous"
# -----------
# The word in the coloured field is the verdict. *Explained* would mean that one set of effects holds at least 95 % of the probability. Here the most
# probable set holds 94 %, so a second one is named beside it: *ambiguous*. We will see below that all likely sets have the same two effects. The other
# verdicts are *no gap* (nothing to explain) and *unknown* (something outside the library).

print(kept["verdict"])

# %%
# "Where does the gap lie?"
# -------------------------
# The diagnosis has replayed the recorded voltages through the simulator. What remains between simulated and recorded currents is the *residual*. The
# first sentence says which part of the drive shows it:

for finding in kept["where"]:
    print(f"{finding['share']:4.0%}  {finding['text']}")

# %%
# "89 % of the gap is voltage, mostly (87 %) on the d axis": it grows with speed and does not depend on current. This points to the machine, and there to
# the magnets, because a voltage that grows with speed and does not depend on current is an induced one. The rest is motion, in the mechanics. "Of electrical order 6 in the rotor frame" means that it
# repeats six times in one electrical turn.
#
# "Which effect causes it?"
# -------------------------
# A *hypothesis* is a set of effects; the probabilities of all hypotheses add up to one.

for hypothesis in kept["hypotheses"][:5]:
    effects = " + ".join(hypothesis["effects"]) or "no effect"
    print(f"{hypothesis['probability']:.3f}  {effects}")
for name, p in kept["hypotheses"][0]["parameters"].items():
    low, high = p["ci95"]
    print(f"{name:24} {p['value']:10.5g} [{low:.5g}, {high:.5g}] {p['unit']}")

# %%
# The brackets hold the 95 % interval. All likely sets have the same two effects. The others add one more, whose size is zero or so small that these
# recordings do not show it: the third set has a skin effect of 0 ohm, and its interval says that up to 1.3 ohm would not be seen. Every effect of the library
# is kept in this way with the small chance that it is there unseen. The list *All effects that may be there* gives a chance to every effect of the library, also to those that are in
# no likely hypothesis:

for effect in kept["effects"][:5]:
    share = effect["share"]
    said = f", takes {share['value']:.0%} of the gap" if share else ""
    print(f"{effect['probability']:6.1%}  {effect['name']}{said}")

# %%
# "How far does the gap shrink?"
# ------------------------------
# J is the residual over the noise of the sensors (its *noise floor*): 1 means that only noise is left. *Before* is J after everything was fitted that every drive has a little of
# (gains, offsets, resistance within their stated tolerances). *After* is J with the effects. The recordings marked as *held out* were not used for the fit; the sentence in the page
# counts only these.

gap = kept["gap"]
print(f"before {gap['before']:.2f}, after {gap['after']:.2f}")
print(f"closed {gap['closed']:.2%} on recordings held out")
names = [r["file"].removesuffix(".parquet") for r in gap["recordings"]]
names = [n + " (held out)" * r["held_out"] for n, r in zip(names, gap["recordings"])]
figure, panel = plt.subplots(figsize=(7, 4), layout="constrained")
for key, colour, shift in (("before", "#de6210", -0.2), ("after", "#2e86de", 0.2)):
    rows = [k + shift for k in range(len(names))]
    panel.barh(rows, [r[key] for r in gap["recordings"]], 0.38, color=colour, label=key)
panel.axvline(1, color="0.3", linewidth=0.8)
panel.set(yticks=range(len(names)), yticklabels=names, xscale="log")
panel.set(xlabel="residual over its noise (J)", xticks=[1, 2, 5, 10])
panel.set_xticks([], minor=True)
panel.xaxis.set_major_formatter("{x:g}")
panel.invert_yaxis()
panel.legend()

# %%
# The turning recordings had the large gap; after it nothing but noise is left in any of them.
#
# "Position error (rms, electrical) of the estimator"
# ---------------------------------------------------
# The page also says what this means for a sensorless drive. The same Kalman filter is run on the recorded currents and on simulated ones:

for name, value in gap["position_error_deg"].items():
    print(f"{name:18} {value:.2f}°")

# %%
# Before the diagnosis the simulator predicted another error than the filter has on the recordings; with the two effects it predicts the same.
#
# "What next?"
# ------------
# Where two sets name different causes, the sentence names a recording that tells them apart, within the limits of the bench; it is kept as ``next_recording.csv``.
# You record it, lay it into the campaign, and ``sensorless diagnose drill/campaigns/w001 --continue sensorless-out/diagnose`` goes on from there. Here there is
# none, as all likely sets agree on the two effects. The sentence then says which recordings show these effects best.

print(kept["next_recording"])

# %%
# "Before you rely on it"
# -----------------------
# The notes at the end of the page say what limits the answer. For this campaign: the choice among hypotheses saw all recordings, so only the parameters are tested
# on unseen ones.
#
# Open the seal
# -------------
# What was really wrong with the drive:

truth = json.loads((Path("..") / "stored" / "truth.json").read_text())
found = kept["hypotheses"][0]["parameters"]
for name, true in truth["parameters"].items():
    low, high = found[name]["ci95"]
    said = "in" if low <= true <= high else "NOT in"
    said += f" [{low:.5g}, {high:.5g}]"
    print(f"{name:34} {true:10.5g}  {said}")

# %%
# Both effects are right, and every interval holds the truth.
#
# Use it
# ------
# The diagnosis has written two files for the simulator: ``motor.toml``, the refitted motor, and ``effects.toml``, the effects beside
# it. The first command shows how near the simulator now comes to the recordings, the second one uses it for another run::
#
#     sensorless replay drill/campaigns/w001 --motor sensorless-out/diagnose/motor.toml --effects sensorless-out/diagnose/effects.toml
#     sensorless simulate --motor sensorless-out/diagnose/motor.toml --effects sensorless-out/diagnose/effects.toml
#
# :doc:`/explanation/diagnosis` says how a diagnosis decides, and where it errs. :doc:`/reference/made/json` lists all keys of the JSON file.

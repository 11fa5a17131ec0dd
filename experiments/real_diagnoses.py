"""What does `sensorless diagnose` say about real drives, and should one believe it?

Five cases through the command itself: a SynRM's standstill test (raw CSV and a column map), LAAS' rolling runs (the
campaign of `sandbox.recordings.real_campaigns`), LAAS' and moteus' files as they are (refused), and a machine of
finite elements (THOR) under simulated voltages.  No case has a certified truth; each is judged by what its fit
predicts of recordings held out and by what other evidence says.

Run: python -m experiments.real_diagnoses   (half a minute; needs SENSORLESS_DATA or the shared folder)
"""

from __future__ import annotations

import contextlib
import io
import json
import math
import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from experiments.drawing import COLOURS, RESULTS, new_figure, save, shared
from experiments.thor_bench import CASES, bench
from model.drives import laas, thor
from sandbox.cli import main as command
from sandbox.recordings.real_campaigns import real_drives
from sandbox.recordings.writing import write_campaign

HEADS = ("Where?", "Which?", "How far?", "Left?", "note:")
LAAS_MAP = """[columns]
t = {column = "Time"}
theta = {column = "Position", mechanical = true}
i_q = {column = "Iq"}
u_q = {column = "Uq"}
i_d = {value = 0.0}
u_d = {value = 0.0}
[drive]
sampling_period = 1e-3
dc_bus_voltage = 24.0
current_noise = 0.018
[motor]
pole_pairs = 12
resistance = 0.7
magnet_flux = 0.00156
inductance_d = 1e-3
inductance_q = 1e-3
inertia = 5.4e-6
[injection]
frequency = 100.0
amplitude = 1.0
[[recording]]
file = "acceleration.txt"
rotor = "free"
"""


def diagnosed(name: str, arguments: list[str], folder: Path) -> dict[str, Any]:
    """Return what the command said, line by line, and its diagnosis.json; the sentence where it refused."""
    out, said, refused = folder / name, io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(refused):
        code = command(["diagnose", *arguments, "--jobs", "1", "--out", str(out)])
    if code:
        sentence = refused.getvalue().strip().splitlines()[-1].replace(str(folder), "FOLDER")
        return {"refused": sentence.replace(str(shared("SENSORLESS_DATA", "realdata")), "realdata")}
    lines = [line for line in said.getvalue().splitlines() if line.startswith(HEADS)]
    return {"said": lines, "diagnosis": json.loads((out / "diagnosis.json").read_text())}


def cases(folder: Path) -> dict[str, dict[str, Any]]:
    """Return every case's answer."""
    data = shared("SENSORLESS_DATA", "realdata")
    os.environ.setdefault("SENSORLESS_DATA", str(data))
    own = Path(__file__).parent
    raw_map = folder / "laas.toml"
    raw_map.write_text(LAAS_MAP)
    rolling = real_drives("laas_bldc")[0]
    assert rolling.campaign is not None
    write_campaign(folder / "laas", rolling.campaign)
    write_campaign(folder / "thor", bench(thor.read(data / "thor_fea" / "thor_fea.npz")))
    calls = {
        "synrm_standstill": [str(data / "synrm_standstill"), "--columns", str(own / "synrm_standstill.toml")],
        "laas_rolling": [str(folder / "laas"), "--exclude", ",".join(rolling.hidden)],
        "laas_as_filed": [str(data / "laas_bldc"), "--columns", str(raw_map)],
        "moteus": [str(data / "moteus_ld")],
        "thor_finite_elements": [str(folder / "thor")],
    }
    return {name: diagnosed(name, call, folder) for name, call in calls.items()}


def parameters(case: dict[str, Any]) -> dict[str, Any]:
    """Return value and interval of each parameter of the best hypothesis that names an effect."""
    named = [h for h in case["diagnosis"]["hypotheses"] if set(h["effects"]) - {"unknown"}]
    return dict(named[0]["parameters"]) if named else {}


def judgement(found: dict[str, dict[str, Any]]) -> dict[str, str]:
    """Return per case why one should or should not believe the answer, with the figures that say so."""
    fit = json.loads((RESULTS / "synrm_standstill.json").read_text())["fit"]
    own = parameters(found["synrm_standstill"])
    names = [n for n in ("current_filter.time_constant", "current_sampling.delay", "pwm_delay.delay") if n in own]
    late = (
        f"the delays it names sum to {1e6 * sum(own[n]['value'] for n in names):.0f} µs"
        if names
        else "it names no delay"
    )
    jitter = _stamps()
    gap = found["laas_rolling"]["diagnosis"]["gap"]["before"]
    speed = 12.0 * 50.7
    count = math.tau * 12 / 20_000 / math.sqrt(12.0)
    fast = max(c[1] for c in CASES)
    ripple = parameters(found["thor_finite_elements"]).get("dc_link_ripple.frequency", {}).get("value")
    order = "" if ripple is None else (
        f" If a link ripple of {ripple:.0f} Hz is named, do not believe it: the link is ideal, and that is order "
        f"{math.tau * ripple / fast:.1f} of the recording at {fast:.0f} rad/s, a slot harmonic that the library (order "
        "6 only) lacks."
    )  # fmt: skip
    return {
        "synrm_standstill": "Believe `unknown`: the quartic energy misses this map by 0.24 A rms at the flux points "
        "it was fitted to, 53 floors. An identification that shares no code with the diagnosis found the currents "
        f"{1e6 * fit['delay']:.0f} µs late and a voltage error of {fit['threshold']:.1f} ± "
        f"{2.0 * fit['threshold_sd']:.1f} V; {late}; under such misfit small causes cannot be told.",
        "laas_rolling": f"Believe `unknown`, not more: before any effect residuals are {gap:.0f} floors, an angle of "
        f"{gap * count:.3f} rad if all were the encoder's, as stamps {1e6 * gap * count / speed:.0f} µs off "
        f"give at {speed:.0f} rad/s electrical; stamps are rounded to 1 ms (steps of position over steps of time "
        f"scatter by {1e6 * jitter:.0f} µs rms). Friction and cogging, which the ramps and the slow scan show "
        "(real_friction, real_cogging), drown in that.",
        "laas_as_filed": "Right to refuse: between two rows the rotor turns further than any replay can follow.",
        "moteus": "Right to refuse: steady points, no time series (`sandbox.recordings.real_campaigns` says what they "
        "show).",
        "thor_finite_elements": "The truth is known to be harmonics of many orders that depend on the currents, and "
        "saturation beyond the quartic energy, which misses these tables by about 0.2 A: believe harmonics, believe "
        "`unknown`. A free regression closes nothing although the machine is a function of currents and angle: its "
        "functions close more than half of each recording they are fitted to, and of driven_2, but fail in locked_c, "
        f"whose currents (23 A) no fitted recording reaches.{order}{_undefined(found['thor_finite_elements'])}",
    }


def _undefined(case: dict[str, Any]) -> str:
    """Return a warning where probabilities are no numbers."""
    chances = [h["probability"] for h in case.get("diagnosis", {}).get("hypotheses", [])]
    if all(c is not None and math.isfinite(c) for c in chances):
        return ""
    return " Probabilities of the named sets are no numbers (nan): at such a misfit the search's evidence fails."


def _stamps() -> float:
    """Return the rms scatter (s) of LAAS' stamps about the encoder's angle at steady speed."""
    run = laas.read(shared("SENSORLESS_DATA", "realdata") / "laas_bldc" / "rolling_data1.txt")
    step, turned = np.diff(run.time), np.diff(run.position)
    usual = step < 1.5e-3
    speed = float(np.median(run.speed))
    return float(np.std(turned[usual] / speed - step[usual])) / math.sqrt(2.0)


def page(found: dict[str, dict[str, Any]], why: dict[str, str]) -> str:
    """Return the results as a page."""
    lines = ["Real drives through `sensorless diagnose`, by `python -m experiments.real_diagnoses`.", ""]
    lines += ["No case has a certified truth. J is the rms over the noise floor on recordings held out.", ""]
    lines += ["| case | verdict | J before → after | closed | a free regression closes more | P(unknown) |"]
    lines += ["|---|---|---|--:|---|--:|"]
    for name, case in found.items():
        if "refused" in case:
            lines.append(f"| {name} | refused | | | | |")
            continue
        d, gap = case["diagnosis"], case["diagnosis"]["gap"]
        left = gap["remains"]
        free = "not measured" if left is None else f"{100 * (left['closable'] or 0.0):.0f} % of the rest"
        chance = sum(h["probability"] or 0.0 for h in d["hypotheses"] if "unknown" in h["effects"])
        closed = "" if gap["closed"] is None else f"{100 * gap['closed']:.0f} %"
        sizes = f"{gap['before']:.1f} → {gap['after']:.1f}"
        lines.append(f"| {name} | {d['verdict']} | {sizes} | {closed} | {free} | {chance:.2f} |")
    for name, case in found.items():
        lines += ["", f"## {name}", ""]
        said = case.get("said", [case.get("refused", "")])
        lines += [f"> {line}  " for line in said if not line.startswith("note:")]
        lines += ["", f"**Believe it?** {why[name]}"]
    return "\n".join(lines) + "\n"


def figure(found: dict[str, dict[str, Any]]) -> Any:
    """Return residuals before and after of each recording that could be replayed."""
    shown = {n: c["diagnosis"]["gap"]["recordings"] for n, c in found.items() if "diagnosis" in c}
    drawn, axes = new_figure(1, len(shown), 4.6, 3.4)
    for a, (name, rows) in zip(axes[0], shown.items(), strict=True):
        place = np.arange(len(rows))
        a.barh(place - 0.2, [r["before"] for r in rows], 0.4, color=COLOURS["first"], label="before")
        a.barh(place + 0.2, [r["after"] for r in rows], 0.4, color=COLOURS["model"], label="after")
        a.set_yticks(place, [Path(r["file"]).stem + (" (held out)" if r["held_out"] else "") for r in rows], fontsize=8)
        a.axvline(1.0, color="0.3", linewidth=0.8)
        a.invert_yaxis()
        a.set(title=name, xlabel="residual / noise floor")
    axes[0, 0].legend(fontsize=8)
    return drawn


def main() -> None:
    """Diagnose all cases; write the page, the numbers and the figure."""
    with tempfile.TemporaryDirectory() as folder:
        found = cases(Path(folder))
    why = judgement(found)
    save("real_diagnoses", {"cases": found, "believe": why}, figure(found))
    (RESULTS / "real_diagnoses.md").write_text(page(found, why), encoding="utf-8")
    print(page(found, why))


if __name__ == "__main__":
    main()

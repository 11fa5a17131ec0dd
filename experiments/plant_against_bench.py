"""The plant against the switched bench: every effect at typical and double size, ten pairs, three
motors.

Recordings of the switched bench without noise (locked, driven at two speeds, free) through the
replay, the parameter set told: rms difference of the sampled currents over rated current.  Where it
exceeds LARGEST, the
same once more with the bench's integration step a thirty-second of its own, with 16 plant steps a
period, and with the rotor's motion told instead of smoothed: the one that takes the difference away
says where it comes from.  And a millionth is put on the resistance: where its trace swells by GROWN
from sample to sample, the drive
itself enlarges every
difference.

A replayed free rotor follows the encoder, so mechanics hardly show in its currents.  The last three
columns are of a free rotor that nothing corrects (`plant_alone`): currents, angle and speed, apart
after as long as the recording runs.

Run: python -m experiments.plant_against_bench
    (4 minutes; Brusa's map in SENSORLESS_DATA; writes results/plant/)
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from datetime import date
from typing import Any

import numpy as np

from experiments.plant_alone import START, alone
from experiments.plant_cases import OUT, cases, of_quartic
from experiments.plant_map_step import left_out
from model.drive_files import load_drive
from model.energy import flux_from_current
from model.errors import BadInput
from model.parameters import Drive
from model.spline import SplineEnergy
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.replay.inputs import Inputs, course_of, with_columns
from sandbox.replay.motion.smoothing import Motion
from sandbox.replay.replay import Prepared, prepare, replay, with_steps
from sandbox.switched.advance import replay as switched
from sandbox.switched.bench_numbers import bench, quiet

MOTORS = ("ipm", "ipm_exchanged", "brusa_hsm1")
CASES = (("locked", 0.0), ("driven", 120.0), ("driven", 600.0), ("free", 0.0))  # rad/s electrical
LARGEST = 2e-5
ALIKE = 0.1  # an equation says what is seen: so close, relative
# largest over median trace of a millionth more resistance: 1 to 6 where nothing grows
GROWN, MILLIONTH = 100.0, 1e-6
SAMPLES, SETTLED, COUNTS = 700, 100, 1 << 20
EQUATIONS = """
What each reason is, S the length of a segment, e the change of current to its middle:

- plant's step, lags (iron loss, skin effect, filter): their input is a parabola through start, middle and end, and the
  kinks of late edges, to which they answer exactly; left is what the lag bends that parabola, R S^3/tau^3 of the
  lagging part.
- plant's step, device drop: the mean of the soft sign along two straight pieces, start to middle to end, the middle put
  right once for what the drop took on the way; left is the next order of that, (V_th S G/(4 w))^2 of the change of drop
  while |i| is below the half width w, G the inverse inductance.  An edge late by r puts a corner into the current, and
  a piece ends there, too (cut off, it was up to 2 V_th r G of current: 1 V, 2 us, 46 mH, 1.2 A: 73 ppm of rated).
- plant's step, flux maps: mean current = i(mean flux) + H'''[S z', S z']/24, which is left out for maps
  (`plant_map_step` adds it up along the recording: 16.2 ppm without effects at 600 rad/s, 0.87 at 120, 0.10 locked).
- plant's step, filter beside late edges on a flux map (below the goal: 12 ppm on Brusa's at 120 rad/s): the filter is
  handed the current as a parabola and a corner of one slope G; the map bends both, and the drop follows the corner.
  i(psi(t)) with psi' = u - R i integrated along each segment says 12.5 ppm where steps of 1/64 say 12.5.
- dead time's gain: an edge is later by t_d/(2 w) for each ampere of its leg, w the half width of the zone, and takes
  2/3 U from the flux along its leg for so long.  While edges lie closer together than t_d, a difference of the current
  is multiplied by 1 - U t_d/(3 w) sum(e' G e) at each of them, e the unit vectors of the legs inside the zone.  Brusa's
  map has G = 4980 1/H along d at no current: with 4 us and two legs inside the factor is -2.65 (seen: 2.6 a period, for
  differences of any origin).  Steps do not help against it; the drive does the same to a change of its resistance.
- bench's own step: it ends at the corners of sign(i) (over them it would be of first order), late edges aside.
"""  # noqa: E501
Logs = list[tuple[CampaignRecording, Motion]]


def record(
    drive: Drive, effects: Mapping[str, float], rotor: str, speed: float, finer: float
) -> tuple[CampaignRecording, Motion]:
    """Return a recording of the switched bench, and its encoder's motion without smoothing."""
    motor, converter, k = drive.motor, drive.converter, np.arange(SAMPLES)
    period, pairs, rated = converter.sampling_period, motor.pole_pairs, motor.rated_current
    b = quiet(bench(motor, converter, effects))
    b = b._replace(step=b.step / finer)
    theta, middle = (0.3 + speed * period * (k + x) for x in (0.0, 0.5))
    d, q = flux_from_current(motor.energy, -0.1 * rated, 0.5 * rated)
    flux = complex(float(d) + motor.magnet_flux, float(q))
    still = 0.8 * motor.resistance * rated * np.sin(2.0 * np.pi * k / 600.0)
    size = (
        motor.resistance * rated * complex(-0.1, 0.5) + 1j * speed * flux
        if rotor == "driven"
        else still + 0j
    )
    u = size * np.exp(1j * middle) + drive.injection.amplitude * np.where(
        k % 8 < 4, 1, -1
    ) * np.exp(1j * middle)
    load, more = np.zeros(SAMPLES), {"theta": theta, "speed": speed / pairs}
    if rotor == "free":
        u = motor.resistance * rated * (0.7 + 0.35 * np.sin(k / 50.0)).astype(complex)
        load = np.where(k > 300, 0.1 * motor.rated_torque, 0.0)
        more = {"theta": START, "load_torque": load}
    r = switched(b, rotor, u.real.copy(), u.imag.copy(), converter.dc_bus_voltage, **more)
    columns = {
        "t": k * period,
        "u_alpha": u.real,
        "u_beta": u.imag,
        "theta": r["theta"],
        "load_torque": load,
    }
    columns |= {"u_dc": np.full(SAMPLES, converter.dc_bus_voltage)} | {
        x: r[x] for x in ("i_a", "i_b", "i_c")
    }
    wobble = b.eccentricity / pairs * np.cos(r["position"] / pairs + b.eccentricity_phase)
    logs = Motion(r["theta"].copy(), pairs * r["speed"] * (1.0 + wobble))
    return CampaignRecording(f"{rotor}_{speed:g}.parquet", rotor, "d", columns), logs


def recorded(drive: Drive, effects: Mapping[str, float], finer: float = 1.0) -> Logs:
    """Return the four recordings."""
    return [record(drive, effects, rotor, speed, finer) for rotor, speed in CASES]


def apart(
    drive: Drive, logs: Logs, prepared: Prepared, effects: Mapping[str, float]
) -> list[float]:
    """Return the rms difference of currents over rated current of each recording."""
    out = []
    for (r, _), current in zip(logs, replay(prepared, [effects]).currents, strict=True):
        miss = (np.stack([r.i_a, r.i_b, r.i_c], axis=1) - current[:, :, 0])[SETTLED:]
        out.append(
            float(np.sqrt(np.mean(np.sum(miss**2, axis=1) * 2.0 / 3.0))) / drive.motor.rated_current
        )
    return out


def moved(inputs: Inputs, motion: Motion, period: float) -> Inputs:
    """Return a recording's inputs on another motion of the rotor; period: s."""
    track = with_columns(inputs.track, course_of(motion, inputs.pole_pairs, period))
    return dataclasses.replace(inputs, motion=motion, track=track)


def run(drive: Drive, effects: Mapping[str, float]) -> dict[str, Any]:
    """Return the differences, and where one is too large those with a finer bench, finer plant, and
    told motion."""
    logs = recorded(drive, effects)
    campaign = Campaign("bench", drive, tuple(r for r, _ in logs), {}, {}, False)
    prepared = prepare(campaign, effects)
    found: dict[str, Any] = {
        "steps": prepared.steps,
        "apart": apart(drive, logs, prepared, effects),
    }
    found["alone"] = alone(drive, *logs[-1], effects, SETTLED)
    if max(found["alone"].current, found["alone"].speed) > LARGEST:
        own = record(drive, effects, *CASES[-1], 32.0)
        found["alone_bench_finer"] = alone(drive, *own, effects, SETTLED)
        found["alone_plant_finer"] = alone(drive, *logs[-1], effects, SETTLED, 16.0)
        found["alone_both"] = alone(drive, *own, effects, SETTLED, 16.0)
    if max(found["apart"]) > LARGEST:
        period = drive.converter.sampling_period
        exactly = tuple(
            moved(i, m, period) for i, (_, m) in zip(prepared.recordings, logs, strict=True)
        )
        fine = recorded(drive, effects, 32.0)
        found["bench_finer"] = apart(drive, fine, prepared, effects)
        found["plant_finer"] = apart(drive, logs, with_steps(prepared, 16), effects)
        found["motion_told"] = apart(
            drive, logs, dataclasses.replace(prepared, recordings=exactly), effects
        )
        all_three = dataclasses.replace(prepared, recordings=exactly, steps=16)
        found["all_three"] = apart(drive, fine, all_three, effects)
        if isinstance(drive.motor.energy, SplineEnergy):
            held = [x for x in logs if x[0].rotor != "free"]
            found["left_out"] = [left_out(drive, *x, effects, SETTLED) for x in held]
        found["grown"] = grown(drive, with_steps(prepared, 16), effects)
    return found


def grown(drive: Drive, prepared: Prepared, effects: Mapping[str, float]) -> list[float]:
    """Return by how much the trace of a millionth more resistance swells in each recording: its
    largest over its median, of the samples judged."""
    resistance = dict(effects).get("stator_resistance.resistance", drive.motor.resistance)
    changed = {**effects, "stator_resistance.resistance": resistance * (1.0 + MILLIONTH)}
    trace = [
        np.linalg.norm(i[SETTLED:, :, 1] - i[SETTLED:, :, 0], axis=1)
        for i in replay(prepared, [effects, changed]).currents
    ]
    return [float(t.max() / np.median(t)) for t in trace]


def why(found: Mapping[str, Any], k: int) -> str:
    """Return which refinement takes the difference of recording k away most."""
    kinds = {
        "bench_finer": "the bench's own step",
        "plant_finer": "the plant's step",
        "motion_told": "the smoothed motion",
    }
    least = min(kinds, key=lambda kind: found[kind][k])
    if found["grown"][k] > GROWN:
        return (
            "the drive's own gain, which makes a millionth of resistance "
            f"{found['grown'][k]:.0f} times as large, too"
        )
    said = (
        f"{found[least][k] * 1e6:.1f} ppm without; {found['all_three'][k] * 1e6:.1f} without "
        "all three"
    )
    logs = found.get("left_out", [])[k : k + 1]
    if (
        least == "plant_finer"
        and logs
        and abs(logs[0] - found["apart"][k]) < ALIKE * found["apart"][k]
    ):
        return (
            f"the plant's step on a flux map, whose equation says {logs[0] * 1e6:.1f} ppm ({said})"
        )
    return f"{kinds[least]} ({said})"


def why_alone(found: Mapping[str, Any]) -> str:
    """Return which refinement brings a rotor left alone nearest to the bench."""
    kinds = {"alone_bench_finer": "the bench's own step", "alone_plant_finer": "the plant's step"}
    least = min(kinds, key=lambda kind: found[kind].speed)
    (i, _, v), (j, _, u) = found[least], found["alone_both"]
    ppm = f"{i * 1e6:.1f} and {v * 1e6:.1f} ppm of current and speed without"
    return f"{kinds[least]} ({ppm}; {j * 1e6:.1f} and {u * 1e6:.1f} without both)"


def table(results: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the results as Markdown."""
    names = [f"{rotor} {speed:g}" if rotor == "driven" else rotor for rotor, speed in CASES]
    lines = [
        "# The plant against the switched bench",
        "",
        f"Written by `python -m experiments.plant_against_bench` on {date.today().isoformat()}: "
        "rms difference of sampled currents over rated current, ppm (driven: rad/s electrical), "
        f"steps a period as `prepare` chooses; encoder of {COUNTS} counts, so that its counts do "
        f"not show. Above {LARGEST * 1e6:.0f} ppm the reason stands below. The last three columns: "
        "the free rotor left alone, as the closed loop moves it, nothing correcting it: rms "
        "difference of the currents (ppm of rated current), of the angle (thousandths of a "
        "degree, electrical) and of the speed (ppm of rated speed).",
    ]
    more = ("alone: current", "angle", "speed")
    for motor, rows in results.items():
        lines += [
            "",
            f"## {motor}",
            "",
            f"| effects | steps | {' | '.join([*names, *more])} |",
            "|---|---|" + "---|" * (len(names) + len(more)),
        ]
        reasons = []
        for title, found in rows.items():
            if "refused" in found:
                lines.append(
                    f"| {title} | | {found['refused']} |" + " |" * (len(names) + len(more) - 1)
                )
                continue
            i, angle, v = found["alone"]
            logs = [(x, f"{x * 1e6:.1f}") for x in (*found["apart"], i)] + [(v, f"{v * 1e6:.2f}")]
            cells = [f"**{ppm}**" if x > LARGEST else ppm for x, ppm in logs]
            cells.insert(-1, f"{angle * 1e3:.2f}")
            lines.append(f"| {title} | {found['steps']} | {' | '.join(cells)} |")
            large = [k for k, x in enumerate(found["apart"]) if x > LARGEST]
            reasons += [f"- {title}, {names[k]}: {why(found, k)}" for k in large]
            reasons += [f"- {title}, left alone: {why_alone(found)}"] if max(i, v) > LARGEST else []
        lines += ["", *reasons] if reasons else ["", f"None above {LARGEST * 1e6:.0f} ppm."]
    return "\n".join(lines) + "\n" + EQUATIONS


def main() -> None:
    """Run everything, print and write the table."""
    results: dict[str, dict[str, Any]] = {}
    for motor in MOTORS:
        drive = load_drive(motor)
        drive = dataclasses.replace(
            drive, converter=dataclasses.replace(drive.converter, encoder_counts=COUNTS)
        )
        results[motor] = {}
        for title, effects in cases(drive):
            try:
                if of_quartic(drive, title):
                    raise BadInput(
                        "the switched bench keeps a motor's flux map as it is; nothing to compare"
                    )
                results[motor][title] = run(drive, effects)
            except BadInput as refused:
                results[motor][title] = {"refused": str(refused).partition(";")[0]}
            print(motor, title, results[motor][title], flush=True)
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / "against_bench.md").write_text(table(results), encoding="utf-8")
    content = {
        "date": date.today().isoformat(),
        "largest": LARGEST,
        "cases": CASES,
        "results": results,
    }
    (OUT / "against_bench.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

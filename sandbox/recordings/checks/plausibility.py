"""What cannot be right in a recording, and what is suspicious, each one sentence with column, row,
value and remedy.

Units, signs and orders that the voltage equation contradicts are in `mistakes`; here is what a
column shows by itself.  BadInput for the impossible, a `Finding` for the rest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from model.array_types import Array
from model.parameters import Drive
from sandbox.recordings.campaign import CampaignRecording
from sandbox.recordings.checks.balance import PHASES
from sandbox.recordings.checks.factors import deviations
from sandbox.recordings.checks.mistakes import contradictions
from sandbox.recordings.checks.pace import without_sign
from sandbox.recordings.checks.shifts import shifted
from sandbox.recordings.findings import Finding, Refused
from sandbox.recordings.rows.held import held
from sandbox.recordings.staircase import LARGEST_TURN, check_sensors, rest_of_sum

LONG = 32  # samples without any change, of a signal that should move
FINEST, WHOLE = 3e-3, 0.95  # of the largest change; of the rows: steps of an angle
BEFORE = 16  # samples over which it is seen moving
NEAR_MIDDLE = 0.1  # relative: zero currents of a converter about its middle
HEXAGON = 2.0 / 3.0  # of u_dc: largest phase voltage an inverter can give
GIVEN = 0.99  # quantile of the commands: no single one counts
INNER = (0.005, 0.995)  # quantiles between which the link moves: no single reading counts
UNITS_OFF = ((1e-3, "k"), (1e3, "m"))  # u_dc / nominal, prefix that explains it


def check(
    recordings: Sequence[CampaignRecording],
    drive: Drive,
    uncertainty: Mapping[str, float] | None = None,
) -> list[Finding]:
    """Return what is suspicious in recordings; BadInput for the first thing that cannot be
    right; uncertainty: relative, of what [motor] states, where it is stated."""
    findings: list[Finding] = []
    for r in recordings:
        findings += link_voltage(r, drive, uncertainty)
    old = [f for r in recordings for f in held(r, drive)]
    for r in recordings:
        findings += [] if old else current_sensors(r, drive)
        findings += without_sign(r, drive)
    # what currents and angle contradict would be the consequence of readings that are old
    findings += old or contradictions(recordings, drive)
    for r in recordings:
        findings += voltage_limit(r)
        findings += angle(r, drive)
        findings += other_columns(r, drive)
    return findings if old else findings + shifted(recordings, drive)


def link_voltage(
    r: CampaignRecording, drive: Drive, uncertainty: Mapping[str, float] | None = None
) -> list[Finding]:
    """Return a finding where u_dc is farther from nominal than it moves in the log and the best
    known value of [motor] is sure; BadInput where it is not positive or in another unit."""
    low = np.flatnonzero(r.u_dc <= 0.0)
    nominal, middle = r.dc_bus_voltage or drive.converter.dc_bus_voltage, float(np.median(r.u_dc))
    if low.size:
        k = int(low[0])
        text = (
            f"{r.file}: row {k} of column 'u_dc' is {r.u_dc[k]:g} V ({low.size} of "
            f"{len(r.u_dc)} rows are not "
            "positive); "
            "the controller divides by it: record the link voltage, or map u_dc = {value = ...}"
        )
        raise Refused(Finding(r.file, "u_dc", k, text))
    asked = float(np.quantile(np.hypot(r.u_alpha, r.u_beta), GIVEN))
    for factor, prefix in UNITS_OFF:
        if 0.5 < middle / nominal / factor < 2.0 and 0.5 * nominal < asked <= middle:
            text = (
                f"{r.file}: row 0 of column 'u_dc' is {r.u_dc[0]:.6g} V and commands reach "
                f"{asked:.3g} V, [drive] dc_bus_voltage is {nominal:g} V; is it in "
                f"{'k' if prefix == 'm' else 'm'}V? write {nominal * factor:g}"
            )
            raise Refused(Finding(r.file, "u_dc", 0, text))
        if 0.5 < middle / nominal / factor < 2.0:
            text = (
                f"{r.file}: row 0 of column 'u_dc' is {r.u_dc[0]:.6g}, [drive] "
                f"dc_bus_voltage is {nominal:g} V; is "
                "u_dc in "
                f'{prefix}V? convert it to V or map it with unit = "{prefix}V"'
            )
            raise Refused(Finding(r.file, "u_dc", 0, text))
    moves = 0.5 * float(np.ptp(np.quantile(r.u_dc, INNER))) / nominal
    ordinary = math.hypot(moves, min(deviations(uncertainty or {}).values()))
    if abs(middle / nominal - 1.0) > ordinary and 0.5 < middle / nominal < 2.0:
        text = (
            f"{r.file}: column 'u_dc' is {middle:.4g} V in the middle, [drive] dc_bus_voltage is "
            f"{nominal:g} V; resistance, inductances and flux that are found may be off by as "
            f"much: state what the link is (dc_bus_voltage = {middle:.4g}), or correct the column"
        )
        return [Finding(r.file, "u_dc", None, text)]
    if not 0.5 < middle / nominal < 2.0:
        text = (
            f"{r.file}: column 'u_dc' is {middle:.6g} V in the middle, [drive] dc_bus_voltage is "
            f"{nominal:g} V (a factor of 2 at most is usual); correct one of them"
        )
        return [Finding(r.file, "u_dc", None, text)]
    return []


def current_sensors(r: CampaignRecording, drive: Drive) -> list[Finding]:
    """Return findings on flat currents; BadInput for a phase of another unit or sign, a stuck or
    saturated sensor."""
    phase = {n: r.columns[n] for n in PHASES}
    one_sided(r, drive)
    _odd_one_out(r, phase)
    total, _ = rest_of_sum(np.stack(list(phase.values())))
    largest = max(float(np.max(np.abs(x))) for x in phase.values())
    bound = (
        10.0 * (drive.converter.current_noise + drive.converter.current_resolution) + 0.02 * largest
    )
    findings = []
    for name, x in phase.items():
        for begin, end in runs(x):
            others = max(float(np.ptp(y[begin:end])) for n, y in phase.items() if n != name)
            if others <= bound:
                continue
            top = abs(x[begin]) >= np.max(np.abs(x)) * (1.0 - 1e-9)
            what = "at its own largest value" if top else "stuck"
            said = (
                f"{r.file}: row {begin} of column '{name}' is {x[begin]:.6g} A and does not change "
                f"for {end - begin} rows while another phase moves by {others:.3g} A"
            )
            if np.mean(np.abs(total[begin:end]) > bound) > 0.5:
                cause = "its sensor is stuck: repair it or leave the recording out"
                if not np.any(x):
                    cause = (
                        "it was not recorded: leave it out of [columns], two currents are enough"
                    )
                elif top:
                    cause = "its sensor is saturated: lower the current or widen the range"
                text = f"{said}, and the three no longer sum to zero (bound {bound:.2g} A); {cause}"
                raise Refused(Finding(r.file, name, begin, text))
            if x[begin] != 0.0:
                findings.append(Finding(r.file, name, begin, f"{said}: {what}; check the sensor"))
            break
    return findings + check_sensors(r, drive)


def one_sided(r: CampaignRecording, drive: Drive) -> list[Finding]:
    """Raise BadInput for currents that never change their sign: three of one star sum to zero, two
    in counts have their zero in the middle of a converter's range."""
    held = [n for n in PHASES if not r.source or n in r.source]
    phase = [r[n] for n in held]
    if len(held) < 2 or min(float(np.min(x)) for x in phase) < 0.0:
        return []
    if not all(np.ptp(x) > 0.0 for x in phase) or (len(held) == 2 and not _are_counts(phase)):
        return []
    x = phase[0]
    top, middle = max(float(np.max(y)) for y in phase), float(np.mean(phase))
    cause = (
        "counts with their zero in the middle? map them with scale (A of a count) and "
        f"offset = -{middle:.4g} x scale"
    )
    inner = np.mean([np.abs(y - 2**15) < 2**14 for y in phase])
    if 0.9 * 2**16 < top < 2**16 and inner < 0.5:
        cause = "are they 16 bits without a sign? take 65536 off those above 32767"
    why = "all three currents are positive, and those of one star sum to zero"
    if len(held) == 2:
        why = "both currents are positive, about the middle of a converter's range"
    name = named_column(r, held[0])
    text = f"{r.file}: row 0 of column {name} is {x[0]:.6g}; in all rows {why}: {cause}"
    raise Refused(Finding(r.file, held[0], 0, text))


def _are_counts(phase: Sequence[Array]) -> bool:
    """Tell whether the middles of all readings are that of one converter of 8 to 16 bits."""
    bits = 2.0 ** np.arange(7, 16)
    middles = np.array([np.median(x) for x in phase])
    return bool(np.any(np.all(np.abs(middles[:, None] / bits - 1.0) < NEAR_MIDDLE, axis=0)))


def named_column(r: CampaignRecording, name: str) -> str:
    """Return a column in quotes, with the log's own name beside ours."""
    own = r.source.get(name, name)
    return f"'{name}'" if own == name else f"'{name}' ('{own}')"


def _odd_one_out(r: CampaignRecording, phase: dict[str, Array]) -> None:
    """Raise BadInput for a phase that is minus the sum of the others but for its sign or a factor
    of 1000."""
    best: tuple[float, str, float] | None = None
    for name, x in phase.items():
        others = -sum((y for n, y in phase.items() if n != name), np.zeros(len(x)))
        energy = float(others @ others)
        ratio = float(x @ others) / energy if energy > 0.0 else 1.0
        for wrong in (-1.0, 1e-3, 1e3):
            if abs(ratio / wrong - 1.0) < 0.1:
                rest = float(np.sum((x - ratio * others) ** 2)) / max(float(x @ x), 1e-300)
                if rest < 0.05 and (best is None or rest < best[0]):
                    best = (rest, name, wrong)
    if best is not None:
        _, name, wrong = best
        k = int(np.argmax(np.abs(phase[name])))
        total = sum(float(y[k]) for y in phase.values())
        cause = {
            -1.0: "its sign is wrong: map it with scale = -1",
            1e-3: "is it in kA?",
            1e3: "is it in mA?",
        }[wrong]
        text = (
            f"{r.file}: row {k} of column '{name}' is {phase[name][k]:.6g} A and the "
            f"three phases sum to {total:.4g} A "
            f"instead of 0; {cause}{'' if wrong < 0 else ' give all three in A'}"
        )
        raise Refused(Finding(r.file, name, k, text))


def runs(x: Array) -> list[tuple[int, int]]:
    """Return [begin, end) of the stretches of at least LONG equal samples."""
    edges = np.flatnonzero(np.diff(x) != 0.0) + 1
    bounds = np.concatenate([[0], edges, [len(x)]])
    long = np.flatnonzero(np.diff(bounds) >= LONG)
    return [(int(bounds[k]), int(bounds[k + 1])) for k in long]


def angle_step(theta: Array) -> float:
    """Return the step (in its unit) in which an angle moves from row to row, 0 where none shows.

    All changes are multiples of it, not nearly all the same one, as at one speed without any
    rounding.
    """
    moved = np.abs(np.diff(theta))
    least = FINEST * float(np.max(moved, initial=0.0))
    some = moved[moved > least]
    if not some.size:
        return 0.0
    step = float(np.min(some))
    for most in (1, 3, 10, math.inf):  # rounding of the log itself spoils one change alone
        times = np.round(moved / step)
        own = (times > 0) & (times <= most)
        step = float(np.sum(moved[own] * times[own]) / np.sum(times[own] ** 2))
    times = np.round(moved / step)
    if np.mean(np.abs(moved - times * step) < 0.1 * step) < WHOLE:
        return 0.0
    shares = np.unique(times, return_counts=True)[1] / len(times)
    return step if np.max(shares) < WHOLE else 0.0


def voltage_limit(r: CampaignRecording) -> list[Finding]:
    """Return a finding where commands leave the circle u_dc / sqrt(3); BadInput beyond u_dc
    itself."""
    size = np.hypot(r.u_alpha, r.u_beta)
    beyond = np.flatnonzero(size > 1.02 / math.sqrt(3.0) * r.u_dc)
    if not beyond.size:
        return []
    k = int(beyond[np.argmax(size[beyond] / r.u_dc[beyond])])
    said = f"{r.file}: row {k} of column 'u_alpha': the command is {size[k]:.4g} V"
    if size[k] > 1.02 * r.u_dc[k]:
        text = (
            f"{said}, u_dc only {r.u_dc[k]:.4g} V (an inverter gives {HEXAGON * r.u_dc[k]:.4g} V "
            "at most); check the units of voltages and of u_dc"
        )
        raise Refused(Finding(r.file, "u_alpha", k, text))
    text = (
        f"{said}, beyond u_dc / sqrt(3) = {r.u_dc[k] / math.sqrt(3.0):.4g} V ({beyond.size} rows "
        f"from {beyond[0]}); the inverter may not have given it: record the limited command, phase "
        "(not line) voltage, peak"
    )
    return [Finding(r.file, "u_alpha", k, text)]


def angle(r: CampaignRecording, drive: Drive) -> list[Finding]:
    """Return findings on the angle; BadInput for a locked rotor that turns, jumps, or a stuck
    encoder."""
    theta, span = r.theta, float(np.ptp(r.theta))
    if r.rotor == "locked":
        if span > LARGEST_TURN:
            text = (
                f"{r.file}: theta spans {span:.3g} while rotor = 'locked' (at most {LARGEST_TURN} "
                "rad); lock the rotor, correct 'rotor', or convert theta from degrees to "
                "electrical rad"
            )
            raise Refused(Finding(r.file, "theta", None, text))
        return []
    if span == 0.0:
        text = (
            f"{r.file}: row 0 of column 'theta' is {theta[0]:.6g} and never changes while "
            f"rotor = '{r.rotor}'"
        )
        return [
            Finding(
                r.file, "theta", 0, f"{text}; correct 'rotor' if it stood, else check the encoder"
            )
        ]
    counts = drive.converter.encoder_counts
    stated = math.tau * drive.motor.pole_pairs / counts if counts else 1e-3
    count = max(stated, angle_step(theta))
    if r.made is None:
        _stuck_encoder(r, count)
    step = np.diff(theta)
    wild = np.flatnonzero(np.abs(step) > math.pi)
    if wild.size:
        k = int(wild[0])
        text = (
            f"{r.file}: row {k + 1} of column 'theta' jumps by {step[k]:.4g} rad from the row "
            "before (at most pi can be followed); give the angle unwrapped, electrical, in rad"
        )
        raise Refused(Finding(r.file, "theta", k + 1, text))
    return _lost_sample(r, step, count)


def _stuck_encoder(r: CampaignRecording, count: float) -> None:
    for begin, end in runs(r.theta):
        before = abs(r.theta[begin] - r.theta[max(begin - BEFORE, 0)])
        after = abs(r.theta[min(end - 1 + BEFORE, len(r.theta) - 1)] - r.theta[end - 1])
        moved = max(float(before), float(after))
        if moved > 0.1 + BEFORE * count:
            text = (
                f"{r.file}: row {begin} of column 'theta' is {r.theta[begin]:.6g} rad and does not "
                f"change for {end - begin} rows, though it moved by {moved:.3g} rad within "
                f"{BEFORE} rows beside them; the encoder is stuck: repair it or leave the "
                "recording out"
            )
            raise Refused(Finding(r.file, "theta", begin, text))


def _lost_sample(r: CampaignRecording, step: Array, count: float) -> list[Finding]:
    """Return a finding where the angle moves on by two steps between two rows: a row that was
    dropped."""
    if len(step) < 5:
        return []
    around = np.stack([step[:-4], step[1:-3], step[3:-1], step[4:]])
    usual, here = around.mean(axis=0), step[2:-2]
    even = np.ptp(around, axis=0) <= 0.2 * np.abs(usual) + 3.0 * count
    odd = np.flatnonzero(
        even & (np.abs(usual) > 5.0 * count) & (np.abs(here - usual) > 0.6 * np.abs(usual))
    )
    if not odd.size:
        return []
    k = int(odd[0]) + 3
    text = (
        f"{r.file}: row {k} of column 'theta' is {here[odd[0]]:.4g} rad on from the row before, "
        f"beside it a row is {usual[odd[0]]:.4g} rad ({odd.size} such rows); samples seem lost or "
        "doubled: export every sample"
    )
    return [Finding(r.file, "theta", k, text)]


def other_columns(r: CampaignRecording, drive: Drive) -> list[Finding]:
    """Return findings on load torque and temperature of another unit."""
    findings = []
    motor = drive.motor
    saliency = abs(motor.inductance_d - motor.inductance_q)
    current = float(np.max(np.hypot(*r.current)))
    able = 1.5 * motor.pole_pairs * (motor.magnet_flux + saliency * current) * current
    for name in ("load_torque", "torque"):
        x = r.columns.get(name, np.zeros(1))
        k = int(np.argmax(np.abs(x)))
        if able > 0.0 and abs(x[k]) > 50.0 * able:
            text = (
                f"{r.file}: row {k} of column '{name}' is {x[k]:.6g} N m, the currents "
                f"give {able:.3g} N m at most; "
                "is it in "
                'mN m? map it with unit = "mNm"'
            )
            findings.append(Finding(r.file, name, k, text))
    warm = r.columns.get("temperature", np.zeros(1))
    k = int(np.argmax(warm))
    if warm[k] > 200.0:
        text = (
            f"{r.file}: row {k} of column 'temperature' is {warm[k]:.4g}; a winding over 200 °C? "
            'map kelvin with unit = "K"'
        )
        findings.append(Finding(r.file, "temperature", k, text))
    return findings

"""Every check of a campaign before any physics is fitted: all mistakes at once, not the first one
only.

What stops a campaign (`refused`) and what is only suspicious come from `plausibility`, `mistakes`
and `conventions`; here are those that need more than one column's sight: columns mapped twice, a
phase without current, factors between conventions, turns of the voltage beside those of the angle,
steps of the readings beside those stated, injection that is not there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from model.array_types import Array
from model.errors import BadInput
from model.parameters import Drive
from model.ratings import cautions
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.recordings.checks.balance import PHASES, VOLTAGES
from sandbox.recordings.checks.changes import ANGLE, CURRENT, MOTOR, VOLTAGE
from sandbox.recordings.checks.factors import conventions_off
from sandbox.recordings.checks.map_range import beyond_map
from sandbox.recordings.checks.mistakes import contradictions
from sandbox.recordings.checks.pace import off_pace, without_sign
from sandbox.recordings.checks.plausibility import (
    angle,
    current_sensors,
    link_voltage,
    one_sided,
    other_columns,
    voltage_limit,
)
from sandbox.recordings.checks.readings import BETTER
from sandbox.recordings.checks.shifts import shifted
from sandbox.recordings.conventions import with_link
from sandbox.recordings.findings import Doubt, Finding, Refused
from sandbox.recordings.rows.held import held

REFUSED, SUSPICIOUS, NOTE = "refused", "suspicious", "note"
COLUMNS = {CURRENT: PHASES, VOLTAGE: VOLTAGES, ANGLE: ("theta",)}
OFF = 0.02  # relative, of steps: as stated
COARSER = 2.0  # times the stated step


@dataclass(frozen=True)
class Noticed:
    """A finding and whether it stops the campaign: `refused`, `suspicious` or `note`."""

    level: str
    finding: Finding


def noticed(campaign: Campaign) -> list[Noticed]:
    """Return all that is wrong, suspicious or changed in a campaign that has been read
    unchecked."""
    out = on_the_way(campaign.findings)
    drive, recordings = campaign.drive, campaign.recordings
    out += [Noticed(NOTE, f) for r in recordings for f in steady_link(r)]
    signs = [
        n
        for r in recordings
        for one in (one_sided, without_sign)
        for n in tried(r.file, lambda one=one, r=r: one(r, drive))  # type: ignore[misc]
    ]
    if signs:  # all else would be their consequence
        return refusals_first([*out, *signs])
    sensors = list[Noticed]()
    for r in recordings:
        sensors += tried(r.file, lambda r=r: current_sensors(r, drive))  # type: ignore[misc]
        out += tried(r.file, lambda r=r: link_voltage(r, drive, campaign.uncertainty))  # type: ignore[misc]
        for one in (_limit, angle, other_columns, *FURTHER):
            out += tried(r.file, lambda one=one, r=r: one(r, drive))  # type: ignore[misc]
    old = [n for r in recordings for n in tried(r.file, lambda r=r: held(r, drive))]  # type: ignore[misc]
    if old:  # what currents and angle contradict would be its consequence
        return refusals_first([*out, *old])
    for check in (contradictions, shifted):
        cause = tried("", lambda check=check: check(recordings, drive))  # type: ignore[misc]
        if any(n.level == REFUSED for n in cause):
            return refusals_first([*_without(out, sensors, cause), *cause])
        out += cause
    out += sensors
    for check in (conventions_off, off_pace):
        if not any(n.finding.rereads for n in out):  # one reading explains what the next would
            out += tried("", lambda check=check: check(recordings, drive))  # type: ignore[misc]
    out = _as_one(_best_explained(out))
    if not any(MOTOR in n.finding.rereads for n in out):  # else its consequence
        out += [Noticed(SUSPICIOUS, f) for f in ratings(campaign)]
    if not any(n.level == REFUSED for n in out):
        out += [
            Noticed(SUSPICIOUS, f) for f in with_link(campaign).findings[len(campaign.findings) :]
        ]
    return refusals_first(out)


def _best_explained(out: Sequence[Noticed]) -> list[Noticed]:
    """Return what was noticed without explanations of the voltage that leave BETTER times as much
    as the best one: it makes them look so."""
    least = min((n.finding.left for n in out if math.isfinite(n.finding.left)), default=math.inf)
    return [n for n in out if not n.finding.left > BETTER * least]


def _as_one(out: Sequence[Noticed]) -> list[Noticed]:
    """Return what was noticed with rows by which an angle is off and a zero of it as one finding:
    at one speed they are the same."""
    late = next((n for n in out if _is_late(n.finding)), None)
    zero = next((n for n in out if ANGLE in n.finding.rereads), None)
    if late is None or zero is None:
        return list(out)
    text = zero.finding.text.partition(": ")[2]
    both = replace(
        late.finding, text=f"{late.finding.text}; or, which is the same at one speed, {text}"
    )
    kept = [n for n in out if n is not late and n is not zero]
    return [*kept, Noticed(late.level, both)]


def _is_late(f: Finding) -> bool:
    """Tell whether a finding is of rows by which the angle is off."""
    return f.column == "theta" and math.isfinite(f.left) and not f.rereads


def _without(
    out: Sequence[Noticed], sensors: Sequence[Noticed], cause: Sequence[Noticed]
) -> list[Noticed]:
    """Return what is said of currents, voltages and the angle without the consequences of what
    stops them: what is suspicious, and what is refused in another unit or by another angle."""
    rereads = frozenset[str]().union(*(n.finding.rereads for n in cause))
    seen = {*PHASES, *VOLTAGES, "theta"}
    again = {n for part, names in COLUMNS.items() if part in rereads for n in names}
    kept = [
        n
        for n in out
        if n.finding.column not in (again if n.level == REFUSED else seen) or n.level == NOTE
    ]
    return kept + [n for n in sensors if n.level == REFUSED and CURRENT not in rereads]


def on_the_way(findings: Iterable[Finding]) -> list[Noticed]:
    """Return what was noticed while reading, each with its level."""
    return [Noticed(SUSPICIOUS if isinstance(f, Doubt) else NOTE, f) for f in findings]


def refusals_first(found: Sequence[Noticed]) -> list[Noticed]:
    """Return what stops a campaign before the rest, without what is suspicious about the same
    readings: a current in another unit has other steps, too.
    """
    refused = [n for n in found if n.level == REFUSED]
    wrong = {
        (f, _kind(x.column))
        for n in refused
        for x in (n.finding,)
        if x.column
        for f in x.files or (x.file,)
    }
    rest = [n for n in found if n.level != REFUSED]
    return [
        *refused,
        *(
            n
            for n in rest
            if n.level == NOTE or (n.finding.file, _kind(n.finding.column)) not in wrong
        ),
    ]


def _kind(column: str) -> str:
    """Return what is told together of columns: currents, voltages, or the column itself."""
    return "current" if column in PHASES else "voltage" if column in VOLTAGES else column


def ratings(campaign: Campaign) -> list[Finding]:
    """Return a finding for each stated value of [motor] that does not go with the others; none of
    stand-ins."""
    texts = [
        text
        for text in cautions(campaign.drive)
        if not any(name in text for name in campaign.stand_ins)
    ]
    return [Finding(campaign.name, "", None, f"{campaign.name}: {text}") for text in texts]


def further(campaign: Campaign) -> list[Finding]:
    """Return what is suspicious in a campaign that has been read and checked, beyond what reading
    checks."""
    found = [f for r in campaign.recordings for one in FURTHER for f in one(r, campaign.drive)]
    own = (campaign.recordings, campaign.drive)
    off = [f for f in campaign.findings if f.rereads] or conventions_off(*own)
    found += [f for f in off if f not in campaign.findings]
    return [*found, *([] if off else off_pace(*own)), *ratings(campaign)]


def tried(file: str, check: Callable[[], Iterable[Finding]]) -> list[Noticed]:
    """Return a check's findings, its refusal as one of them."""
    try:
        return [Noticed(SUSPICIOUS, f) for f in check()]
    except Refused as error:
        return [Noticed(REFUSED, error.finding)]
    except BadInput as error:
        text = str(error)
        return [Noticed(REFUSED, Finding(file or text.partition(":")[0], "", None, text))]


def _limit(r: CampaignRecording, drive: Drive) -> list[Finding]:
    return voltage_limit(r) if np.all(r.u_dc > 0.0) else []  # told by `link_voltage`


def _balanced(r: CampaignRecording, names: Sequence[str]) -> bool:
    """Return whether three columns sum to zero as only columns made from two do: then two of them
    may be alike."""
    columns = np.array([r[x] for x in names])
    return len(names) == 3 and bool(
        np.abs(columns.sum(axis=0)).max() < 1e-9 * np.abs(columns).max()
    )


def twice(r: CampaignRecording, drive: Drive) -> list[Finding]:
    """Return a finding for two columns that are one and the same."""
    out = []
    for names in (PHASES, VOLTAGES):
        for k, a in enumerate(names):
            for b in names[k + 1 :]:
                if np.array_equal(r[a], r[b]) and np.ptp(r[a]) > 0.0 and not _balanced(r, names):
                    text = (
                        f"{r.file}: columns '{a}' and '{b}' are the same in every row; one "
                        "is mapped twice"
                    )
                    out.append(Finding(r.file, b, None, text))
    return out


def silent(r: CampaignRecording, drive: Drive) -> list[Finding]:
    """Return findings on voltages or currents that stay zero, all or one phase beside the
    others."""
    largest = max(float(np.max(np.abs(r[n]))) for n in PHASES)
    out = []
    if largest == 0.0:
        out.append(
            Finding(
                r.file,
                "i_a",
                0,
                f"{r.file}: all currents are 0 A in every row; map the sensors' columns",
            )
        )
    for n in PHASES if largest > 0.0 else ():
        own = float(np.max(np.abs(r[n])))
        if own <= 0.01 * largest and r.rotor != "locked":
            text = (
                f"{r.file}: column '{n}' stays within {own:.3g} A while another phase "
                f"reaches {largest:.3g} A"
            )
            out.append(Finding(r.file, n, None, f"{text}; is its sensor or its lead open?"))
    if (
        all(np.ptp(r[n]) == 0.0 for n in VOLTAGES)
        and float(np.max(np.abs(r[VOLTAGES[0]]))) == 0.0
        and largest > 0.0
    ):
        text = (
            f"{r.file}: the commands are 0 V in every row though current flows; map what the "
            "controller commanded"
        )
        out.append(Finding(r.file, "u_alpha", 0, text))
    return out


def clipped(r: CampaignRecording, drive: Drive) -> list[Finding]:
    """Return a finding for readings that stop at the same largest value on both sides, as a full
    converter does."""
    size = np.stack([np.abs(r[n]) for n in PHASES])
    top = float(size.max())
    quantum = max(drive.converter.current_resolution, 1e-9 * top)
    at = np.abs(size - top) <= 0.5 * quantum
    for k, n in enumerate(PHASES):
        step = np.abs(np.diff(r[n]))
        rises = np.flatnonzero(at[k, 2:] & at[k, 1:-1] & ~at[k, :-2] & (step[:-1] > 8.0 * quantum))
        both = np.any(at[k] & (r[n] > 0)) and np.any(at[k] & (r[n] < 0))
        if len(rises) >= 4 and both:
            row = int(rises[0]) + 1
            text = (
                f"{r.file}: row {row} of column '{n}' reaches {top:.4g} A in one step and stays "
                f"there, {len(rises)} times and on both sides; the converter is full: lower the "
                "current or widen the range"
            )
            return [Finding(r.file, n, row, text)]
    return []


def steady_link(r: CampaignRecording) -> list[Finding]:
    """Return a finding where the log's link voltage is one and the same number: no reading shows
    what the link does."""
    if "u_dc" not in r.source or np.ptp(r.u_dc) > 0.0:
        return []
    own = r.source["u_dc"]
    text = (
        f"{r.file}: column '{own}' is {r.u_dc[0]:g} V in every row, as no reading is; link sag and "
        "ripple stay unseen"
    )
    return [Finding(r.file, "u_dc", None, text)]


def steps(r: CampaignRecording, drive: Drive) -> list[Finding]:
    """Return findings on readings that step otherwise than `current_resolution` and
    `encoder_counts` say."""
    c, out = drive.converter, []
    stated = [("i_a", c.current_resolution, "current_resolution", "A")]
    if c.encoder_counts:
        stated.append(
            ("theta", math.tau * drive.motor.pole_pairs / c.encoder_counts, "encoder_counts", "rad")
        )
    for column, step, key, unit in stated:
        own = quantum(r[column])
        if own is None or step <= 0.0 or 1.0 / COARSER < own / step < COARSER:
            continue
        found = f"{own:.4g} A"
        if key == "encoder_counts":
            found = f"{math.tau * drive.motor.pole_pairs / own:.6g} counts a turn"
            if abs(own / step * COARSER - 1.0) < OFF or abs(own / step / COARSER - 1.0) < OFF:
                found += (
                    ", unless pole_pairs counts poles"
                    if own < step
                    else ", unless pole_pairs is half of what it is"
                )
        text = (
            f"{r.file}: column '{column}' moves in steps of {own:.4g} {unit}, {key} says "
            f"{step:.4g} {unit}; correct [drive] {key} ({found})"
        )
        out.append(Finding(r.file, column, None, text))
    return out


def quantum(x: Array) -> float | None:
    """Return the step in which readings move, None where they do not move in steps."""
    values = np.unique(x)
    if len(values) < 4 or len(values) > 0.5 * len(x):
        return None
    gaps = np.diff(values)
    step = float(np.min(gaps[gaps > 1e-6 * np.ptp(values)], initial=np.inf))
    if not math.isfinite(step):
        return None
    places = (values - values[0]) / step
    return step if float(np.mean(np.abs(places - np.round(places)) < 0.1)) > 0.95 else None


def ripple(r: CampaignRecording, drive: Drive) -> list[Finding]:
    """Return a finding where injection is stated and its frequency is not in the commands, seen
    from the rotor.

    Injection turns with the rotor: from outside, the speed would move its line.
    """
    if r.injection_axis == "none":
        return []
    h, f = drive.converter.sampling_period, drive.injection.frequency
    u = (r.u_alpha + 1j * r.u_beta) * np.exp(-1j * r["theta"])
    spectrum = np.abs(np.fft.fft((u - u.mean()) * np.hanning(len(u)))) / (0.5 * len(u))
    at = np.abs(np.fft.fftfreq(len(u), h))
    near = np.abs(at - f) < max(4.0 / (len(u) * h), 0.02 * f)
    if not np.any(near) or float(spectrum[near].max()) > 0.1 * drive.injection.amplitude:
        return []
    fast = at > 0.2 * f
    k = int(np.argmax(np.where(fast, spectrum, 0.0)))
    text = (
        f"{r.file}: injection_axis = '{r.injection_axis}', but the commands hold "
        f"{float(spectrum[near].max()):.3g} V "
        f"at [injection] frequency = {f:g} Hz (amplitude = {drive.injection.amplitude:g} "
        "V); their strongest line is "
        f'{spectrum[k]:.3g} V at {at[k]:.4g} Hz: correct [injection], or injection_axis = "none"'
    )
    return [Finding(r.file, "u_alpha", None, text)]


# what is looked for in each recording beyond what reading it checks
FURTHER = (twice, silent, clipped, steps, ripple, beyond_map)

"""Campaigns that know only the motion: angle and torque current (or torque), no voltages, uneven
stamps welcome.

What the electrical part would need is not there, so nothing of it is read: [drive] and [injection]
may be absent, of [motor] only what turns current into torque is needed: `torque_constant`, or
`magnet_flux` and `pole_pairs`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.energy import flux_from_current
from model.errors import BadInput, PhysicsError, as_toml, brief
from model.names import fitting
from model.number_table import Table
from model.parameters import Motor, finite
from model.remedies import remedy
from sandbox.recordings.angle.changes import at_changes
from sandbox.recordings.angle.commutation import STEP
from sandbox.recordings.angle.turning import with_angle
from sandbox.recordings.campaign import Campaign, table_of
from sandbox.recordings.checks.motion_clock import SHORTEST, stretches
from sandbox.recordings.column_map import (
    Column,
    by_states,
    has_voltages,
    lacks_voltages,
    measured,
    phase_currents,
    source_columns,
    source_units,
    stamps_of,
)
from sandbox.recordings.copies import copied, copy_finding, own_rows
from sandbox.recordings.findings import Finding
from sandbox.recordings.importing import Source, unchecked
from sandbox.recordings.motion_axis import ROTARY, Axis, axis_of, shafts_keys
from sandbox.recordings.stamps import rows_of, segment_name

SHORT_LAG = 2e-5  # s: below it are small coreless motors alone, and inductances in another unit
THOUSAND = 1000.0  # of a unit that is mistaken
OF_LAG = ("resistance", "inductance_d", "inductance_q")
OF_TORQUE = {"i_q", "torque"}  # columns that tell a torque whatever the zero of the angle
FURTHER = ("speed", "i_d", "i_q", "u_d", "u_q")
OR_SPEED = ', or the log\'s speed (speed = {column = ..., unit = "rpm"})'
SIXTHS = (
    "states tell the angle to a sixth of an electrical turn: between them a current moves for the "
    "angle's error as for electrical effects, which are no candidates; the motion alone is judged "
    "(log the speed, too, and all is)"
)
BESIDE_OTHERS = (
    "states tell the angle to a sixth of an electrical turn, so beside recordings that tell more "
    "it is left out (log the speed, too; diagnose this file alone for its motion)"
)
WITHOUT = "so electrical effects are no candidates; the motion alone is judged"


@dataclass(frozen=True)
class MotionRecording:
    """One stretch without a gap: stamps t (s, rising, uneven), mechanical angle (rad), air-gap
    torque by the nominal motor and the load's (N m); each (n,).

    further: what else the log says of the same rows, under our names (speed in mechanical rad/s);
    source: the log's own columns by ours; sixth: rad mechanical from change to change of an angle
    made of states, 0 of one that was read, and zero: rad mechanical of a change.
    """

    file: str
    t: Array
    angle: Array
    torque: Array
    load: Array
    further: Mapping[str, Array] = field(default_factory=dict)
    source: Mapping[str, str] = field(default_factory=dict)
    sixth: float = 0.0
    zero: float = 0.0


@dataclass(frozen=True)
class MotionCampaign:
    """A drive's shaft and what moved it.

    torque_constant: N m per A of i_q, None where a torque was recorded and nothing says it; inertia
    (kg m^2) None where none is stated; viscous_friction: N m s/rad;
    deviations: relative, of what is stated; current_noise: A rms, None: from the recordings; count:
    rad mechanical of an encoder's count, 0 where unknown; why: why only the motion is judged, one
    sentence; stated: numbers of [motor];
    mapped, units: how columns are read; axis: of a shaft, or linear: then m, N and kg stand for
    rad, N m and kg m^2.
    """

    name: str
    torque_constant: float | None
    inertia: float | None
    viscous_friction: float
    deviations: Mapping[str, float]
    current_noise: float | None
    count: float
    recordings: tuple[MotionRecording, ...]
    findings: tuple[Finding, ...]
    why: str
    stated: Mapping[str, float] = field(default_factory=dict)
    mapped: Mapping[str, Column] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    axis: Axis = ROTARY


def motion_only(source: Source) -> str | None:
    """Return why a source can be judged by its motion alone, one sentence; None where a recording
    can be replayed.

    Of each recording: no voltages, an angle known to sixths of a turn alone, or samples further
    apart than the currents take to settle.
    """
    first = None
    for file, rotor, *_ in source.entries:
        why = _motion_only(file, rotor, source)
        if why is None:
            return None
        first = first or why
    return first


def _motion_only(file: str, rotor: str, source: Source) -> str | None:
    """Return why one recording can be judged by its motion alone, None where it can be replayed."""
    drive, motor = table_of(source.data, "drive"), table_of(source.data, "motor")
    table = source.table(file)
    if not has_voltages(table, source.mapped):
        return f"{lacks_voltages(table, source.mapped)}, {WITHOUT}"
    if rotor == "free" and (sixths := by_states(table, source.mapped)):
        return f"{sixths}: {SIXTHS}"
    stated = finite(drive.get("sampling_period"))
    period = stated or _step(file, table, source)
    resistance, *inductances = (finite(motor.get(k)) or 0.0 for k in OF_LAG)
    if min(period, resistance, *inductances) > 0.0:
        if _another_unit(period, resistance, max(inductances)):
            return None  # its voltages tell which value is, and a motor that is so is told later
        rows = (
            f"sampling_period = {period:.3g} s is"
            if stated
            else f"{file}: rows {period:.3g} s apart are"
        )
        return _too_slow(rows, period, resistance, max(inductances))
    return None


def _step(file: str, table: Table, source: Source) -> float:
    """Return the usual step (s) of a table's stamps, 0 where it has none."""
    if "t" not in source.mapped:
        return 0.0
    found, _ = measured(file, table, {"t": source.mapped["t"]}, 1.0)
    return float(np.median(np.diff(found["t"]))) if "t" in found and len(found["t"]) > 1 else 0.0


def read_motion(source: Source, why: str) -> MotionCampaign:
    """Return the motion that a source's recordings hold; BadInput names what is missing and how to
    get it.

    why: only the motion is judged (see `motion_only`).
    """
    if _zero_by_voltages(source):
        return by_changes(motion_of(unchecked(source), why))
    motor, drive = table_of(source.data, "motor"), table_of(source.data, "drive")
    pairs = _stated(motor, "pole_pairs", source.name, 1.0, 100.0)
    axis = axis_of(motor, source.name)
    motor = shafts_keys(motor)
    constant = _stated(motor, "torque_constant", source.name, 1e-9, 1e5)
    flux = _stated(motor, "magnet_flux", source.name, 1e-9, 1e2)
    if constant is None and flux is not None and pairs is not None:
        constant = 1.5 * pairs * flux
    findings = source.remarks
    recordings: list[MotionRecording] = []
    for file, rotor, _, _ in source.entries:
        if rotor == "free":
            recordings += _read(file, source, pairs, constant, findings)
        else:
            text = (
                f"{file}: rotor = '{brief(rotor)}' tells nothing of the motion, and the rest "
                "is not judged; left out"
            )
            findings.append(Finding(file, "theta", None, text))
    recordings = _counted_once(recordings, findings)
    if not recordings:
        raise BadInput(
            f"{source.name}: {why}; but no recording has rotor = 'free', so there is no "
            "motion to judge either"
        )
    counts = _stated(drive, "encoder_counts", source.name, 1.0, 1e9)
    name = table_of(source.data, "campaign").get("name") or fitting(
        source.folder.resolve().name, "campaign"
    )
    return by_changes(
        MotionCampaign(
            str(name),
            constant,
            _stated(motor, "inertia", source.name, 1e-12, 1e5),
            _stated(motor, "viscous_friction", source.name, 0.0, 1e5) or 0.0,
            _deviations(source),
            _stated(drive, "current_noise", source.name, 0.0, 1e5),
            math.tau / counts if counts else 0.0,
            tuple(recordings),
            tuple(findings),
            why,
            {k: v for k, x in motor.items() if (v := finite(x)) is not None},
            source.mapped,
            source_units(source.table(source.entries[0][0]), source.mapped),
            axis,
        )
    )


def by_changes(campaign: MotionCampaign) -> MotionCampaign:
    """Return a campaign whose angles of states are told at their changes alone; BadInput where
    these are too few.

    The currents' own noise says little of a torque at such an angle: how much it scatters is left
    to the recordings.
    """
    if not any(r.sixth for r in campaign.recordings):
        return campaign
    out, findings = list[MotionRecording](), list(campaign.findings)
    for r in campaign.recordings:
        if not r.sixth:
            out.append(r)
            continue
        values = {"torque": r.torque, "load": r.load, **r.further}
        t, angle, own = at_changes(r.t, r.angle, values, r.sixth, r.zero)
        if len(t) >= SHORTEST:
            torque, load = own.pop("torque"), own.pop("load")
            out.append(replace(r, t=t, angle=angle, torque=torque, load=load, further=own))
            continue
        text = (
            f"{r.file}: the states change {len(t)} times, a motion takes {SHORTEST}; left "
            "out: let the rotor turn on"
        )
        findings.append(Finding(r.file, "theta", None, text))
    if not out:
        raise BadInput(findings[-1].text)
    return replace(campaign, recordings=tuple(out), findings=tuple(findings), current_noise=None)


def _zero_by_voltages(source: Source) -> bool:
    """Tell whether phase currents beside states become a torque only by the zero that voltages
    show."""
    if not source.entries:
        return False
    table = source.table(source.entries[0][0])
    named = OF_TORQUE & set(source_columns(table, source.mapped))
    return (
        not named and bool(by_states(table, source.mapped)) and has_voltages(table, source.mapped)
    )


def _counted_once(
    recordings: list[MotionRecording], findings: list[Finding]
) -> list[MotionRecording]:
    """Return recordings without rows that stand in two of them, each with a finding."""
    copies = {c.at: c for c in copied([[r.angle, r.torque] for r in recordings])}
    for k, c in copies.items():
        findings.append(
            copy_finding(recordings[k].file, recordings[c.of].file, c, len(recordings[k].t))
        )
    out = []
    for k, r in enumerate(recordings):
        keep = own_rows(copies[k], len(r.t)) if k in copies else slice(0, len(r.t))
        if keep is not None:
            arrays = {n: getattr(r, n)[keep] for n in ("t", "angle", "torque", "load")}
            out.append(replace(r, **arrays, further={n: x[keep] for n, x in r.further.items()}))
    return out


def _read(
    file: str, source: Source, pairs: float | None, constant: float | None, findings: list[Finding]
) -> list[MotionRecording]:
    """Return the stretches of one table between pauses and jumps of its clock.

    An angle is followed from row to row, so each stretch is read by itself.  What is said of all is
    said once.
    """
    table = source.table(file)
    mapped = dict(source.mapped)
    if pairs is None and (s := mapped.get("speed")) is not None and not s.mechanical:
        del mapped["speed"]  # electrical: what it says of the shaft is unknown
    t = stamps_of(file, table, mapped)
    if t is None:
        raise BadInput(f"{file}: column 't' is missing; log each row's time stamp: map it")
    good = stretches(file, t, findings)
    out, said = [], set[str]()
    for k, rows in enumerate(good, 1):
        name = file if len(good) == 1 else segment_name(file, k)
        part = table if len(rows) == len(t) else rows_of(table, rows)
        notes: list[Finding] = []
        out.append(_stretch(name, part, mapped, source.name, pairs, constant, notes))
        for note in notes:
            whole = replace(note, file=file, text=note.text.replace(name, file))
            if whole.text not in said:
                findings.append(whole if note.row is None else note)
            said.add(whole.text)
    return out


def _stretch(
    file: str,
    table: Table,
    mapped: Mapping[str, Column],
    source: str,
    pairs: float | None,
    constant: float | None,
    findings: list[Finding],
) -> MotionRecording:
    """Return the motion of a table's rows, whose stamps rise without a pause."""
    found, notes = measured(file, table, mapped, pairs or 1.0)
    findings += notes
    own = source_columns(table, mapped)
    found, made = with_angle(file, found, own, findings)
    if "theta" not in found:
        why = "without voltages the angle shows the motion"
        raise BadInput(f"{file}: column 'theta' is missing; {why}: map it{OR_SPEED}")
    if pairs is None and not mapped.get("theta", mapped.get("speed", Column("", ""))).mechanical:
        raise BadInput(
            f"{source}: [motor] lacks 'pole_pairs'; add it, or map theta with mechanical = true"
        )
    if made is not None and not OF_TORQUE & set(found) and {"i_a", "i_b", "i_alpha"} & set(found):
        raise BadInput(
            f"{file}: phase currents tell no torque at an angle made from {made.of}, whose zero is "
            "unknown; map i_q, a torque, or the rotor's angle (theta)"
        )
    torque = _torque(file, found, made is None, constant, source, findings)
    load = found.get("load_torque", np.zeros(len(torque)))
    further = {n: found[n] for n in FURTHER if n in found}
    if "speed" in further:
        further["speed"] = further["speed"] / (pairs or 1.0)
    sixth = STEP / (pairs or 1.0) if made is not None and made.either_way else 0.0
    return MotionRecording(
        file, found["t"], found["theta"] / (pairs or 1.0), torque, load, further, own, sixth
    )


def motion_of(campaign: Campaign, why: str) -> MotionCampaign:
    """Return the motion of a campaign whose electrical part cannot be judged, `why` in one
    sentence.

    BadInput with that sentence where no rotor is free.
    """
    m, c = campaign.drive.motor, campaign.drive.converter
    pairs = float(m.pole_pairs)
    recordings = []
    for r in campaign.recordings:
        if r.rotor != "free":
            continue
        a, b = r.current
        i = (a + 1j * b) * np.exp(-1j * r.theta)
        torque = _air_gap(m, i)
        load = r.columns.get("load_torque", np.zeros(len(r.t)))
        sixth, zero = (STEP, r.made.turned) if r.made and r.made.either_way else (0.0, 0.0)
        own = MotionRecording(
            r.file, r.t, r.theta / pairs, torque, load, sixth=sixth / pairs, zero=zero / pairs
        )
        recordings.append(own)
    if not recordings:
        raise BadInput(f"{why}; no rotor is free either: record faster, or let the rotor turn")
    noise = math.hypot(c.current_noise, c.current_resolution / math.sqrt(12.0))
    deviations = {
        n: campaign.uncertainty[n]
        for n in ("inertia", "viscous_friction")
        if n in campaign.uncertainty
    }
    return MotionCampaign(
        campaign.name,
        1.5 * pairs * m.magnet_flux,
        m.inertia,
        m.viscous_friction,
        deviations,
        noise or None,
        math.tau / c.encoder_counts if c.encoder_counts else 0.0,
        tuple(recordings),
        campaign.findings,
        why,
    )


def _air_gap(m: Motor, i: NDArray[np.complex128]) -> Array:
    """Return the torque (N m) that a motor makes of currents (n,) in its frame (A); by its
    inductances at zero current where the saturated model ends before them."""
    try:
        d, q = flux_from_current(m.energy, i.real, i.imag)
    except PhysicsError:
        d, q = m.inductance_d * i.real, m.inductance_q * i.imag
    return np.asarray(1.5 * float(m.pole_pairs) * ((d + m.magnet_flux) * i.imag - q * i.real))


def with_replayable(campaign: Campaign) -> Campaign:
    """Return a campaign without free rotors whose angle is known to sixths alone, a finding each,
    where others tell more."""
    out = [
        r
        for r in campaign.recordings
        if r.rotor == "free" and r.made and r.made.either_way and "speed" not in r.source
    ]
    if not out or len(out) == len(campaign.recordings):
        return campaign
    found = [
        Finding(r.file, "theta", None, f"{r.file}: {r.made.of}: {BESIDE_OTHERS}")
        for r in out
        if r.made
    ]
    kept = tuple(r for r in campaign.recordings if r not in out)
    return replace(campaign, recordings=kept, findings=(*campaign.findings, *found))


def too_slow(campaign: Campaign) -> str | None:
    """Return why a campaign's samples stand too far apart for its electrical part, None where they
    do not."""
    m, period = campaign.drive.motor, campaign.drive.converter.sampling_period
    rows = f"sampling_period = {period:.3g} s is"
    return _too_slow(rows, period, m.resistance, max(m.inductance_d, m.inductance_q))


def _another_unit(period: float, resistance: float, inductance: float) -> bool:
    """Tell whether L/R is that of hardly any motor, and a thousand times of it (ohm for mohm, H for
    mH the other way) that of one whose currents the rows can follow."""
    slowest = inductance / resistance
    return slowest < SHORT_LAG and period <= THOUSAND * slowest


def _too_slow(rows: str, period: float, resistance: float, inductance: float) -> str | None:
    """Return that rows (in words) are further apart than currents settle, None where they are
    not."""
    slowest = inductance / resistance
    if period <= slowest:
        return None
    asked = (
        " (hardly a motor has so short a one: are the inductances in H, the resistance in ohm?)"
        if slowest < SHORT_LAG
        else ""
    )
    return (
        f"{rows} beyond L/R = {slowest:.3g} s{asked}: between two rows the currents settle, so "
        "electrical effects cannot be told and are no candidates; the motion alone is judged"
    )


def _torque(
    file: str,
    found: Mapping[str, Array],
    zero_known: bool,
    constant: float | None,
    source: str,
    findings: list[Finding],
) -> Array:
    """Return the torque (N m): as measured, or of i_q; of phase currents where the angle's zero is
    known."""
    phase = zero_known and ({"i_a", "i_b"} <= set(found) or "i_alpha" in found)
    if "i_q" not in found and not phase:
        if "torque" in found:
            return found["torque"]
        raise BadInput(
            f"{file}: neither voltages nor i_q nor torque; map i_q, phase currents or a torque"
        )
    if constant is None:
        raise BadInput(
            f"{source}: [motor] says no torque of a current; add torque_constant (N m per A of "
            "i_q), or magnet_flux and pole_pairs"
        )
    if "i_q" in found:
        return constant * found["i_q"]
    notes: list[Finding] = []
    i_a, i_b, i_c = phase_currents(file, found, notes).values()
    findings += notes
    i = (2.0 * i_a - i_b - i_c) / 3.0 + 1j * (i_b - i_c) / math.sqrt(3.0)
    return np.asarray(constant * (i * np.exp(-1j * found["theta"])).imag)


def _deviations(source: Source) -> dict[str, float]:
    stated = table_of(source.data, "uncertainty")
    return {
        n: v
        for n in ("inertia", "viscous_friction")
        if (v := finite(stated.get(n))) is not None and v >= 0.0
    }


def _stated(
    table: Mapping[str, Any], key: str, source: str, low: float, high: float
) -> float | None:
    """Return a number that a table may state; BadInput where it is none, or out of range."""
    if key not in table:
        return None
    value = finite(table[key])
    if value is None or not low <= value <= high:
        how = remedy(key, math.nan if value is None else value, low, high, "")
        raise BadInput(
            f"{source}: {key} = {as_toml(table[key])} is out of range; give a number in "
            f"[{low:g}, {high:g}]{how}"
        )
    return value

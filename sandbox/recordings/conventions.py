"""Which conventions a log follows that its columns do not say: what voltage and link have to do with each other, and
whether commands stand in the row in which they act.

What commands u become at the motor is u (1 + p x), x the link's reading over nominal less one:

    p = 0   the link varies as read, and the drive divides by the reading (or neither)     dc_link = "measured"
    p = -1  the drive divides by a reading, the link itself is steady                      dc_link = "steady"
    p = 1   the link varies as read, and the drive divides by the nominal voltage          command = "nominal"

p is a least-squares estimate from the flux balance (`checks.mistakes`) beside errors of what the nominal
model states, recording by recording.  A log shifted by one row leaves the balance of single samples open, and closes it
once it is shifted back; where commands hardly change from row to row it cannot be seen.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.parameters import Drive
from sandbox.recordings.campaign import Campaign, CampaignRecording, Finding
from sandbox.recordings.checks.balance import PHASES, VOLTAGES, balance
from sandbox.recordings.formats.parquet import with_volts

Array = NDArray[np.float64]
SURE, NEAR = 0.2, 0.4  # standard deviation of p, and distance from a whole number, up to which it is one
WINDOW, FEWEST = 4, 16  # samples, of the balance from which p is told; windows that a recording needs
STATED = 0.05  # relative standard deviation of what the nominal model states
ALIKE = 2.0  # times the deviation of white residuals: what a gap leaves is alike from window to window
MOST_ROWS = 4  # by which commands may stand off, as a logger's buffers make them
SHIFTS = tuple(sorted((k for k in range(-MOST_ROWS, MOST_ROWS + 1) if k), key=abs))
MOVED = (VOLTAGES, PHASES, ("theta",))  # columns that are logged together
SHIFTED = 0.25  # of the unexplained share: what shifting must leave of it
NOTICED = 0.02  # of the voltage's energy: less unexplained is no shift
WORDS = {
    0: ("varies as u_dc reads, and commands are what the motor got", {"dc_link": "measured"}),
    -1: ("is steady, though commands were divided by the reading u_dc", {"dc_link": "steady"}),
    1: ("varies as u_dc reads, and commands were divided by the nominal voltage", {"dc_link": "measured",
                                                                                  "command": "nominal"}),
}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Exponent:
    """Estimate of p and its standard deviation (infinite where the link's reading never changes)."""

    value: float
    deviation: float

    @property
    def whole(self) -> int | None:
        """The whole number that p is, None where it cannot be told."""
        near = round(self.value) if math.isfinite(self.value) else 0
        sure = self.deviation < SURE and abs(self.value - near) < NEAR + self.deviation and abs(near) <= 1
        return near if sure else None


def link_exponent(recordings: Sequence[CampaignRecording], drive: Drive) -> Exponent:
    """Return p of all recordings together, each with its own errors of resistance, inductances, flux and voltage."""
    top = bottom = 0.0
    for r in recordings:
        nominal = r.dc_bus_voltage or drive.converter.dc_bus_voltage
        b = balance(r.columns, drive, WINDOW)
        if len(b.rows) < FEWEST:
            continue
        mean = sum((r.u_dc[b.rows + k] for k in range(WINDOW)), np.zeros(1)) / WINDOW / nominal - 1.0
        told, rest = _parts(b.voltage * mean), -_parts(b.rest)
        known = _stated(r, b.rows, drive, b.voltage)
        noise = max(float(rest @ rest) / len(rest), 1e-12)
        inner = known.T @ known / noise + np.eye(known.shape[1]) / STATED**2
        told_only = told - known @ np.linalg.solve(inner, known.T @ told) / noise
        top, bottom = top + float(told_only @ rest) / noise, bottom + float(told_only @ told) / noise
    return Exponent(top / bottom, ALIKE * bottom**-0.5) if bottom > 0.0 else Exponent(0.0, math.inf)


def _parts(x: NDArray[Any]) -> Array:
    return np.concatenate([x.real, x.imag])


def _stated(r: CampaignRecording, rows: NDArray[np.int64], drive: Drive, voltage: Any) -> Array:
    """Return what stated numbers contribute to the balance (V), a column each: link, R, flux.

    Not inductances: steps of the readings hold the very noise of the balance, which a fit would explain with them; an
    error of theirs is like one of the link.
    """
    m, ends = drive.motor, rows + WINDOW
    turned = np.exp(1j * r.theta[ends]) - np.exp(1j * r.theta[rows])
    flux = m.magnet_flux * turned / (WINDOW * drive.converter.sampling_period)
    between = m.resistance * 0.5 * (_current(r, rows) + _current(r, ends))
    return np.stack([_parts(x) for x in (voltage, between, flux)], axis=1)


def _current(r: CampaignRecording, rows: NDArray[np.int64]) -> Any:
    """Return the current vector (A, complex) at some rows."""
    a, b, c = (r.columns[n][rows] for n in PHASES)
    return (2.0 * a - b - c) / 3.0 + 1j * ((b - c) / math.sqrt(3.0))


def with_link(campaign: Campaign) -> Campaign:
    """Return a campaign whose [drive] says what its link does: what it states, or else what recordings show.

    A finding says what was found, or that what is stated is contradicted.
    """
    c = campaign.drive.converter
    found = link_exponent(campaign.recordings, campaign.drive).whole
    if found is None or (found == -1 and c.dc_link != "measured") or (found == 0 and c.dc_link == "measured"):
        return campaign
    text, keys = WORDS[found]
    says, write = f"the DC link {text}", ", ".join(f'{k} = "{v}"' for k, v in keys.items())
    if c.dc_link is not None:
        note = f'recordings contradict [drive] dc_link = "{c.dc_link}": {says}; write {write} in [drive]'
    else:
        note = f"as recordings show it, {says}; taken so, write {write} in [drive] to state it"
        campaign = _taken(campaign, found)
    finding = Finding(campaign.recordings[0].file, "u_dc", None, note)
    return dataclasses.replace(campaign, findings=(*campaign.findings, finding))


def _taken(campaign: Campaign, found: int) -> Campaign:
    """Return a campaign read as an exponent of 0 or 1 says."""
    converter = dataclasses.replace(campaign.drive.converter, dc_link="measured")
    recordings = campaign.recordings
    if found == 1:
        nominal = dataclasses.replace(converter, command="nominal")
        recordings = tuple(with_volts(r, nominal) for r in recordings)
    drive = dataclasses.replace(campaign.drive, converter=converter)
    return dataclasses.replace(campaign, drive=drive, recordings=recordings)


def shifted(recordings: Sequence[CampaignRecording], drive: Drive) -> list[Finding]:
    """Return a finding where commands, currents or the angle, shifted by some rows, explain all recordings in which
    commands jump far better; commands first, where others do not do so twice as well."""
    told: dict[tuple[int, tuple[str, ...]], list[tuple[str, float, float]]] = {}
    for r in recordings:
        as_is = _open(r, drive, 0)
        if as_is <= NOTICED:
            continue
        left = {(rows, moved): _open(r, drive, rows, moved) for moved in MOVED for rows in SHIFTS}
        best = min(left, key=lambda k: left[k] * (1.0 if k[1] == VOLTAGES else 2.0))
        if left[best] < SHIFTED * as_is:
            told.setdefault(best, []).append((r.file, as_is, left[best]))
    if len(told) != 1:
        return []
    (rows, moved), found = next(iter(told.items()))
    file, before, after = found[0]
    many = "one sample" if abs(rows) == 1 else f"{abs(rows)} samples"
    by = "one row" if abs(rows) == 1 else f"{abs(rows)} rows"
    when = f"{many} {'later than' if rows > 0 else 'before'}"
    effect = {VOLTAGES: "pwm_delay", PHASES: "current_sampling"}.get(moved)
    late = f" (a drive that is late itself shows as {effect})" if effect else ""
    stand = "it stands" if moved == ("theta",) else "they stand"
    what = "commands act" if moved == VOLTAGES else "currents are of" if moved == PHASES else "the angle is of"
    more = f" (and in {len(found) - 1} other recordings)" if len(found) > 1 else ""
    text = (
        f"{file}: column '{moved[0]}': {what} {when} the row in which {stand}: {100.0 * before:.3g} % of the "
        f"voltage is unexplained, shifted by {by.replace('one', 'a')} {100.0 * after:.3g} %{more}; if the log is "
        f"shifted, move {', '.join(moved)} {'down' if rows > 0 else 'up'} by {by}{late}"
    )
    return [Finding(file, moved[0], None, text)]


def _open(r: CampaignRecording, drive: Drive, rows: int, moved: Sequence[str] = VOLTAGES) -> float:
    """Return the share of the voltage that stays open sample by sample, columns moved down by `rows`, noise off."""
    n = len(r.t)
    if n <= 2 * MOST_ROWS + 2:
        return 0.0
    own = slice(MOST_ROWS, n - MOST_ROWS)
    columns = {name: r.columns[name][own] for name in ("theta", *PHASES, *VOLTAGES)}
    columns |= {name: r.columns[name][own.start - rows : own.stop - rows] for name in moved}
    b = balance(columns, drive, 1)
    return max(b.share - b.noise, 0.0)

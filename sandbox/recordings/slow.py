"""Logs whose rows are several PWM periods apart: what the commands do between two rows.

[drive] pwm_frequency says how many periods a row is (`Converter.periods_a_row`), and between_rows which of these holds:

    "held"          the drive gives a new voltage once a row: it stands still in the stator's frame until the next one
    "interpolated"  the drive updates in every PWM period and the log shows each n-th: u_d, u_q go straight from row to
                    row and turn with the rotor

If it is not stated, the flux balance (`checks.balance`) of the recordings tells: what it leaves open with held commands
is p times what interpolation changes, p = 0 or 1, beside errors of what the nominal model states and a voltage that
each leg loses.  Where that does not tell, commands count as held.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from model.errors import BadInput
from model.parameters import Drive
from sandbox.recordings.campaign import Campaign, CampaignRecording, Finding
from sandbox.recordings.checks.balance import balance
from sandbox.recordings.row_commands import HELD, INTERPOLATED

WORDS = {HELD: "held until the next row", INTERPOLATED: "interpolated in the rotor's frame"}
SURE, NEAR = 0.2, 0.2  # standard deviation of the share, and distance from a whole number, up to which it is one
WINDOW, FEWEST = 4, 16  # rows, of the balance that tells; windows that a recording needs


def with_slow_rows(campaign: Campaign) -> Campaign:
    """Return a campaign of a slow log that says what commands do between rows, and what such a log cannot show."""
    c = campaign.drive.converter
    if c.periods_a_row == 1 or not campaign.recordings:
        return campaign
    way, told = c.between_rows, "as [drive] between_rows says"
    if way is None:
        share, deviation = interpolated(campaign)
        sure = deviation < SURE and min(abs(share), abs(share - 1.0)) < NEAR + deviation
        way = INTERPOLATED if sure and share > 0.5 else HELD
        told = f'as the recordings show; write between_rows = "{way}" in [drive] to state it'
        if not sure:
            told = f'nothing in the recordings tells; [drive] between_rows = "{INTERPOLATED}" is the other way'
    converter = dataclasses.replace(c, between_rows=way)
    first = campaign.recordings[0].file
    text = (
        f"{first}: rows are {c.periods_a_row} PWM periods apart: the drive is simulated in every period, its commands "
        f"{WORDS[way]} ({told}). What happens within {c.sampling_period:.3g} s is not seen: the current controller at "
        f"work, injection above {0.5 / c.sampling_period:.4g} Hz, delays below a row; log every period to see it"
    )
    injected = [r.file for r in campaign.recordings if r.injection_axis != "none"]
    if injected and campaign.drive.injection.frequency > 0.25 / c.sampling_period:
        raise BadInput(
            f"{injected[0]}: injection of {campaign.drive.injection.frequency:g} Hz needs four rows a period and more, "
            f"{1.0 / c.sampling_period:g} rows a second are logged: log every PWM period while injecting"
        )
    findings = [Finding(first, "t", None, text)]
    drive = dataclasses.replace(campaign.drive, converter=converter)
    return dataclasses.replace(campaign, drive=drive, findings=(*campaign.findings, *findings))


def interpolated(campaign: Campaign) -> tuple[float, float]:
    """Return p of all recordings together and its standard deviation (infinite where commands never change)."""
    top = bottom = 0.0
    held, other = (_drive(campaign.drive, way) for way in (HELD, INTERPOLATED))
    for r in campaign.recordings:
        b, more = balance(r.columns, held, WINDOW), balance(r.columns, other, WINDOW)
        if len(b.rows) < FEWEST or (b.doubtful and more.doubtful):
            continue
        change, rest = _parts(more.voltage - b.voltage), _parts(b.rest)
        known = _beside(r, b.rows, b.voltage)
        change = change - known @ np.linalg.lstsq(known, change, rcond=1e-9)[0]
        left = rest - known @ np.linalg.lstsq(known, rest, rcond=1e-9)[0]
        own = float(change @ change)
        if own <= 1e-12 * float(_parts(b.voltage) @ _parts(b.voltage)):
            continue
        left -= change * (float(change @ left) / own)
        noise = max(float(left @ left) / len(left), 1e-12)
        top, bottom = top - float(change @ rest) / noise, bottom + own / noise
    return (top / bottom, bottom**-0.5) if bottom > 0.0 else (0.0, math.inf)


def _beside(r: CampaignRecording, rows: NDArray[np.int64], voltage: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return what else may be open in a balance, a column each: link, resistance, flux, a voltage that legs lose."""
    turn = np.exp(1j * r.theta)
    phases = np.stack([r.i_a, r.i_b, r.i_c])
    star = (2.0 / 3.0) * np.exp(2j * math.pi / 3.0 * np.arange(3))
    columns = [voltage]
    step = np.diff(phases, axis=1)
    lost = np.diff(np.abs(phases), axis=1) / np.where(step == 0.0, 1.0, step)  # mean sign of a straight line
    lost = np.where(step == 0.0, np.sign(phases[:, 1:]), lost)
    for x in (star @ (phases[:, 1:] + phases[:, :-1]), star @ lost):
        total = np.concatenate([[0j], np.cumsum(x)])
        columns.append((total[rows + WINDOW] - total[rows]) / WINDOW)
    columns.append(turn[rows + WINDOW] - turn[rows])
    return np.stack([_parts(x) for x in columns], axis=1)


def _parts(x: NDArray[np.complex128]) -> NDArray[np.float64]:
    return np.concatenate([x.real, x.imag])


def _drive(drive: Drive, way: str) -> Drive:
    """Return a drive whose log is read in one way."""
    return dataclasses.replace(drive, converter=dataclasses.replace(drive.converter, between_rows=way))

"""Logs whose rows are several PWM periods apart: what the commands do between two rows.

[drive] pwm_frequency says how many periods a row is (`Converter.periods_a_row`), and between_rows
which of these holds:

    "held"          the drive gives a new voltage once a row: it stands still in the stator's frame until the next one
    "interpolated"  the drive updates in every PWM period and the log shows each n-th: u_d, u_q go
    straight from row to
                    row and turn with the rotor

If it is not stated, the flux balance (`checks.balance`) of the recordings tells: what it leaves
open with held commands is p times what interpolation changes, p = 0 or 1, beside errors of what the
nominal model states and a voltage that each leg loses.  The size of the voltage is one of these
errors: where a share a of it does not act, a share 1 - a of the change is seen.  Commands do
nothing where dead time holds the currents at zero (a = 1): nothing there tells what they are.  What
stays unexplained is no white noise, see `_deviation`.  Where nothing tells, commands count as held.
"""  # noqa: E501

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from model.errors import BadInput
from model.parameters import Drive
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.recordings.checks.balance import Complex, balance
from sandbox.recordings.findings import Doubt, Finding
from sandbox.recordings.rows.aliased import refuse_aliased
from sandbox.recordings.rows.commands import HELD, INTERPOLATED
from sandbox.recordings.stamps import MOST_SEGMENTS, SHORTEST, segment_name

WORDS = {HELD: "held until the next row", INTERPOLATED: "interpolated in the rotor's frame"}
# standard deviations of the share to 0.5, and distance from a whole number: it counts as one
SURE, NEAR = 2.0, 0.2
EXACT = 0.01  # deviation of a share: none counts as better known
SETTLED = 3.0  # times L/R
# times the usual change of a step, and times the sensors' noise: a command that jumps
JUMP, SEEN = 8.0, 10.0
WINDOW, FEWEST = 4, 16  # rows, of the balance that tells; windows that a recording needs


def with_slow_rows(campaign: Campaign) -> Campaign:
    """Return a campaign of a slow log that says what commands do between rows, and what such a log
    cannot show."""
    c = campaign.drive.converter
    refuse_aliased(campaign.recordings, campaign.drive)
    if c.periods_a_row == 1 or not campaign.recordings:
        return campaign
    way, reason = c.between_rows, "as [drive] between_rows says"
    if way is None:
        share, deviation = interpolated(campaign)
        sure = (
            abs(share - 0.5) > SURE * deviation
            and min(abs(share), abs(share - 1.0)) < NEAR + deviation
        )
        way = INTERPOLATED if sure and share > 0.5 else HELD
        reason = f'as the recordings show; write between_rows = "{way}" in [drive] to state it'
        if not sure:
            reason = (
                f'nothing in the recordings tells; [drive] between_rows = "{INTERPOLATED}" '
                "is the other way"
            )
    converter = dataclasses.replace(c, between_rows=way)
    first = campaign.recordings[0].file
    text = (
        f"{first}: rows are {c.periods_a_row} PWM periods apart: the drive is simulated in every "
        f"period, its commands {WORDS[way]} ({reason}). What happens within "
        f"{c.sampling_period:.3g} s is not seen: the current controller at work, injection above "
        f"{0.5 / c.sampling_period:.4g} Hz, delays below a row; log every period to see it"
    )
    injected = [r.file for r in campaign.recordings if r.injection_axis != "none"]
    if injected and campaign.drive.injection.frequency > 0.25 / c.sampling_period:
        raise BadInput(
            f"{injected[0]}: injection of {campaign.drive.injection.frequency:g} Hz needs four "
            f"rows a period and more, {1.0 / c.sampling_period:g} rows a second are logged: log "
            "every PWM period while injecting"
        )
    findings, recordings = [Finding(first, "t", None, text)], list(campaign.recordings)
    drive = dataclasses.replace(campaign.drive, converter=converter)
    if way == INTERPOLATED:
        recordings = []
        for r in campaign.recordings:
            parts, jumps = without_jumps(r, drive)
            recordings += parts
            findings += jumps
    unseen = _unseen(recordings, drive) if way == INTERPOLATED else 0.0
    if unseen:
        text = (
            f"{first}: what commands do between rows leaves currents open by {unseen:.3g} A "
            "rms, which counts as noise"
        )
        findings.append(Finding(first, "u_alpha", None, text))
    return dataclasses.replace(
        campaign,
        drive=drive,
        recordings=tuple(recordings),
        findings=(*campaign.findings, *findings),
        unseen=math.hypot(campaign.unseen, unseen),
    )


def _unseen(recordings: Sequence[CampaignRecording], drive: Drive) -> float:
    """Return the current (A rms of a phase) that commands leave open which scatter about straight
    lines.

    Second differences of white values have six times their variance v.  A row's mean voltage is off
    by half of what both ends are off, and the next one shares one of them: its variance is v/2, and
    v/4 with the next one's.  R and L keep a share x = exp(-R T / L) of the current through a row of
    T and add (1 - x) / R of the voltage; so

        i' = x i + (1 - x) / R u,  <i^2> = ((1 - x) / R)^2 (v/2 + 2 x v/4) / (1 - x^2) = v (1 - x) /
        (2 R^2).
    """
    squares = rows = 0.0
    for r in recordings:
        bend = np.abs(np.diff((r.u_alpha + 1j * r.u_beta) * np.exp(-1j * r.theta), 2))
        squares, rows = squares + 0.5 * float(bend @ bend) / 6.0, rows + len(bend)
    if not rows:
        return 0.0
    m, period = drive.motor, drive.converter.sampling_period
    gathered = [
        0.5 * squares / rows * -math.expm1(-m.resistance * period / inductance) / m.resistance**2
        for inductance in (m.inductance_d, m.inductance_q)
    ]
    return math.sqrt(0.5 * sum(gathered))


def without_jumps(
    r: CampaignRecording, drive: Drive
) -> tuple[list[CampaignRecording], list[Finding]]:
    """Return the parts of a recording between rows where the command jumps, and a finding; parts of
    SHORTEST rows and more, or the whole where there are none.

    A jump is a step of u_d, u_q unlike both steps beside it: JUMP times the usual difference of two
    steps, and enough to leave the current open by SEEN times the sensors' noise, as the jump may
    come anywhere between the rows.
    """
    step = np.diff((r.u_alpha + 1j * r.u_beta) * np.exp(-1j * r.theta))
    if len(step) < SHORTEST:
        return [r], []
    turn = np.abs(np.diff(step))
    alone = np.minimum(np.append(turn, np.inf), np.insert(turn, 0, np.inf))
    c, m = drive.converter, drive.motor
    noise = math.hypot(c.current_noise, c.current_resolution / math.sqrt(12.0))
    least = SEEN * noise * min(m.inductance_d, m.inductance_q) / (0.5 * c.sampling_period)
    jumps = np.flatnonzero(alone > max(JUMP * float(np.median(turn)), least))
    if not jumps.size:
        return [r], []
    k = int(jumps[np.argmax(alone[jumps])])
    often = "once" if jumps.size == 1 else f"{jumps.size} times"
    said = (
        f"{r.file}: the command jumps between two rows ({often}, by {abs(step[k]):.3g} V after row "
        f"{k}); what it did there is not known"
    )
    bounds = [0, *(int(j) + 1 for j in jumps), len(r.t)]
    kept = [(a, b) for a, b in itertools.pairwise(bounds) if b - a >= SHORTEST]
    kept = sorted(sorted(kept, key=lambda x: x[0] - x[1])[:MOST_SEGMENTS])
    if not kept:
        return [r], [
            Doubt(
                r.file, "u_alpha", k, f"{said}, and may look like an effect: log every PWM period"
            )
        ]
    left = len(r.t) - sum(b - a for a, b in kept)
    settle = math.ceil(
        SETTLED * max(m.inductance_d, m.inductance_q) / m.resistance / c.sampling_period
    )
    parts = f"{len(kept)} part{'s' if len(kept) > 1 else ''}"
    text = (
        f"{said}: it is cut there into {parts}, {settle} rows after a jump only let the "
        "currents settle"
    )
    text += f"; {left} rows of shorter parts are left out" if left else ""
    return [_part(r, n, a, b, settle) for n, (a, b) in enumerate(kept, 1)], [
        Finding(r.file, "u_alpha", k, text)
    ]


def _part(
    r: CampaignRecording, number: int, first: int, last: int, settle: int
) -> CampaignRecording:
    """Return rows first to last - 1 of a recording as one of its own, after a jump without those
    that settle."""
    own = min(first + settle, first + (last - first) // 2) if first else first
    columns, before = (
        {name: x[rows].copy() for name, x in r.columns.items()}
        for rows in (slice(own, last), slice(first, own))
    )
    begins = float(columns["t"][0])
    columns["t"] -= begins
    before["t"] -= begins
    return dataclasses.replace(
        r,
        file=segment_name(r.file, number),
        of=r.origin,
        starts_at=r.starts_at + begins,
        columns=columns,
        settling=before if own > first else {},
    )


def interpolated(campaign: Campaign) -> tuple[float, float]:
    """Return p of all recordings together and its standard deviation (infinite where nothing
    tells).

    Recordings count by their own deviations; these do not shrink with their number, as the same gap
    is in all of them.
    """
    found = [x for r in campaign.recordings if (x := _share(r, campaign.drive)) is not None]
    if not found:
        return 0.0, math.inf
    share, deviation = np.array(found).T
    return float(np.average(share, weights=deviation**-2)), float(
        np.average(deviation, weights=deviation**-2)
    )


def _share(r: CampaignRecording, drive: Drive) -> tuple[float, float] | None:
    """Return p of a recording and its standard deviation; None where what is open is not about
    it."""
    b, more = (balance(r.columns, _drive(drive, way), WINDOW) for way in (HELD, INTERPOLATED))
    if len(b.rows) < FEWEST or (b.doubtful and more.doubtful):
        return None
    change, rest = _parts(more.voltage - b.voltage), _parts(b.rest)
    known = _open_columns(r, b.rows, b.voltage)
    own = change - known @ np.linalg.lstsq(known, change, rcond=1e-9)[0]
    if float(own @ own) <= 1e-12 * float(_parts(b.voltage) @ _parts(b.voltage)):
        return None
    shapes = np.column_stack([known, change])
    sizes = np.linalg.lstsq(shapes, rest, rcond=1e-9)[0]
    left, acts = rest - shapes @ sizes, 1.0 - float(sizes[0])
    if acts <= 0.0 or float(left @ left) > acts**2 * float(own @ own):
        return None
    return -float(sizes[-1]) / acts, max(_deviation(own, left) / acts, EXACT)


def _deviation(own: NDArray[np.float64], left: NDArray[np.float64]) -> float:
    """Return the standard deviation of the size of a shape that was fitted and left a misfit;
    `_parts` of both.

    It is that of their product's sum, for a misfit of the spectrum that it shows (Bartlett's
    formula, by transforms), or up to sqrt(2) more, as phases may agree: the square is left^2 /
    (own^2 n) for white noise, and some left^2 / own^2 where both are one slow wave.
    """
    n = len(own) // 2
    shape, misfit = (np.abs(np.fft.fft(x[:n] + 1j * x[n:], 2 * n)) ** 2 for x in (own, left))
    return math.sqrt(float(shape @ misfit) / (2 * n * n)) / float(own @ own)


def _open_columns(
    r: CampaignRecording, rows: NDArray[np.int64], voltage: Complex
) -> NDArray[np.float64]:
    """Return what else may be open in a balance, a column each: link, resistance, flux, a voltage
    that legs lose."""
    turn = np.exp(1j * r.theta)
    phases = np.stack([r.i_a, r.i_b, r.i_c])
    star = (2.0 / 3.0) * np.exp(2j * math.pi / 3.0 * np.arange(3))
    columns = [voltage]
    step = np.diff(phases, axis=1)
    # mean sign of a straight line
    lost = np.diff(np.abs(phases), axis=1) / np.where(step == 0.0, 1.0, step)
    lost = np.where(step == 0.0, np.sign(phases[:, 1:]), lost)
    for x in (star @ (phases[:, 1:] + phases[:, :-1]), star @ lost):
        total = np.concatenate([[0j], np.cumsum(x)])
        columns.append((total[rows + WINDOW] - total[rows]) / WINDOW)
    columns.append(turn[rows + WINDOW] - turn[rows])
    return np.stack([_parts(x) for x in columns], axis=1)


def _parts(x: Complex) -> NDArray[np.float64]:
    return np.concatenate([x.real, x.imag])


def _drive(drive: Drive, way: str) -> Drive:
    """Return a drive whose log is read in one way."""
    return dataclasses.replace(
        drive, converter=dataclasses.replace(drive.converter, between_rows=way)
    )

"""The zero of an angle that was made of a speed, of Hall states, or of nothing at a locked rotor.

It is where the flux balance of the nominal model (`checks.readings`) leaves least, its sense with
it where that is unknown; of a speed also the drift, as a clock or a filter that is a little off
gives it: zeros of parts of a recording lie on a straight line over time.  Resistance and magnet
flux do not turn the voltage of a current on q, L_q does: as voltage turns with the rotor, an error
dL_q moves the zero by dL_q i_q over the flux that shows it.  So the zero stays open by `Made.zero`
in whatever is made of the recording, and an offset of the angle cannot be told.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence

import numpy as np

from model.array_types import Array
from model.parameters import Drive
from sandbox.recordings.angle.commutation import STEP
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.recordings.checks.readings import ZEROS, Products
from sandbox.recordings.findings import Doubt, Finding

PARTS, FEWEST = 8, 64  # of a recording whose zero may drift; rows of one
# of the sharpest part: one below says nothing (chosen: its zero is 4 to 5 times as uncertain)
SHARP = 0.05
# rad over a recording, a drift below is none (chosen: left in, it opens 0.1^2 / 12 of the voltage)
DRIFTS = 0.1
WELL = 0.35  # of the voltage that stays open: beyond it the zero is in doubt (chosen)
# of the voltage that the zero moves: below it no zero is told (no rotor turns, no saliency; chosen)
OPEN = 0.002
# rad, at least, of an angle made of a speed, and of any zero (chosen: a step of the zeros tried is
# 0.009)
STRAY = 0.01
# of L_q, its deviation where a campaign states none: what saturation takes on common motors
UNSTATED = 0.2
# rad: most that a zero is left open by, as far as a slope in it holds (sin 0.5 = 0.48)
UNTOLD = 0.5
LED = 3  # times that a lag is looked for, in the angle led by what was found before
LATEST = 0.02  # s, a lag that moves no zero by STRAY cannot be told
TWICE = 2.0  # times less must stay open the other way round, or with a drift


def with_zeros(campaign: Campaign) -> Campaign:
    """Return a campaign whose angles that were made have the zero that its recordings show, with a
    finding each."""
    if all(r.made is None for r in campaign.recordings):
        return campaign
    share = campaign.uncertainty.get("inductance_q", UNSTATED)
    led, late = _without_lag(campaign)
    done = [with_zero(r, campaign.drive, share) for r in led]
    findings = (*campaign.findings, *late, *(f for _, f in done if f is not None))
    recordings = tuple(r for r, _ in done)
    unseen = _unseen(recordings, campaign.drive)
    if unseen:
        r = next(r for r in recordings if _by_states(r))
        text = (
            f"{r.file}: what the angle misses between two changes leaves currents open by "
            f"{unseen:.2g} A rms, which "
        )
        findings = (*findings, Finding(r.file, "theta", None, f"{text}counts as noise"))
    return dataclasses.replace(campaign, recordings=recordings, findings=findings, unseen=unseen)


def _without_lag(campaign: Campaign) -> tuple[tuple[CampaignRecording, ...], list[Finding]]:
    """Return recordings whose angles of a speed are turned on by what that lags, with a finding;
    as they are where voltages show no lag."""
    own = [
        r
        for r in campaign.recordings
        if r.made is not None and "speed" in r.source and not r.made.either_way
    ]
    turned = [_Turned(r, campaign.drive, 1.0) for r in own if r.rotor != "locked"]
    lag, late = 0.0, turned
    for _ in range(LED):  # zeros of parts are those of their mean speeds
        lag += _lag(late)
        late = [_Turned(_led(t.r, lag), campaign.drive, 1.0) for t in turned]
    if not lag or _cost(late) + math.log(TWICE) > _cost(turned):
        return campaign.recordings, []
    r = turned[0].r
    column = r.source["speed"]
    text = (
        f"{r.file}: column '{column}' {'lags' if lag > 0.0 else 'leads'} by {1e3 * abs(lag):.2g} "
        "ms, as voltages show (a filter of the drive); the angle made of it is turned on by that"
    )
    led = tuple(_led(r, lag) if r in own else r for r in campaign.recordings)
    return led, [Finding(r.file, "theta", None, text)]


def _led(r: CampaignRecording, lag: float) -> CampaignRecording:
    """Return a recording whose angle is turned on by a lag (s) times its speed."""
    theta = r.theta + lag * np.gradient(r.theta, r.t)
    return dataclasses.replace(r, columns={**r.columns, "theta": theta})


def _lag(turned: Sequence[_Turned]) -> float:
    """Return the lag (s) that zeros of parts of recordings show against their speeds, each
    recording with a zero and a drift of its own; 0 where no speed varies."""
    rows, read, weights = [], [], []
    for k, x in enumerate(turned):
        sharp, speed = np.ptp(x.curves, axis=1), x.speeds()
        clear = np.flatnonzero(sharp > SHARP * sharp.max())
        if len(clear) < 4:
            continue
        own = np.unwrap(_lowest(x.curves[clear]))
        each = np.zeros((len(clear), 2 * len(turned)))
        each[:, 2 * k], each[:, 2 * k + 1] = 1.0, x.middle[clear] / len(x.theta)
        rows.append(np.column_stack([speed[clear], each]))
        read.append(own)
        weights.append(np.sqrt(sharp[clear] / sharp.max()))
    if not rows:
        return 0.0
    w = np.concatenate(weights)
    a, b = np.concatenate(rows) * w[:, None], np.concatenate(read) * w
    rest = a[:, 0] - a[:, 1:] @ np.linalg.lstsq(a[:, 1:], a[:, 0], rcond=None)[0]
    energy = float(rest @ rest)
    return float(rest @ b) / energy if energy * LATEST**2 > STRAY**2 else 0.0


def _lowest(curves: Array) -> Array:
    """Return where curves over ZEROS are lowest, by the parabola through the three points there."""
    k, n = np.argmin(curves, axis=1), curves.shape[1]
    before, least, after = (
        np.take_along_axis(curves, ((k + d) % n)[:, None], axis=1)[:, 0] for d in (-1, 0, 1)
    )
    bend = np.maximum(before - 2.0 * least + after, 1e-300)
    return np.asarray(ZEROS[k] + 0.5 * (before - after) / bend * (ZEROS[1] - ZEROS[0]))


def _cost(turned: Sequence[_Turned]) -> float:
    """Return the mean logarithm of what stays open of recordings, beside a drift that is none."""
    return float(np.mean([math.log(x.least + DRIFTS**2 / 12.0) for x in turned]))


def _by_states(r: CampaignRecording) -> bool:
    """Tell whether a rotor that turns has an angle that states tell and a speed follows."""
    return r.made is not None and r.made.either_way and "speed" in r.source and r.rotor != "locked"


def _unseen(recordings: Sequence[CampaignRecording], drive: Drive) -> float:
    """Return the current (A rms of a phase) that an angle of states leaves open, in the mean of all
    rows.

    An angle that is off by x turns the flux f that voltage is balanced with: in the rotor's frame

        L i' + (R + j w L) i = -f (x' + j w x),

    and x goes from change to change, so |x'| is about w x / (pi / 3).
    """
    m, squares, rows = drive.motor, 0.0, 0
    inductance = min(m.inductance_d, m.inductance_q)
    for r in recordings:
        rows += len(r.t)
        if not _by_states(r) or r.made is None:
            continue
        off, pace = (
            r.made.count / math.sqrt(12.0),
            np.gradient(r.theta, r.t) * math.hypot(1.0, 1.0 / STEP),
        )
        flux = np.hypot(m.magnet_flux, (m.inductance_d - m.inductance_q) * np.hypot(*r.current))
        open_by = flux * pace * off / np.hypot(m.resistance, inductance * pace)
        squares += 0.5 * float(open_by @ open_by)
    return math.sqrt(squares / rows) if rows else 0.0


def with_zero(
    r: CampaignRecording, drive: Drive, share: float
) -> tuple[CampaignRecording, Finding | None]:
    """Return a recording whose made angle begins at the zero that fits best; share: relative
    deviation of L_q."""
    if r.made is None:
        return r, None
    ways = [_Turned(r, drive, sense) for sense in ((1.0, -1.0) if r.made.either_way else (1.0,))]
    best = ways[1] if len(ways) > 1 and ways[1].least * TWICE < ways[0].least else ways[0]
    said = r.made.of or "a locked rotor without an angle"
    if best.moved < OPEN:
        text = (
            f"{r.file}: {said}: the zero of the angle makes no difference to its voltages, 0 "
            "stands for it"
        )
        same = dataclasses.replace(r, made=dataclasses.replace(r.made, zero=UNTOLD))
        return same, Finding(r.file, "theta", None, text)
    theta, drift, stray = best.angle()
    count = r.made.count or (math.sqrt(12.0) * max(stray, STRAY) if r.made.of else 0.0)
    turned = float(np.mean(theta - best.sense * r.theta))
    made = dataclasses.replace(
        r.made, count=count, zero=_left_open(r, drive, share, stray), turned=turned
    )
    back = ", counted backwards" if best.sense < 0.0 else ""
    slow = f", and it drifts by {drift:.2g} rad" if drift else ""
    text = (
        f"{r.file}: {said}: the angle's zero, {math.degrees(best.zero):.0f} degrees{back}{slow}, "
        f"is where its voltages fit the nominal model best ({100.0 * best.least:.2g} % stay open): "
        "an offset of the angle cannot be told, and L_q and all that turns the voltage only "
        "beside it"
    )
    kind = Doubt if best.least > WELL else Finding
    return dataclasses.replace(r, columns={**r.columns, "theta": theta}, made=made), kind(
        r.file, "theta", None, text
    )


def _left_open(r: CampaignRecording, drive: Drive, share: float, stray: float) -> float:
    """Return the standard deviation (rad) of a zero: what L_q moves it by, and how far parts stray
    from it.

    The magnets' flux shows it where a rotor turns, saliency elsewhere; |i| stands for i_q, which
    the zero itself tells.
    """
    m, current = drive.motor, float(np.sqrt(np.mean(r.current[0] ** 2 + r.current[1] ** 2)))
    magnets = m.magnet_flux if np.ptp(r.theta) > 0.0 else 0.0
    flux = max(magnets, abs(m.inductance_d - m.inductance_q) * current, 1e-12)
    return min(math.hypot(share * m.inductance_q * current / flux, max(stray, STRAY)), UNTOLD)


class _Turned:
    """A recording read one way round: what stays open of its voltages over the zero of its angle,
    part by part."""

    def __init__(self, r: CampaignRecording, drive: Drive, sense: float) -> None:
        self.r, self.sense = r, sense
        self.theta = sense * r.theta
        n = len(r.t)
        parts = PARTS if r.made is not None and r.made.of and n >= PARTS * FEWEST else 1
        bounds = np.linspace(0, n, parts + 1).astype(int)
        self.middle = 0.5 * (bounds[:-1] + bounds[1:])
        self.products = []
        for a, b in itertools.pairwise(bounds):
            columns = {name: x[a:b] for name, x in {**r.columns, "theta": self.theta}.items()}
            self.products.append(
                Products(dataclasses.replace(r, columns=columns, source={}), drive, 0.0, 0.0)
            )
        self.energy = np.array(
            [max(float(p.of(None, None, 1.0)[0, 0].real), 0.0) for p in self.products]
        )
        self.curves = self._open(ZEROS)
        self.zero = self._fine()
        total = max(float(self.energy.sum()), 1e-300)
        self.least = float(self._open(np.array([self.zero])).sum()) / total
        self.moved = float(np.ptp(self.curves.sum(axis=0))) / total

    def speeds(self) -> Array:
        """Return the mean speed of each part (rad/s)."""
        bounds = np.round(np.linspace(0, len(self.theta) - 1, len(self.products) + 1)).astype(int)
        return np.asarray(np.diff(self.theta[bounds]) / np.diff(self.r.t[bounds]))

    def _open(self, zeros: Array) -> Array:
        """Return the squares that stay open in each part (parts, zeros)."""
        return np.stack(
            [e * p.shares((), zeros) for e, p in zip(self.energy, self.products, strict=True)]
        )

    def _fine(self) -> float:
        """Return the zero of all parts together, between those of the grid."""
        near = float(ZEROS[int(np.argmin(self.curves.sum(axis=0)))])
        around = near + np.linspace(-1.0, 1.0, 41) * (ZEROS[1] - ZEROS[0])
        return float(around[int(np.argmin(self._open(around).sum(axis=0)))])

    def angle(self) -> tuple[Array, float, float]:
        """Return the angle (n,) with its zero and its drift, the drift (rad over the recording),
        and how far parts stray from it (rad rms)."""
        sharp = np.ptp(self.curves, axis=1)
        clear = np.flatnonzero(sharp > SHARP * sharp.max())
        if len(clear) < 3:
            return self.theta + self.zero, 0.0, 0.0
        own = np.unwrap(ZEROS[np.argmin(self.curves[clear], axis=1)])
        place = self.middle[clear] / len(self.theta)
        rate, at = np.polyfit(place, own, 1, w=np.sqrt(sharp[clear]))
        stray = float(np.sqrt(np.average((own - at - rate * place) ** 2, weights=sharp[clear])))
        line = at + rate * self.middle / len(self.theta)
        own_open = sum(float(self._open(np.array([z]))[k, 0]) for k, z in enumerate(line))
        if abs(rate) < DRIFTS or own_open * TWICE > self.least * float(self.energy.sum()):
            return self.theta + self.zero, 0.0, stray
        self.least = own_open / max(float(self.energy.sum()), 1e-300)
        self.zero = float(math.remainder(at + 0.5 * rate, math.tau))
        return (
            self.theta + at + rate * np.arange(len(self.theta)) / len(self.theta),
            float(rate),
            stray,
        )

"""Which conventions a log follows that its columns do not say: what voltage and link have to do
with each other.

What commands u become at the motor is u (1 + p x), x the link's reading over nominal less one:

    p = 0   the link varies as read, and the drive divides by the reading (or neither)     dc_link = "measured"
    p = -1  the drive divides by a reading, the link itself is steady                      dc_link = "steady"
    p = 1   the link varies as read, and the drive divides by the nominal voltage          command = "nominal"

p is a least-squares estimate from the flux balance (`checks.balance`) beside errors of what the
nominal model states, recording by recording.
"""  # noqa: E501

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.parameters import Drive
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.recordings.checks.balance import PHASES, balance
from sandbox.recordings.findings import Finding

# standard deviation of p, and distance from a whole number, up to which it is one
SURE, NEAR = 0.2, 0.4
# samples, of the balance from which p is told; windows that a recording needs
WINDOW, FEWEST = 4, 16
STATED = 0.05  # relative standard deviation of what the nominal model states
# times the deviation of white residuals: what a gap leaves is alike from window to window
ALIKE = 2.0
WORDS = {
    0: ("varies as u_dc reads, and commands are what the motor got", {"dc_link": "measured"}),
    -1: ("is steady, though commands were divided by the reading u_dc", {"dc_link": "steady"}),
    1: (
        "varies as u_dc reads, and commands were divided by the nominal voltage",
        {"dc_link": "measured", "command": "nominal"},
    ),
}


@dataclasses.dataclass(frozen=True)
class Exponent:
    """Estimate of p and its standard deviation (infinite where the link's reading never
    changes)."""

    value: float
    deviation: float

    @property
    def whole(self) -> int | None:
        """The whole number that p is, None where it cannot be told."""
        near = round(self.value) if math.isfinite(self.value) else 0
        sure = (
            self.deviation < SURE
            and abs(self.value - near) < NEAR + self.deviation
            and abs(near) <= 1
        )
        return near if sure else None


def link_exponent(recordings: Sequence[CampaignRecording], drive: Drive) -> Exponent:
    """Return p of all recordings together, each with its own errors of resistance, inductances,
    flux and voltage."""
    top = bottom = 0.0
    for r in recordings:
        nominal = r.dc_bus_voltage or drive.converter.dc_bus_voltage
        b = balance(r.columns, drive, WINDOW)
        if len(b.rows) < FEWEST:
            continue
        mean = (
            sum((r.u_dc[b.rows + k] for k in range(WINDOW)), np.zeros(1)) / WINDOW / nominal - 1.0
        )
        commanded, rest = _parts(b.voltage * mean), -_parts(b.rest)
        known = _stated(r, b.rows, drive, b.voltage)
        noise = max(float(rest @ rest) / len(rest), 1e-12)
        inner = known.T @ known / noise + np.eye(known.shape[1]) / STATED**2
        commanded_only = commanded - known @ np.linalg.solve(inner, known.T @ commanded) / noise
        top, bottom = (
            top + float(commanded_only @ rest) / noise,
            bottom + float(commanded_only @ commanded) / noise,
        )
    return Exponent(top / bottom, ALIKE * bottom**-0.5) if bottom > 0.0 else Exponent(0.0, math.inf)


def _parts(x: NDArray[Any]) -> Array:
    return np.concatenate([x.real, x.imag])


def _stated(r: CampaignRecording, rows: NDArray[np.int64], drive: Drive, voltage: Any) -> Array:
    """Return what stated numbers contribute to the balance (V), a column each: link, R, flux.

    Not inductances: steps of the readings hold the very noise of the balance, which a fit would
    explain with them; an error of theirs is like one of the link.
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
    """Return a campaign whose [drive] says what its link does: what it states, or else what
    recordings show.

    A finding says what was found, or that what is stated is contradicted.
    """
    c = campaign.drive.converter
    found = link_exponent(campaign.recordings, campaign.drive).whole
    if (
        found is None
        or (found == -1 and c.dc_link != "measured")
        or (found == 0 and c.dc_link == "measured")
    ):
        return campaign
    text, keys = WORDS[found]
    says, write = f"the DC link {text}", ", ".join(f'{k} = "{v}"' for k, v in keys.items())
    if c.dc_link is not None:
        note = (
            f'recordings contradict [drive] dc_link = "{c.dc_link}": {says}; write {write} '
            "in [drive]"
        )
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
        recordings = tuple(r.in_volts(nominal) for r in recordings)
    drive = dataclasses.replace(campaign.drive, converter=converter)
    return dataclasses.replace(campaign, drive=drive, recordings=recordings)

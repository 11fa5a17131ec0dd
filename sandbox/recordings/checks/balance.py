"""The stator's voltage equation over windows of a recording, whatever the load: what of the
commands stays unexplained.

Over a window of m samples the flux that voltage leaves behind must be the flux that currents and
magnet show,

    sum h (u_k - R (i_k + i_k+1) / 2) = psi(end) - psi(begin),
    psi = (L_d + L_q)/2 i + (L_d - L_q)/2 exp(2j theta) conj(i) + phi_m exp(j theta)      (stator frame, complex)

The nominal linear model is asked, and the saturated one where that leaves a doubt.  The share of
the voltage's energy that stays unexplained is some per cent for a real gap, about 1 or far more for
a wrong unit.
"""  # noqa: E501

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.energy import AnyEnergy, flux_or_nan
from model.parameters import Drive
from sandbox.recordings.campaign import CampaignRecording
from sandbox.recordings.rows.commands import mean_command

Complex = NDArray[np.complexfloating[Any, Any]]
Columns = Mapping[str, Array]
PHASES = ("i_a", "i_b", "i_c")
VOLTAGES = ("u_alpha", "u_beta")
UNDISTURBED = 0.35  # unexplained share that no mistake needs to answer for
LOOKED = 200  # windows in which the saturated model is asked
BLOCK = 500_000  # samples of which the balance is made at a time: some 100 MB


@dataclass(frozen=True)
class Balance:
    """Voltage and its unexplained part over each window, V; `noise` is the share that the sensors'
    noise explains."""

    rows: NDArray[np.int64]
    voltage: Complex
    rest: Complex
    noise: float

    @property
    def doubtful(self) -> bool:
        """Tell whether more goes unexplained than gap and noise are allowed."""
        return self.share > UNDISTURBED + 3.0 * self.noise

    @property
    def worst_row(self) -> int:
        """Row at which most voltage goes unexplained."""
        return int(self.rows[np.argmax(np.abs(self.rest))])

    @property
    def share(self) -> float:
        """Unexplained share of the voltage's energy."""
        total = float(np.sum(np.abs(self.voltage) ** 2))
        return float(np.sum(np.abs(self.rest) ** 2)) / total if total > 0.0 else 0.0


def balance(
    columns: Columns, drive: Drive, window: int | None = None, *, saturated: bool = False
) -> Balance:
    """Return the flux balance of a recording's columns over windows of so many samples (None: as
    many as keep the voltage), with the nominal linear model or the saturated one.

    saturated: some LOOKED windows all over the recording, without those whose currents are outside
    the nominal model.
    """
    m, size = drive.motor, window or window_of(columns)
    ends = np.arange(0, len(columns["theta"]), size)
    asked = _some(len(ends)) if saturated else None
    step = max(BLOCK // size, 1)
    voltage, rest = np.empty((2, max(len(ends) - 1, 0)), dtype=np.complex128)
    for k in range(0, len(voltage), step):
        own = slice(k, k + step)
        voltage[own], rest[own] = _differences(columns, drive, ends[k : k + step + 1], asked, k)
    sensor = math.hypot(
        drive.converter.current_noise, drive.converter.current_resolution / math.sqrt(12.0)
    )
    span = size * drive.converter.sampling_period
    noise = 4.0 / 3.0 * (m.inductance_d**2 + m.inductance_q**2) * (sensor / span) ** 2
    energy = float(np.mean(np.abs(voltage) ** 2)) if len(voltage) else 0.0
    share = noise / energy if energy > 0.0 else math.inf
    inside = np.isfinite(rest)
    if inside.all():
        return Balance(ends[:-1], voltage, rest, share)
    return Balance(ends[:-1][inside], voltage[inside], rest[inside], share)


def _some(windows: int) -> NDArray[np.int64]:
    """Return some LOOKED beginnings and ends of windows, by their number."""
    some = np.unique(np.linspace(0, windows - 1, min(LOOKED, windows), dtype=np.int64))
    return np.asarray(np.unique(np.minimum([some, some + 1], windows - 1)))


def _differences(
    columns: Columns,
    drive: Drive,
    ends: NDArray[np.int64],
    asked: NDArray[np.int64] | None,
    first: int,
) -> tuple[Complex, Complex]:
    """Return voltage and its unexplained part (V) over the windows between some ends of a
    recording.

    asked: numbers of the ends at which the saturated model is asked (None: the linear one
    everywhere); `first` is the number of the first end here.
    """
    m, h = drive.motor, drive.converter.sampling_period
    part = slice(int(ends[0]), int(ends[-1]) + 1)
    u = columns["u_alpha"][part] + 1j * columns["u_beta"][part]
    a, b, c = (columns[n][part] for n in PHASES)
    i = (2.0 * a - b - c) / 3.0 + 1j * (b - c) / math.sqrt(3.0)
    u, rows = mean_command(u, columns["theta"][part], drive.converter), ends - ends[0]
    turn = np.exp(1j * columns["theta"][ends])
    if asked is None:
        half_sum, half_gap = (
            0.5 * (m.inductance_d + m.inductance_q),
            0.5 * (m.inductance_d - m.inductance_q),
        )
        psi = half_sum * i[rows] + half_gap * turn**2 * np.conj(i[rows]) + m.magnet_flux * turn
    else:
        own = asked[(asked >= first) & (asked < first + len(ends))] - first
        psi = np.full(len(ends), np.nan, dtype=np.complex128)
        psi[own] = _saturated_flux(m.energy, (i[rows] * np.conj(turn))[own]) + m.magnet_flux
        psi *= turn
    flux = np.concatenate([[0j], np.cumsum(h * u[:-1])])[rows]
    drop = np.concatenate([[0j], np.cumsum(0.5 * h * m.resistance * (i[:-1] + i[1:]))])[rows]
    span = h * int(ends[1] - ends[0])
    voltage: Complex = np.asarray(np.diff(flux) / span, dtype=np.complex128)
    return voltage, voltage - np.diff(drop + psi) / span


def _saturated_flux(energy: AnyEnergy, current: Complex) -> Complex:
    """Return d + j q (Wb) (n,) of currents d + j q (A), not a number where the model does not hold
    them."""
    d, q = flux_or_nan(energy, current.real, current.imag)
    return np.asarray(d + 1j * q)


def window_of(columns: Columns) -> int:
    """Return the longest of 8, 4, 2, 1 samples whose averages keep a fifth of the voltage's
    energy."""
    u = [columns[n] for n in VOLTAGES]
    energy = sum(float(x @ x) for x in u)
    for size in (8, 4, 2):
        whole = len(u[0]) // size * size
        means = [x[:whole].reshape(-1, size).mean(axis=1) for x in u]
        if size * sum(float(x @ x) for x in means) >= 0.2 * energy:
            return size
    return 1


def with_saturation(
    r: CampaignRecording, drive: Drive, window: int | None = None
) -> Balance | None:
    """Return the balance with the nominal model's saturation; None where it holds less than half of
    the windows."""
    size = window or window_of(r.columns)
    with np.errstate(all="ignore"):  # currents of a wrong unit
        balanced = balance(r.columns, drive, size, saturated=True)
    asked = min(LOOKED, len(r.t) // size)
    return balanced if len(balanced.rows) >= 0.5 * asked else None


def saturation_explains(r: CampaignRecording, drive: Drive) -> bool:
    """Return whether a recording agrees with the nominal model once its saturation is asked,
    too."""
    balanced = with_saturation(r, drive)
    return balanced is not None and not balanced.doubtful


def percent(share: float) -> str:
    """Return a share in percent, or how many times the whole it is; two digits, no power of ten."""
    if share < 10.0:
        return f"{plain(100.0 * share)} %"
    return f"{plain(share)} times all"


def plain(x: float) -> str:
    """Return a number of two digits as a person writes it."""
    rounded = float(f"{x:.2g}")
    return f"{rounded:.0f}" if abs(rounded) >= 10.0 else f"{rounded:g}"

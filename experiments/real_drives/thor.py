"""THOR: iron loss, AC resistance and 6k harmonics of a PM-assisted SyRM from finite elements (data
set `thor_fea`).

SyR-e's file has d along the iron and the magnets along -q.  Here it is turned into this package's
axes (d along the magnets): i_d = -i_q', i_q = i_d', likewise the fluxes, theta = theta' - 90°.  No
measurement: no noise, and intervals say how well an equation describes the tables, not how well the
tables describe a motor.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from experiments.real_drives.fitted import Fitted, interval, jackknife
from model.errors import BadInput

RATED_CURRENT = 22.06  # A peak: 15.6 A rms, motulator's example
RATED_FREQUENCY = 85.0  # Hz electrical, likewise


@dataclass(frozen=True)
class Thor:
    """Tables over (i_d, i_q) in magnet axes; fluxes (n, n, 90) over theta; loss at `loss_frequency`
    and its flux."""

    pole_pairs: int
    resistance: float
    i_d: np.ndarray
    i_q: np.ndarray
    theta: np.ndarray
    psi_d: np.ndarray
    psi_q: np.ndarray
    torque: np.ndarray
    loss_i: np.ndarray
    loss_psi: np.ndarray
    hysteresis: np.ndarray
    eddy: np.ndarray
    loss_frequency: float
    exponent: float
    frequency: np.ndarray
    temperature: np.ndarray
    factor: np.ndarray

    def iron_loss(self, frequency: float | np.ndarray) -> np.ndarray:
        """Return the iron and magnet loss (W) over the loss map at an electrical frequency (Hz), by
        SyR-e's rule."""
        ratio = frequency / self.loss_frequency
        return self.hysteresis * ratio**self.exponent + self.eddy * ratio**2


def read(path: Path) -> Thor:
    """Return the content of `thor_fea.npz` in magnet axes; BadInput where a table is missing."""
    try:
        with np.load(path, allow_pickle=False) as data:
            d = {name: data[name] for name in data.files}
        return Thor(
            int(d["pole_pairs"]),
            float(d["Rs"]),
            -d["iq_grid"][::-1],
            d["id_grid"],
            np.deg2rad(d["theta_deg"].astype(float)) - np.pi / 2,
            -_turned(d["psi_q"]),
            _turned(d["psi_d"]),
            _turned(d["torque"]),
            d["loss_id"] * 1j - d["loss_iq"],
            d["psi_d_mean"] * 1j - d["psi_q_mean"],
            d["loss_stator_hyst"] + d["loss_rotor_hyst"],
            d["loss_stator_eddy"] + d["loss_rotor_eddy"] + d["loss_magnet"],
            float(d["loss_freq_hz"]),
            float(d["loss_exp_hyst"]),
            d["ac_factor_freq"][0].astype(float),
            d["ac_factor_temp"][:, 0].astype(float),
            d["ac_factor"],
        )
    except (OSError, ValueError, KeyError) as error:
        raise BadInput(
            f"file '{path}' is not THOR's tables ({error!r}); see the data set 'thor_fea'"
        ) from None


def _turned(table: np.ndarray) -> np.ndarray:
    """Return a table over (i_d', i_q', theta) as one over (i_d = -i_q', i_q = i_d', theta), both
    ascending."""
    return np.swapaxes(table.astype(float), 0, 1)[::-1]


def core_resistance(
    thor: Thor, frequency: float, largest: float = RATED_CURRENT, smallest: float = 0.0
) -> Fitted:
    """Return R_c (ohm): loss = 1.5 (omega |psi|)^2 / R_c over smallest <= |i| <= largest (A).

    The interval is the spread over that current disk (2.5 to 97.5 % of the points), not an error of
    a mean.
    """
    inside = (np.abs(thor.loss_i) <= largest) & (np.abs(thor.loss_i) >= smallest)
    volts_squared = 1.5 * (2.0 * np.pi * frequency * np.abs(thor.loss_psi[inside])) ** 2
    loss = thor.iron_loss(frequency)[inside]
    value = float(np.sum(volts_squared**2) / np.sum(volts_squared * loss))
    low, high = np.quantile(volts_squared / loss, [0.025, 0.975])
    return Fitted(value, float(low), float(high), "ohm", "spread over the current disk")


@dataclass(frozen=True)
class SkinEffect:
    """R_1 (ohm) and time constant (s) of drop = R i + R_1 (i - x), tau dx/dt = i - x; relative to
    `dc` (ohm)."""

    resistance: Fitted
    time_constant: Fitted
    dc: float

    def factor(self, frequency: np.ndarray) -> np.ndarray:
        """Return the AC resistance over the DC one at frequencies (Hz)."""
        return skin_factor(frequency, self.resistance.value / self.dc, self.time_constant.value)


def skin_factor(frequency: np.ndarray, ratio: float, time_constant: float) -> np.ndarray:
    """Return 1 + ratio (omega tau)^2 / (1 + (omega tau)^2): the real part of the skin effect's
    impedance over R."""
    x = (2.0 * np.pi * frequency * time_constant) ** 2
    return 1.0 + ratio * x / (1.0 + x)


def skin_effect(frequency: np.ndarray, factor: np.ndarray, dc: float) -> SkinEffect:
    """Return the fit of the skin effect's first-order form to an AC resistance factor (jackknife
    over frequencies)."""

    def fit(mask: np.ndarray) -> np.ndarray:
        """Return log of ratio and of time constant (s) fitted to a mask's frequencies."""

        def miss(x: np.ndarray) -> np.ndarray:
            """Return the resistance factor of the form less that of the table, by frequency."""
            return skin_factor(frequency[mask], np.exp(x[0]), np.exp(x[1])) - factor[mask]

        return least_squares(miss, [np.log(2.0), np.log(1e-4)], xtol=1e-12, ftol=1e-12).x

    log, error = jackknife(fit, np.arange(len(frequency)))
    ratio, tau = np.exp(log)
    freedom = len(frequency) - 2
    basis = "jackknife over the table's frequencies"
    return SkinEffect(
        interval(ratio * dc, ratio * dc * error[0], freedom, "ohm", basis),
        interval(tau, tau * error[1], freedom, "s", basis),
        dc,
    )


def phasors(thor: Thor, table: np.ndarray, order: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the cos and sin amplitudes (n, n) of an electrical order of a table over theta."""
    wave = np.exp(-1j * order * thor.theta)
    value = 2.0 * np.mean(table * wave, axis=2)
    return value.real, -value.imag


def flux_harmonics(thor: Thor, order: int = 6) -> tuple[Fitted, Fitted]:
    """Return (psi_d, psi_q) of a 6k order without current: psi_d cos(order theta), psi_q sin(order
    theta), Wb.

    The interval is the amplitude of the phase that symmetry forbids (sin in d, cos in q): what the
    mesh leaves.
    """
    a, b = int(np.argmin(np.abs(thor.i_d))), int(np.argmin(np.abs(thor.i_q)))
    cos_d, sin_d = (float(x[a, b]) for x in phasors(thor, thor.psi_d, order))
    cos_q, sin_q = (float(x[a, b]) for x in phasors(thor, thor.psi_q, order))
    basis = "amplitude of the phase that symmetry forbids"
    return (
        Fitted(cos_d, cos_d - abs(sin_d), cos_d + abs(sin_d), "Wb", basis),
        Fitted(sin_q, sin_q - abs(cos_q), sin_q + abs(cos_q), "Wb", basis),
    )


def inductance_harmonic(thor: Thor, largest: float) -> tuple[Fitted, float, np.ndarray, np.ndarray]:
    """Return (gamma_6 (1/H), explained share, seen, fitted) from the 6th flux harmonic's change
    with current.

    H's term ½ gamma [cos 6θ (φ_d² - φ_q²) + 2 sin 6θ φ_d φ_q] moves the flux at a given current
    by -L δi, with δi_d = gamma (cos 6θ φ_d + sin 6θ φ_q), δi_q = gamma (sin 6θ φ_d - cos 6θ φ_q)
    and L the incremental inductance.
    """
    mean_d, mean_q = thor.psi_d.mean(axis=2), thor.psi_q.mean(axis=2)
    l_dd, l_dq = np.gradient(mean_d, thor.i_d, thor.i_q)
    l_qd, l_qq = np.gradient(mean_q, thor.i_d, thor.i_q)
    a, b = int(np.argmin(np.abs(thor.i_d))), int(np.argmin(np.abs(thor.i_q)))
    phi_d, phi_q = mean_d - mean_d[a, b], mean_q
    rows_d = [-(l_dd * phi_d - l_dq * phi_q), -(l_dd * phi_q + l_dq * phi_d)]  # cos 6θ, sin 6θ
    rows_q = [-(l_qd * phi_d - l_qq * phi_q), -(l_qd * phi_q + l_qq * phi_d)]
    seen = [x - x[a, b] for x in (*phasors(thor, thor.psi_d, 6), *phasors(thor, thor.psi_q, 6))]
    inside = np.hypot(*np.meshgrid(thor.i_d, thor.i_q, indexing="ij")) <= largest
    x = np.concatenate([row[inside] for row in (*rows_d, *rows_q)])
    y = np.concatenate([row[inside] for row in seen])
    points = np.tile(np.arange(inside.sum()), 4)
    value, error = jackknife(lambda m: np.array([np.dot(x[m], y[m]) / np.dot(x[m], x[m])]), points)
    explained = 1.0 - float(np.sum((y - value[0] * x) ** 2) / np.sum(y**2))
    basis = "jackknife over current points"
    return (
        interval(value[0], error[0], int(inside.sum()) - 1, "1/H", basis),
        explained,
        y,
        value[0] * x,
    )


def harmonic_torque(thor: Thor, order: int = 6) -> tuple[np.ndarray, np.ndarray]:
    """Return (from the fluxes' harmonics, from the torque table): complex amplitude (n, n) of a
    torque order, N m.

    Torque = 1.5 p (ψ_d i_q - ψ_q i_d + ∂W'/∂θ), W' the co-energy ∫ψ·di from zero current plus the
    torque there.
    """
    grid_d, grid_q = np.meshgrid(thor.i_d, thor.i_q, indexing="ij")
    d, q, seen = (
        (c - 1j * s)
        for c, s in (phasors(thor, table, order) for table in (thor.psi_d, thor.psi_q, thor.torque))
    )
    a, b = int(np.argmin(np.abs(thor.i_d))), int(np.argmin(np.abs(thor.i_q)))
    along_d = _integral(d[:, b], thor.i_d, a)
    along_q = np.array([_integral(row, thor.i_q, b) for row in q])
    energy = along_d[:, None] + along_q
    built = 1.5 * thor.pole_pairs * (d * grid_q - q * grid_d + 1j * order * energy) + seen[a, b]
    return built, seen


def _integral(values: np.ndarray, x: np.ndarray, zero: int) -> np.ndarray:
    """Return the trapezoidal integral of values over x, from x[zero]."""
    steps = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(x))])
    return steps - steps[zero]

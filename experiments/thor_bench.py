"""Recordings of a machine that exists as finite elements only: THOR's tables over (i_d, i_q, angle)
behind voltages.

No bench has recorded this motor.  Its flux tables (motulator's example, data set `thor_fea`) are
integrated here under open-loop voltages, rotor locked or driven; inverter and sensors are ideal but
for noise.  So only the machine can be at fault: slots (6k harmonics that depend on the currents)
and saturation beyond the nominal model, the
quartic energy fitted to the tables' mean over the angle.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import map_coordinates, spline_filter1d

from experiments.real_drives.thor import RATED_CURRENT, RATED_FREQUENCY, Thor
from model.frames import phases
from model.parameters import Converter, Drive, Injection, Motor
from sandbox.recordings.campaign import Campaign, CampaignRecording

PERIOD, LINK, NOISE, COUNTS = 1e-4, 540.0, 0.02, 1 << 16
SAMPLES, FINE = 3000, 4
# name, electrical speed (rad/s), angle of a locked rotor (rad), middle and swing of i_d and i_q (A)
CASES = (
    ("locked_a", 0.0, 0.2, -8.0, 7.0, 9.0, 7.0),
    ("locked_b", 0.0, 1.1, -5.0, 5.0, 11.0, 6.0),
    ("locked_c", 0.0, 2.5, -9.0, 6.0, 10.0, 8.0),
    ("driven_1", 40.0, 0.0, -8.0, 6.0, 10.0, 6.0),
    ("driven_2", 120.0, 0.0, -6.0, 5.0, 11.0, 8.0),
    ("driven_3", 250.0, 0.0, -10.0, 5.0, 10.0, 5.0),
    ("driven_4", 75.0, 0.0, -7.0, 6.0, 10.0, 8.0),
)


def nominal(thor: Thor) -> Motor:
    """Return the motor whose quartic energy fits the tables' mean over the angle best within rated
    current."""
    i_d, i_q = np.meshgrid(thor.i_d, thor.i_q, indexing="ij")
    own = np.hypot(i_d, i_q) <= 1.1 * RATED_CURRENT
    middle = (int(np.argmin(abs(thor.i_d))), int(np.argmin(abs(thor.i_q))))
    magnet = float(thor.psi_d.mean(2)[middle])
    d, q = thor.psi_d.mean(2)[own] - magnet, thor.psi_q.mean(2)[own]
    o = np.zeros_like(d)
    rows = np.r_[
        np.c_[d, o, 3 * d**2, q**2, 4 * d**3, 2 * d * q**2, o],
        np.c_[o, q, o, 2 * d * q, o, 2 * d**2 * q, 4 * q**3],
    ]
    x = np.linalg.lstsq(rows, np.r_[i_d[own], i_q[own]], rcond=None)[0]
    torque = float(np.max(thor.torque.mean(2)[own]))
    return Motor(
        "thor",
        thor.pole_pairs,
        thor.resistance,
        magnet,
        1.0 / x[0],
        1.0 / x[1],
        0.005,
        RATED_CURRENT,
        torque,
        60.0 * RATED_FREQUENCY / thor.pole_pairs,
        *(float(a) for a in x[2:]),
    )


class Tables:
    """THOR's fluxes at currents and angles, cubic splines between the tables' points.

    The tables hold i_q >= 0; below, the machine is its own mirror image: psi_d even, psi_q odd
    under (i_q, theta) -> -.
    """

    def __init__(self, thor: Thor) -> None:
        self.origin = np.array([thor.i_d[0], -thor.i_q[-1]])
        self.step = np.array([thor.i_d[1] - thor.i_d[0], thor.i_q[1] - thor.i_q[0]])
        turn = np.mod(thor.theta, math.tau)
        order = np.argsort(turn)
        self.first, self.count = float(turn[order[0]]), len(order)
        back = (
            np.rint(np.mod(-turn[order] - self.first, math.tau) / math.tau * self.count).astype(int)
            % self.count
        )
        self.psi = []
        for table, sign in ((thor.psi_d, 1.0), (thor.psi_q, -1.0)):
            own = table[:, :, order]
            both = np.concatenate([sign * own[:, :0:-1, back], own], axis=1)
            for axis, mode in ((0, "mirror"), (1, "mirror"), (2, "grid-wrap")):
                both = spline_filter1d(both, 3, axis=axis, mode=mode)
            self.psi.append(both)

    def flux(self, i, theta):
        """Return flux (n, 2) in Wb at currents (n, 2) in A and electrical angles (n,)."""
        turn = np.mod(theta - self.first, math.tau) / math.tau * self.count
        at = np.vstack([((i - self.origin) / self.step).T, turn])
        return np.stack(
            [map_coordinates(c, at, order=3, mode="grid-wrap", prefilter=False) for c in self.psi],
            axis=-1,
        )

    def slopes(self, i, theta):
        """Return the incremental inductances (n, 2, 2) in H, by central differences."""
        moves = 0.05 * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
        psi = self.flux((i + moves[:, None]).reshape(-1, 2), np.tile(theta, 4)).reshape(4, -1, 2)
        return np.stack([psi[0] - psi[1], psi[2] - psi[3]], axis=-1) / 0.1

    def current(self, psi, theta, i):
        """Return the currents (n, 2) of fluxes by Newton's rule from a guess."""
        slope = self.slopes(i, theta)
        for _ in range(20):
            step = np.linalg.solve(slope, (psi - self.flux(i, theta))[:, :, None])[:, :, 0]
            i = i + step
            if np.max(np.abs(step)) < 1e-6:
                break
        return i


def bench(thor: Thor, seed: int = 0) -> Campaign:
    """Return the campaign: what each case's voltages make of THOR's tables, sampled with noise."""
    tables, motor, rng = Tables(thor), nominal(thor), np.random.default_rng(seed)
    speed, angle, d_0, d_1, q_0, q_1 = (
        np.array([c[k] for c in CASES], dtype=float) for k in range(1, 7)
    )
    t = PERIOD * np.arange(SAMPLES + 1)[:, None]
    theta = angle + speed * t
    rise = 1.0 - np.exp(-t / 0.02)
    wanted = np.stack(
        [rise * (d_0 + d_1 * np.sin(9.0 * t + angle)), rise * (q_0 + q_1 * np.sin(31.0 * t))],
        axis=-1,
    )
    psi = np.stack([tables.flux(w, th) for w, th in zip(wanted, theta, strict=True)])
    z = (psi[..., 0] + 1j * psi[..., 1]) * np.exp(1j * theta)
    i = (wanted[..., 0] + 1j * wanted[..., 1]) * np.exp(1j * theta)
    smooth = np.zeros_like(z)  # commands know nothing of slots: the mean over thirds of 60°
    for k in (-1.0, 0.0, 1.0):
        moved = theta + k * math.tau / 18.0
        own = np.stack([tables.flux(w, th) for w, th in zip(wanted, moved, strict=True)])
        smooth += (own[..., 0] + 1j * own[..., 1]) * np.exp(1j * theta) / 3.0
    u = np.diff(smooth, axis=0) / PERIOD + thor.resistance * 0.5 * (i[1:] + i[:-1])
    x, at = z[0], wanted[0]
    out = np.empty((SAMPLES, len(CASES)), dtype=complex)
    for k in range(SAMPLES):
        at = tables.current(_split(x * np.exp(-1j * theta[k])), theta[k], at)
        out[k] = (at[:, 0] + 1j * at[:, 1]) * np.exp(1j * theta[k])
        x, at = _step(tables, thor.resistance, x, u[k], theta[k], speed, at)
    converter = Converter(PERIOD, LINK, 0.0, NOISE, encoder_counts=COUNTS)
    drive = Drive(
        motor,
        converter,
        Injection(500.0, 1.0),
        {"motor": "finite elements, THOR, quartic fit of the mean"},
    )
    parts = [
        _recording(c, t[:-1, 0], u[:, k], out[:, k], theta[:-1, k], rng)
        for k, c in enumerate(CASES)
    ]
    return Campaign("thor", drive, tuple(parts), {}, {}, False)


def _split(z):
    return np.stack([z.real, z.imag], axis=-1)


def _step(tables, resistance, x, u, theta, speed, at):
    """Return stationary flux and currents after one period, by Runge and Kutta's midpoint rule in
    FINE steps."""
    h = PERIOD / FINE
    for n in range(FINE):
        th = theta + speed * h * n

        def slope(x, th, at):
            """Return the flux linkage's slope (V, stationary) and where the table was read."""
            at = tables.current(_split(x * np.exp(-1j * th)), th, at)
            return u - resistance * (at[:, 0] + 1j * at[:, 1]) * np.exp(1j * th), at

        first, at = slope(x, th, at)
        second, at = slope(x + 0.5 * h * first, th + 0.5 * h * speed, at)
        x = x + h * second
    return x, at


def _recording(case, t, u, i, theta, rng) -> CampaignRecording:
    count = math.tau * 2.0 / COUNTS
    columns = {"t": t, "u_alpha": u.real, "u_beta": u.imag, "u_dc": np.full(len(t), LINK)}
    columns |= dict(
        zip(
            ("i_a", "i_b", "i_c"),
            (np.asarray(x) for x in phases.py_func(i.real, i.imag)),
            strict=True,
        )
    )
    for name in ("i_a", "i_b", "i_c"):
        columns[name] = columns[name] + NOISE * rng.standard_normal(len(t))
    columns["theta"] = count * np.round(theta / count)
    return CampaignRecording(
        f"{case[0]}.parquet", "driven" if case[1] else "locked", "none", columns
    )

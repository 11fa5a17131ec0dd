"""Steady levels of locked-rotor recordings: found by themselves, demodulated, checked for what a
bench gets wrong.

A stretch is steady where the period averages of current and command stand still within their own
noise; its slopes are projections of the current on the flux ripple that the *commanded* voltage
makes on the sampling grid, so any periodic zero-mean waveform will do.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.errors import BadInput
from model.levels import NONE, D, Levels, NoStaircase, Q
from model.parameters import Drive
from model.ripple import flux_ripple
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.recordings.checks.balance import PHASES
from sandbox.recordings.findings import Finding
from sandbox.recordings.injection import samples_per_period

GAINS = 3.0  # times the mean of the three: the most that a sensor's gain is believed to be off
NEAR_ONE = 1e-5  # of the currents' energy: how much weights near 1 are preferred
LEFT = 0.1  # of the sum's energy: more than this is not explained by gains
SEEN = 0.05  # of the currents: a sum that no ordinary gains make
NOISES = 3.0  # times what gains do not explain of it
AXIS = {"d": D, "q": Q, "none": NONE}
WINDOW = 4  # periods over which a steady average may not drift
FEWEST = 8  # periods of a steady stretch
BLOCKS = 8  # degrees of freedom of a level's own noise
MARGIN = 2  # periods left out at either end
TRANSIENT_DOUBT = 0.3  # of what is left of a transient: nominal L and R are no better
DRIFT = 6.0  # noise levels
STILL = 2e-4  # of the largest vector's average: drift allowed where there is no noise
LARGEST_TURN = 0.05  # rad, of a rotor called locked
WRONG_AXIS = 0.35  # rad between injected voltage and the axis it is said to lie on
# rad between an axis of the rotor and the saliency's, half of an atan2(2 G_dq, ..)
LARGEST_CROSS = math.pi / 4.0
WRONG_UNIT = 8.0  # factor between resistance found and nominal


class _Level(NamedTuple):
    """What is read of one steady stretch, as in `Levels`."""

    voltage: Array
    current: Array
    slope: Array
    voltage_sd: Array
    slope_sd: Array
    waveform: Array


def levels_of(campaign: Campaign) -> Levels:
    """Return the steady levels of all locked recordings with injection; BadInput names what stands
    in the way."""
    chosen = [r for r in campaign.recordings if r.rotor == "locked" and r.injection_axis != "none"]
    if not chosen:
        raise NoStaircase(
            "no recording has a locked rotor and injection_axis 'd' or 'q'; identification needs "
            "bias staircases with injection"
        )
    parts = [_levels(r, campaign.drive) for r in chosen]

    levels = Levels(
        period=parts[0].period,
        axis=np.concatenate([p.axis for p in parts]),
        voltage=np.concatenate([p.voltage for p in parts]),
        current=np.concatenate([p.current for p in parts]),
        slope=np.concatenate([p.slope for p in parts]),
        voltage_sd=np.concatenate([p.voltage_sd for p in parts]),
        slope_sd=np.concatenate([p.slope_sd for p in parts]),
        waveform=np.concatenate([p.waveform for p in parts]),
        theta=np.concatenate([p.theta for p in parts]),
        source=tuple(itertools.chain(*(p.source for p in parts))),
    )
    check_units(levels, campaign.drive)
    return levels


def _levels(r: CampaignRecording, drive: Drive) -> Levels:
    """Return the levels of one recording."""
    n = samples_per_period(drive.injection, drive.converter)
    theta = _lock_angle(r)
    check_sensors(r, drive)
    u = _in_frame(r.u_alpha, r.u_beta, theta, n)
    i = _in_frame(*r.current, theta, n)
    axis = AXIS[r.injection_axis]
    stretches = steady(np.concatenate([i.mean(axis=1), u.mean(axis=1)], axis=1), r.file, n)
    _check_injection(r, drive, u, axis, stretches, theta)
    rows = [_level(u[a:b], i[a:b], axis, drive) for a, b in stretches]
    own = _Level(*(np.array(x) for x in zip(*rows, strict=True)))
    periods = np.sqrt([[b - a] for a, b in stretches])
    voltage_sd, slope_sd = (_pooled(x * periods) / periods for x in (own.voltage_sd, own.slope_sd))
    m = len(rows)
    return Levels(
        period=drive.converter.sampling_period,
        axis=np.full(m, axis),
        voltage=own.voltage,
        current=own.current,
        slope=own.slope,
        voltage_sd=voltage_sd,
        slope_sd=slope_sd,
        waveform=own.waveform,
        theta=np.full(m, theta),
        source=m * (r.file,),
    )


def _in_frame(alpha: Array, beta: Array, theta: float, n: int) -> Array:
    """Return (periods, n, 2): a stator-frame quantity in the frame at theta, cut into injection
    periods."""
    whole = len(alpha) // n * n
    c, s = math.cos(theta), math.sin(theta)
    both = np.column_stack([c * alpha + s * beta, c * beta - s * alpha])
    return both[:whole].reshape(-1, n, 2)


def steady(averages: Array, file: str, n: int) -> list[tuple[int, int]]:
    """Return [start, end) of the steady stretches of period averages (P, channels); NoStaircase if
    there is none."""
    if len(averages) <= FEWEST:
        raise NoStaircase(
            f"{file}: {len(averages)} injection periods in all; a steady level needs at "
            f"least {FEWEST + 2 * MARGIN}"
        )
    step = np.diff(averages, axis=0)
    noise = 1.4826 * np.median(np.abs(step - np.median(step, axis=0)), axis=0) / math.sqrt(2.0)
    # d and q of each: a vector's size counts, not its d or q
    vectors = np.max(np.abs(averages), axis=0).reshape(-1, 2)
    largest = np.repeat(vectors.max(axis=1), 2)
    allowed = np.maximum(DRIFT * math.sqrt(2.0) * noise, STILL * largest + 1e-12)
    drift = np.abs(averages[WINDOW:] - averages[:-WINDOW])
    still = np.all(drift <= allowed, axis=1)
    good = np.ones(len(averages), dtype=bool)
    for k in np.flatnonzero(~still):
        good[k : k + WINDOW + 1] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[0], good.astype(int), [0]])))
    runs, left = [], 0
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        # a transient that took that long to sink into the noise gets as long again to vanish
        runs.append((a + max(MARGIN, min(a - left, (b - a) // 2)), b - MARGIN))
        left = b
    kept = [(int(a), int(b)) for a, b in runs if b - a >= FEWEST]
    if not kept:
        longest = max((b - a + 2 * MARGIN for a, b in runs), default=0)
        raise NoStaircase(
            f"{file}: no steady level: the longest stretch in which current and voltage stand "
            f"still has {longest} injection periods ({longest * n} samples), needed are "
            f"{FEWEST + 2 * MARGIN}; dwell longer at each level"
        )
    return kept


def _level(u: Array, i: Array, axis: int, drive: Drive) -> _Level:
    """Return mean voltage and current, slopes, their standard deviations and the waveform of a
    stretch."""
    h = drive.converter.sampling_period
    wave = u.mean(axis=0) - u.mean(axis=(0, 1))
    psi = flux_ripple(wave[:, axis], h)
    slope = np.einsum("pkc,k->pc", i, psi) / (psi @ psi)
    bias, current = u.mean(axis=1), i.mean(axis=1)
    inductance = np.array([drive.motor.inductance_d, drive.motor.inductance_q])
    # nominal across, measured here unless absurd
    least, most = 0.1 * inductance[axis], 10.0 * inductance[axis]
    inductance[axis] = min(max(1.0 / (slope[:, axis].mean() or math.inf), least), most)
    rest, blur = rest_of_transient(current, drive.motor.resistance, inductance, len(wave) * h)
    v_sd = np.maximum(
        np.sqrt(_error_of_mean(bias) ** 2 + blur**2 + (TRANSIENT_DOUBT * rest) ** 2),
        1e-7 * np.max(np.abs(wave)) + 1e-9,
    )
    s_sd = np.maximum(_error_of_mean(slope), 1e-7 * np.max(np.abs(slope)))
    return _Level(
        bias.mean(axis=0) - rest, current.mean(axis=0), slope.mean(axis=0), v_sd, s_sd, wave
    )


def rest_of_transient(
    current: Array, resistance: float, inductance: Array, period: float
) -> tuple[Array, Array]:
    """Return the mean of L di/dt (V) left of the approach to a level, and the blur of u less it and
    R i (V, both (2,)).

    The period averages (P, 2) are taken as a constant and an exponential of the winding's time
    constant; a straight line in place of the exponential would miss most of a transient that is
    over early in the level.
    """
    # a faster one is over before the first average
    rate = np.minimum(resistance / inductance, 1.0 / period)
    t, whole = (np.arange(len(current)) + 0.5) * period, len(current) * period
    shape = np.exp(-np.outer(t, rate))
    shape -= shape.mean(axis=0)
    square = np.sum(shape**2, axis=0)
    size, fall = (
        np.sum(shape * current, axis=0) / square,
        inductance / whole * np.expm1(-whole * rate),
    )
    steady = _error_of_mean(current - size * shape)
    blur = np.hypot(fall * np.sqrt(len(current) / square), resistance) * steady
    return fall * size, blur


def _error_of_mean(x: Array) -> Array:
    """Return the standard error of the mean of (P, 2), from blocks long enough to carry the
    control's correlation."""
    blocks = max(min(len(x), BLOCKS + 1), len(x) // 10)
    size = len(x) // blocks
    means = x[: blocks * size].reshape(blocks, size, -1).mean(axis=1)
    return np.asarray(means.std(axis=0, ddof=1) / math.sqrt(blocks))


def _pooled(x: Array) -> Array:
    """Return noise levels (n, 2), each from few blocks, drawn to what is common to all levels."""
    # median of chi-squared over its mean
    common = np.median(x**2, axis=0) / (1 - 2 / (9 * BLOCKS)) ** 3
    return np.asarray(np.sqrt(0.75 * common + 0.25 * x**2))


def _lock_angle(r: CampaignRecording) -> float:
    theta, span = r.theta, float(np.ptp(r.theta))
    if span > LARGEST_TURN:
        raise BadInput(
            f"{r.file}: theta spans {span:.3g} while rotor = 'locked' (at most {LARGEST_TURN} "
            "rad); lock the rotor, or convert theta from degrees to electrical rad"
        )
    return float(np.mean(theta))


def _check_injection(
    r: CampaignRecording,
    drive: Drive,
    u: Array,
    axis: int,
    stretches: list[tuple[int, int]],
    theta: float,
) -> None:
    """Raise BadInput where the command of the first steady stretch carries no injection, or on
    another axis."""
    a, b = stretches[0]
    wave = u[a:b].mean(axis=0)
    wave = wave - wave.mean(axis=0)
    size, stated = float(np.max(np.hypot(*wave.T))), drive.injection.amplitude
    if size < 0.05 * stated:
        raise BadInput(
            f"{r.file}: no injection in the commanded voltage (level at rows {a * len(wave)} to "
            f"{b * len(wave)}: {size:.3g} V at {drive.injection.frequency:g} Hz, [injection] says "
            f"{stated:g} V); inject, or correct [injection]"
        )
    moment = wave.T @ wave
    along = 0.5 * math.atan2(2 * moment[0, 1], moment[0, 0] - moment[1, 1])
    off = abs((along - axis * math.pi / 2 + math.pi / 2) % math.pi - math.pi / 2)
    if off > WRONG_AXIS and _tracked(r, theta):
        raise NoStaircase(
            f"{r.file}: the injected voltage lies {math.degrees(off):.0f} degrees off axis "
            f"{r.injection_axis}, where the recorded estimate (theta_hat) turned it, by its "
            "start-up or by cross-saturation; the method needs injection on d or q of the rotor: "
            "inject by the encoder's angle"
        )
    if off > WRONG_AXIS:
        raise BadInput(
            f"{r.file}: the injected voltage lies {math.degrees(off):.0f} degrees off axis "
            f"{r.injection_axis} at theta = {theta:.4g}; give theta in electrical rad (not "
            "degrees, not mechanical) and the right injection_axis"
        )


def _tracked(r: CampaignRecording, theta: float) -> bool:
    """Tell whether an estimator held the injection: its estimate is recorded, over the whole
    recording no farther off than cross-saturation turns an axis (in its start-up it is anywhere);
    then the angle is not what is wrong."""
    if "theta_hat" not in r.columns:
        return False
    mean = np.mean(np.exp(2j * (r.columns["theta_hat"] - theta)))  # d has no sign
    return bool(abs(np.angle(mean)) / 2.0 <= LARGEST_CROSS)


def check_sensors(r: CampaignRecording, drive: Drive) -> list[Finding]:
    """Return a finding where the phases' sum follows their currents, as gains of sensors make it;
    BadInput where it is otherwise not zero, above all while one stands at its own limit."""
    noise = 10.0 * (drive.converter.current_noise + drive.converter.current_resolution)
    phase = np.stack([r.columns[c] for c in PHASES])
    bound = noise + 0.02 * np.max(np.abs(phase))
    rest, shared = rest_of_sum(phase)
    findings = []
    if float(np.std(shared)) > max(
        NOISES * float(np.std(rest)), SEEN * math.sqrt(float(np.mean(phase**2)))
    ):
        k = int(np.argmax(np.abs(shared)))
        text = (
            f"{r.file}: row {k}: the three currents sum to {phase[:, k].sum():.3g} A and the sum "
            "follows the currents: the sensors' gains differ (effect current_gain); calibrate "
            "them, or go on and let diagnose tell them"
        )
        findings.append(Finding(r.file, "i_a", k, text))
    bad = np.abs(rest) > bound
    for name, i in zip("abc", phase, strict=True):
        at_limit = bad & (np.abs(i) >= np.max(np.abs(i)) * (1 - 1e-9))
        if at_limit.sum() >= 3:
            raise BadInput(
                f"{r.file}: sensor of i_{name} is saturated at {np.max(np.abs(i)):.4g} A (row "
                f"{np.flatnonzero(at_limit)[0]}, {int(at_limit.sum())} rows; the three currents no "
                "longer sum to zero); lower the bias or widen the range"
            )
    if bad.mean() > 0.5:
        raise BadInput(
            f"{r.file}: the three currents sum to {np.median(np.abs(rest)):.3g} A; "
            "record all three phases of one star"
        )
    return findings


def rest_of_sum(phase: Array) -> tuple[Array, Array]:
    """Return the sum (n,) of three phase currents (3, n), A, in two parts: what no gains of sensors
    explain, and what they do.

    With gains k the true currents' sum of zero is sum(i / k) = 0: weights w = 1/k beside 1 make it
    vanish.  Where the currents lie on one line, many do, and those nearest to 1 count.  The
    constant part is an offset's and in neither.
    """
    centered = phase - phase.mean(axis=1, keepdims=True)
    total = centered.sum(axis=0)
    products = centered @ centered.T
    near = NEAR_ONE * float(np.trace(products)) * np.eye(3)
    if not np.any(products):
        return total, np.zeros_like(total)
    w = np.linalg.solve(products + near, near @ np.ones(3))
    w /= np.mean(w)
    rest = np.asarray(w @ centered)
    del centered  # a long recording's three columns
    believed = bool(np.all((w > 1.0 / GAINS) & (w < GAINS))) and float(rest @ rest) < LEFT * float(
        total @ total
    )
    return (rest, np.asarray(total - rest)) if believed else (total, np.zeros_like(total))


def check_units(levels: Levels, drive: Drive) -> None:
    """Raise BadInput where currents do not lie along the bias voltages, or are in another unit."""
    u, i = (
        levels.voltage[:, 0] + 1j * levels.voltage[:, 1],
        levels.current[:, 0] + 1j * levels.current[:, 1],
    )
    largest, noise = (
        float(np.max(np.abs(i))),
        drive.converter.current_noise + drive.converter.current_resolution,
    )
    if not largest > noise:
        raise BadInput(
            f"{levels.source[0]}: no level has a mean current above {largest:.3g} A (sensor noise "
            f"and resolution are {noise:.3g} A); check that the currents were recorded and the "
            "bias voltages reached the motor"
        )
    big = np.flatnonzero(np.abs(i) > 0.4 * largest)
    turn = np.angle(u[big] * np.conj(i[big]))
    if np.median(np.abs(turn)) > 0.35 or np.max(np.abs(turn)) > 1.2:
        k = int(big[np.argmax(np.abs(turn))])
        order = _order_that_fits(levels, big)
        hint = (
            f"the phase order {order} fits"
            if order
            else "no order of the phases fits; check signs and theta"
        )
        raise BadInput(
            f"{levels.source[k]}: at the level with u = ({u[k].real:.3g}, {u[k].imag:.3g}) V the "
            f"current is ({i[k].real:.3g}, "
            f"{i[k].imag:.3g}) A, {math.degrees(np.max(np.abs(turn))):.0f} degrees off: phases "
            f"swapped ({hint}); reorder i_a, i_b, i_c"
        )
    found, nominal = float(np.median(np.abs(u[big]) / np.abs(i[big]))), drive.motor.resistance
    if not 1 / WRONG_UNIT < found / nominal < WRONG_UNIT:
        guess = (
            "currents in mA or voltages in kV"
            if found < nominal
            else "currents in kA or voltages in mV"
        )
        k = int(np.argmax(np.abs(i)))
        raise BadInput(
            f"{levels.source[k]}: the bias levels give a resistance of {found:.3g} ohm, nominal is "
            f"{nominal:.3g} ohm (at the largest, {abs(u[k]):.3g} V and {abs(i[k]):.3g} A); are "
            f"{guess}? convert them to V and A (amplitude-invariant)"
        )


def _order_that_fits(levels: Levels, rows: NDArray[np.int64]) -> str:
    """Return the order of the recorded phase columns with which currents follow voltages, or ''."""
    turn = np.exp(1j * levels.theta[rows])
    u = (levels.voltage[rows, 0] + 1j * levels.voltage[rows, 1]) * turn
    i = (levels.current[rows, 0] + 1j * levels.current[rows, 1]) * turn
    phase = np.stack([(i * np.exp(-2j * math.pi / 3 * k)).real for k in range(3)])
    for order in itertools.permutations(range(3)):
        x = sum(phase[p] * np.exp(2j * math.pi / 3 * k) for k, p in enumerate(order)) * 2 / 3
        if np.median(np.abs(np.angle(u * np.conj(x)))) < 0.1:
            return ", ".join("i_" + "abc"[p] for p in order)
    return ""

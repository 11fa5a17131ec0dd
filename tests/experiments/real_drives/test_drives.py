"""Real drives: planted values come back from data of the same form, and the real data give
plausible ones."""

from __future__ import annotations

import json

import numpy as np
import pytest

from experiments.real_drives import laas, moteus, thor
from experiments.real_drives.fitted import Fitted, interval, jackknife
from model.datasets import locate
from model.errors import BadInput


def data(name):
    """Return a data set's folder, or skip."""
    folder = locate(name)
    if folder is None:
        pytest.skip(f"data set {name} is not here; set SENSORLESS_DATA")
    return folder


def holds(fitted: Fitted, value: float) -> bool:
    return fitted.low <= value <= fitted.high


def test_jackknife_of_a_mean_is_the_standard_error():
    x = np.random.default_rng(1).normal(size=400)
    value, error = jackknife(lambda m: np.array([x[m].mean()]), np.arange(400))
    assert value[0] == pytest.approx(x.mean())
    assert error[0] == pytest.approx(x.std(ddof=1) / 20.0, rel=1e-9)  # an identity for a mean


def test_interval_is_students():
    # t table
    assert interval(1.0, 2.0, 10, "V", "").high == pytest.approx(1.0 + 2.0 * 2.2281, rel=1e-4)


# --- moteus ------------------------------------------------------------


def planted_sweep(path, voltage, i_q=0.4, noise=2e-3, seed=0):
    rng = np.random.default_rng(seed)
    raw = {}
    for i_d in (0.0, -5.0, -9.0, -13.0, -17.0, -21.0, -25.0):
        omega = np.linspace(250.0, 600.0, 5)
        y = omega * (2.5e-3 + 3e-5 * i_d) + voltage * i_q / np.hypot(i_q, i_d) + 0.01
        y = y + noise * rng.normal(size=5)
        raw[str(i_d)] = [{"omega": w, "y": v} for w, v in zip(omega, y, strict=True)]
    content = {
        "raw": raw,
        "params": {"R": 0.05, "poles": 14},
        "fit": {"lambda_m": 2.5e-3, "B": 3e-5},
    }
    path.write_text(json.dumps(content))
    return moteus.read(path)


def test_planted_drop_comes_back(tmp_path):
    found = [
        moteus.inverter_drop(moteus.intercepts(planted_sweep(tmp_path / "ld_a.json", 0.15, seed=k)))
        for k in range(20)
    ]
    assert np.mean([f.voltage.value for f in found]) == pytest.approx(0.15, abs=5e-3)
    assert np.mean([holds(f.voltage, 0.15) for f in found]) >= 0.85  # 95 % nominal, 20 draws
    assert all(f.held_out_with < f.held_out_without for f in found)


def test_no_drop_is_not_found_where_none_is(tmp_path):
    found = [
        moteus.inverter_drop(moteus.intercepts(planted_sweep(tmp_path / "ld_a.json", 0.0, seed=k)))
        for k in range(20)
    ]
    assert np.mean([holds(f.voltage, 0.0) for f in found]) >= 0.85


def test_dead_time_is_the_fundamental_of_a_square_wave():
    angle = np.linspace(0.0, 2 * np.pi, 200_000, endpoint=False)
    error = 24.0 * 30e3 * 2e-7 * np.sign(np.sin(angle))  # volts lost by a leg: u_dc f T sign(i)
    fundamental = 2.0 * np.mean(error * np.sin(angle))
    assert moteus.dead_time(fundamental, 24.0, 30e3) == pytest.approx(2e-7, rel=1e-6)


@pytest.mark.parametrize("name", ["flipsky6374", "mad8318", "mj5208", "hoverboard"])
def test_real_moteus_drop_is_plausible(name):
    sweep = moteus.read(data("moteus_ld") / f"ld_{name}.json")
    lines = moteus.intercepts(sweep)
    drop = moteus.inverter_drop(lines)
    # 24 V, 30 kHz and the 50 to 400 ns of MOSFET gate drivers (DRV83xx) make 0.05 to 0.37 V
    assert drop.voltage.high > 0.05
    assert drop.voltage.low < 0.37
    if name != "hoverboard":  # whose scatter hides it
        assert 0.05 < drop.voltage.value < 0.37
        assert drop.voltage.low > 0.0
        assert drop.held_out_with < 0.6 * drop.held_out_without
    assert lines.slope[0] == pytest.approx(sweep.own_flux, rel=0.02)  # the drive's own fit, on file


def test_wrong_file_is_bad_input(tmp_path):
    (tmp_path / "x.json").write_text("{}")
    for read in (moteus.read, laas.read, thor.read):
        with pytest.raises(BadInput, match=r"x\.json"):
            read(tmp_path / "x.json")


# --- LAAS ------------------------------------------------------------


def planted_motion(k=0.03, inertia=5e-6, coulomb=2e-3, viscous=5e-6):
    """Integrate K i = J domega/dt + T_c tanh + B omega under a 2 Hz current, as the recorded
    run."""
    step, time = 1e-4, np.arange(0.0, 16.0, 1e-4)
    current = 0.4 * np.sin(2 * np.pi * 2.0 * time)
    speed = np.zeros_like(time)
    for n in range(len(time) - 1):
        torque = k * current[n] - coulomb * np.tanh(speed[n] / 2.0) - viscous * speed[n]
        speed[n + 1] = speed[n] + step * torque / inertia
    position = np.cumsum(speed) * step
    rng = np.random.default_rng(0)
    voltage = 0.5 * current + k / 1.5 * speed
    pick = slice(0, None, 10)
    counts = 2 * np.pi / 20_000
    noisy = current[pick] + 0.02 * rng.normal(size=len(time[pick]))
    return laas.Run(
        time[pick], np.round(position[pick] / counts) * counts, speed[pick], noisy, voltage[pick]
    )


def test_planted_friction_comes_back():
    found = laas.friction(planted_motion())
    assert found.torque_constant.value == pytest.approx(0.03, rel=2e-3)
    assert found.inertia.value == pytest.approx(5e-6, rel=0.01)
    assert holds(found.coulomb, 2e-3)
    assert holds(found.viscous, 5e-6)
    assert found.steady[1] <= (2e-3 + 5e-6 * 50.7) / 0.03 <= found.steady[2]


def test_planted_cogging_and_hold_come_back():
    angle = np.r_[np.linspace(0, 6.28, 8000), np.linspace(6.28, 0, 8000)]
    rng = np.random.default_rng(0)
    hold = np.r_[np.full(8000, 0.05), np.full(8000, -0.05)]
    current = (
        hold
        + 0.18 * np.sin(72 * angle - 2.5)
        + 0.04 * np.sin(18 * angle)
        + 0.02 * rng.normal(size=16000)
    )
    zero = np.zeros_like(angle)
    up, down = laas.scan_halves(laas.Run(np.arange(16000.0), angle, zero, current, zero))
    for half, sign in ((up, 1), (down, -1)):
        found, error = laas.cogging(half)
        size = laas.amplitudes(found)
        assert found[0] == pytest.approx(0.05 * sign, abs=4 * error[0])
        assert size[laas.ORDERS.index(72)] == pytest.approx(0.18, abs=3e-3)
        assert size[laas.ORDERS.index(18)] == pytest.approx(0.04, abs=3e-3)
        assert size[laas.ORDERS.index(12)] < 3e-3  # nothing was planted


def test_planted_speed_ripple_comes_back():
    time = np.arange(0.0, 3.0, 1e-3)
    angle = 50.0 * time
    # rad/s after the 200 Hz low-pass
    amplitude = 300.0 / (18 * 50.0) / np.hypot(1.0, 18 * 50.0 / (2 * np.pi * 200.0))
    run = laas.Run(time, angle, 50.0 + amplitude * np.sin(18 * angle), 0 * time, 0 * time)
    assert laas.speed_ripple(run, 18) == pytest.approx(300.0, rel=1e-3)


def test_real_laas_friction_is_plausible():
    folder = data("laas_bldc")
    found = laas.friction(laas.read(folder / "acceleration.txt"))
    # 300 rpm/V in the drive's firmware: back-EMF 60 / (2 pi 300 sqrt 3) V s/rad per phase, K = 1.5
    # of it
    assert found.torque_constant.value == pytest.approx(
        1.5 * 60 / (2 * np.pi * 300 * np.sqrt(3)), rel=0.05
    )
    assert 3e-6 < found.inertia.value < 1.2e-5  # m r^2 of an assumed 30 g at 10 to 20 mm
    measured = [
        float(laas.read(folder / f"rolling_data{n}.txt").current.mean()) for n in ("", 1, 2)
    ]
    assert found.steady[0] == pytest.approx(np.mean(measured), rel=0.10)  # held out
    assert found.steady[1] < 1.02 * np.mean(measured)
    # Coulomb leads over the whole speed range
    assert found.coulomb.value / found.viscous.value > 150


def test_real_laas_cogging_predicts_the_way_back():
    up, down = laas.scan_halves(laas.read(data("laas_bldc") / "quasi_static_scan.txt"))
    (there, _), (back, _) = laas.cogging(up), laas.cogging(down)
    predicted = -there[0] + laas.harmonics(down.position) @ there[1:]
    assert np.mean((down.current - predicted) ** 2) < 0.06 * np.var(down.current)  # held out
    # 24 poles (firmware) and 18 slots: cogging at their least common multiple leads, slots follow
    assert laas.ORDERS[int(np.argmax(laas.amplitudes(there)))] == np.lcm(18, 2 * laas.POLE_PAIRS)
    np.testing.assert_allclose(
        laas.amplitudes(there)[[1, 6]], laas.amplitudes(back)[[1, 6]], rtol=0.03
    )


def test_real_laas_order_18_agrees_between_scan_and_rolling():
    folder = data("laas_bldc")
    found = laas.friction(laas.read(folder / "acceleration.txt"))
    scan = (
        laas.amplitudes(laas.cogging(laas.read(folder / "quasi_static_scan.txt"))[0])[1]
        * found.torque_constant.value
    )
    for n in ("", 1, 2):
        rolling = found.inertia.value * laas.speed_ripple(
            laas.read(folder / f"rolling_data{n}.txt"), 18
        )
        assert rolling == pytest.approx(scan, rel=0.2)


# --- THOR ------------------------------------------------------------


def planted_thor(psi_d6=4e-4, psi_q6=-2.5e-4, gamma=0.8, core=500.0):
    """Tables of a linear motor whose energy holds the two 6k effects, exact to first order in
    gamma."""
    magnet, l_d, l_q, p = 0.1, 4e-3, 12e-3, 2
    i_d, i_q = np.linspace(-20, 20, 21), np.linspace(0, 20, 11)
    theta = np.deg2rad(np.arange(0, 360, 4.0)) - np.pi / 2
    d, q, t = np.meshgrid(i_d, i_q, theta, indexing="ij")
    c, s = np.cos(6 * t), np.sin(6 * t)
    phi_d, phi_q = l_d * d, l_q * q
    psi_d = magnet + psi_d6 * c + phi_d - gamma * l_d * (c * phi_d + s * phi_q)
    psi_q = psi_q6 * s + phi_q - gamma * l_q * (s * phi_d - c * phi_q)
    slope = 6 * (
        -psi_d6 * s * d
        + psi_q6 * c * q
        - 0.5 * gamma * (-s * (phi_d**2 - phi_q**2) + 2 * c * phi_d * phi_q)
    )
    torque = 1.5 * p * (psi_d * q - psi_q * d + slope)
    current = i_d[:, None] + 1j * i_q[None, :]
    psi = magnet + l_d * current.real + 1j * l_q * current.imag
    loss = 1.5 * (2 * np.pi * 100.0 * np.abs(psi)) ** 2 / core
    frequency, none = np.linspace(0, 1500, 16), np.zeros_like(loss)
    factor = thor.skin_factor(frequency, 2.0, 1.5e-4)[None, :]
    return thor.Thor(
        p,
        0.2,
        i_d,
        i_q,
        theta,
        psi_d,
        psi_q,
        torque,
        current,
        psi,
        none,
        loss,
        100.0,
        1.3,
        frequency,
        np.array([20.0]),
        factor,
    )


def test_planted_thor_comes_back():
    machine = planted_thor()
    psi_d, psi_q = thor.flux_harmonics(machine)
    assert (psi_d.value, psi_q.value) == pytest.approx((4e-4, -2.5e-4), rel=1e-9)
    gamma, explained, _, _ = thor.inductance_harmonic(machine, 15.0)
    assert gamma.value == pytest.approx(0.8, rel=1e-9)
    assert explained == pytest.approx(1.0)
    built, seen = thor.harmonic_torque(machine)
    np.testing.assert_allclose(built, seen, atol=1e-9)
    for frequency in (20.0, 100.0, 300.0):  # eddy current loss alone is a constant resistance
        assert thor.core_resistance(machine, frequency).value == pytest.approx(500.0)
    skin = thor.skin_effect(machine.frequency, machine.factor[0], machine.resistance)
    assert skin.resistance.value == pytest.approx(0.4, rel=1e-6)
    assert skin.time_constant.value == pytest.approx(1.5e-4, rel=1e-6)


@pytest.fixture(scope="module")
def machine():
    return thor.read(data("thor_fea") / "thor_fea.npz")


def test_real_thor_axes_are_the_magnets(machine):
    """Mean torque is 1.5 p (psi_d i_q - psi_q i_d), and motoring needs positive i_q: the turned
    axes are right."""
    mean = (
        1.5
        * machine.pole_pairs
        * (
            machine.psi_d.mean(axis=2) * machine.i_q
            - machine.psi_q.mean(axis=2) * machine.i_d[:, None]
        )
    )
    np.testing.assert_allclose(
        mean, machine.torque.mean(axis=2), atol=0.005 * machine.torque.mean(axis=2).max()
    )
    assert machine.psi_d[15, 0].mean() > 0.05
    assert abs(machine.psi_q[15, 0].mean()) < 1e-4


def test_real_thor_harmonics_have_one_energy(machine):
    built, seen = thor.harmonic_torque(machine)
    inside = np.hypot(*np.meshgrid(machine.i_d, machine.i_q, indexing="ij")) <= thor.RATED_CURRENT
    assert np.sum(np.abs(built - seen)[inside] ** 2) < 0.05 * np.sum(np.abs(seen[inside]) ** 2)
    psi_d, psi_q = thor.flux_harmonics(machine)
    magnet = machine.psi_d[15, 0].mean()
    # 6k flux of 0.1 to 2 %: the usual size in such motors
    assert 1e-3 < abs(psi_d.value) / magnet < 2e-2
    assert 1e-3 < abs(psi_q.value) / magnet < 2e-2
    assert psi_d.high - psi_d.low < 0.01 * abs(psi_d.value)  # symmetry holds in the mesh


def test_real_thor_losses_are_plausible(machine):
    rated = thor.core_resistance(machine, thor.RATED_FREQUENCY)
    # rated power 5.07 kW (motulator's example); iron takes 1 to 3 % of it
    at = int(np.argmin(np.abs(machine.loss_i.ravel() - thor.RATED_CURRENT * np.exp(0.75j * np.pi))))
    assert 0.01 < machine.iron_loss(thor.RATED_FREQUENCY).ravel()[at] / 5070 < 0.03
    assert rated.low < rated.value < rated.high
    assert 300 < rated.value < 1000  # U²/P of that loss at the rated 220 V rms between lines
    twice = thor.core_resistance(machine, 2 * thor.RATED_FREQUENCY).value / rated.value
    # between pure hysteresis and pure eddy currents
    assert 2 ** (2 - machine.exponent) > twice > 1.0


@pytest.mark.parametrize("row", [0, 6, 13])
def test_real_thor_skin_effect_predicts_higher_frequencies(machine, row):
    below = machine.frequency <= 1000
    found = thor.skin_effect(
        machine.frequency[below], machine.factor[row][below], machine.resistance
    )
    missed = found.factor(machine.frequency[~below]) - machine.factor[row][~below]
    assert np.abs(missed).max() < 1e-3

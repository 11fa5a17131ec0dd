"""Causes that are put into a bench: those the library names, in its form or in another one, and
those outside it.

Each function takes the design, a signed size (1: medium), whether the form is the bench's own, and
a generator; it changes the design and returns the library's parameters where they compare, and one
sentence about the form.
"""

from collections.abc import Callable

import numpy as np

from . import forms
from .design import ALPHAS, Design

Result = tuple[dict[str, float], str]
Cause = Callable[[Design, float, bool, np.random.Generator], Result]
LIBRARY_FORM = "the library's formula"


def _sign(rng: np.random.Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def stator_resistance(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `stator_resistance` into a bench."""
    value = d.nominal["resistance"] * (1 + max(0.12 * size * _sign(rng), -0.5))
    d.true["resistance"] = value
    if own:
        d.loss["drift"] = 0.1 * (value / d.nominal["resistance"] - 1) / 1.5
        return {
            "resistance": value
        }, "and it goes on changing within a recording (heat): a tenth of the error in 1.5 s"
    return {"resistance": value}, LIBRARY_FORM


def magnet_flux(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `magnet_flux` into a bench."""
    d.true["magnet_flux"] = d.nominal["magnet_flux"] * (1 + 0.06 * size * _sign(rng))
    return {"magnet_flux": d.true["magnet_flux"]}, LIBRARY_FORM


def inductance(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `inductance` into a bench."""
    scales = {}
    for axis in ("d", "q"):
        scales[f"scale_{axis}"] = 1 + 0.08 * size * _sign(rng) * rng.uniform(0.6, 1.2)
        d.true[f"inductance_{axis}"] = d.nominal[f"inductance_{axis}"] * scales[f"scale_{axis}"]
    return scales, LIBRARY_FORM if d.map is None else "the map with its currents stretched"


def saturation(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `saturation` into a bench."""
    if d.map is not None:
        d.sooner = float(np.clip(0.12 * size * _sign(rng), -0.35, 0.35))
        return {}, "the published map saturates sooner or later: psi(f i)/f"
    if not own:
        for a in ALPHAS:
            d.true[a] = d.nominal[a] * (
                1 + 0.3 * min(size, 2.0) * rng.uniform(0.5, 1.2) * _sign(rng)
            )
        return {a: d.true[a] for a in ALPHAS}, LIBRARY_FORM
    i, s, t = d.drive.current, float(rng.choice([3.0, 5.0])), float(rng.choice([1.0, 2.0]))
    f_d, f_q = d.true["inductance_d"] * i, d.true["inductance_q"] * i
    d.mag["power"][0:4] = 0.10 * size * i / f_d ** (s + 1), s, 0.12 * size * i / f_q ** (t + 1), t
    return {}, f"power functions beside the quartic, S = {s:g}, T = {t:g} (Hinkkan et al. 2017)"


def cross_saturation(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `cross_saturation` into a bench."""
    if d.map is not None:
        d.crossed = float(np.clip(-0.45 * size, -0.9, 0.0))
        return {}, "the part of the published map that crosses the axes is smaller"
    if not own:
        for a in ("alpha_12", "alpha_22"):
            d.true[a] = d.nominal[a] * (
                1 + 0.4 * min(size, 2.0) * rng.uniform(0.6, 1.2) * _sign(rng)
            )
        return {a: d.true[a] for a in ("alpha_12", "alpha_22")}, LIBRARY_FORM
    i = d.drive.current
    f_d, f_q = d.true["inductance_d"] * i, d.true["inductance_q"] * i
    d.mag["power"][4:7] = 0.30 * size * i / (f_q * f_d**2), 1.0, 0.0
    return {}, "a_dq |f_d|^3 |f_q|^2 / 6 in the energy (Hinkkan et al. 2017)"


def flux_harmonics(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `flux_harmonics` into a bench."""
    magnet = d.nominal["magnet_flux"]
    if not own:
        a, b = 0.008 * size * magnet * rng.uniform(0.6, 1.3, 2)
        d.mag["harmonics"] = np.array([[6.0, a, 0.0, 0.0, b]])
        return {"psi_d6": float(a), "psi_q6": float(b)}, LIBRARY_FORM
    table = forms.FINITE_ELEMENT_HARMONICS.copy()
    table[:, 1:] *= 1.2 * size * magnet
    d.mag["harmonics"] = table
    return {}, "orders 6, 12 and 18 of a finite-element model (THOR), sine and cosine on both axes"


def inductance_harmonics(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `inductance_harmonics` into a bench."""
    gamma = 0.03 * size * _sign(rng) / d.nominal["inductance_q"]
    if not own:
        d.mag["saliency"] = np.array([gamma, 0.0, 0.0])
        return {"gamma_6": gamma}, LIBRARY_FORM
    f = d.nominal["inductance_q"] * d.drive.current
    d.mag["saliency"] = np.array([gamma, 0.5 * gamma, 0.5 / f**2])
    return {"gamma_6": gamma}, "orders 6 and 12, both fading as the core saturates"


def iron_loss(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `iron_loss` into a bench."""
    w = d.drive.pole_pairs * d.drive.speed
    psi = float(
        np.hypot(d.nominal["magnet_flux"], d.nominal["inductance_q"] * d.drive.current * 0.7)
    )
    e, i = w * psi, 0.03 * size * d.drive.current  # core current at rated speed
    tau = float(rng.uniform(0.1e-3, 0.3e-3))
    if not own:
        d.loss["eddy"][0] = i / e, tau
        return {"core_resistance": e / i, "time_constant": tau}, LIBRARY_FORM
    d.loss["eddy"] = forms.lamination(0.5 * i / e, tau)
    d.loss["excess"] = 0.25 * i / np.sqrt(e)
    r = 0.15 * psi
    d.loss["hysteresis"] = np.array([0.25 * i / r, r])
    text = (
        "Bertotti: eddy currents in three modes of a lamination, excess loss by the root, "
        "hysteresis by a play operator"
    )
    return {"core_resistance": e / i}, text


def skin_effect(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `skin_effect` into a bench."""
    r = d.nominal["resistance"]
    at = 1 / (8 * d.drive.period)
    if not own:
        tau = float(rng.uniform(0.6, 1.5) / (2 * np.pi * at))
        d.loss["skin"][0] = 0.35 * size * r, tau
        return {"resistance": 0.35 * size * r, "time_constant": tau}, LIBRARY_FORM
    layers = int(rng.integers(2, 7))
    branches, error = forms.dowell_branches(0.3 * size, at, layers, 1 / d.drive.period)
    branches[:, 0] *= r
    branches[branches[:, 0] <= 0, 1] = 1.0
    d.loss["skin"] = branches
    return {}, f"Dowell's curve of {layers} layers by four branches (within {100 * error:.1f} %)"


def winding_asymmetry(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `winding_asymmetry` into a bench."""
    r = d.nominal["resistance"]
    if not own:
        a, b = 0.05 * size * r * rng.uniform(0.4, 1.2, 2) * np.array([_sign(rng), _sign(rng)])
        d.loss["added"] = np.array([a, b, 0.0])
        return {"delta_a": float(a), "delta_b": float(b)}, LIBRARY_FORM
    cold = 0.05 * size * r
    d.loss["contact"] = np.array([cold, 0.6 / d.drive.current**2, 0.3])
    return {
        "delta_a": cold,
        "delta_b": 0.0,
    }, "a loose terminal in phase a that heats with the square of its current (0.3 s)"


def dead_time(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `dead_time` into a bench."""
    time = 0.006 * size * d.drive.period * rng.uniform(0.8, 1.25)
    if not own:
        d.inv["dead_time_ideal"] += time
        return {"time": time}, LIBRARY_FORM
    share = rng.uniform(0.03, 0.12)
    d.inv["dead_time"] = time
    d.inv["capacitance"] = share * d.drive.current * time / d.drive.link
    return (
        {"time": time},
        (
            "switches, diodes and capacitance: the leg just slews over in the dead time at "
            f"{share:.3f} of rated current"
        ),
    )


def device_drop(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `device_drop` into a bench."""
    v = 0.0025 * size * d.drive.link * rng.uniform(0.8, 1.25)
    r = 0.3 * v / d.drive.current
    if not own:
        d.inv["drop_ideal"] = np.array([v, r])
        return {"threshold": v, "on_resistance": r}, LIBRARY_FORM
    knee = rng.uniform(0.03, 0.10) * d.drive.current
    k = rng.uniform(0.1, 0.3)
    d.inv["switch"] = np.array([v * (1 + k), knee, r * (1 - k)])
    d.inv["diode"] = np.array([v * (1 - k), 0.6 * knee, r * (1 + k)])
    return {
        "threshold": v,
        "on_resistance": r,
    }, f"switch and diode apart, with a knee at {knee / d.drive.current:.3f} of rated current"


def dc_link_error(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `dc_link_error` into a bench."""
    gain = 0.03 * size * _sign(rng)
    d.inv["link_gain"] += gain
    if not own:
        return {"gain_error": gain}, LIBRARY_FORM
    ohm = 0.01 * size * d.drive.link**2 / max(d.drive.power, 1.5 * d.torque * d.drive.speed)
    _source(d, ohm, 0.0)
    return {
        "gain_error": gain
    }, "link with capacitor behind a source with impedance: it sags under load, too"


def _source(d: Design, ohm: float, ripple: float) -> None:
    """Capacitor for a time constant of 6 periods of the resonance at 90 Hz; the ohms damp it."""
    s = d.inv["source"]
    power = 1.5 * d.torque * d.drive.speed
    z = 0.12 * d.drive.link**2 / power  # characteristic impedance
    w = 2 * np.pi * 90.0
    s[:] = (
        1.0,
        max(s[1] if s[0] > 0 else 0.0, ohm, 0.25 * z),
        z / w,
        1 / (z * w),
        max(s[4], ripple),
        s[5],
    )


def dc_link_ripple(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `dc_link_ripple` into a bench."""
    if not own:
        amplitude = 0.015 * size * d.drive.link
        f, phase = (
            float(rng.choice([100.0, 120.0, 300.0, 360.0])),
            float(rng.uniform(-np.pi, np.pi)),
        )
        d.inv["ripple"] = np.array([amplitude, f, phase])
        return {"amplitude": amplitude, "frequency": f, "phase": phase}, LIBRARY_FORM
    line = float(rng.choice([50.0, 60.0]))
    _source(d, 0.0, 2.5 * size)
    d.inv["source"][5] = line
    # what reaches the capacitor: the sixth order, 2/35 of the bridge's voltage, behind the choke
    s = d.inv["source"]
    w = 12 * np.pi * line
    through = abs(1 / (1 - w * w * s[2] * s[3] + 1j * w * s[1] * s[3]))
    amplitude = float(2 / 35 * 3 / np.pi * d.drive.link * 2.5 * size * through)
    return {
        "amplitude": amplitude,
        "frequency": 6 * line,
    }, "six-pulse rectifier, choke and capacitor: orders 6, 12, ... and the load's own sag"


def pwm_delay(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `pwm_delay` into a bench."""
    delay = 0.05 * size * d.drive.period
    if not own:
        d.inv["delay"] = np.full(3, delay)
        return {"delay": delay}, LIBRARY_FORM
    d.inv["delay"] = delay * (1 + 0.25 * np.array([-1.0, 0.2, 0.8]))
    return {"delay": delay}, "each leg's driver has its own delay, 25 % apart"


def current_gain(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `current_gain` into a bench."""
    a, b = 1 + 0.015 * size * rng.uniform(0.5, 1.3, 2) * np.array([_sign(rng), _sign(rng)])
    d.sens["gain"] = d.sens["gain"] * np.array([a, b, 1.0])
    if own:
        d.sens["cubic"] = -0.03 * size
        return {
            "gain_a": float(a),
            "gain_b": float(b),
        }, "all three sensors also bend: a cubic of 3 % at 2.5 times rated current"
    return {"gain_a": float(a), "gain_b": float(b)}, LIBRARY_FORM


def current_offset(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `current_offset` into a bench."""
    a, b = (
        0.012
        * size
        * d.drive.current
        * rng.uniform(0.5, 1.3, 2)
        * np.array([_sign(rng), _sign(rng)])
    )
    offset = np.array([a, b, -a - b])
    d.sens["offset"] = d.sens["offset"] + offset
    if own:
        d.sens["offset_drift"] = d.sens["offset_drift"] + 0.25 * offset
        return {
            "offset_a": float(a),
            "offset_b": float(b),
        }, "the offset grows by a quarter each second of a recording"
    return {"offset_a": float(a), "offset_b": float(b)}, LIBRARY_FORM


def current_filter(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `current_filter` into a bench."""
    tau = 0.05 * size * d.drive.period
    if not own:
        d.sens["filter"] = np.array([1.0, tau, 1.0])
        return {"time_constant": tau}, LIBRARY_FORM
    damping = float(rng.uniform(0.6, 0.9))
    d.sens["filter"] = np.array([2.0, tau / (2 * damping), damping])
    return {
        "time_constant": tau
    }, f"second order, damping {damping:.2f}; the time constant is its delay at low frequency"


def current_sampling(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `current_sampling` into a bench."""
    delay = 0.03 * size * d.drive.period
    if not own:
        d.sens["delay"] = np.full(3, delay)
        return {"delay": delay}, LIBRARY_FORM
    d.sens["delay"] = delay * np.array([0.4, 1.0, 1.6])
    return {"delay": delay}, "the phases are sampled one after another, at 0.4, 1 and 1.6 of it"


def encoder_offset(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `encoder_offset` into a bench."""
    offset = 0.035 * size * _sign(rng)
    d.sens["angle_offset"] += offset
    if own:
        d.sens["angle_latency"] = 0.3 * abs(offset) / (d.drive.speed * d.drive.pole_pairs)
        return {"offset": offset}, "and the encoder answers late: 30 % of the offset at rated speed"
    return {"offset": offset}, LIBRARY_FORM


def encoder_eccentricity(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `encoder_eccentricity` into a bench."""
    a, phase = 0.03 * size / d.drive.pole_pairs, float(rng.uniform(-np.pi, np.pi))
    second = 0.4 * a if own else 0.0
    d.sens["eccentricity"] = np.array([a, phase, second, rng.uniform(-np.pi, np.pi)])
    text = "and a second harmonic of 40 %" if own else LIBRARY_FORM
    return {"amplitude_mech": a, "phase": phase}, text


def coulomb_friction(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `coulomb_friction` into a bench."""
    t = 0.04 * size * d.torque
    if not own:
        d.mech["coulomb"] = np.array([t, 2.0])
        return {"torque": t, "width": 2.0}, LIBRARY_FORM
    rise = float(rng.uniform(1.2, 1.7))
    d.mech["lugre"] = np.array(
        [t, rise * t, 0.02 * d.drive.speed, t / 2e-3, 0.02 * t / (0.01 * d.drive.speed)]
    )
    return {
        "torque": t
    }, f"LuGre: breaks away at {rise:.2f} of the sliding torque, Stribeck, bristles of 2 mrad"


def viscous_friction(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `viscous_friction` into a bench."""
    b = d.nominal["viscous_friction"] + 0.05 * size * d.torque / d.drive.speed
    d.true["viscous_friction"] = b
    return {"coefficient": b}, LIBRARY_FORM


def cogging_torque(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `cogging_torque` into a bench."""
    order = float(np.lcm(d.drive.slots, 2 * d.drive.pole_pairs))
    a, phase = 0.03 * size * d.torque, float(rng.uniform(-np.pi, np.pi))
    rows = [[a, order, phase]]
    if own:
        rows += [
            [0.5 * a, d.drive.slots, rng.uniform(-3, 3)],
            [0.35 * a, 2 * d.drive.pole_pairs, rng.uniform(-3, 3)],
        ]
        rows += [[0.25 * a, 2 * order, rng.uniform(-3, 3)]]
    d.mech["cogging"] = np.array(rows, float)
    text = "orders of slots, poles, their common multiple and twice it" if own else LIBRARY_FORM
    return {"amplitude": a, "order_mech": order, "phase": phase}, text


def inertia(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `inertia` into a bench."""
    d.true["inertia"] = d.nominal["inertia"] * (1 + max(0.15 * size * _sign(rng), -0.6))
    return {"inertia": d.true["inertia"]}, LIBRARY_FORM


def shaft_compliance(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `shaft_compliance` into a bench."""
    j = d.true["inertia"]
    load = float(rng.uniform(0.3, 0.6)) * j
    f = float(np.clip(70.0 / np.sqrt(size), 25.0, 600.0))
    reduced = load * (j - load) / j
    k = (2 * np.pi * f) ** 2 * reduced
    damping = 2 * 0.02 * np.sqrt(k * reduced)
    d.mech["load_inertia"] = load
    gap = 0.3 * d.torque / k if own else 0.0
    d.mech["shaft"] = np.array([k, damping, 0.5 * gap])
    text = f"with a gap of {1e3 * gap:.2f} mrad beside the spring" if own else LIBRARY_FORM
    return {"stiffness": k, "load_inertia": load}, text


LIBRARY: dict[str, Cause] = {
    f.__name__: f
    for f in (
        stator_resistance,
        magnet_flux,
        inductance,
        saturation,
        cross_saturation,
        flux_harmonics,
        inductance_harmonics,
        iron_loss,
        skin_effect,
        winding_asymmetry,
        dead_time,
        device_drop,
        dc_link_error,
        dc_link_ripple,
        pwm_delay,
        current_gain,
        current_offset,
        current_filter,
        current_sampling,
        encoder_offset,
        encoder_eccentricity,
        coulomb_friction,
        viscous_friction,
        cogging_torque,
        inertia,
        shaft_compliance,
    )
}
ONLY_LIBRARY_FORM = ("magnet_flux", "inductance", "viscous_friction", "inertia")


def fan(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `fan` into a bench."""
    d.mech["fan"] = 0.12 * size * d.torque / d.drive.speed**2 * 4
    return {}, "a fan on the shaft: torque by the square of the speed"


def temperature_drift(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `temperature_drift` into a bench."""
    d.loss["drift"] = 0.08 * size
    return {}, "the winding heats within each recording: its resistance rises by 8 % a second"


def sensor_hysteresis(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `sensor_hysteresis` into a bench."""
    d.sens["hysteresis"] = 0.012 * size * d.drive.current
    return {}, "current sensors with remanence: a play of 1.2 % of rated current"


def sensor_saturation(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `sensor_saturation` into a bench."""
    d.sens["clip"] = d.drive.current * 1.35 / size**0.25
    return {}, "current sensors that saturate near 1.35 of rated current"


def slipping_encoder(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `slipping_encoder` into a bench."""
    d.sens["slip"] = -3e-4 * size
    return {}, "the encoder's coupling slips: 0.3 mrad for each radian turned"


def periodic_load(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `periodic_load` into a bench."""
    d.mech["periodic"] = np.array(
        [0.06 * size * d.torque, float(rng.choice([0.37, 1.62, 2.71])), rng.uniform(-3, 3)]
    )
    return {}, "a load torque that turns with another shaft (belt), asked by nobody"


def rough_counter(d: Design, size: float, own: bool, rng: np.random.Generator) -> Result:
    """Put the cause `rough_counter` into a bench."""
    d.inv["counts"] = float(max(20, round(90 / size)))
    return {}, "the modulator rounds duties to some 90 steps"


OUTSIDE: dict[str, Cause] = {
    f.__name__: f
    for f in (
        fan,
        temperature_drift,
        sensor_hysteresis,
        sensor_saturation,
        slipping_encoder,
        periodic_load,
        rough_counter,
    )
}

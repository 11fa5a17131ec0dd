"""All effects of the switched bench at once, and commands as a controller with injection gives
them."""

import numpy as np

from sandbox.switched.bench_state import Slot
from sandbox.switched.layers import CIRCUITS, Held
from sandbox.switched.phase_machine import reservoir

ALL_ON = {
    "stator_resistance.resistance": 11.0,
    "magnet_flux.magnet_flux": 0.1,
    "inductance.scale_d": 1.1,
    "inductance.scale_q": 0.93,
    "saturation.alpha_30": 8.0,
    "cross_saturation.alpha_12": 5.0,
    "cross_saturation.alpha_22": 20.0,
    "flux_harmonics.psi_d6": 0.002,
    "flux_harmonics.psi_q6": -0.001,
    "inductance_harmonics.gamma_6": 0.6,
    "iron_loss.core_resistance": 1500.0,
    "iron_loss.time_constant": 1.5e-4,
    "skin_effect.resistance": 1.5,
    "skin_effect.time_constant": 3e-4,
    "winding_asymmetry.delta_a": 0.3,
    "winding_asymmetry.delta_b": -0.2,
    "dead_time.time": 2e-6,
    "device_drop.threshold": 0.8,
    "device_drop.on_resistance": 0.3,
    "dc_link_error.gain_error": 0.01,
    "dc_link_error.sag": 8.0,
    "dc_link_ripple.amplitude": 4.0,
    "dc_link_ripple.frequency": 300.0,
    "pwm_delay.delay": 1.3e-5,
    "current_gain.gain_a": 1.01,
    "current_gain.gain_b": 0.99,
    "current_offset.offset_a": 0.01,
    "current_filter.time_constant": 2e-5,
    "current_sampling.delay": 4e-6,
    "encoder_offset.offset": 0.02,
    "encoder_eccentricity.amplitude_mech": 0.003,
    "coulomb_friction.torque": 0.05,
    "coulomb_friction.stribeck_torque": 0.02,
    "viscous_friction.coefficient": 8e-4,
    "cogging_torque.amplitude": 0.03,
    "cogging_torque.order_mech": 12.0,
    "inertia.inertia": 1.2e-3,
    "shaft_compliance.stiffness": 400.0,
    "shaft_compliance.load_inertia": 5e-4,
}


def commands(n, seed=3, amplitude=40.0):
    """Return commanded voltages (V): a turning vector with steps, as a controller with injection
    gives them."""
    rng = np.random.default_rng(seed)
    k = np.arange(n)
    u = amplitude * np.exp(2j * np.pi * 0.011 * k) + 30.0 * np.where(k % 8 < 4, 1.0, -1.0)
    u += rng.normal(0.0, 2.0, n) + 1j * rng.normal(0.0, 2.0, n)
    return u.real.copy(), u.imag.copy()


def stored(b, state):
    """Return the energy (J) that the bench's machine and shaft hold in a state."""
    vectors = (Slot.PSI_ALPHA, Slot.CORE_ALPHA, Slot.SKIN_ALPHA)
    motion = (Slot.THETA, Slot.SPEED, Slot.LOAD_SPEED, Slot.TWIST)
    return reservoir(
        b,
        *(complex(state[k], state[k + 1]) for k in vectors),
        Held(*(complex(*state[Slot.MODES + 2 * k :][:2]) for k in range(CIRCUITS))),
        *(state[k] for k in motion),
    )


def unaccounted(b, state):
    """Return what came in and is neither lost, nor given to the load, nor stored (J): constant."""
    gone = state[Slot.LOSS] + state[Slot.OUTPUT]
    return state[Slot.INPUT] - gone - stored(b, state)

"""What a period of the replay takes, by the number of sets side by side and by what they need.

The constants of `sandbox.replay.grouping`, measured: ns a period of a block of every size, bare and
with each kind of effect on, and a straight line through what each adds.  Run on an otherwise idle
machine:

    python -m experiments.lane_cost
"""

from __future__ import annotations

import time

import numpy as np

from model.drive_files import load_drive
from sandbox.plant import additions as add
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.replay.grouping import ROOMS, SAMPLED, VECTOR
from sandbox.replay.replay import Prepared, block_of, needs_of, prepare, run_block

SAMPLES, TIMES = 4000, 25
NAMES = (
    "LEG",
    "IRON",
    "SKIN",
    "LAYERS",
    "FILTER",
    "ENERGY",
    "LINK",
    "MAGNETS",
    "COMMUTE",
    "ROUND",
    "WINDING",
    "DELAYED",
    "WOBBLE",
    "SAMPLED",
    "CURVE",
    "CORE_LOSS",
)
ON = {
    "LEG": {"device_drop.threshold": 1.0, "device_drop.on_resistance": 0.05},
    "IRON": {"iron_loss.core_resistance": 500.0},
    "SKIN": {"skin_effect.resistance": 1.0, "skin_effect.time_constant": 1e-4},
    "LAYERS": {
        "skin_effect.resistance": 1.0,
        "skin_effect.layers": 3.0,
        "skin_effect.time_constant": 3e-5,
    },
    "FILTER": {"current_filter.time_constant": 5e-6},
    "ENERGY": {"inductance_harmonics.gamma_6": 1.0},
    "LINK": {"dc_link_ripple.amplitude": 5.0},
    "MAGNETS": {"flux_harmonics.psi_d6": 0.01},
    "COMMUTE": {"dead_time.time": 1e-6, "dead_time.capacitance": 1e-10},
    "ROUND": {"device_drop.threshold": 1.0, "bench.soft_shape": 0.5},
    "WINDING": {"winding_asymmetry.delta_a": 0.1},
    "DELAYED": {"pwm_delay.delay": 5e-6},
    "WOBBLE": {"encoder_eccentricity.amplitude_mech": 0.005},
    "CURVE": {"leg_voltage.v_2": 1.0, "leg_voltage.v_6": 0.5},
    # with what IRON adds, which `grouping` counts apart
    "CORE_LOSS": {"iron_loss.hysteresis_current": 0.05, "iron_loss.excess_current": 0.05},
    # the first lane; the others down to as much too early
    "SAMPLED": {"current_sampling.delay": 4e-5},
}


def driven() -> Prepared:
    """Return a recording of a rotor driven at half its rated speed."""
    drive = load_drive("ipm_exchanged")
    motor, h, k = drive.motor, drive.converter.sampling_period, np.arange(SAMPLES)
    omega = 0.5 * motor.rated_omega
    u = (np.where(k % 8 < 4, 30.0, -30.0) + 1j * omega * motor.magnet_flux) * np.exp(
        1j * omega * h * (k + 0.5)
    )
    columns = {
        "t": k * h,
        "u_alpha": u.real,
        "u_beta": u.imag,
        "theta": omega * h * k,
        "u_dc": np.full(SAMPLES, 400.0),
    }
    columns |= {f"i_{x}": np.zeros(SAMPLES) for x in "abc"}
    recording = CampaignRecording("driven", "driven", "d", columns)
    return prepare(Campaign("cost", drive, (recording,), {}, {}, False), steps=1)


def times(prepared: Prepared, effects: dict[str, float]) -> list[float]:
    """Return the ns a period of blocks of all sizes, the best of some."""
    drive, r = prepared.campaign.drive, prepared.recordings[0]
    out = []
    for lanes in ROOMS:
        each = [{k: x * (1.0 - 2.0 * j / lanes) for k, x in effects.items()} for j in range(lanes)]
        sets = each if "current_sampling.delay" in effects else [effects] * lanes
        block = block_of(
            prepared, range(lanes), [complete(drive.motor, drive.converter, v) for v in sets]
        )
        currents, moved, taken = np.empty((r.samples + 1, 3, lanes)), np.empty((1, 1)), []
        for _ in range(TIMES):
            start = time.thread_time()
            run_block(prepared, r, block, currents, moved, 0)
            taken.append(time.thread_time() - start)
        out.append(1e9 * min(taken) / r.samples)
    return out


def main() -> None:
    """Print a line for every kind of effect: times, and what it adds: constant, and for every
    VECTOR lanes."""
    prepared = driven()
    bare = times(prepared, {})
    vectors = np.array(ROOMS[1:]) / VECTOR  # a lane alone is no part of a vector: `grouping.ALONE`
    print(
        f"{'':10s}"
        + "".join(f"{n:>8d}" for n in ROOMS)
        + "   lanes: ns a period;  constant + each vector"
    )
    for name, own in (("bare", bare), *((n, times(prepared, ON[n])) for n in NAMES)):
        values = complete(
            prepared.campaign.drive.motor, prepared.campaign.drive.converter, ON.get(name, {})
        )
        drive = prepared.campaign.drive
        bit = SAMPLED if name == "SAMPLED" else getattr(add, name, 0)
        if name != "bare" and not needs_of(drive.motor, drive.converter, values) & bit:
            raise ValueError(f"ON[{name!r}] does not switch {name} on")
        each, constant = np.polyfit(
            vectors, np.subtract(own, 0.0 if name == "bare" else bare)[1:], 1
        )
        print(f"{name:10s}" + "".join(f"{x:8.0f}" for x in own) + f"   {constant:8.0f} {each:8.0f}")


if __name__ == "__main__":
    main()

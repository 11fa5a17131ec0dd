"""The protocol's tests, estimators and motors by name: to list or check them nothing is
compiled."""

from __future__ import annotations

from model.datasets import locate

BELIEFS = ("saturated", "linear")  # in the order of reading
ESTIMATORS = (
    "qnull",
    "inversion",
    "rotating",
    "hfi45",
    "vesc_hfi",
    "random_frequency",
    "table",
    "arbitrary",
    "pwm_ripple",
    "fluxdemod",
    "pll3",
    "mechanical",
    "monitor",
    "active_flux",
    "hybrid",
    "ekf",
    "ekf_current",
    "ukf",
)
MOTORS = ("ipm", "ipm_exchanged", "spm_exchanged")
MEASURED = "baldor_pmsyrm"  # the fourth, where its flux map is at hand

LINES = {
    "start": "how often the polarity is right in 3024 starts; one start-up serves all estimators",
    "static_map": "a locked rotor, currents in twelve directions up to twice rated current",
    "load_step": "a free rotor is held at standstill; the load steps from 0 to 180 % and back",
    "creep": "a free rotor creeps through a reversal at 0.2 % of rated speed, under 180 % load",
    "hand_over": "a free rotor goes from standstill to at most 30 % speed and back, under rated load",  # noqa: E501
    "robustness": (
        "standstill and 5 % speed, one thing at a time other than believed; asks that lock be kept"
    ),
    "attraction": "the first position is told wrong, all round the circle: how many come "
    "back to the right pole, end at the wrong one, end elsewhere",
    "bandwidth": "the frequency at which the estimate's answer to a swinging rotor has fallen by 3 dB",  # noqa: E501
    "mission": "210 s at low speed: loads up to 180 %, reversals, ramps, creeping; on one motor",
    "reversal": (
        "motulator's run on motulator's motor; with --peer error (rms) and CPU beside motulator's"
    ),
    "modulation": "discontinuous PWM, short pulses dropped, overmodulation to six steps, "
    "flying starts; asks that lock be kept, or found again",
    "cost": "the time of one step; torque ripple at standstill and at speed; copper loss and "
    "sound (a proxy, see injection_cost.py) that the injection adds at standstill",
}


def usual_motors() -> tuple[str, ...]:
    """Return MOTORS and, where its data set is on this machine, the measured one."""
    return (*MOTORS, MEASURED) if locate(MEASURED) is not None else MOTORS

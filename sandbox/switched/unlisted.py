"""What the bench can have beyond the effect library, by name: units, bounds, and checks before it
is put in.

    b = unlisted(bench(motor, converter), {"fan": 2e-5, "resolver": 2e-3})
    b = with_sign(b, "tanh", 0.45)

Equations stand where they act: `machine`, `simulate`, `leg`, `link`, `load_side`, `readers`,
`short_pulses`, `harmonics`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from model.errors import BadInput, unknown
from sandbox.switched.bench_numbers import SwitchedBench
from sandbox.switched.leg import SHAPES


@dataclass(frozen=True)
class Unlisted:
    """One number of an effect outside the library: its subsystem, unit, bounds, what it is and what
    it needs."""

    subsystem: str
    unit: str
    low: float
    high: float
    summary: str
    needs: str = ""


UNLISTED = {
    "grip": Unlisted(
        "machine",
        "1/H",
        0.0,
        1e7,
        "hysteresis, a play of the flux: current per flux (listed, too, as part of iron_loss)",
        "grip_radius",
    ),
    "grip_radius": Unlisted("machine", "Wb", 0.0, 1e2, "flux at which the play is used up"),
    "short_conductance": Unlisted(
        "machine", "S", 0.0, 1e4, "short-circuited turns of phase a", "short_time"
    ),
    "short_time": Unlisted("machine", "s", 0.0, 1.0, "time constant of their loop"),
    "knee": Unlisted("machine", "A/Wb^2", 0.0, 1e9, "saturation with a knee"),
    "knee_flux": Unlisted("machine", "Wb", 0.0, 1e2, "flux from which on it acts"),
    "curvature": Unlisted(
        "sensor", "1/A^2", -1e3, 1e3, "current sensors lose by the square of the current"
    ),
    "fan": Unlisted(
        "mechanics", "N m s^2/rad^2", 0.0, 1e3, "load torque by the square of the load's speed"
    ),
    "resolver": Unlisted(
        "sensor", "rad mechanical", 0.0, 0.2, "error twice a turn, of a resolver of one pole pair"
    ),
    "resolver_phase": Unlisted("sensor", "rad", -1e3, 1e3, "its phase"),
    "least_pulse": Unlisted(
        "inverter", "s", 0.0, 1e-3, "shorter pulses and gaps of a leg are dropped"
    ),
    "least_vector": Unlisted(
        "inverter", "s", 0.0, 1e-3, "shorter active vectors are dropped: legs switch together"
    ),
    "link_rate": Unlisted(
        "inverter",
        "rad/s",
        0.0,
        1e5,
        "resonance of the link, 1/sqrt(L C) (listed, too, as part of dc_link_error)",
        "link_impedance",
    ),
    "link_impedance": Unlisted(
        "inverter", "ohm", 0.0, 1e3, "sqrt(L/C): dip after a step of one ampere"
    ),
    "link_damping": Unlisted(
        "inverter", "", 0.0, 2.0, "damping ratio; 2 damping impedance is the link's resistance"
    ),
    "one_sided": Unlisted(
        "inverter", "ohm", 0.0, 1e3, "what a leg loses more while its current flows out of it"
    ),
    "channel_lag": Unlisted(
        "sensor",
        "s",
        0.0,
        1e-3,
        "phases are read one after another, b after a, c after b (listed, too, as part of "
        "current_sampling)",
    ),
    "remanence": Unlisted(
        "sensor", "", 0.0, 1.0, "cores of current sensors remember: a play", "remanence_radius"
    ),
    "remanence_radius": Unlisted("sensor", "A", 0.0, 1e4, "current at which the play is used up"),
    "crank": Unlisted(
        "mechanics", "kg m^2", 0.0, 1e3, "the load's inertia swings twice a turn, as behind a crank"
    ),
    "crank_phase": Unlisted("mechanics", "rad", -1e3, 1e3, "its phase"),
    "lobe": Unlisted(
        "mechanics", "N m", 0.0, 1e5, "load torque once in several turns", "lobe_turns"
    ),
    "lobe_turns": Unlisted("mechanics", "", 0.0, 1e3, "turns of the motor for one of the load"),
    "lobe_phase": Unlisted("mechanics", "rad", -1e3, 1e3, "its phase"),
    "load_lag": Unlisted("mechanics", "s", 0.0, 10.0, "time constant of the load machine's torque"),
}
SHORT = {
    "least_pulse": (0.5, "half"),
    "least_vector": (0.5, "half"),
    "channel_lag": (0.1, "a tenth of"),
}


def unlisted(b: SwitchedBench, values: Mapping[str, float]) -> SwitchedBench:
    """Return the bench with effects outside the library, e.g. {"fan": 2e-5}; BadInput for what
    cannot be."""
    for name, value in values.items():
        if name not in UNLISTED:
            raise unknown("effect outside the library", name, UNLISTED)
        _check(name, value)
    new = b._replace(**{name: float(value) for name, value in values.items()})  # type: ignore[arg-type]
    for name, one in UNLISTED.items():
        if one.needs and getattr(new, name) > 0.0 and not getattr(new, one.needs) > 0.0:
            raise BadInput(
                f"{name} = {getattr(new, name):g} alone does nothing sound; give "
                f"{one.needs} > 0 beside it"
            )
    for name, (share, what) in SHORT.items():
        if not getattr(new, name) < share * new.period:
            raise BadInput(
                f"{name} = {getattr(new, name):g} s is out of range; give less than "
                f"{what} the PWM period"
            )
    carried = new.load_inertia if new.load_inertia > 0.0 else new.inertia
    if not new.crank < carried:
        raise BadInput(
            f"crank = {new.crank:g} kg m^2 leaves no inertia; give less than "
            f"{carried:g}, what the load has"
        )
    return new


def _check(name: str, value: float) -> None:
    one = UNLISTED[name]
    if (
        isinstance(value, bool)
        or not isinstance(value, (int, float))
        or not one.low <= value <= one.high
    ):
        bounds = f"[{one.low:g}, {one.high:g}] {one.unit}".rstrip()
        raise BadInput(f"{name} = {value!r} is out of range; give a number in {bounds}")


def with_sign(b: SwitchedBench, shape: str, half_width: float) -> SwitchedBench:
    """Return the bench whose currents' sign goes through zero as told: 'linear', 'hard' or 'tanh',
    half_width in A; BadInput for another shape, or a width that is none."""
    if shape not in SHAPES:
        raise unknown("shape of the sign", shape, SHAPES)
    if not (math.isfinite(half_width) and half_width > 0.0):
        raise BadInput(
            f"half_width = {half_width} A is out of range; give more than 0 (shape "
            "'hard' for no width)"
        )
    return b._replace(sign_shape=SHAPES[shape], soft_current=float(half_width))

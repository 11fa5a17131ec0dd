"""The card of an effect: what it is called, its equation, where it comes from, its parameters and how it shows."""

from __future__ import annotations

import math
from dataclasses import dataclass

from model.parameters import Converter, Motor

INF = math.inf
LINEAR_LACKS = 0.2  # of the linear energy at rated current: what saturation takes on common motors
SUBSYSTEMS = ("machine", "inverter", "sensor", "mechanics")


@dataclass(frozen=True)
class Parameter:
    """A number of an effect: neutral value (None: the motor's own `of_motor`), closed bounds, unit, typical size.

    The typical size is in units of `relative_to`, a key of `scales` ("": absolute; "neutral": of the neutral value).
    How a diagnosis fits it: `fit` is "linear", "log", "reciprocal" (the coordinate in which readings are close to
    linear) or "fixed" (kept neutral); `spread` the prior's standard deviation in that coordinate where the typical size
    does not say it; `starts` values to begin from, in units of the typical size; `scan` (first, last, step) in the
    parameter's unit, step 0: as fine as the recordings resolve.
    """

    name: str
    unit: str
    neutral: float | None
    low: float
    high: float
    typical: float
    relative_to: str = ""
    of_motor: str = ""
    fit: str = "linear"
    spread: float = 0.0
    starts: tuple[float, ...] = (1.0,)
    scan: tuple[float, float, float] | None = None

    def neutral_for(self, motor: Motor) -> float:
        """Return the neutral value for a motor."""
        return float(getattr(motor, self.of_motor)) if self.neutral is None else self.neutral

    def typical_for(self, motor: Motor, converter: Converter) -> float:
        """Return the typical size (in the parameter's unit) on a drive."""
        if self.relative_to == "neutral" and self.neutral_for(motor) == 0.0:
            if self.of_motor.startswith("alpha_"):
                return saturation_size(motor, self.of_motor)
            return abs(1.0 - self.typical) * flux_scale(motor)  # of magnets, where there are none
        if self.relative_to == "neutral":
            return self.typical * self.neutral_for(motor)
        return self.typical * scales(motor, converter)[self.relative_to]


@dataclass(frozen=True)
class Effect:
    """One effect; equation and source as text, signature as axis, order and region of the residual it leaves."""

    name: str
    summary: str
    subsystem: str
    equation: str
    source: str
    parameters: tuple[Parameter, ...]
    axis: str
    order: str
    region: str
    confused_with: tuple[str, ...]
    separated_by: str
    polar: tuple[str, str] | None = None  # amplitude and phase that are fitted as cosine and sine
    trace: float = 1.0  # of the size an ordinary trace may have in a diagnosis: less where a simulation meets it better


def saturation_size(motor: Motor, alpha: str) -> float:
    """Return the size of a coefficient `alpha_jk` that a linear nominal model lacks: its term phi^(j+k) then has
    LINEAR_LACKS of the energy phi^2 / 2 L at the flux L x rated current."""
    inductance = math.sqrt(motor.inductance_d * motor.inductance_q)
    degree = sum(int(x) for x in alpha.removeprefix("alpha_"))
    return LINEAR_LACKS / (2.0 * inductance * (inductance * motor.rated_current) ** (degree - 2))


def flux_scale(motor: Motor) -> float:
    """Return the magnet flux (Wb), or what rated current links where the rotor has no magnets."""
    return motor.magnet_flux or math.sqrt(motor.inductance_d * motor.inductance_q) * motor.rated_current


def scales(motor: Motor, converter: Converter) -> dict[str, float]:
    """Return what typical sizes are relative to, on this drive (SI)."""
    speed = motor.rated_omega / motor.pole_pairs
    return {
        "": 1.0,
        "rated current": motor.rated_current,
        "rated torque": motor.rated_torque,
        "rated torque / rated speed": motor.rated_torque / speed,
        "magnet flux": flux_scale(motor),
        "resistance": motor.resistance,
        "1 / L_d": 1.0 / motor.inductance_d,
        "rated reactance": motor.rated_omega * max(motor.inductance_d, motor.inductance_q),
        "DC link": converter.dc_bus_voltage,
        "DC link / rated current": converter.dc_bus_voltage / motor.rated_current,
        "PWM period": converter.sampling_period,
        "pole pairs": float(motor.pole_pairs),
        "inertia": motor.inertia,
        "inertia x (2 pi 100 Hz)^2": motor.inertia * (math.tau * 100.0) ** 2,
    }

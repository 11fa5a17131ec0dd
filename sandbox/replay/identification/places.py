"""What a fit of ordinary recordings moves: the motor's four values, and beside them what every
drive has.

Beside the motor stand the voltage that legs lose, delays, the core's loss, the magnets' sixth
harmonic, the sensors' gains and offsets, the zero of the angle and how the motor saturates.  Each
has the deviation that the campaign states, or the usual one of its effect's card; what may well be
there on any log (lost voltage, delays, a core, a harmonic, saturation of a motor that is stated
without) has its effect's typical size.  Data that tell it outdo this, and what they do not tell
widens the intervals of what looks alike.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from model.effects.card import Parameter, saturation_size
from model.effects.library import load_effect, neutral, parameters
from model.mapped import MappedMotor
from model.parameters import Motor
from sandbox.plant.sets import ORDINARY, SIGN_SPREAD, soft_current
from sandbox.recordings.campaign import Campaign
from sandbox.replay.identification.ends import ends
from sandbox.replay.replay import Prepared

NAMES = ("resistance", "inductance_d", "inductance_q", "magnet_flux")
LEAST = 1e-9  # of any of them, SI: a reluctance motor states no flux
OF_EFFECT = {
    "resistance": "stator_resistance.resistance",
    "inductance_d": "inductance.scale_d",
    "inductance_q": "inductance.scale_q",
    "magnet_flux": "magnet_flux.magnet_flux",
}
LOGARITHMS = ("inductance_d", "inductance_q")  # R and flux in shares of their start: linear ones
LOST = THRESHOLD, DEAD = ("device_drop.threshold", "dead_time.time")
OFFSETS = ("current_offset.offset_a", "current_offset.offset_b")
DELAYS = ("pwm_delay.delay", "current_sampling.delay")
HARMONICS = ("flux_harmonics.psi_d6", "flux_harmonics.psi_q6")
OFFSET_OF = "encoder_offset.offset"
ANGLE = "angles."  # of each angle that was made: its zero is nobody's reading
CORE, LAG = "iron_loss.core_resistance", "iron_loss.time_constant"
SIGN, SHAPE = "bench.soft_current", "bench.soft_shape"
# effects whose ordinary deviations join
JOINING = ("dead_time", "current_gain", "encoder_offset")
ALPHA = "saturation.alpha_"
# priors, one standard deviation: of rated current; of the link, as voltage or as time
OFFSET, DROP = 0.01, 0.02
# prior of R and flux, one standard deviation over nominal: data that say anything outdo it
OPEN = 10.0
# logarithm of the factor from the start within which one is looked for; inductances: inside a
# scale's bounds
WIDE = {
    "resistance": math.log(1e3),
    "magnet_flux": math.log(1e3),
    "inductance_d": math.log(4.0),
    "inductance_q": math.log(4.0),
}


class Place(NamedTuple):
    """A number of a fit: its unit (value at the place 1, or 0 of a logarithm), the place where it
    begins, its prior's centre and standard deviation, the bounds, all in that unit; form: how the
    place stands for the value, as cards say it ("linear", "log" or "reciprocal")."""

    unit: float
    begin: float
    centre: float
    deviation: float
    low: float
    high: float
    form: str = "linear"

    def value(self, x: float) -> float:
        """Return the value at a place."""
        if self.form == "reciprocal":
            return self.unit / x if x > 0.0 else math.inf
        return self.unit * (math.exp(x) if self.form == "log" else x)


def places(prepared: Prepared, begin: Mapping[str, float], nominal: Motor) -> dict[str, Place]:
    """Return every number that a fit may move, by name: the motor's own, then what stands beside.

    begin: of the motor's; nominal: the motor as it was stated.
    """
    return {
        **{n: _own(n, begin[n], float(getattr(nominal, n))) for n in NAMES},
        **dict(_other_places(prepared)),
        **{
            ANGLE + r.angle_name: Place(1.0, 0.0, 0.0, r.zero, -math.inf, math.inf)
            for r in prepared.recordings
            if r.zero > 0.0
        },
    }


def _own(name: str, begin: float, nominal: float) -> Place:
    stated, wide = max(nominal, LEAST) / begin, WIDE[name]
    if name in LOGARITHMS:
        return Place(begin, 0.0, math.log(stated), wide, -wide, wide, form="log")
    most = min(math.exp(wide), parameters()[OF_EFFECT[name]].high / begin)
    return Place(begin, 1.0, stated, OPEN * stated, math.exp(-wide), most)


def _other_places(prepared: Prepared) -> Iterator[tuple[str, Place]]:
    """Yield what is fitted beside the motor: name, place."""
    campaign, known = prepared.campaign, parameters()
    motor, converter = campaign.drive.motor, campaign.drive.converter
    lost = {THRESHOLD: DROP * converter.dc_bus_voltage, DEAD: DROP * converter.update_period}
    wide = lost | dict.fromkeys(OFFSETS, OFFSET * motor.rated_current)
    wide |= {n: known[n].typical_for(motor, converter) for n in (*DELAYS, *HARMONICS)}
    core = known[CORE].typical_for(motor, converter)
    lag = known[LAG]
    yield CORE, Place(core, 0.0, 0.0, 1.0, 0.0, core / known[CORE].low, form="reciprocal")
    yield LAG, _log(lag.neutral_for(motor), lag.spread, lag)
    for name, p in known.items():
        if name in wide:
            place, most = _linear(p, p.neutral_for(motor), wide[name]), _limit(name, campaign)
            if most > 0.0:  # a harmonic of magnets that are not there has no room
                yield name, place._replace(low=max(place.low, -most), high=min(place.high, most))
        elif name.partition(".")[0] in JOINING and p.ordinary is not None:
            yield name, _linear(p, p.neutral_for(motor), _ordinary(p, campaign))
        elif name.startswith(ALPHA) and not isinstance(motor, MappedMotor):
            own = p.neutral_for(motor)
            size = _ordinary(p, campaign) if own else saturation_size(motor, p.of_motor)
            yield name, _linear(p, own, size)
    yield SIGN, _log(soft_current(motor), SIGN_SPREAD)
    yield SHAPE, Place(1.0, 0.0, 0.0, 1.0, 0.0, 1.0)


def _limit(name: str, campaign: Campaign) -> float:
    """Return how far a parameter may go for the limits of its effect's card."""
    drive = campaign.drive
    card, values = load_effect(name.partition(".")[0]), neutral(drive.motor) | {name: 0.0}
    return ends(card, drive, values).get(name, math.inf)


def _linear(p: Parameter, own: float, deviation: float) -> Place:
    low, high = own - ORDINARY * deviation, own + ORDINARY * deviation
    return Place(1.0, own, own, deviation, max(p.low, low), min(p.high, high))


def _log(unit: float, spread: float, p: Parameter | None = None) -> Place:
    """Return the place of a size of which little is known, inside the bounds of its parameter."""
    low, high = (math.log(p.low / unit), math.log(p.high / unit)) if p else (-math.inf, math.inf)
    return Place(unit, 0.0, 0.0, spread, max(low, -3 * spread), min(high, 3 * spread), form="log")


def _ordinary(p: Parameter, campaign: Campaign) -> float:
    """Return the standard deviation of an ordinary deviation about a parameter's neutral value."""
    assert p.ordinary is not None
    return campaign.deviation_of(p.ordinary, p.neutral_for(campaign.drive.motor))

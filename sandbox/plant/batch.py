"""The batch: many parameter sets side by side in one record, a row of `lanes` numbers for each
quantity.

A record with one small array a field is what lets a compiler see that rows do not overlap, so that
loops over lanes become vector code; fields have names, not positions.  One state is a batch of one
lane.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numba
import numpy as np

from model.effects.card import REPEATED
from model.inverter_table import MOST_POINTS
from sandbox.plant import ports
from sandbox.plant.edges import EDGES

NEVER = -1.0  # s: no edge waits

STATES = {  # what a period starts from; stationary frame (alpha, beta) unless said otherwise
    "psi_alpha": "flux linkage, Wb",
    "psi_beta": "flux linkage, Wb",
    "eddy_alpha": "flux behind the iron's lag, Wb",
    "eddy_beta": "flux behind the iron's lag, Wb",
    "ahead_alpha": "flux less what hysteresis holds of it, Wb",
    "ahead_beta": "likewise, Wb",
    "slow_alpha": "current behind the skin effect's lag, A",
    "slow_beta": "current behind the skin effect's lag, A",
    "filter_alpha": "current behind the sensors' filter, A",
    "filter_beta": "current behind the sensors' filter, A",
    "angle": "rotor less the shaft's twist, rad electrical",
    "speed": "of it, rad/s electrical",
    "twist": "of the shaft, rad mechanical",
    "slip": "slope of the twist, rad/s",
    "bristle": "torque of bent bristles against the motion, N m",
    "deviation": "what the angle's readings are off beside a constant, rad electrical",
    "dip": "of the link below its source, V",
    "feed": "current that the source feeds, times its impedance, V",
    "fed": "1 once both are known",
}
SCRATCH = {  # within a period
    "off_c": "cos of what the rotor stands behind the angle handed in",
    "off_s": "sin of it",
    "rest_d": "magnets' harmonics in the rotor frame, Wb",
    "rest_q": "magnets' harmonics in the rotor frame, Wb",
    "z_d": "flux due to currents, rotor frame, Wb",
    "z_q": "flux due to currents, rotor frame, Wb",
    "i_d": "magnetising current, rotor frame, A",
    "i_q": "magnetising current, rotor frame, A",
    "core_alpha": "iron-loss current, A",
    "core_beta": "iron-loss current, A",
    "i_alpha": "terminal current at the segment's start, A",
    "i_beta": "terminal current at the segment's start, A",
    "first_alpha": "terminal current at the pattern's start, A",
    "first_beta": "terminal current there, A",
    "j_alpha": "terminal current in its middle, A",
    "j_beta": "terminal current in its middle, A",
    "last_alpha": "terminal current at the last segment's start, A",
    "last_beta": "terminal current there, A",
    "more_alpha": "of it what the energy's further terms say, A",
    "more_beta": "likewise, A",
    "extra_alpha": "the same where it was last asked for, A",
    "extra_beta": "likewise, A",
    "bend_alpha": "half of what late edges add to the segment's mean flux, Wb",
    "bend_beta": "likewise, Wb",
    "begun_alpha": "iron-loss current at the segment's start, A",
    "begun_beta": "likewise, A",
    "dragged_alpha": "`ahead` at the segment's end, Wb",
    "dragged_beta": "likewise, Wb",
    "held_back_alpha": "its mean over the segment, Wb",
    "held_back_beta": "likewise, Wb",
    "eased": "excess-loss current by the lagged slope, at the segment's start, 1/ohm",
    "core_stiff": "1/H by which the iron-loss current follows the flux at once",
    "core_less": "what a growing drop takes from the mean iron-loss current, A/V",
    "swell_alpha": "mean current less that in the middle, A",
    "swell_beta": "likewise, A",
    "by_middle": "what the drops of layers keep from a segment's flux, by A and s, in the middle",
    "by_mean": "likewise, in the mean",
    "middle_alpha": "the same without a change of the current, V",
    "middle_beta": "likewise, V",
    "mean_alpha": "likewise, in the mean, V",
    "mean_beta": "likewise, V",
    "over_alpha": "V s that the drop of layers took too much in the last segment",
    "over_beta": "likewise, V s",
    "leg_alpha": "lost in the legs at the start, V",
    "leg_beta": "likewise, V",
    "drop_alpha": "resistive voltage at the start, V",
    "drop_beta": "resistive voltage at the start, V",
    "fall_alpha": "resistive voltage, mean of the segment, V",
    "fall_beta": "resistive voltage, mean of the segment, V",
    "volt_alpha": "volt-seconds of the segment, V s",
    "volt_beta": "volt-seconds of the segment, V s",
    "mid_alpha": "flux in the middle, Wb",
    "mid_beta": "flux in the middle, Wb",
    "late": "s by which the edge just taken acts later",
    "lost_alpha": "volt-seconds edges before it take, V s",
    "lost_beta": "V s",
    "lose_alpha": "their mean over the segment, V s",
    "lose_beta": "V s",
    "early_alpha": "K of late edges, Wb s, see `sandbox.plant.electrical`",
    "early_beta": "likewise, Wb s",
    "wait_alpha": "of it the part of edges before",
    "wait_beta": "Wb s",
    "link": "voltage of the DC link, V",
    "link_sag": "what the load takes off it, V",
    "turning": "dH/dtheta of what depends on the angle, J/rad (up to 3/2)",
    "torque": "of the air gap, N m",
    "impulse": "integral of it, N m s",
    "last_torque": "at the last period's end, N m",
    "held_alpha": "current that the samplers hold, A",
    "held_beta": "current that the samplers hold, A",
    "slope_alpha": "slope of the current in the zero vector, A/s",
    "slope_beta": "likewise, A/s",
    "slopes_alpha": "slope of that, A/s^2",
    "slopes_beta": "likewise, A/s^2",
    "when": "instant of a reading in the period, s",
    "next_deviation": "deviation at the period's end, rad",
    "read_a": "reading of sensor a, A",
    "read_b": "of sensor b, A",
    "read_c": "of sensor c, A",
    "stiff_aa": "inverse incremental inductance, 1/H",
    "stiff_ab": "1/H",
    "stiff_bb": "1/H",
    "stiffer_aa": "what the energy's further terms add to it, in a closed loop alone, 1/H",
    "stiffer_ab": "1/H",
    "stiffer_bb": "1/H",
    "faced_aa": "of it, the rotor as in the segment's middle, 1/H",
    "faced_ab": "1/H",
    "faced_bb": "1/H",
    "span_inv": "1/s of the segment",
    "turn": "rotor, rad mechanical",
    "omega": "rad/s mechanical",
    "surge": "half the rotor's last acceleration, rad/s^2 electrical",
    "bound": "torque bound to the rotor's position, N m",
    "net": "torque on the rotor's side, N m",
    "taken": "by the load, N m",
}
# of each lag over the segment under way, a row each for `CORE`, `SKIN`, `FILTER` and, from `LAYER`
# on, every branch of a winding's layers; see `sandbox.plant.lags`
LAGS = {
    "zeroth": "moments of its answer, see `model.lanes.lag_moments`",
    "first": "likewise",
    "second": "likewise",
    "kink_alpha": "what the kinks that late edges make in the flux add to the lag's flux at the end, Wb",  # noqa: E501
    "kink_beta": "likewise, Wb",
}
CORE, SKIN, FILTER, LAYER = range(4)
BRANCHES = 6  # that stand for the layers of a winding
# of each branch; see `sandbox.plant.layers`
LAYERS = {
    "layer_alpha": "current behind its lag, A: a state",
    "layer_beta": "likewise, A",
    "layer_r": "ohm; fixed once a batch",
    "layer_rate": "1/s; likewise",
}
# numbers of motor and bench, as `sandbox.plant.sets` writes them; a mapped motor adds them to its
# map
PLANT = {
    "gamma_d": "1/H",
    "gamma_q": "1/H",
    "cubic_d": "3 alpha_30, A/Wb^2",
    "cubic_q": "alpha_12, A/Wb^2",
    "quartic_d": "4 alpha_40, A/Wb^3",
    "quartic_dq": "alpha_22, A/Wb^3",
    "quartic_q": "4 alpha_04, A/Wb^3",
    "magnet": "magnet flux, Wb",
    "winding": "its resistance, ohm",
    "pairs": "pole pairs",
    "masses": "inertia of all, kg m^2",
    "rated_flux": "nominal flux of the magnets (of rated current without magnets), Wb",
    "rated_slope": "of it at rated speed, V",
    "common": "offset of all readings alike, A",
    "soft": "1/A: over half the width of sign(i) through zero",
    "shape": "of it: 0 linear, 1 tanh",
    "load_gain": "relative error of the load's torque",
    "load_offset": "N m",
}
FIXED = {  # what effects fix once a batch, as `sandbox.plant.fixed` writes it
    "resistance": "of winding and devices, ohm",
    "supply": "mean voltage of the DC link, V",
    "source_rate": "at which the link rings with its source, rad/s",
    "source_ohm": "impedance of that, ohm",
    "source_damping": "its damping ratio",
    "source_cos": "what is left of a swing after half a period",
    "source_sin": "what its slope makes of it, times the rate",
    "delay": "of the pattern, s",
    "sample": "instant of sampling less t_k and less the pattern's delay, s",
    "max_edge_delay": "latest that an edge acts after its command, s; written by `commutation.latest`",  # noqa: E501
    "jitter": "of the instant of sampling, s rms: in a closed loop, noise elsewhere",
    "core_g": "conductance across the flux slope, 1/ohm",
    "core_rate": "1/s of the iron's lag",
    "excess": "of the excess-loss current, A/V^(1/2) of the lagged slope",
    "slope_width": "of that slope within which it goes straight through zero, V",
    "play": "of hysteresis, current by flux not held, 1/H",
    "play_reach": "most of that flux, Wb",
    "skin_r": "ohm",
    "skin_rate": "1/s",
    "filter_rate": "1/s",
    "offset": "of the angle's reading, rad electrical",
    "latency": "by which the angle's reading is older than its row, s",
    "channel_lag": "by which each phase is sampled later than the one before, s",
    "inertia_inv": "1/(kg m^2), all of it",
    "motor_inv": "1/(kg m^2), the motor's side",
    "load_inv": "the load's",
    "load_share": "of the inertia",
    "swing_rate": "of the shaft, rad/s",
    "swing_ratio": "its damping ratio",
    "backlash": "of it, rad",
}


@cache
def batch_type(lanes: int) -> np.dtype[Any]:
    """Return the record's type for so many lanes.

    Beside the rows: those of effects' further parts (parts, lanes), how many of them any lane has
    at a port, and the inverter's measured table, the same for all lanes: points (A, V) and the
    integral up to each (A V).
    """
    rows = [
        (name, np.float64, (lanes,)) for name in (*STATES, *SCRATCH, *PLANT, *FIXED, *ports.NUMBERS)
    ]
    parts = [(name, np.float64, (count, lanes)) for name, count in several().items()]
    counts = [(name, np.int64) for name in (*map(more, REPEATED), "table_points")]
    table = [(f"table_{name}", np.float64, (MOST_POINTS,)) for name in ("current", "volts", "sum")]
    return np.dtype([*rows, *parts, *counts, *table], align=True)


def several() -> dict[str, int]:
    """Return the rows of which there are several, and how many of each."""
    return {
        **dict.fromkeys(LAGS, LAYER + BRANCHES),
        **dict.fromkeys(LAYERS, BRANCHES),
        **ports.FURTHER,
    }


def more(port: str) -> str:
    """Return the name of the number of further parts at a port."""
    return f"more_{port}"


@cache
def numba_type(lanes: int) -> Any:
    """Return the same as numba's type."""
    return numba.from_dtype(batch_type(lanes))


def blank(lanes: int) -> Any:
    """Return a record of zeros."""
    return np.zeros(1, batch_type(lanes))[0]


@cache
def room_type(lanes: int) -> np.dtype[Any]:
    """Return the type of the record in which a run keeps a period's pulses and the edges that wait.

    The edges of a period in order of time: instant (s), unit vector of the leg, side (1 rises, -1
    falls), whether one is switched (1 or 0), the leg, the place of the same leg's rising edge
    before it (-1: none).  duty, before: three legs', of this period and the last; shift: how late
    each leg's pulse is moved (s); half: of a PWM period (`edges.write_edges`).  blocked: 1 with the
    gates of all switches off; level: of each leg then, of the link; given: V s by the legs
    (`gates.blocked`).  Waiting: six edges of this period, then one of each leg left by the last:
    when they act in each lane (s), when all have (s; last: the latest of all), what they change of
    the legs' vector.
    """
    edge = [(name, np.float64, (EDGES,)) for name in ("time", "x", "y", "side", "real")]
    place = [(name, np.int64, (EDGES,)) for name in ("leg", "mate")]
    legs = [(name, np.float64, (3,)) for name in ("duty", "before", "shift")]
    legs += [("level", np.float64, (3,)), ("given", np.float64, (2,))]
    flags = [(name, np.int64) for name in ("half", "blocked")]
    more = [("acts", np.float64, (EDGES + 3, lanes)), ("until", np.float64, (EDGES + 4,))]
    change = [(name, np.float64, (EDGES + 3,)) for name in ("change_x", "change_y")]
    return np.dtype([*edge, *place, *legs, *flags, *more, *change], align=True)


def blank_room(lanes: int) -> Any:
    """Return room for a batch of so many lanes: no voltage before, nothing waiting."""
    room = np.zeros(1, room_type(lanes))[0]
    room["duty"], room["until"] = 0.5, NEVER
    return room

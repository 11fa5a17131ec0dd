"""The plant without a compiler, one lane: what a test starts with NUMBA_DISABLE_JIT=1.

`bits` prints readings of one lane in hexadecimal; `energy` the energies of one electrical turn at
steady state.
"""

import json
import sys

import numpy as np

from model.effects import library
from sandbox.plant import additions as add
from sandbox.plant import period as plant
from sandbox.plant import sets
from sandbox.plant.batch import blank_room
from sandbox.plant.fixed import fix
from sandbox.plant.sets import batch_of, complete, features_of, timing_of
from sandbox.replay.kernel import Fixed, Rows, run
from sandbox.replay.negative_resistance import none_given
from sandbox.replay.walking import start_states
from tests.sandbox.plant.stated_duties import DRIVE, duties, from_duties, turning

SHORT = 12  # periods
TURN = 40  # periods an electrical turn


class Fields:
    """A record whose fields are attributes, as compiled code sees them."""

    def __init__(self, record):
        for name in record.dtype.names:
            setattr(self, name, record[name])

    def __getitem__(self, name):
        """Return a field."""
        return getattr(self, name)

    def __setitem__(self, name, value):
        """Write a field in place."""
        getattr(self, name)[:] = value


def every(subsystems=("machine", "inverter", "sensor", "mechanics")):
    """Return all effects of subsystems at typical size."""
    names = [n for n in library.effect_names() if library.load_effect(n).subsystem in subsystems]
    out = {}
    for name in names:
        if name != "cross_saturation":
            out |= library.typical(name, DRIVE.motor, DRIVE.converter)
    return out


def lane(values):
    """Return a batch of one lane as a record with attributes, and its features."""
    v = complete(DRIVE.motor, DRIVE.converter, values)
    sets.fix = lambda w, nominal, period: fix(Fields(w), nominal, period)
    w = batch_of(DRIVE.motor, DRIVE.converter, [v], 1)
    return Fields(w), features_of(DRIVE.motor, v)


def room():
    """Return fresh room for one lane."""
    return Fields(blank_room(1))


def bits():
    """Return the readings of one lane with every effect as hexadecimal numbers."""
    prepared = from_duties(DRIVE, duties(SHORT), *turning(SHORT))
    r, (w, features) = prepared.recordings[0], lane(every())
    start_states(w, r, None)
    out = np.empty((SHORT, 3, 1))
    timing = timing_of(w, DRIVE.converter.sampling_period, 1)
    track, fixed = (
        [Fields(x) for x in r.track],
        Fixed(True, w.supply.copy(), none_given(w.supply.size)),
    )
    none, torque, rows = np.empty((1, 1)), np.empty(0), Rows(1, 0, 0, SHORT)
    run(w, None, timing, features, room(), track, rows, fixed, 0.0, out, none, torque, 0)
    return [float(x).hex() for x in out.ravel()]


class Meter:
    """Adds up powers over the plant's segments by Simpson's rule: at start, middle and the next
    one's start."""

    def __init__(self, w, values, omega, first):
        """first: the period at whose start the turn begins."""
        self.w, self.v, self.omega, self.first_period, self.total = (
            w,
            values,
            omega,
            first,
            dict.fromkeys(NAMES, 0.0),
        )
        self.period, self.begun, self.last = -1, [], None

    def losses(self, i, core, slow):
        """Return copper, skin, winding and core losses (W) at a current, iron-loss current and slow
        current."""
        v, g = self.v, self.w.core_g[0]
        a, b = i.real, -0.5 * i.real + 0.5 * np.sqrt(3.0) * i.imag
        phases = v["winding_asymmetry.delta_a"] * a * a + v["winding_asymmetry.delta_b"] * b * b
        copper = 1.5 * self.w.resistance[0] * abs(i) ** 2 + phases
        return np.array(
            [copper, 1.5 * self.w.skin_r[0] * abs(i - slow) ** 2, 1.5 * abs(core) ** 2 / g]
        )

    def at_start(self, share):
        """End the last segment and begin one, share of the period after its start."""
        w, counts = self.w, 0 <= self.period - self.first_period < TURN
        now = [
            complex(getattr(w, f"{x}_alpha")[0], getattr(w, f"{x}_beta")[0])
            for x in ("i", "core", "slow")
        ]
        if counts:
            span, volts, impulse, first, middle = self.last
            i = (first[0] + 4.0 * middle[0] + now[0]) / 6.0
            self.total["input"] += 1.5 * (volts.conjugate() * i).real
            middle[2] = 0.5 * (first[2] + now[2])
            lost = (
                (self.losses(*first) + 4.0 * self.losses(*middle) + self.losses(*now)) * span / 6.0
            )
            for name, x in zip(("copper", "skin", "core"), lost, strict=True):
                self.total[name] += x
            self.total["shaft"] += impulse * self.omega
        self.begun = now
        self.period += share == 0.0

    def in_middle(self, span, impulse):
        """Keep what a segment's middle says."""
        w = self.w
        middle = [
            complex(getattr(w, f"{x}_alpha")[0], getattr(w, f"{x}_beta")[0]) for x in ("j", "core")
        ] + [0j]
        self.last = span, complex(w.volt_alpha[0], w.volt_beta[0]), impulse, self.begun, middle


NAMES = ("input", "copper", "skin", "core", "shaft")


def energy(steps, turns=8):
    """Return the energies (J) of one electrical turn at steady state, all machine effects on."""
    period, pairs = DRIVE.converter.sampling_period, DRIVE.motor.pole_pairs
    speed, values = 2.0 * np.pi / (TURN * period), every(("machine",))
    n = TURN * turns
    middle = 0.3 + speed * period * (np.arange(n) + 0.5)
    u = 0.28 * np.exp(1j * (middle + 1.9))
    legs = np.stack(
        [u.real, -0.5 * u.real + np.sqrt(0.75) * u.imag, -0.5 * u.real - np.sqrt(0.75) * u.imag],
        axis=1,
    )
    duty = 0.5 + legs - 0.5 * (legs.max(axis=1) + legs.min(axis=1))[:, None]
    (w, features), v = lane(values), complete(DRIVE.motor, DRIVE.converter, values)
    w.psi_alpha[0] = w.eddy_alpha[0] = 0.0
    meter = Meter(w, v, speed / pairs, n - TURN - 1)
    start, mid = plant.at_start, plant.in_middle

    def at_start(*args):
        """Begin a segment, then look."""
        start(*args)
        meter.at_start(args[5])

    def in_middle(batch, flux_map, bits_on, c, s, share, trajectory, span, *more):
        """Go to a segment's middle, then look."""
        before = w.impulse[0]
        mid(batch, flux_map, bits_on, c, s, share, trajectory, span, *more)
        meter.in_middle(span, w.impulse[0] - before)

    plant.at_start, plant.in_middle = at_start, in_middle
    prepared = from_duties(DRIVE, duty, *turning(n, speed))
    timing = timing_of(w, period, steps)
    track, out, moved = (
        [Fields(x) for x in prepared.recordings[0].track],
        np.empty((n, 3, 1)),
        np.zeros((n, 1)),
    )
    run(
        w,
        None,
        timing,
        features | add.MOTION,
        room(),
        track,
        Rows(1, 0, 0, n),
        Fixed(True, w.supply.copy(), none_given(w.supply.size)),
        0.0,
        out,
        moved,
        np.empty(n),
        0,
    )
    plant.at_start, plant.in_middle = start, mid
    return meter.total


if __name__ == "__main__":
    print(json.dumps(bits() if sys.argv[1] == "bits" else [energy(n) for n in (1, 4, 16)]))

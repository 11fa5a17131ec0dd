"""The exact plant under told voltages, and the switched bench under the same: samples of motors
with closed forms."""

import numpy as np

from sandbox.drive.closed import closed_bench, longest_step, looked_into
from sandbox.drive.loop import MEMORY, Memory, Rig, progress, rotor, shift
from sandbox.drive.sensing import encoder, gather, looked_at, read_phases
from sandbox.plant.gates.modulation import modulation_of
from sandbox.plant.period import STILL
from sandbox.plant.sets import complete, features_of
from sandbox.switched.advance import replay
from sandbox.switched.bench_numbers import bench, quiet
from tests.sandbox.plant.effect_motors import CONVERTER, LINEAR, U, vector


class Exact:
    """The plant of a closed loop, moved period by period by hand; its batch `w`, sensors without
    noise.

    inside: what is read inside a period (`Inside`), None for nothing.
    """

    def __init__(
        self,
        effects=None,
        motor=LINEAR,
        rotor="locked",
        theta=0.0,
        speed=0.0,
        converter=CONVERTER,
        inside=None,
    ):
        values = complete(motor, converter, effects)
        step = longest_step(
            motor, values, features_of(motor, values), motor.pole_pairs * abs(speed)
        )
        # the plant's periods begin with their pattern
        ahead = motor.pole_pairs * speed * values["pwm_delay.delay"]
        self.bench = closed_bench(motor, converter, values, rotor, theta + ahead, step)
        self.bench = looked_into(self.bench) if inside else self.bench
        self.w, self.pairs, self.inside = self.bench.w, motor.pole_pairs, inside
        self.w["speed"][0] = self.pairs * speed
        self.rig = Rig(
            *5 * (0,),
            converter.sampling_period,
            0.0,
            0.0,
            0.0,
            converter.dc_bus_voltage,
            0.0,
            0.0,
            modulation_of(converter),
        )
        self.memory = np.zeros(MEMORY)
        self.memory[Memory.LINK], self.memory[Memory.INSTANT] = 1.0, self.w["sample"][0]
        self.looks, self.seen = looked_at(self.w, converter.sampling_period, inside)
        self.k, self.rng = 0, np.random.default_rng(0)

    def advance(self, u, load=0.0, blocked=False):
        """Return the current vector (A) read for t_k; the voltage u (complex, V) acts for a period
        from there."""
        self.memory[Memory.U_ALPHA], self.memory[Memory.U_BETA] = u.real, u.imag
        if self.inside:
            shift(self.bench.room, self.k, self.inside)
        applied = STILL._replace(load=load, load_after=load)
        progress(
            self.k,
            self.bench,
            self.rig,
            applied,
            self.memory,
            self.looks,
            self.seen,
            self.rng,
            blocked,
        )
        self.k += 1
        sample = vector(
            dict(zip(("i_a", "i_b", "i_c"), read_phases(self.w, self.rig, self.rng), strict=True))
        )
        if self.inside:
            gather(
                self.w, self.bench.room, self.rig, self.inside, self.rig.link, self.seen, self.rng
            )
        return sample

    @property
    def motion(self):
        """Angle (rad) and speed (rad/s) of the rotor, mechanical."""
        theta, omega = rotor(self.w)
        return theta / self.pairs, omega / self.pairs

    @property
    def flux(self):
        """Flux vector (Wb) at the end of the last period."""
        w, span = self.w, self.memory[Memory.SPAN]
        return complex(
            *(
                w[f"psi_{x}"][0] + w[f"volt_{x}"][0] - span * w[f"fall_{x}"][0]
                for x in ("alpha", "beta")
            )
        )

    @property
    def encoder(self):
        """Angle (rad, electrical) that the encoder reads, and its slope (rad/s)."""
        theta, omega = rotor(self.w)
        return encoder(self.w, self.bench.features, theta, omega, 0.0)


def exact(effects, u, motor=LINEAR, theta=0.0, speed=None):
    """Return the exact plant's samples (n,) under voltages u: rotor locked, or driven at a constant
    speed (rad/s)."""
    plant = Exact(effects, motor, "locked" if speed is None else "driven", theta, speed or 0.0)
    return np.array([plant.advance(v) for v in np.asarray(u, complex)])


def switched(effects, u, motor=LINEAR, theta=0.0, speed=None):
    """Return the switched bench's samples under the same."""
    u, how = np.asarray(u, complex), {"theta": theta}
    b = quiet(bench(motor, CONVERTER, effects))
    if speed is not None:
        how = {
            "theta": theta + motor.pole_pairs * speed * b.period * np.arange(len(u)),
            "speed": speed,
        }
    return vector(
        replay(b, "locked" if speed is None else "driven", u.real.copy(), u.imag.copy(), U, **how)
    )

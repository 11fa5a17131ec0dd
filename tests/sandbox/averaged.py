"""The averaged kernel and the switched bench fed with the same commands, for comparing their samples."""

import numpy as np

from model.effects.library import complete, true_motor
from model.parameters import load_drive
from sandbox.effects import compiled, longest_step, masses, start
from sandbox.full import advance
from sandbox.inverter import deliver
from sandbox.oldplant import OMEGA, Plant, steps_per_period
from sandbox.sensors import sampled
from sandbox.switched.effects import bench, quiet
from sandbox.switched.simulate import replay

LOCKED, DRIVEN, FREE = 0, 1, 2


class Averaged:
    """The full kernel of a drive with effects, without noise; state, plant and effects as attributes."""

    def __init__(self, motor, converter, effects=None, free=False, theta=0.0, omega=0.0, step=12.5e-6, resistance=None):
        values = complete(motor, converter, effects)
        true = true_motor(motor, values)
        self.effects = compiled(motor, converter, values, free)
        self.period = converter.sampling_period
        self.steps = steps_per_period(self.period, longest_step(values, step), abs(omega))
        self.x = start(self.effects, theta)
        self.x[OMEGA] = self.x[8] = omega
        acceleration = motor.pole_pairs / masses(values)[0] if free else 0.0
        self.plant = Plant(
            true.energy, true.magnet_flux, true.resistance if resistance is None else resistance,
            float(motor.pole_pairs), acceleration,
            true.viscous_friction, self.period / self.steps,
        )  # fmt: skip
        self.rng = np.random.default_rng(0)

    def sample(self, u):
        """Return the current vector that the sensors hold, the command u (complex, V) acting from now on."""
        e = self.effects
        i = sampled(self.x, self.plant, e.machine, e.inverter, e.sensors, u.real, u.imag, self.rng)
        return complex(i[0], i[1])

    def advance(self, u, load=0.0, imposed=0.0):
        """Advance by one period under the command u."""
        e = self.effects
        v = deliver(self.x, self.plant, e.machine, e.inverter, u.real, u.imag)
        advance(self.x, self.plant, e.machine, e.shaft, e.inverter.filter_time, *v, load, imposed, self.steps)
        return complex(*v)

    def run(self, u, load=0.0):
        """Return the samples under commands u, shape (n,)."""
        out = np.empty(len(u), complex)
        for k, v in enumerate(u):
            out[k] = self.sample(v)
            self.advance(v, load)
        return out


def vector(out):
    return (2 * out["i_a"] - out["i_b"] - out["i_c"]) / 3 + 1j * (out["i_b"] - out["i_c"]) / np.sqrt(3)


def commands(motor, omega, theta, period, n):
    """Return a driven motor's commands with injection along d, V: as tests/sandbox/test_switched_averaging.py."""
    k = np.arange(n)
    middle = theta + omega * period * (k + 0.5)
    u = (12.0 + 0.6 * omega / motor.pole_pairs) * 1j * np.exp(1j * (middle + 0.03))
    return u + 30.0 * np.where(k % 8 < 4, 1, -1) * np.exp(1j * middle)


def sensed(b, run):
    """Return the current vector that sensors of the bench's gains and offsets make of sampled vectors."""
    gains = np.array([b.gain_a, b.gain_b, b.gain_c]), np.array([b.offset_a, b.offset_b, -b.offset_a - b.offset_b])
    legs = np.array([run.real, -run.real / 2 + np.sqrt(0.75) * run.imag, -run.real / 2 - np.sqrt(0.75) * run.imag])
    read = gains[0][:, None] * legs + gains[1][:, None]
    return vector(dict(zip(("i_a", "i_b", "i_c"), read, strict=True)))


def both(effects, speed, n=600, motor="ipm"):
    """Return sampled currents (n,) of a driven motor over rated current: averaged, switched."""
    motor, converter = load_drive(motor).motor, load_drive(motor).converter
    omega, theta = motor.pole_pairs * speed, 0.3
    u = commands(motor, omega, theta, converter.sampling_period, n)
    b = quiet(bench(motor, converter, effects))
    if "current_sampling.jitter" in effects:
        b = b._replace(jitter=effects["current_sampling.jitter"])
    angle = theta + omega * converter.sampling_period * np.arange(n)
    switched = vector(replay(b, "driven", u.real, u.imag, converter.dc_bus_voltage, theta=angle, speed=speed))
    averaged = sensed(b, Averaged(motor, converter, effects, theta=theta, omega=omega).run(u))
    return averaged / motor.rated_current, switched / motor.rated_current


def both_free(effects, n=1200, motor="ipm"):
    """Return sampled currents (n,) over rated current of a free rotor swinging in a held field with a step of load."""
    motor, converter = load_drive(motor).motor, load_drive(motor).converter
    u = (10.0 + 5.0 * np.sin(np.arange(n) / 50.0)).astype(complex)
    load = np.where(np.arange(n) > n // 2, 0.2, 0.0)
    b = quiet(bench(motor, converter, effects))
    out = replay(b, "free", u.real, u.imag, converter.dc_bus_voltage, theta=2.0, load_torque=load)
    a, run = Averaged(motor, converter, effects, free=True, theta=2.0), np.empty(n, complex)
    for k in range(n):
        run[k] = a.sample(u[k])
        a.advance(u[k], load[k])
    return sensed(b, run) / motor.rated_current, vector(out) / motor.rated_current


def rms(x):
    """Return the rms of a vector signal after its first 80 samples."""
    return float(np.sqrt(np.mean(np.abs(x[80:]) ** 2)))


def gap(effects, speed, **how):
    """Return the rms difference of the sampled currents, averaged less switched, in rated currents."""
    averaged, switched = both(effects, speed, **how)
    return rms(averaged - switched)

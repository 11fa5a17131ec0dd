"""An exported drive as a shared library, run beside the Python plant on the same commands and the
same chances."""

import ctypes
import subprocess
from dataclasses import replace

import numpy as np

from estimators.c.build import STRICT, compiler
from estimators.registry import load_estimator
from model.effects import library
from sandbox.drive.export.source import HEADER, SOURCE, source_of
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate
from sandbox.plant.sets import complete

ROTORS = ("locked", "driven", "free")
SEED, ANGLE, SPEED = 3, 0.4, 0.2  # rad; speed of rated
READ, THETA_READ, LINK, CURRENT, THETA = slice(0, 3), 3, 5, slice(6, 9), 9  # places of the outputs
REAL, WHOLE, BY = ctypes.c_double, ctypes.c_int32, ctypes.c_void_p


def scene(rotor):
    """A tenth of a second: load, and speed where the rotor may turn."""
    speeds = (0.0, 0.0) if rotor == "locked" else (0.5 * SPEED, SPEED)
    loads = zip((0.3, 0.8), speeds, strict=True)
    parts = tuple(Segment(0.05, load, speed, ramp=0.02) for load, speed in loads)
    reference = {"reference": "current"} if rotor != "free" else {}
    return Scenario("exported", parts, rotor, start_up=False, start_angle=ANGLE, **reference)


def sizes(drive, names=None):
    """Return effects at half of their typical deviation (orders and phases as they are), all or
    some."""
    out = {}
    for name in names or library.effect_names():
        for p in library.load_effect(name).parameters:
            if p.same_as or (p.of_motor and p.of_motor != "viscous_friction"):
                continue  # a value of the motor itself: effects scale it
            size, neutral = p.typical_for(drive.motor, drive.converter), p.neutral_for(drive.motor)
            kept = p.whole or not np.isfinite(neutral) or p.fit == "fixed"
            out[f"{name}.{p.name}"] = size if kept else neutral + 0.5 * (size - neutral)
    if "shaft_compliance.load_inertia" in out:
        out["shaft_compliance.load_inertia"] = 0.3 * drive.motor.inertia
    return out


def python_run(drive, rotor, effects):
    """Return the recording of the Python plant under encoder control, so that both see the same
    commands."""
    run = simulate(
        drive, scene(rotor), load_estimator("qnull"), effects=effects, closed_loop=False, seed=SEED
    )
    return run.recording


def top_speed(drive):
    """Return the speed (rad/s) up to which `simulate` makes its steps short enough."""
    return 1.5 * SPEED * drive.motor.rated_omega


class Exported:
    """A drive in C, compiled."""

    def __init__(self, drive, folder, effects=None, double=True):
        self.drive = drive
        values = complete(drive.motor, drive.converter, effects)
        self.source = source_of(drive, values, top_speed(drive))
        (folder / HEADER).write_text(self.source.header)
        (folder / SOURCE).write_text(self.source.source)
        wide = ["-DSENSORLESS_FLOAT64"] if double else []
        call = [
            compiler(),
            *STRICT,
            "-O2",
            "-fPIC",
            "-shared",
            *wide,
            "-o",
            "drive.so",
            SOURCE,
            "-lm",
        ]
        subprocess.run(call, cwd=folder, check=True)
        self.real = REAL if double else ctypes.c_float
        self.library = ctypes.CDLL(str(folder / "drive.so"))
        self.library.sensorless_drive_init.argtypes = [BY, BY, WHOLE, *3 * (self.real,)]
        self.library.sensorless_drive_duties.argtypes = [*3 * (self.real,), BY]
        self.library.sensorless_drive_part.argtypes = [BY, BY, BY, WHOLE, WHOLE]

    def parameters(self, values):
        """Return the parameters as exported, some of them changed by public name."""
        count, title = (
            len(self.source.numbers),
            f"sensorless_drive_parameters_of_{self.source.motor}",
        )
        own = (self.real * count).from_buffer_copy((self.real * count).in_dll(self.library, title))
        for k, number in enumerate(self.source.numbers):
            own[k] = values.get(number.name, own[k])
        return own

    def begin(self, rotor, values=None, angle=ANGLE, chance=0.0):
        """Return memory of a drive begun, and what init said."""
        memory = ctypes.create_string_buffer(1 << 17)
        given = self.parameters(values or {})
        return memory, self.library.sensorless_drive_init(
            memory, given, ROTORS.index(rotor), angle, 0.0, chance
        )

    def run(self, recording, rotor, values=None, parts=1):
        """Return outputs (n, 13) under a recording's commands, with the chances that the Python
        plant had."""
        rng, jitter = (
            np.random.default_rng(SEED),
            (values or {}).get("current_sampling.jitter", 0.0) > 0.0,
        )
        memory, status = self.begin(rotor, values, chance=rng.standard_normal() if jitter else 0.0)
        assert status == 0
        n, duty, out = len(recording), (self.real * 3)(), (self.real * 13)()
        given, found = (self.real * 12)(), np.zeros((n, 13))
        for k in range(n):
            link = rng.standard_normal() if self.drive.converter.link_noise > 0.0 else 0.0
            chances = [rng.standard_normal() if jitter else 0.0, *rng.standard_normal(3), link]
            one, two = min(k + 1, n - 1), min(k + 2, n - 1)
            command = recording.u_alpha[k], recording.u_beta[k], recording.u_dc[k]
            self.library.sensorless_drive_duties(*command, duty)
            loads = recording.load_torque[k], recording.load_torque[one]
            given[:] = [*duty, *loads, recording.omega_ref[one], recording.omega_ref[two], *chances]
            for part in range(parts):
                assert self.library.sensorless_drive_part(memory, given, out, part, parts) == 0
            found[k] = out[:]
        return found


def differences(drive, found, recording):
    """Return by how much outputs differ from a recording: currents (of rated) at the samples and as
    read, angles (rad), all but the last two samples, whose next commands a recording does not
    know."""
    n, rated, pairs = len(recording) - 2, drive.motor.rated_current, drive.motor.pole_pairs
    a, b, c = found[: n - 1, CURRENT].T
    theta = recording.theta[1:n]
    i = ((2.0 * a - b - c) / 3.0 + 1j * (b - c) / np.sqrt(3.0)) * np.exp(-1j * theta)
    true = np.abs(i - recording.i_d[1:n] - 1j * recording.i_q[1:n]).max() / rated
    phases = np.column_stack([recording.i_a, recording.i_b, recording.i_c])[:n]
    read = np.abs(found[:n, READ] - phases).max() / rated
    angle = within(found[:n, THETA_READ] - recording.theta_read[:n], pairs)
    return true, read, np.abs(angle).max()


def within(angle, pairs):
    """Return electrical angles within a turn of the shaft."""
    turn = 2.0 * np.pi * pairs
    return (np.asarray(angle) + 0.5 * turn) % turn - 0.5 * turn


def quiet(drive):
    """Return a drive whose readings have neither noise nor counts."""
    return replace(
        drive,
        converter=replace(
            drive.converter, current_noise=0.0, current_resolution=0.0, link_noise=0.0
        ),
    )

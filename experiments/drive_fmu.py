"""A drive as an FMU under a controller in Python: estimator and current control here, motor and
inverter there.

python -m experiments.drive_fmu     prints the position error; needs FMPy and a C compiler
"""

from __future__ import annotations

import math
import shutil
import tempfile
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave

from estimators.contract import Sample
from estimators.registry import load_estimator
from model.drive_files import load_drive
from model.frames import rotate, stationary, wrapped
from sandbox.drive.control import average, blank, current_control
from sandbox.drive.design import belief_of, design
from sandbox.plant.edges import duties
from sandbox.public.exports.drive import export_drive
from sandbox.recordings.injection import carrier

# of rated current and speed
MOTOR, ESTIMATOR, LOAD, SPEED, ROTOR_DRIVEN = "ipm_exchanged", "qnull", 0.8, 0.05, 1
SECONDS, BEGIN = 0.6, 0.1  # s; from when on there is load and speed
READINGS = ["read_a", "read_b", "read_c", "theta_read"]
EFFECTS = {"dead_time.time": 5e-7}


def unit(folder: Path) -> tuple[Any, dict[str, int]]:
    """Return the FMU ready to step, its rotor driven, and its variables' references by name."""
    file = export_drive(MOTOR, EFFECTS).save(folder / "drive") / f"{MOTOR}_fmi2.fmu"
    description = fmpy.read_model_description(str(file))
    fmu = FMU2Slave(
        guid=description.guid,
        unzipDirectory=fmpy.extract(str(file)),
        instanceName="drive",
        modelIdentifier=description.coSimulation.modelIdentifier,
    )
    places = {v.name: v.valueReference for v in description.modelVariables}
    fmu.instantiate()
    fmu.setInteger([places["rotor"], places["noise_seed"]], [ROTOR_DRIVEN, 1])
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    return fmu, places


def run(folder: Path) -> np.ndarray:
    """Return the position error (degrees) of every period under load."""
    drive, estimator = load_drive(MOTOR), load_estimator(ESTIMATOR)
    belief, gains = belief_of(drive, "saturated"), design(drive, start_up=False)
    control, tuning, wave = gains.control, gains.tuning, carrier(drive.injection, drive.converter)
    state, step, memory = estimator.init(belief, tuning, 0.0), estimator.step_for(belief), blank()
    fmu, places = unit(folder)
    h, link, n, error = (
        control.sampling_period,
        drive.converter.dc_bus_voltage,
        len(wave.waveform),
        [],
    )
    before = acting = (0.0, 0.0)
    for k in range(round(SECONDS / h)):
        loaded = k * h >= BEGIN
        omega = SPEED * drive.motor.rated_omega if loaded else 0.0
        given = {
            **dict(zip(("duty_a", "duty_b", "duty_c"), duties(*acting, link), strict=True)),
            "omega_driven": omega,
        }
        fmu.setReal([places[name] for name in given], list(given.values()))
        fmu.doStep(k * h, h)
        a, b, c, theta = fmu.getReal([places[name] for name in READINGS])
        sample = Sample(*stationary(a, b, c), *before, wave.primitive[k % n])
        now = step(state, sample, belief, tuning)
        i_d, i_q = average(memory, *rotate(sample.i_alpha, sample.i_beta, -now.theta), n)
        wanted = LOAD * drive.motor.rated_current if loaded else 0.0
        injected = control.amplitude * now.injection
        u = current_control(memory, control, i_d, i_q, 0.0, wanted, omega, injected)
        pulse = injected * wave.waveform[(k + 1) % n]
        x, y = (
            rotate(*u, now.theta + 1.5 * h * now.omega),
            rotate(pulse, 0.0, now.axis + 1.5 * h * now.omega),
        )
        before, acting = acting, (x[0] + y[0], x[1] + y[1])
        if k * h >= 2.0 * BEGIN:
            error.append(math.degrees(float(wrapped(now.theta - theta))))
    fmu.terminate()
    fmu.freeInstance()
    shutil.rmtree(fmu.unzipDirectory)
    return np.array(error)


def main() -> None:
    """Run and say how far the estimate was off."""
    with tempfile.TemporaryDirectory() as folder:
        error = run(Path(folder))
    print(
        f"{ESTIMATOR} on {MOTOR} as an FMU: mean {error.mean():+.3f}, rms "
        f"{np.sqrt(np.mean(error**2)):.3f} degrees"
    )


if __name__ == "__main__":
    main()

"""motulator 0.18 and its native simulation on its own example, 2.2 kW, injection, speed reversal;
run by `peer_table`.

Prints a JSON line for each: CPU seconds a simulated second (median), position error rms (degrees)
after 1/8 of the run.
"""

from __future__ import annotations

import json
import statistics
import time

import motulator.drive.control.sm as control
import numpy as np
from motulator.drive import model, utils
from motulator_export import native

SECONDS = 4.0


def built(constant):
    """Return system and control: the values of motulator's 2.2 kW example, averaged voltage.

    constant: a constant speed without load in place of the profile, which the native simulation
    asks Python for.
    """
    machine = model.SynchronousMachinePars(n_p=3, R_s=3.6, L_d=0.036, L_q=0.051, psi_f=0.545)
    base = utils.BaseValues.from_nominal(
        utils.NominalValues(U=370, I=4.3, f=75, P=2.2e3, tau=14), n_p=3
    )
    converter = model.VoltageSourceConverter(u_dc=540)
    system = model.Drive(
        model.SynchronousMachine(machine), model.MechanicalSystem(J=0.015), converter
    )
    wanted = control.CurrentVectorControllerCfg(i_s_max=2 * base.i, alpha_o=2 * np.pi * 40)
    injection = control.SignalInjectionController(machine, wanted, U_inj=250)
    drive = control.VectorControlSystem(
        injection, control.SpeedController(J=0.015, alpha_s=2 * np.pi * 4)
    )
    if constant:
        drive.set_speed_ref(0.1 * base.w_M)
        return system, drive
    t = np.array([0, 0.25, 0.25, 0.375, 0.5, 0.625, 0.75, 0.75, 1]) * SECONDS
    drive.set_speed_ref(
        utils.SequenceGenerator(t, np.array([0, 0, 1, 1, 0, -1, -1, 0, 0]) * 0.1 * base.w_M)
    )
    t = np.array([0, 0.125, 0.125, 0.875, 0.875, 1]) * SECONDS
    system.mechanics.set_external_load_torque(
        utils.SequenceGenerator(t, np.array([0, 0, 1, 1, 0, 0]) * 14.0)
    )
    return system, drive


def run(simulation):
    """Return CPU seconds a simulated second and error rms (degrees)."""
    begun = time.process_time()
    result = simulation.simulate(SECONDS)
    spent = time.process_time() - begun
    seen = np.searchsorted(result.mdl.t, result.ctrl.t, side="right") - 1
    off = (
        np.asarray(result.mdl.machine.theta_m)[seen[seen >= 0]]
        - np.asarray(result.ctrl.fbk.theta_m)[seen >= 0]
    )
    error = np.degrees(np.angle(np.exp(1j * off)))[len(off) // 8 :]
    return spent / SECONDS, float(np.sqrt(np.mean(error**2)))


for name, kind, times, constant in (
    ("motulator-export, native", native.Simulation, 5, False),
    ("motulator-export, native, constant speed", native.Simulation, 5, True),
    ("motulator", model.Simulation, 3, False),
):
    found = [run(kind(*built(constant), show_progress=False)) for _ in range(times)]
    cost = statistics.median(f[0] for f in found)
    print(json.dumps({"peer": name, "cpu_s_per_s": cost, "rms_deg": found[0][1]}), flush=True)

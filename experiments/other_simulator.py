"""Campaigns whose only plant is another project's simulator (motulator 0.18, Python >= 3.12),
diagnosed blindly.

    pip install motulator==0.18.0
    python -m experiments.other_simulator FOLDER [CASE ...]
        # record; then: sensorless diagnose FOLDER/CASE

A 2.2 kW motor without saturation on switching PWM: its integrator, its carrier comparison, its dead
time, its shaft.
The control is a few lines here: currents in the encoder's frame, speed around it for free rotors.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from model.parameters import Converter, Drive, Injection, Motor
from sandbox.output.toml import toml_text
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.recordings.writing import write_campaign

PAIRS, R, L_D, L_Q, MAGNET, INERTIA, LINK = 3, 3.6, 0.036, 0.051, 0.545, 0.015, 540.0
RATED, TORQUE, SPEED_RPM, COUNTS, NOISE, STEP = (
    4.3 * math.sqrt(2.0),
    14.0,
    1500.0,
    4096,
    0.012,
    0.01,
)
INJECTED, BAND = 80.0, 2.0 * math.pi * 120.0  # V; rad/s of the current control
CARRIER, LOAD_INERTIA, DAMPING = 250e-6, 0.6 * INERTIA, 0.02


def stiffness(hz: float) -> float:
    """Return a shaft's stiffness (N m/rad) by the frequency at which its two masses swing."""
    return (INERTIA - LOAD_INERTIA) * LOAD_INERTIA / INERTIA * (2.0 * math.pi * hz) ** 2


@dataclass(frozen=True)
class Case:
    """What is unusual about a drive, and what its campaign says of it ([drive] keys)."""

    period: float = 250e-6
    double: bool = False
    delay: int = 0  # half carrier periods
    dead_time: float = 0.0
    bridge: bool = False
    levels: int = 2**20  # of the PWM's counter
    shaft_hz: float = 0.0
    says: dict[str, Any] = field(default_factory=dict)

    def truth(self) -> dict[str, dict[str, float]]:
        """Return the effects of the library that are put in, with their parameters."""
        out = {}
        if self.dead_time:
            out["dead_time"] = {"time": self.dead_time}
        if self.delay:
            out["pwm_delay"] = {"delay": 0.5 * self.delay * CARRIER}
        if self.shaft_hz:
            shaft = {
                "load_inertia": LOAD_INERTIA,
                "stiffness": stiffness(self.shaft_hz),
                "damping_ratio": DAMPING,
            }
            out["shaft_compliance"] = shaft
        return out


CASES = {
    "control": Case(),
    "dead_time": Case(dead_time=2e-6),
    "bridge": Case(bridge=True, says={"dc_link": "measured"}),
    "bridge_unsaid": Case(bridge=True),
    "double": Case(period=125e-6, double=True, dead_time=2e-6, says={"pwm_frequency": 4000.0}),
    "double_unsaid": Case(period=125e-6, double=True, dead_time=2e-6),
    "shaft_90": Case(shaft_hz=90.0),
    "delay_125": Case(delay=1),
    "delay_250": Case(delay=2),
    "counter_12": Case(levels=2**12, says={"pwm_counts": 2**12}),
    "counter_12_unsaid": Case(levels=2**12),
}


@dataclass(frozen=True)
class Run:
    """One recording: currents d, q (A) over time, or for a free rotor speed (rad/s) and load (N m);
    seconds."""

    file: str
    rotor: str
    seconds: float
    wanted: Callable[[float], tuple[float, float]]
    turning: Callable[[float], float] = lambda t: 0.0
    axis: str = "none"


def stairs(
    levels: list[tuple[float, float]], hold: float
) -> Callable[[float], tuple[float, float]]:
    """Return pairs of values one after another, each held for so many seconds."""
    return lambda t: levels[min(int(t / hold), len(levels) - 1)]


GRID = [
    (0.0, 0.0),
    (0.0, 3.0),
    (-2.0, 3.0),
    (-4.0, 0.0),
    (0.0, -3.0),
    (-2.0, 6.0),
    (2.0, 1.0),
    (0.0, -6.0),
]
RUNS = (
    Run(
        "locked_d.parquet",
        "locked",
        0.4,
        stairs([(x, 0.0) for x in (0, 2, 4, -2, -4, -5, 5, 1)], 0.05),
        axis="d",
    ),
    Run(
        "locked_q.parquet",
        "locked",
        0.4,
        stairs([(0.0, x) for x in (0, 2, 4, -2, -4, -5, 5, 1)], 0.05),
        axis="d",
    ),
    Run(
        "locked_slow.parquet",
        "locked",
        0.4,
        lambda t: (1.5 * math.sin(12.0 * t), 1.5 * math.cos(17.0 * t)),
    ),
    Run("driven_slow.parquet", "driven", 0.6, stairs(GRID, 0.075), lambda t: 15.0),
    Run("driven.parquet", "driven", 0.6, stairs(GRID, 0.075), lambda t: 30.0 + 60.0 * t),
    Run("driven_fast.parquet", "driven", 0.4, stairs(GRID, 0.05), lambda t: 100.0),
    Run(
        "free.parquet",
        "free",
        0.8,
        stairs([(20.0, 0.0), (60.0, 0.0), (60.0, 8.0), (-30.0, 3.0)], 0.2),
    ),
    Run(
        "free_fast.parquet",
        "free",
        0.8,
        stairs([(90.0, 0.0), (90.0, 10.0), (50.0, -6.0), (100.0, 0.0)], 0.2),
    ),
)


class Control:
    """Currents in the encoder's frame, speed around it; keeps what a drive logs."""

    def __init__(self, run: Run, case: Case, seed: int) -> None:
        self.run, self.case, self.rng = run, case, np.random.default_rng(seed)
        self.rows: list[tuple[float, ...]] = []
        self.turns, self.last, self.sum, self.pull, self.speed = 0.0, 0.0, 0j, 0.0, 0.0
        self.u = 0j

    def get_enable(self) -> bool:
        """Return that the gates are on."""
        return True

    def post_process(self) -> None:
        """Nothing of the other simulator's records is kept."""

    def __call__(self, plant: Any) -> tuple[float, list[float]]:
        """Sample, keep a row, return period and duties."""
        k, h = len(self.rows), self.case.period
        t = k * h
        i = (
            np.round((plant.machine.meas_currents() + NOISE * self.rng.standard_normal(3)) / STEP)
            * STEP
        )
        count = math.tau / COUNTS
        angle = round(plant.mechanics.meas_position() / count) * count
        step = math.remainder(angle - self.last, math.tau)
        self.turns, self.last = self.turns + (step if k else angle), angle
        self.speed += 0.05 * ((step / h if k else 0.0) - self.speed)
        theta, u_dc = PAIRS * self.turns, plant.converter.meas_dc_voltage()
        if not self.case.bridge:
            u_dc += 0.2 * self.rng.standard_normal()
        a, b = (2.0 * i[0] - i[1] - i[2]) / 3.0, (i[1] - i[2]) / math.sqrt(3.0)
        u = self.voltage(t, complex(a, b) * np.exp(-1j * theta), k)
        u = complex(u * np.exp(1j * (theta + 0.5 * h * PAIRS * self.speed)))
        u *= min(1.0, 0.98 * u_dc / math.sqrt(3.0) / max(abs(u), 1e-9))
        load = self.run.wanted(t)[1] if self.run.rotor == "free" else 0.0
        self.rows.append((t, u.real, u.imag, *i, theta, u_dc, load))
        legs = [(u * np.exp(-2j * math.pi * n / 3.0)).real for n in range(3)]
        middle = 0.5 * (max(legs) + min(legs))
        return h, [min(max(0.5 + (x - middle) / u_dc, 0.0), 1.0) for x in legs]

    def voltage(self, t: float, i: complex, k: int) -> complex:
        """Return the voltage (V) in the encoder's frame."""
        h, band = self.case.period, BAND / (1.0 + self.case.delay)
        wanted = complex(*self.run.wanted(t))
        if self.run.rotor == "free":
            off = wanted.real - self.speed
            self.pull += h * 40.0 * 0.2 * off
            wanted = complex(0.0, min(max(0.2 * off + self.pull, -6.5), 6.5))
        e = wanted - i
        self.sum += h * e
        omega = PAIRS * self.speed
        e += 0.3 * band * self.sum
        u = band * complex(L_D * e.real, L_Q * e.imag)
        u += R * wanted + 1j * omega * (complex(L_D * i.real, L_Q * i.imag) + MAGNET)
        if self.run.axis == "d":
            u += INJECTED if (k // 4) % 2 else -INJECTED
        return u


def recorded(run: Run, case: Case, seed: int) -> CampaignRecording:
    """Return one recording made on the other simulator's plant."""
    from motulator.common.model._pwm import CarrierComparison
    from motulator.common.model._simulation import SolverCfg
    from motulator.drive import model

    par = model.SynchronousMachinePars(n_p=PAIRS, R_s=R, L_d=L_D, L_q=L_Q, psi_f=MAGNET)
    if run.rotor != "free":
        shaft = model.ExternalRotorSpeed()
        shaft.set_external_rotor_speed(run.turning)
    elif case.shaft_hz:
        j = (INERTIA - LOAD_INERTIA) * LOAD_INERTIA / INERTIA
        stiff = stiffness(case.shaft_hz)
        damping = 2.0 * DAMPING * math.sqrt(stiff * j)
        shaft = model.TwoMassMechanicalSystem(INERTIA - LOAD_INERTIA, LOAD_INERTIA, stiff, damping)
    else:
        shaft = model.MechanicalSystem(INERTIA)
    if run.rotor == "free":
        shaft.set_external_load_torque(
            lambda t: run.wanted(case.period * math.floor(t / case.period + 1e-6))[1]
        )
    converter = model.VoltageSourceConverter(None if case.bridge else LINK, t_d=case.dead_time)
    bus = model.DiodeBridgeDCBus(235e-6, 2e-3, 400.0, 50.0, [converter]) if case.bridge else None
    plant = model.Drive(
        model.SynchronousMachine(par),
        shaft,
        converter,
        dc_bus=bus,
        pwm=True,
        delay=case.delay,
        single_update=not case.double,
    )
    plant.pwm = CarrierComparison(case.levels, case.dead_time)
    if case.delay:
        plant.delay.data = [[0.5, 0.5, 0.5] for _ in range(case.delay)]
    control = Control(run, case, seed)
    cfg = SolverCfg(rtol=1e-6, atol=1e-8)
    simulation = model.Simulation(plant, control, show_progress=False, cfg=cfg)
    plant.save = lambda sol: None  # nothing of its records is needed
    control_only = simulation._run_simulation_loop
    plant.set_outputs(0.0)
    control_only(run.seconds, lambda: None, 0)
    table = np.array(control.rows).T
    names = ("t", "u_alpha", "u_beta", "i_a", "i_b", "i_c", "theta", "u_dc", "load_torque")
    columns = dict(zip(names, table, strict=True))
    if run.rotor != "free":
        columns.pop("load_torque")
    return CampaignRecording(run.file, run.rotor, run.axis, columns)


def campaign_of(name: str, seed: int = 1) -> Campaign:
    """Return a case's campaign: nominal values are the true ones."""
    case = CASES[name]
    motor = Motor(name, PAIRS, R, MAGNET, L_D, L_Q, INERTIA, RATED, TORQUE, SPEED_RPM)
    says = {"pwm_frequency": 1.0 / case.period, "encoder_counts": COUNTS, **case.says}
    converter = Converter(case.period, LINK, STEP, NOISE, **says)
    injection = Injection(1.0 / (8.0 * case.period), INJECTED)
    ordinary = dict.fromkeys(
        ("resistance", "magnet_flux", "inductance_d", "inductance_q", "inertia"), 0.01
    )
    background = {
        "current_gain": 0.0015,
        "current_offset": 0.005,
        "encoder_offset": 0.002,
        "dead_time": 4e-8,
    }
    background |= {"load_torque_gain": 0.01, "load_torque_offset": 0.04}
    runs = tuple(recorded(r, case, seed + k) for k, r in enumerate(RUNS))
    return Campaign(name, Drive(motor, converter, injection, {}), runs, ordinary, background, False)


def main(folder: str, *names: str) -> None:
    """Record the campaigns named (all by default) below a folder, their truths beside them where
    all is stated."""
    for name in names or CASES:
        print(write_campaign(Path(folder) / name, campaign_of(name)), flush=True)
        if name.endswith("_unsaid"):
            # their inverter works otherwise than they state, so there is more than effects
            continue
        truth = CASES[name].truth()
        tables: list[tuple[str, Any]] = [("", {"effects": list(truth)})]
        tables += [(f"[{effect}]", own) for effect, own in truth.items()]
        (Path(folder) / f"{name}.truth.toml").write_text(toml_text(tables), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])

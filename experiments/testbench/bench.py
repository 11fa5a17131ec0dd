"""One campaign: the bench is built, its twelve recordings are run and written in the recording
format."""

import os
import shutil
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from . import cycles, design, forms, maps
from .design import ALPHAS, UNCERTAINTY, Design
from .draw import Truth, generator
from .loop import run
from .plant import FEW, STATES
from .types import DRIVEN, FREE, Control, References

INJECTION_PERIOD = 8  # samples
COLUMNS = ("u_alpha", "u_beta", "i_a", "i_b", "i_c", "theta", "u_dc", "load_torque")


class Recording(NamedTuple):
    """What a recording holds, and what really was: columns (n, 8) of COLUMNS; i_alpha, i_beta,
    speed, torque (n, 4)."""

    plan: cycles.Plan
    columns: np.ndarray
    really: np.ndarray


class CompiledDesign(NamedTuple):
    """The compiled containers of a design, and what scales its cycles."""

    design: Design
    parts: tuple
    step: float
    scale: cycles.Scale
    injection: float  # V


def build(d: Design) -> CompiledDesign:
    """The bench of a design; slow parts (inverting a map) are done once."""
    drive, n = d.drive, d.nominal
    i = drive.current
    pulse = min(0.4 * i * min(loaded_inductance(d)) / (4 * drive.period), 0.45 * drive.link)
    scale = cycles.Scale(
        drive.period,
        i,
        drive.bias,
        drive.speed,
        d.torque,
        n["resistance"],
        pulse,
        -0.8 if d.map is None else -0.9,
    )
    parts = (
        design.magnetics(d),
        design.losses(d),
        design.inverter(d),
        design.mechanics(d),
        design.sensors(d),
    )
    return CompiledDesign(d, parts, design.shortest(d), scale, injection_amplitude(d))


def loaded_inductance(d: Design) -> tuple[float, float]:
    """The smaller of the slopes at zero current and at rated load, by the stated model (H)."""
    l_d, l_q = d.nominal["inductance_d"], d.nominal["inductance_q"]
    if d.map is None:
        return l_d, l_q
    _, _, jac = maps.flux(
        d.map, np.array(d.drive.bias * d.drive.current), np.array(d.drive.current)
    )
    return min(l_d, float(jac[0, 0])), min(l_q, float(jac[1, 1]))


def control(b: CompiledDesign, axis: int) -> Control:
    """The drive's controller, tuned on nominal values; it goes slower under injection, whose ripple
    it averages out."""
    d, drive = b.design, b.design.drive
    bandwidth = (0.015 if axis else 0.1) / drive.period
    # a load step moves the speed by 0.3 of its rating
    steepest = d.torque / (d.nominal["inertia"] * 0.8 * drive.speed)
    return Control(
        inductance=loaded_inductance(d),
        resistance=d.nominal["resistance"],
        magnet=d.nominal["magnet_flux"],
        bandwidth=bandwidth,
        speed_bandwidth=float(np.clip(steepest, 25.0, min(120.0, 0.3 * bandwidth))),
        torque_constant=d.torque / drive.current,
        inertia=d.nominal["inertia"],
        limit=1.5 * drive.current,
        injection_period=INJECTION_PERIOD,
        injection=b.injection,
        injection_axis=axis,
    )


def references(
    b: CompiledDesign, plan: cycles.Plan, truth: Truth, rng: np.random.Generator
) -> References:
    """A plan with this bench's noise, jitter, errors of load and start."""
    d, drive, o = b.design, b.design.drive, truth.ordinary
    under_current = rng.uniform() < o["begins_under_current"]
    before = round(0.15 / drive.period) if under_current else 0

    def held(x: np.ndarray) -> np.ndarray:
        return np.concatenate([np.full(before, x[0]), x])

    load = held(plan.load)
    n = load.size
    error = load * d.background["load_torque_gain"] * rng.standard_normal(n)
    uneven: tuple = ((0.0, 1.0, 0.0), (0.0, 2.0, 0.0))
    if plan.rotor == DRIVEN:
        a = o["uneven_speed"]
        uneven = ((a, 1.0, float(rng.uniform(-3, 3))), (0.5 * a, 2.0, float(rng.uniform(-3, 3))))
    return References(
        rotor=plan.rotor,
        mode=plan.mode,
        before=before,
        reference_d=held(plan.reference_d),
        reference_q=held(plan.reference_q),
        speed=held(plan.speed),
        load=load,
        load_error=error + (truth.background["load_torque_offset"] if plan.rotor == FREE else 0.0),
        uneven=uneven,
        start_angle=float(rng.uniform(-np.pi, np.pi)),
        noise=forms.coloured(rng, n, 3, d.noise * o["noise_over_stated"], o["colour"]),
        jitter=o["jitter"] * rng.standard_normal(n),
        link_noise=5e-4 * drive.link * rng.standard_normal(n),
    )


def record(
    b: CompiledDesign, plan: cycles.Plan, truth: Truth, rng: np.random.Generator
) -> Recording:
    """Run one recording.

    Raises ArithmeticError where the drive leaves what its bench can hold (not finite, or three
    times rated current).
    """
    d, drive = b.design, b.design.drive
    c = references(b, plan, truth, rng)
    mag, loss, inv, mech, sens = b.parts
    more = loss.core or loss.rise or loss.contact[0] > 0 or sens.filter[0] > 0
    y = np.zeros(STATES if more else FEW)
    theta = c.start_angle
    y[0:3] = d.true["magnet_flux"] * np.cos(theta), d.true["magnet_flux"] * np.sin(theta), theta
    y[3] = y[5] = c.speed[0] if plan.rotor in (DRIVEN, FREE) else 0.0
    y[6] = drive.link
    n = plan.load.size
    out = np.zeros((n, 12))
    done = run(mag, loss, inv, mech, sens, control(b, plan.injection), c, y, b.step, out)
    peak = np.abs(out[:, 8:10]).max()
    if done < c.load.size or not peak < 3.0 * drive.current:
        raise ArithmeticError(
            f"{drive.name}, {plan.name}: stops at sample {done}, peak {peak:.3g} A"
        )
    return Recording(plan, out[:, :8], out[:, 8:])


def recordings(truth: Truth, d: Design) -> list[Recording]:
    """All recordings of a truth."""
    b = build(d)
    rng = generator(truth.seed, truth.kind, truth.index, "cycles")
    return [
        record(b, p, truth, generator(truth.seed, truth.kind, truth.index, p.name))
        for p in cycles.plans(b.scale, rng)
    ]


def write(folder: Path, name: str, truth: Truth, d: Design) -> None:
    """Write a campaign to `folder`/`name`, whole or not at all."""
    runs = recordings(truth, d)
    temporary = folder / f".{name}.{os.getpid()}"
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir(parents=True)
    try:
        for r in runs:
            t = np.arange(len(r.columns)) * d.drive.period
            wide = ("theta",)
            columns = {"t": t} | {
                c: r.columns[:, k].astype(np.float64 if c in wide else np.float32)
                for k, c in enumerate(COLUMNS)
            }
            pq.write_table(
                pa.table(columns), temporary / f"{r.plan.name}.parquet", compression="zstd"
            )
        if d.map is not None:
            _write_map(
                temporary / "flux_map.csv", d, generator(truth.seed, truth.kind, truth.index, "map")
            )
        (temporary / "campaign.toml").write_text(campaign_text(name, d, [r.plan for r in runs]))
        shutil.rmtree(folder / name, ignore_errors=True)
        os.replace(temporary, folder / name)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def stated_map(d: Design, rng: np.random.Generator) -> maps.FluxMap:
    """The map as its engineer knows it: other points than the true one's, each with the scatter of
    a measurement."""
    assert d.map is not None
    reach = min(2.0 * d.drive.current, d.map.i_d[-1], d.map.i_q[-1])
    m = maps.resample(d.map, int(rng.integers(19, 26)), float(rng.uniform(0.0, 1.0)), float(reach))
    spread = 2e-4 * max(np.ptp(m.psi_d), np.ptp(m.psi_q))
    scatter = [spread * rng.standard_normal(m.psi_d.shape) for _ in range(2)]
    return m._replace(psi_d=m.psi_d + scatter[0], psi_q=m.psi_q + scatter[1])


def _write_map(path: Path, d: Design, rng: np.random.Generator) -> None:
    m = stated_map(d, rng)
    a, b = np.meshgrid(m.i_d, m.i_q, indexing="ij")
    rows = np.column_stack([a.ravel(), b.ravel(), m.psi_d.ravel(), m.psi_q.ravel()])
    np.savetxt(path, rows, delimiter=",", header="i_d,i_q,psi_d,psi_q", comments="", fmt="%.8g")


def _table(name: str, values: dict[str, float | int | str]) -> str:
    lines = [f"[{name}]"]
    for key, v in values.items():
        lines.append(f'{key} = "{v}"' if isinstance(v, str) else f"{key} = {v!r}")
    return "\n".join(lines) + "\n"


def campaign_text(name: str, d: Design, plans: list[cycles.Plan]) -> str:
    """campaign.toml: what the engineer of this bench knows."""
    drive, n = d.drive, dict(d.nominal)
    motor: dict[str, float | int | str] = {"pole_pairs": int(n.pop("pole_pairs"))}
    uncertain = dict(UNCERTAINTY)
    if d.map is not None:
        for key in ("magnet_flux", "inductance_d", "inductance_q"):
            n.pop(key)
        for key in ALPHAS:
            uncertain.pop(key)
    motor |= {k: float(v) for k, v in n.items()} | {"rated_current": drive.current}
    drive_table: dict[str, float | int | str] = {
        "sampling_period": drive.period,
        "pwm_frequency": round(1 / drive.period, 6),
        "dc_bus_voltage": drive.link,
        "transformation": "amplitude-invariant",
        "current_resolution": 0.002 * drive.current,
        "current_noise": d.noise,
        "encoder_counts": drive.lines,
    }
    parts = [
        _table("campaign", {"name": name}),
        _table("drive", drive_table),
        _table("motor", motor),
        _table("flux_map", {"file": "flux_map.csv"}) if d.map is not None else "",
        _table("uncertainty", dict(uncertain)),
        _table("background", dict(d.background)),
        _table(
            "injection",
            {
                "waveform": "square",
                "frequency": 1 / (INJECTION_PERIOD * drive.period),
                "amplitude": injection_amplitude(d),
            },
        ),
    ]
    axis = ("none", "d", "q")
    for p in plans:
        entry = {
            "file": f"{p.name}.parquet",
            "rotor": cycles.ROTORS[p.rotor],
            "injection_axis": axis[p.injection],
        }
        parts.append(_table("[recording]", dict(entry)))
    return "\n".join(p for p in parts if p)


def injection_amplitude(d: Design) -> float:
    """Amplitude (V) of the injection: a tenth of rated current as ripple, at most 12 % of the
    link."""
    drive = d.drive
    return min(
        0.1 * drive.current * 4 * d.nominal["inductance_d"] / (INJECTION_PERIOD * drive.period),
        0.12 * drive.link,
    )

"""A recommended recording as a table that a bench can play: setpoints and phase voltages, sample by
sample.

Currents, speed and link voltage are what a bench's own control is asked for.  The phase voltages
are the ones that the refitted motor needs for them at the angle beside them: for a drive that plays
voltages at a locked rotor, or turned at that speed from that angle; a free rotor turns as the
refitted shaft does, so play its currents.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from model.array_types import Array
from model.frames import phases
from model.parameters import Drive, Limits
from sandbox.gap.planning.bench_plan import DIGITS
from sandbox.gap.planning.menu import Entry, injected_wave, menu, recording_of, settings, shaft
from sandbox.gap.planning.next_recording import Next
from sandbox.gap.planning.within import largest_current, within
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign

NAME = "next_recording.csv"


@dataclass(frozen=True)
class BenchTable:
    """An experiment's settings in words, its columns by name (n,), what [[recording]] has to say of
    it, the largest values in it, and what its bench may do."""

    entry: Entry
    settings: str
    columns: Mapping[str, Array]
    recording: Mapping[str, str | float]
    limits: Mapping[str, float]
    bench: Limits


def bench_table(campaign: Campaign, following: Next, drive: Drive) -> BenchTable | None:
    """Return a recommended recording's table; drive: with the refitted motor.

    [limits] hold for what that motor is predicted to do (where there are none, what `menu` asks
    for); None where it cannot do the experiment within them.
    """
    drive = drive.at_full_rate()
    wanted = next(
        e
        for e in menu(campaign.drive.at_full_rate(), following.seconds)
        if e.name == following.entry
    )
    entry = within(wanted, drive, campaign.limits)
    if entry is None:
        return None
    values = complete(drive.motor, drive.converter)
    r = recording_of(
        Campaign(campaign.name, drive, (), {}, {}, False), entry, shaft(values, drive)
    ).recordings[0]
    rpm = 60.0 / math.tau / drive.motor.pole_pairs
    injected = {
        f"injected_{x}_V": u * injected_wave(len(r.t))
        for x, u in zip("dq", entry.injection, strict=True)
    }
    voltages = dict(
        zip(("u_a_V", "u_b_V", "u_c_V"), phases.py_func(r.u_alpha, r.u_beta), strict=True)
    )
    speed = np.gradient(r.theta, r.t) if entry.rotor == "free" else entry.speed
    columns = {"t_s": r.t, "i_d_A": entry.i_d, "i_q_A": entry.i_q, "speed_rpm": rpm * speed}
    columns |= {**injected, "link_V": r.u_dc, "theta_rad": r.theta, **voltages}
    axis = next((x for x, u in zip("dq", entry.injection, strict=True) if u), "none")
    said: dict[str, str | float] = {"rotor": entry.rotor, "injection_axis": axis}
    if entry.link != 1.0:
        said["dc_bus_voltage"] = entry.link * drive.converter.dc_bus_voltage
    limits = {
        "current": largest_current(entry, drive),
        "speed_rpm": float(np.max(np.abs(rpm * speed))),
        "voltage": float(np.max(np.hypot(r.u_alpha, r.u_beta))),
        "link": float(r.u_dc[0]),
    }
    return BenchTable(entry, settings(entry, drive), columns, said, limits, campaign.limits)


def stated(bench: Limits) -> str:
    """Return a bench's limits in words, empty where there are none."""
    units = {"current": "A peak", "speed_rpm": "rpm", "voltage": "V link"}
    parts = [
        f"{getattr(bench, k):g} {unit}"
        for k, unit in units.items()
        if getattr(bench, k) is not None
    ]
    return ", ".join([*parts, *["link fixed: its voltage cannot be changed"] * bench.fixed_link])


def write_bench_table(path: Path, table: BenchTable, following: Next) -> None:
    """Write the table as CSV, what it is and what it will tell in comments above it."""
    sets = "; or ".join(" + ".join(s) or "no effect" for s in following.separates)
    limits, allowed = table.limits, stated(table.bench)
    most = (
        f"{limits['current']:.4g} A peak, {limits['voltage']:.4g} V phase peak, "
        f"{limits['speed_rpm']:.0f} rpm, link {limits['link']:.4g} V"
    )
    entry = " ".join(
        f'{k} = "{v}"' if isinstance(v, str) else f"{k} = {v:g}" for k, v in table.recording.items()
    )
    lines = [
        f"# {table.entry.description} ({table.settings}), for {following.seconds:g} s",
        f"# tells apart, with probability {following.power:.2f}: {sets}",
        f"# at most: {most}; rotor {table.entry.rotor}"
        + (f"; [limits]: {allowed}" if allowed else ""),
        f'# afterwards, in campaign.toml: [[recording]] file = "..." {entry}',
        (
            "# u_a_V ...: the refitted motor's phase voltages at theta_rad (electrical); or "
            "follow i and speed"
        ),
        ",".join(table.columns),
    ]
    rows = np.column_stack(list(table.columns.values()))
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write("\n".join(lines) + "\n")
        np.savetxt(file, rows, fmt=DIGITS, delimiter=",")

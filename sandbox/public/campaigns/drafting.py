"""A column map drafted from a folder's tables: their columns with ranges, names guessed, what is
left to fill in."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from model.errors import BadInput, shown
from model.number_table import Table
from model.units import UNITS
from sandbox.public.campaigns.column_words import meant
from sandbox.recordings.column_map import KIND
from sandbox.recordings.foreign import SUFFIXES, read_table

NAME = "columns.toml"
MOST_TABLES, MOST_COLUMNS = 24, 40
SECONDS = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
HINTS = {
    "t": 'unit = "ms" where it is not s',
    "speed": 'unit = "rpm"; mechanical = true for the shaft\'s; stands in for an angle',
    "temperature": "of the winding",
    "hall": "stands in for an angle",
    "steps": "stands in for an angle: commutation steps, six an electrical turn",
    "theta": (
        'electrical rad; else unit = "deg" or "rev", mechanical = true for the shaft\'s, '
        "scale = 2 pi / counts"
    ),
}
TAIL = """
# [log]                          # stamps of the program, not of the drive: stamps = "arrival" or "polled"
# matrix = {data = ["t", "theta", "i_q"]}   # names of a matrix' columns

# [drive]                        # with voltages only
# sampling_period = %s           # s: the median step of t
# dc_bus_voltage = 24.0          # V
# current_noise = 0.01           # A rms
# encoder_counts = 4096

# [motor]                        # without voltages: pole_pairs, torque_constant (N m per A of i_q) and inertia suffice
# pole_pairs = 4
# resistance = 0.5               # ohm, a phase
# magnet_flux = 0.01             # Wb peak: back-EMF of a phase (V peak) over electrical speed (rad/s)
# inductance_d = 1e-3            # H
# inductance_q = 1e-3
# inertia = 1e-4                 # kg m^2

# [flux_map]                     # in place of magnet_flux and inductances
# file = "map.csv"               # beside this file
"""  # noqa: E501


def draft(folder: Path) -> str:
    """Return a column map's draft for the tables in a folder, empty where none can be read."""
    files = sorted(p for p in folder.iterdir() if p.suffix.lower() in SUFFIXES)[:MOST_TABLES]
    first, entries = "", []
    for path in files:
        try:
            table = read_table(path)
        except BadInput:
            continue
        first = first or _columns(path.name, table)
        entries.append(
            f'[[recording]]\nfile = {_text(path.name)}\nrotor = "free"  # or "locked", "driven"\n'
        )
    if not entries:
        return ""
    head = (
        "# Drafted by `sensorless check`: correct it, then `sensorless check CAMPAIGN --columns "
        f"{NAME}`.\n# Every key: sandbox/recordings/IMPORTING.md; programs whose names are known: "
        "`sensorless list presets`.\n"
    )
    return head + first + "\n" + "\n".join(entries)


def _text(name: str) -> str:
    """Return a name as TOML text; letters of other alphabets stay readable."""
    return json.dumps(name, ensure_ascii=False)


def _hint(standard: str, unit: str | None, options: str) -> str:
    """Return the comment behind an entry: the unit that the table states, else what to look for;
    options: what the entry says already."""
    if unit not in UNITS[KIND[standard]]:
        return f"  # {HINTS[standard]}" if standard in HINTS and not options else ""
    turns = standard in ("theta", "speed") and "mechanical" not in options
    return f"  # {unit}, as the table says" + "; mechanical = true for the shaft's" * turns


def _columns(file: str, table: Table) -> str:
    """Return what a table holds as comments, names guessed, and what is left to fill in."""
    lines, guessed, step = [f"# Columns of {shown(file)}:"], list[str](), "1e-4"
    for name, x in list(table.columns.items())[:MOST_COLUMNS]:
        standard, options = meant(name, table.units.get(name)) or (None, "")
        finite = x[np.isfinite(x)]
        reach = f"{finite.min():.6g} to {finite.max():.6g}" if finite.size else "no number"
        steps = np.diff(finite)
        rising = ", rising" if steps.size and np.all(steps > 0.0) else ""
        lines.append(f"#   {shown(name)}: {reach}{rising}")
        if standard and not any(line.startswith(f"{standard} =") for line in guessed):
            hint = _hint(standard, table.units.get(name), options)
            guessed.append(f"{standard} = {{column = {_text(name)}{options}}}{hint}")
        if standard == "t" and steps.size:
            step = f"{SECONDS.get(table.units.get(name, 's'), 1.0) * np.median(steps):.6g}"
    return "\n".join([*lines, "", "[columns]", *guessed]) + "\n" + TAIL % step

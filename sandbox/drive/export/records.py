"""The plant's records as structures in C: the batch of one lane, its room, and the named tuples of
a period."""

from __future__ import annotations

from estimators.c.kinds import INT, LANE, REAL, Kind, Record, Rows, declared
from model.effects.card import REPEATED
from model.inverter_table import MOST_POINTS
from model.spline import SplineEnergy
from sandbox.plant import batch, ports
from sandbox.plant.period import AppliedTorque, RotorTrajectory, Timing

APPLIED_TORQUE = Record("drive_applied_torque", tuple((f, REAL) for f in AppliedTorque._fields))
ROTOR_TRAJECTORY = Record(
    "drive_rotor_trajectory",
    tuple((f, APPLIED_TORQUE if f == "applied" else REAL) for f in RotorTrajectory._fields),
)
TIMING = Record("drive_timing", tuple((f, REAL) for f in Timing._fields))
TUPLES = {AppliedTorque: APPLIED_TORQUE, RotorTrajectory: ROTOR_TRAJECTORY, Timing: TIMING}
TABLE = {f"table_{name}": MOST_POINTS for name in ("current", "volts", "sum")}


def plant() -> Record:
    """Return the batch's record, effects of one's own included."""
    rows = {
        name: Rows((LANE,))
        for name in (*batch.STATES, *batch.SCRATCH, *batch.PLANT, *batch.FIXED, *ports.NUMBERS)
    }
    parts = {name: Rows((count, LANE)) for name, count in batch.several().items()}
    counts: dict[str, Kind] = dict.fromkeys([*map(batch.more, REPEATED), "table_points"], INT)
    table = {name: Rows((count,)) for name, count in TABLE.items()}
    return Record("drive_plant", tuple({**rows, **parts, **counts, **table}.items()), pointed=True)


def room() -> Record:
    """Return the record of a period's pulses, as `batch.room_type`; whole numbers stay whole."""
    fields: dict[str, Kind] = {}
    kinds = batch.room_type(1)
    for name in kinds.names or ():
        kind, shape = kinds[name].subdtype or (kinds[name], ())
        whole = kind.kind == "i"
        sizes = tuple(LANE if name == "acts" and k == 1 else n for k, n in enumerate(shape))
        fields[name] = Rows(sizes, whole) if sizes else (INT if whole else REAL)
    return Record("drive_room", tuple(fields.items()), pointed=True)


def flux_map(energy: SplineEnergy | None) -> Record | None:
    """Return a flux map's record, its cells behind a pointer; None where the motor has a
    quartic."""
    if energy is None:
        return None
    kinds = {"cells": Rows(tuple(int(n) for n in energy.cells.shape), fixed=True)}
    return Record("drive_map", tuple((f, kinds.get(f, REAL)) for f in SplineEnergy._fields))


def definition(record: Record, said: dict[str, str] | None = None) -> str:
    """Return a structure's type definition, a field a line; said: words behind a field."""
    lines = [
        (
            "    "
            f"{_field(name, kind, record)};{f' /* {said[name]} */' if said and said.get(name) else ''}"  # noqa: E501
        )
        for name, kind in record.fields
    ]
    return "\n".join(["typedef struct {", *lines, f"}} {record.name};"])


def _field(name: str, kind: Kind, record: Record) -> str:
    """Return a field's declaration: rows are arrays, of the only lane plain numbers."""
    if isinstance(kind, Rows) and record.pointed:
        size = kind.size
        text = f"{kind.of} {name}" if kind.shape == (LANE,) else f"{kind.of} {name}[{size}]"
    else:
        text = declared(kind, name)
    return f"drive_{text}" if text.startswith(f"{REAL} ") else text


SAID = {**batch.STATES, **batch.SCRATCH, **batch.PLANT, **batch.FIXED}

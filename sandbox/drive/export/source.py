"""A drive as C source: the plant's kernels translated, its parameters with their bounds, and how it
is stepped."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from importlib.metadata import version
from pathlib import Path
from string import Template
from typing import Any

from estimators.c.expressions import MATHS, literal
from estimators.c.kinds import INT, LANE, REAL, Absent, Kind, Record, Rows
from estimators.c.translate import HELPERS, Program, macros
from model.effects import library
from model.effects.card import flux_scale
from model.parameters import Converter, Drive, Motor
from model.spline import SplineEnergy
from sandbox.drive import loop, sensing
from sandbox.drive.closed import longest_step
from sandbox.drive.export import records
from sandbox.plant import additions, batch, commutation, edges, fixed, sampling, sets
from sandbox.plant.compose import further_field
from sandbox.plant.period import at_start, travel

HERE = Path(__file__).parent
LARGEST = 1e37  # larger numbers are infinite in a float
MOST_STEP = 1e-2  # s
UNUSED = ("bench.lock_angle",)  # of recordings alone
HEADER, SOURCE = "sensorless_drive.h", "sensorless_drive.c"


@dataclass(frozen=True)
class Number:
    """A parameter of an exported drive: public name, value, bounds, unit, what it is."""

    name: str
    value: float
    low: float
    high: float
    unit: str
    said: str

    @property
    def field(self) -> str:
        """Return its name in C."""
        return field_of(self.name)


def field_of(name: str) -> str:
    """Return the name in C of a parameter by its public name."""
    return name.replace(".", "_")


def identifier(name: str) -> str:
    """Return a motor's name as C takes it."""
    return re.sub(r"\W", "_", name)


def own_numbers(drive: Drive, values: Mapping[str, float], top_speed: float) -> list[Number]:
    """Return what belongs to the drive beside effects; top_speed: rad/s electrical, up to which
    steps are short."""
    motor, converter = drive.motor, drive.converter
    true = library.true_motor(motor, values, keep_map=True)
    step = min(longest_step(true, values, sets.features_of(motor, values), top_speed), MOST_STEP)
    counts = converter.encoder_counts
    own = [
        _of(converter, "sampling_period", "of a PWM period"),
        _of(converter, "dc_bus_voltage", "of the link, nominal"),
        _of(motor, "inductance_d", "at zero current, nominal"),
        _of(motor, "inductance_q", "at zero current, nominal"),
        _of(motor, "pole_pairs", "electrical angle over mechanical"),
        _of(converter, "current_resolution", "of a count of a reading; 0: none"),
        _of(converter, "current_noise", "of a reading, rms"),
        _of(converter, "link_noise", "of the link's reading, rms"),
        Number(
            "encoder_step",
            math.tau * motor.pole_pairs / counts if counts else 0.0,
            0.0,
            math.tau,
            "rad",
            "of a count of the encoder, electrical; 0: none",
        ),
        Number(
            "longest_step",
            step,
            1e-9,
            MOST_STEP,
            "s",
            f"of the integration: up to {top_speed * 30.0 / math.pi / motor.pole_pairs:.4g} rpm",
        ),
    ]
    return [Number(f"drive.{n.name}", n.value, n.low, n.high, n.unit, n.said) for n in own]


def _of(thing: Motor | Converter, name: str, said: str) -> Number:
    meta = next(f for f in fields(thing) if f.name == name).metadata
    return Number(name, float(getattr(thing, name)), meta["low"], meta["high"], meta["unit"], said)


def numbers_of(drive: Drive, values: Mapping[str, float], top_speed: float) -> list[Number]:
    """Return every parameter of an exported drive: its own, then those of effects and bench;
    values: completed."""
    out, same = own_numbers(drive, values, top_speed), library.same_numbers()
    for name, p in library.parameters().items():
        if name not in same:
            out.append(Number(name, values[name], p.low, p.high, p.unit, library.title(name)))
    for name, b in sets.BENCH.items():
        if name not in UNUSED:
            out.append(
                Number(
                    name,
                    values[name],
                    b.low,
                    b.high,
                    b.unit,
                    name.partition(".")[2].replace("_", " "),
                )
            )
    return out


@dataclass(frozen=True)
class Source:
    """A drive in C: its files by name, and its parameters."""

    header: str
    source: str
    numbers: tuple[Number, ...]
    motor: str


def source_of(drive: Drive, values: Mapping[str, float], top_speed: float) -> Source:
    """Return a drive with effects (completed values) as C."""
    numbers = numbers_of(drive, values, top_speed)
    name = identifier(drive.name)
    energy = drive.motor.energy if isinstance(drive.motor.energy, SplineEnergy) else None
    program, looking = _translated(energy)
    text = _template("drive.c").substitute(
        rows=_indented(_rows(drive, energy)),
        needs=_indented(_needs(drive.motor)),
        sound=_sound(),
        map=", drive_flux_map" if energy else "",
        travel_looking=looking,
    )
    head = HEAD.substitute(
        header=HEADER, motor=drive.name, macros=macros(sorted({*MATHS, "fabs"})), maths=HELPERS
    )
    constants = [
        *_bounds(name, numbers),
        *(_map(energy) if energy else []),
        *_table(drive.converter),
    ]
    whole = "\n\n".join([head, program.text() + "\n", *constants, text])
    return Source(_header(drive, numbers, name), whole, tuple(numbers), name)


HEAD = Template("""\
/* $header says what this is: $motor with its inverter, shaft and sensors.
 * Translated by sensorless-sandbox from its kernels; names tell from which module a function is. */
#include "$header"

#include <math.h>
#include <string.h>

$macros

typedef drive_real real;

$maths
static inline real modulo(real x, real y) { /* has the sign of y */
    const real rest = FMOD(x, y);
    return rest != R(0.0) && (rest < R(0.0)) != (y < R(0.0)) ? rest + y : rest;
}""")


def _template(name: str) -> Template:
    return Template(HERE.joinpath(name).read_text(encoding="utf-8"))


def _translated(energy: SplineEnergy | None) -> tuple[Program, str]:
    """Return the kernels that a step needs, and the name of the period that looks at the current
    inside it."""
    rig = Record("loop_rig", (("rotor", INT),))
    kinds: dict[Any, Record] = dict(records.TUPLES)
    the_map: Kind = records.flux_map(energy) or Absent()
    if isinstance(the_map, Record):
        kinds[SplineEnergy] = the_map
    p, w, room = Program(kinds), records.plant(), records.room()
    row = Rows((LANE,))
    p.several((REAL, REAL))
    p.translate(edges.write_edges, (room, REAL))
    p.translate(edges.put, (room, INT, REAL, INT, REAL, REAL))
    p.translate(edges.duties, (REAL, REAL, REAL))
    p.constant("sandbox.plant.edges", "LEG_X", edges.LEG_X)
    p.constant("sandbox.plant.edges", "LEG_Y", edges.LEG_Y)
    for name in ("SOONEST", "LATEST"):
        p.constant("sandbox.drive.sensing", name, getattr(sensing, name))
    for name in (
        "MOVED",
        "MOTION",
        "TWIST",
        "ANGULAR",
        *(n for n in vars(additions) if n.isupper()),
    ):
        value = getattr(additions, name)
        if isinstance(value, int):
            p.constant("sandbox.plant.additions", name, value)
    p.translate(fixed.fix, (w, REAL, REAL))
    p.translate(commutation.latest, (w,))
    p.translate(additions.at_rest, (w, row, row, Rows((2, LANE))))
    p.translate(sampling.read, (w,))
    p.translate(loop.rotor, (w,))
    p.translate(loop.at_sample, (w, rig, records.APPLIED_TORQUE))
    p.translate(sensing.encoder, (w, INT, REAL, REAL, REAL))
    p.translate(loop.judge, (w, p.several((REAL, REAL))))
    p.translate(additions.turning, (w, REAL, REAL))
    start = (w, the_map, INT, REAL, REAL, REAL, records.ROTOR_TRAJECTORY, REAL)
    p.translate(at_start, start)
    given = (w, the_map, records.TIMING, INT, room, records.ROTOR_TRAJECTORY, REAL, REAL)
    p.translate(travel, (*given, Rows((0,)), Rows((0, 2))))
    looking = p.translate(travel, (*given, Rows((2,)), Rows((2, 2))))
    p.tuples = {"loop_rig": records.definition(rig), **p.tuples}
    if isinstance(the_map, Record):
        p.tuples = {"drive_map": records.definition(the_map), **p.tuples}
    return p, looking.name


def _indented(lines: list[str]) -> str:
    return "\n".join(f"    {line}" for line in lines)


def _is(name: str) -> str:
    """Return a parameter in C by its public name: where two are the same number, the one that
    stands for both."""
    return f"is->{field_of(library.same_numbers().get(name, name))}"


def _number(value: float) -> str:
    """Return a literal; a number too large for a float is infinite."""
    return literal(math.copysign(math.inf, value) if abs(value) > LARGEST else float(value))


def _rows(drive: Drive, energy: SplineEnergy | None) -> list[str]:
    """Return the assignments of `sets.rows_of` in C."""
    own = {value: _is(name) for name, value in library.replaced().items()}
    scale = {value: _is(name) for name, value in library.scaled().items()}
    lines = []
    for axis in "dq":
        added = f" - R(1.0) / is->drive_inductance_{axis}" if energy else ""
        whole = f"R(1.0) / ({scale[f'inductance_{axis}']} * is->drive_inductance_{axis}){added}"
        lines.append(f"w->gamma_{axis} = {whole};")
    lines += [
        f"w->cubic_d = R(3.0) * {own['alpha_30']};",
        f"w->cubic_q = {own['alpha_12']};",
        f"w->quartic_d = R(4.0) * {own['alpha_40']};",
        f"w->quartic_dq = {own['alpha_22']};",
        f"w->quartic_q = R(4.0) * {own['alpha_04']};",
        f"w->magnet = {own['magnet_flux']};",
        f"w->winding = {own['resistance']};",
        f"w->masses = {own['inertia']};",
        "w->pairs = is->drive_pole_pairs;",
        f"w->soft = R(1.0) / {_is('bench.soft_current')};",
        f"w->shape = {_is('bench.soft_shape')};",
        f"w->common = {_is('bench.common_offset')};",
        f"w->load_gain = {_is('bench.load_torque_gain')};",
        f"w->load_offset = {_is('bench.load_torque_offset')};",
    ]
    flux = flux_scale(drive.motor)
    lines.append(f"w->rated_flux = {_number(flux)};")
    lines.append(f"w->rated_slope = {_number(drive.motor.rated_omega * flux)};")
    lines += [f"w->{row} = {_is(name)};" for row, name in sets.numbers()]
    for row, usual in sets.references(drive.motor).items():  # as `sets.rows_of`
        lines.append(f"if (w->{row} == R(0.0)) {{ w->{row} = {_number(usual)}; }}")
    lines += ["if (is->dead_time_zone_width == R(0.0)) {"]  # as `sets.zone_of`
    lines += [f"    w->dead_time_zone_width = {_is('bench.soft_current')};"]
    for name in ("shape", "center"):
        row = f"dead_time_zone_{name}"
        usual = _is(f"bench.soft_{name}")
        lines.append(f"    w->{row} = is->{row} != R(0.0) ? is->{row} : {usual};")
    lines.append("}")
    lines += [line for card in sets.several() for line in _further(drive.motor, card)]
    table = drive.converter.inverter_table
    if table:
        size = f"{len(table)} * sizeof(drive_real)"
        lines.append(f"w->table_points = {len(table)};")
        lines += [
            f"memcpy(w->table_{n}, drive_table_{n}, {size});" for n in ("current", "volts", "sum")
        ]
    return lines


def _further(motor: Motor, card: Any) -> list[str]:
    """Return the assignments of an effect's further parts: those that are there come first."""
    neutral, names = (
        library.neutral(motor),
        sorted({n for at in card.part(2).at for n in at.numbers}),
    )
    lines = ["{", "    int32_t at = 0;"]
    for k in range(2, card.repeats + 1):
        lines.append(f"    if ({_moved(card.switched_by[k - 1], neutral)}) {{")
        lines += [
            f"        w->{further_field(card.name, n)}[at] = {_is(card.public(k, n))};"
            for n in names
        ]
        lines += ["        at++;", "    }"]
    ports = sorted({at.port for at in card.part(2).at})
    return [*lines, *(f"    w->more_{p} = larger_whole(w->more_{p}, at);" for p in ports), "}"]


def _moved(names: tuple[str, ...], neutral: Mapping[str, float]) -> str:
    return " || ".join(f"{_is(n)} != {_number(neutral[n])}" for n in names)


def _needs(motor: Motor) -> list[str]:
    """Return in C which bits of the plant parameters ask for, as `sets.features_of`."""
    neutral, zero = library.neutral(motor), dict.fromkeys(library.neutral(motor), 0.0)
    lines = [f"bits |= {_is('bench.soft_shape')} != R(0.0) ? ADDITIONS_ROUND : 0;"]
    for need in sets.needs():
        test = _moved(need.names, zero if need.zero else neutral)
        if need.form:
            name, other = need.form
            there = f"{_is(name)} {'!=' if other else '=='} {_number(neutral[name])}"
            test = f"({test}) && {there}"
        lines += [f"if ({test}) {{", f"    bits |= {need.bits};", "}"]
    return lines


def _sound() -> str:
    several = batch.several()
    each = [
        (place, least)
        for rows in sets.SOUND.values()
        for row, least in rows.items()
        for place in ([f"{row}[{k}]" for k in range(several[row])] if row in several else [row])
    ]
    tests = [
        f"isfinite(w->{row})"
        if math.isinf(least)
        else f"isfinite(w->{row}) && w->{row} >= {literal(least)}"
        for row, least in each
    ]
    return "\n        && ".join(tests)


def _bounds(name: str, numbers: list[Number]) -> list[str]:
    def of(title: str, value: str) -> str:
        """Return the C of one set of numbers."""
        lines = [f"    .{n.field} = {_number(getattr(n, value))}," for n in numbers]
        return "\n".join([f"const sensorless_drive_parameters {title} = {{", *lines, "};"])

    return [
        of(f"sensorless_drive_parameters_of_{name}", "value"),
        of("sensorless_drive_lowest", "low"),
        of("sensorless_drive_highest", "high"),
    ]


def _map(energy: SplineEnergy) -> list[str]:
    """Return a flux map's cells as constants."""
    cells = ",\n    ".join(
        ", ".join(literal(float(v)) for v in row) for row in energy.cells.reshape(-1, 5)
    )
    rest = ", ".join(literal(float(v)) if math.isfinite(v) else "R(0.0)" for v in energy[1:])
    return [
        f"static const {REAL} drive_cells[{energy.cells.size}] = {{ /* J */\n    {cells}}};",
        f"static const drive_map drive_flux_map = {{drive_cells, {rest}}};",
    ]


def _table(converter: Converter) -> list[str]:
    """Return an inverter's measured table as constants: A, V, and the integral up to each point (A
    V)."""
    points = converter.inverter_table
    if not points:
        return []
    total, sums = 0.0, [0.0]
    for (i, u), (j, v) in itertools.pairwise(points):
        total += 0.5 * (u + v) * (j - i)
        sums.append(total)
    columns = {"current": [p[0] for p in points], "volts": [p[1] for p in points], "sum": sums}
    return [
        (
            f"static const {REAL} drive_table_{name}[{len(points)}] = "
            f"{{{', '.join(literal(float(v)) for v in column)}}};"
        )
        for name, column in columns.items()
    ]


def _header(drive: Drive, numbers: list[Number], name: str) -> str:
    lines = [f"    drive_real {n.field}; /* {n.unit or '1'}: {n.said} */" for n in numbers]
    return _template("drive.h").substitute(
        version=version("sensorless-sandbox"),
        motor=drive.name,
        cname=name,
        parameters="\n".join(lines),
        count=len(numbers),
        applied_torque=records.definition(records.APPLIED_TORQUE),
        rotor_trajectory=records.definition(records.ROTOR_TRAJECTORY),
        timing=records.definition(records.TIMING),
        plant=records.definition(records.plant(), records.SAID),
        room=records.definition(records.room()),
    )

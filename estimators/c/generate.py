"""qnull.c, inversion.c, ekf.c and startup.h: plain C99 from the Python kernels themselves, nothing
written twice.

python -m estimators.c.generate
    writes them anew beside this file; a test says when they are stale
"""

from __future__ import annotations

import inspect
import textwrap
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from string import Template
from types import ModuleType
from typing import Any, get_type_hints

from estimators.c.counting import Operations, operations
from estimators.c.golden import Golden, read_golden
from estimators.c.kinds import INT, REAL, Kind, Record, Rows
from estimators.c.translate import HELPERS, Program, macros, of_quartic
from estimators.contract import MAX_PERIOD, Belief, Estimate, Sample, Tuning
from estimators.registry import MODULES
from model.quartic import Energy

HERE = Path(__file__).parent
HEADER = HERE / "sensorless_estimator.h"
# slots that grow with every turn
ANGLES = {"qnull": ("AXIS",), "inversion": ("AXIS",), "ekf": ("X + 3",)}
NAMES = tuple(ANGLES)
# constants that depend on the width: 18 roundings either way
WIDTHS = {"TOLERANCE": ("4e-15", "2e-06")}

TOP = Template("""\
/* $name: $summary, in C99.
 * Translated from estimators/$module.py by estimators/c/generate.py: do not edit, write it anew.
 *
$text
 *
 * Source: $source.
 * Cost of a step, tracking: $cost
 * Memory: $slots numbers of state, and the setup.  Of libm it calls sin, cos, sqrt and atan2, in float or double. */
""")  # noqa: E501

START_UP = Template("""\
/* The start-up that our estimators share, to be included by one of yours: initial position with polarity.
 * Translated from estimators/startup.py by estimators/c/generate.py: do not edit, write it anew.
 *
$text
 *
 * Keep a `real state[START_UP_SLOTS]`, all zero; call `start` for every sample until state[PHASE] is TRACKING, and tell
 * what it returns; state[AXIS] is then the magnet's angle.  Where the angle is known, set PHASE to TOLD, AXIS to it. */
#ifndef SENSORLESS_START_UP_H
#define SENSORLESS_START_UP_H

$parts
#define START_UP_SLOTS $slots

#endif
""")  # noqa: E501

PARTS = Template("""\
#include "sensorless_estimator.h"

#include <math.h>

typedef sensorless_real real;

$macros

#define PI R(3.141592653589793)

$helpers

/* Places in the state and other numbers, then functions. */
$program
""")

BOTTOM = Template("""
typedef struct {
    sensorless_belief belief;
    sensorless_tuning tuning;
    real state[$slots];
} $name;

/* Return the angle (rad) within a turn: a float keeps its digits. */
static real within_a_turn(real angle) {
    if (angle > PI) {
        return angle - R(2.0) * PI;
    }
    return angle < -PI ? angle + R(2.0) * PI : angle;
}

int32_t sensorless_init(void *state, const sensorless_setup *setup) {
    $name *own = state;
    const sensorless_tuning *tuning = &setup->tuning;
    if (tuning->period < 2 || tuning->period > $most || !(tuning->power > R(0.0))) {
        return 1; /* no injection that fits the rings */
    }
    if (!(setup->belief.energy.gamma_d > R(0.0)) || !(setup->belief.energy.gamma_q > R(0.0))) {
        return 2; /* no motor */
    }
    own->belief = setup->belief;
    own->tuning = setup->tuning;
    for (int32_t k = 0; k < $slots; k++) {
        own->state[k] = R(0.0);
    }
    if (setup->angle_known) {
        own->state[PHASE] = TOLD;
        own->state[AXIS] = setup->angle;
    }
    return 0;
}

void sensorless_step(void *state, const sensorless_sample *sample, sensorless_estimate *estimate) {
    $name *own = state;
    *estimate = step(own->state, sample, &own->belief, &own->tuning);
$wrapped
}

SENSORLESS_ESTIMATOR("${name}_c", $name, SENSORLESS_PULSATING);
""")


def record(name: str, kept: Any, inside: dict[str, Record]) -> Record:
    """Return a named tuple of the contract as a structure that is only read."""
    kinds: dict[str, Kind] = {k: INT if t is int else REAL for k, t in get_type_hints(kept).items()}
    defaults = tuple(kept._field_defaults.values())
    return Record(
        name, tuple((kinds | inside).items()), pointed=True, fixed=True, defaults=defaults
    )


MATHS = """\
static inline real length(real x, real y) { return SQRT(x * x + y * y); }
static inline real magnitude(real x) { return x < R(0.0) ? -x : x; }
static inline real down(real x) {
    const real whole = (real)(int32_t)x;
    return whole > x ? whole - R(1.0) : whole;
}
#define HYPOT(x, y) length(x, y)
#define FABS(x) magnitude(x)
#define FLOOR(x) down(x)"""
LIBRARY = ("atan2", "cos", "sin", "sqrt")  # what is called of libm

ENERGY = record("sensorless_energy", Energy, {})
BELIEF = record("sensorless_belief", Belief, {"energy": ENERGY})
SAMPLE, TUNING = record("sensorless_sample", Sample, {}), record("sensorless_tuning", Tuning, {})
ESTIMATE = replace(record("sensorless_estimate", Estimate, {}), pointed=False, fixed=False)


def module_of(name: str) -> ModuleType:
    """Return the module of an estimator."""
    return import_module(MODULES[name])


def source(name: str) -> str:
    """Return an estimator's C file."""
    module = module_of(name)
    card = module.ESTIMATOR
    cost = f"{counted(name).said()}."
    return (
        TOP.substitute(
            name=name,
            summary=card.summary,
            module=module.__name__.rpartition(".")[2],
            text=_said(module),
            source=card.source,
            cost=textwrap.fill(cost, 80, subsequent_indent=" * "),
            slots=slots(name),
        )
        + _parts(card.step, name)
        + BOTTOM.substitute(
            name=name,
            slots=slots(name),
            most=MAX_PERIOD,
            wrapped="\n".join(
                f"    own->state[{a}] = within_a_turn(own->state[{a}]);" for a in ANGLES[name]
            ),
        )
    )


def start_up() -> str:
    """Return the start-up as a header of its own."""
    module = import_module("estimators.startup")
    parts = _parts(module.start, "qnull")
    return START_UP.substitute(text=_said(module), parts=parts, slots=slots("qnull"))


def translated(step: Any, size: int) -> Program:
    """Return a step and all that it calls in C; size: numbers of its state."""
    kept: dict[type, Record] = {Estimate: ESTIMATE}
    program = Program(kept, bare=True, chosen=of_quartic)
    program.translate(step, (Rows((size,)), SAMPLE, BELIEF, TUNING))
    return program


def _parts(step: Any, name: str) -> str:
    """Return constants and functions of a step."""
    text = translated(step, slots(name)).text()
    for constant, (wide, narrow) in WIDTHS.items():
        one = f"#define {constant} R({wide})"
        assert one in text, one
        text = text.replace(one, f"#define {constant} EITHER({wide}, {narrow})")
    return PARTS.substitute(macros=macros(LIBRARY), helpers=f"{HELPERS}\n{MATHS}", program=text)


def _said(module: ModuleType) -> str:
    return "\n".join(f" * {line}".rstrip() for line in (inspect.getdoc(module) or "").splitlines())


def counted(name: str, golden: Golden | None = None) -> Operations:
    """Return what an estimator's step costs on golden samples, those of `golden.json` where none
    are given."""
    golden = golden or read_golden()
    step = module_of(name).ESTIMATOR.step
    state = module_of(name).init(golden.belief, golden.tuning, golden.angles[0])
    return operations(step, (golden.belief, golden.tuning), state, golden.samples)


def slots(name: str) -> int:
    """Return how many numbers an estimator keeps."""
    golden = read_golden()
    return int(module_of(name).init(golden.belief, golden.tuning).size)


def main() -> None:
    """Write every file."""
    for name in NAMES:
        (HERE / f"{name}.c").write_text(source(name), encoding="utf-8")
    (HERE / "startup.h").write_text(start_up(), encoding="utf-8")


if __name__ == "__main__":
    main()

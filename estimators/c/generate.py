"""qnull.c, inversion.c, ekf.c and startup.h: plain C99 from the Python kernels themselves, nothing
written twice.

python -m estimators.c.generate
    writes them anew beside this file; a test says when they are stale
"""

from __future__ import annotations

import inspect
import textwrap
from importlib import import_module
from pathlib import Path
from string import Template
from types import ModuleType

from estimators.c.collect import Program, collect
from estimators.c.counting import Operations, operations
from estimators.c.golden import Golden, read_golden
from estimators.c.translate import translated
from estimators.contract import MAX_PERIOD
from estimators.registry import MODULES

HERE = Path(__file__).parent
HEADER = HERE / "sensorless_estimator.h"
# slots that grow with every turn
ANGLES = {"qnull": ("AXIS",), "inversion": ("AXIS",), "ekf": ("X + 3",)}
NAMES = tuple(ANGLES)
WIDTHS = {"TOLERANCE": "4e-15, 2e-6"}  # constants that depend on the width: 18 roundings either way

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

#ifdef SENSORLESS_FLOAT64
#define R(x) x
#define EITHER(wide, narrow) wide
#define COS(x) cos(x)
#define SIN(x) sin(x)
#define SQRT(x) sqrt(x)
#define ATAN2(y, x) atan2(y, x)
#define NEARLY_NOTHING 1e-290
#else
#define R(x) x##f
#define EITHER(wide, narrow) R(narrow)
#define COS(x) cosf(x)
#define SIN(x) sinf(x)
#define SQRT(x) sqrtf(x)
#define ATAN2(y, x) atan2f(y, x)
#define NEARLY_NOTHING 1e-37f
#endif

#define PI R(3.141592653589793)

/* Places in the state, and other whole numbers. */
enum {
$numbers
};

$reals

$helpers

$functions
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

HELPERS = {
    "square": ("real x", "x * x"),
    "cube": ("real x", "x * x * x"),
    "fourth": ("real x", "x * x * (x * x)"),
    "smaller": ("real a, real b", "b < a ? b : a"),
    "larger": ("real a, real b", "b > a ? b : a"),
    "magnitude": ("real x", "x < R(0.0) ? -x : x"),
    "length": ("real x, real y", "SQRT(x * x + y * y)"),
    "down": ("real x", "(real)(int32_t)x - ((real)(int32_t)x > x ? R(1.0) : R(0.0))"),
}


def module_of(name: str) -> ModuleType:
    """Return the module of an estimator."""
    return import_module(MODULES[name])


def source(name: str) -> str:
    """Return an estimator's C file."""
    module = module_of(name)
    program, card = collect(module.ESTIMATOR.step), module.ESTIMATOR
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
        + _parts(program, "step")
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
    parts = _parts(collect(module.start), "start")
    return START_UP.substitute(text=_said(module), parts=parts, slots=slots("qnull"))


def _parts(program: Program, first: str) -> str:
    """Return numbers, constants and functions of a program."""
    functions = "\n\n".join(translated(program, first))
    helpers = [
        f"static real {h}({a}) {{ return {b}; }}"
        for h, (a, b) in HELPERS.items()
        if f"{h}(" in functions
    ]
    return PARTS.substitute(
        numbers=_numbers(program),
        reals=_reals(program),
        helpers="\n".join(helpers),
        functions=functions,
    )


def _said(module: ModuleType) -> str:
    return "\n".join(f" * {line}".rstrip() for line in (inspect.getdoc(module) or "").splitlines())


def counted(name: str, golden: Golden | None = None) -> Operations:
    """Return what an estimator's step costs on golden samples, those of `golden.json` where none
    are given."""
    golden = golden or read_golden()
    program = collect(module_of(name).ESTIMATOR.step)
    state = module_of(name).init(golden.belief, golden.tuning, golden.angles[0])
    return operations(program, (golden.belief, golden.tuning), state, golden.samples)


def slots(name: str) -> int:
    """Return how many numbers an estimator keeps."""
    golden = read_golden()
    return int(module_of(name).init(golden.belief, golden.tuning).size)


def _numbers(program: Program) -> str:
    whole = {k: v for k, v in program.constants.items() if isinstance(v, int)}
    return ",\n".join(
        f"    {k} = {v}" for k, v in sorted(whole.items(), key=lambda kv: (kv[1], kv[0]))
    )


def _reals(program: Program) -> str:
    rest = {k: v for k, v in program.constants.items() if not isinstance(v, int)}
    return "\n".join(
        f"#define {k} {f'EITHER({WIDTHS[k]})' if k in WIDTHS else f'R({v!r})'}"
        for k, v in rest.items()
    )


def main() -> None:
    """Write every file."""
    for name in NAMES:
        (HERE / f"{name}.c").write_text(source(name), encoding="utf-8")
    (HERE / "startup.h").write_text(start_up(), encoding="utf-8")


if __name__ == "__main__":
    main()

"""What a firmware needs beside an estimator's file: a motor's constants, golden vectors, a program
to check by."""

from __future__ import annotations

from string import Template

from estimators.c.generate import slots
from estimators.c.golden import WINDOW, Golden

HEAD_WORDS = 26  # of a setup's numbers that a state keeps: belief and tuning
SETUP = Template("""\
/* $motor, $belief belief, as designed by sensorless-sandbox: give &sensorless_motor to sensorless_init.
 * Set angle_known = 1 and the angle (rad) in a copy where the first position is known. */
#include "sensorless_estimator.h"

#define SENSORLESS_STATE_BYTES ($words * sizeof(sensorless_real)) /* of $name: static memory for its state */

static const sensorless_setup sensorless_motor = {
    .belief = {
        .energy = {
$energy
        },
$rest
    },
    .tuning = {
$tuning
    },
    .angle_known = 0,
    .angle = 0,
};
""")  # noqa: E501
CHECK = Template("""\
/* Golden vectors of $name on $motor: what the Python twin tells, in double.
 * cc -std=c99 -O2 check.c $name.c -lm && ./a.out     prints the largest differences; exit code 1 beyond $most° */
#include <stdio.h>
#include <string.h>

#include "motor.h"

#define COUNT $count
#define WINDOW $window /* samples; then the estimator begins anew, told an angle */

static const double angles[COUNT / WINDOW] = {$angles};

/* i_alpha, i_beta (A), u_alpha, u_beta (V), carrier (s) */
static const sensorless_real samples[COUNT][5] = {
$samples
};

/* theta (rad), omega (rad/s) */
static const double estimates[COUNT][2] = {
$estimates
};

static union {
    double aligned;
    unsigned char bytes[SENSORLESS_STATE_BYTES];
} memory;

int main(void) {
    sensorless_setup setup = sensorless_motor;
    double angle = 0.0, speed = 0.0;
    setup.angle_known = 1;
    for (int k = 0; k < COUNT; k++) {
        sensorless_estimate estimate;
        sensorless_sample sample;
        double off, fast;
        if (k % WINDOW == 0) {
            setup.angle = (sensorless_real)angles[k / WINDOW];
            memset(&memory, 0, sizeof(memory));
            if (sensorless_state_bytes() > (int32_t)sizeof(memory) || sensorless_init(&memory, &setup) != 0) {
                puts("sensorless_init refuses the motor, or its state is larger than motor.h says");
                return 1;
            }
        }
        memset(&estimate, 0, sizeof(estimate));
        estimate.injection = 1;
        sample.i_alpha = samples[k][0];
        sample.i_beta = samples[k][1];
        sample.u_alpha = samples[k][2];
        sample.u_beta = samples[k][3];
        sample.carrier = samples[k][4];
        sensorless_step(&memory, &sample, &estimate);
        off = (double)estimate.theta - estimates[k][0];
        while (off > 3.141592653589793) {
            off -= 6.283185307179586;
        }
        while (off < -3.141592653589793) {
            off += 6.283185307179586;
        }
        fast = (double)estimate.omega - estimates[k][1];
        angle = off > angle ? off : -off > angle ? -off : angle;
        speed = fast > speed ? fast : -fast > speed ? -fast : speed;
    }
    angle *= 57.29577951308232;
    printf("$name on $motor, %d samples: angle within %.2g degrees, speed within %.2g rad/s\\n", COUNT, angle, speed);
    return angle <= $most ? 0 : 1;
}
""")  # noqa: E501
TOLERANCE_DEG = 0.05  # degrees


def motor_header(golden: Golden, name: str, belief: str) -> str:
    """Return motor.h: a motor's constants as a setup."""
    energy, rest = golden.belief.energy._asdict(), golden.belief._asdict()
    del rest["energy"]
    return SETUP.substitute(
        motor=golden.motor,
        belief=belief,
        name=name,
        words=slots(name) + HEAD_WORDS,
        energy=_fields(energy, 12),
        rest=_fields(rest, 8),
        tuning=_fields(golden.tuning._asdict(), 8),
    )


def check_program(golden: Golden, name: str) -> str:
    """Return check.c: golden vectors, and a program that runs an estimator over them."""
    return CHECK.substitute(
        name=name,
        motor=golden.motor,
        count=len(golden.samples),
        window=WINDOW,
        most=TOLERANCE_DEG,
        angles=", ".join(map(repr, golden.angles)),
        samples=_rows(golden.samples, "(sensorless_real)"),
        estimates=_rows(golden.estimates[name][:, :2]),
    )


def _fields(values: dict[str, float], indent: int) -> str:
    numbers = {
        k: str(v) if isinstance(v, int) else f"(sensorless_real){v!r}" for k, v in values.items()
    }
    return "\n".join(f"{' ' * indent}.{k} = {v}," for k, v in numbers.items())


def _rows(table: object, cast: str = "") -> str:
    import numpy as np

    return "\n".join(
        f"    {{{', '.join(f'{cast}{v:.9g}' for v in row)}}}," for row in np.asarray(table)
    )

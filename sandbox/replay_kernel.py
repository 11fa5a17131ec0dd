"""One recording through LANES parameter sets: sample, period, sample, ... (see `sandbox.replay` for the meaning)."""

from __future__ import annotations

from model.compiled import kernel
from sandbox import replay_legs as legs
from sandbox import replay_machine as machine
from sandbox.replay_lanes import (
    ASYMMETRY, C_0, C_1, C_2, CLAG_A, CORE_INV, CORE_KEEP, CORE_TIME, DEVIATION, DROP, ECCENTRIC, EDGES, FILTER,
    FILTER_INV, FILTER_KEEP, FILTER_TIME, FLAG_A, FULL, HARMONICS, IRON, KF_ANGLE, LANES, LAST_TORQUE, LATE_PULSES,
    LINK, LINK_RIPPLE, MISS, NEXT_DEVIATION, OFFSET, READ_A, S_0, S_1, S_2, SHAFT_TWIST, SHIFTED_SAMPLE, SKIN, TORQUE,
    U_A, U_B, plain_sample, plain_step, turn_by_offset,
)  # fmt: skip

# columns of the table that all sets share, one row a sample
(MEAN_A, MEAN_B, D_A, D_B, D_C, OMEGA, SINE, COSINE, LOAD, READ, GAIN_ANGLE, GAIN_SPEED, SCALE, MID_ANGLE, MID_SPEED) = (
    range(15)
)
COLUMNS = 15
EDGE = 5  # instant, unit flux (2), unit vector of the leg (2)
MACHINE = HARMONICS | IRON | SKIN | ASYMMETRY | FULL  # what `plain_step` cannot do
SAMPLED = IRON | FILTER | SHIFTED_SAMPLE
INVERTER = EDGES | DROP | LATE_PULSES | LINK_RIPPLE | FILTER | IRON | SHIFTED_SAMPLE


@kernel
def angle(w, eccentric, share, c, s, c_row, s_row):
    """Write cos and sin of the true angle, `share` of the way from this sample's encoder error to the next one's."""
    if eccentric:
        machine.turn_by_deviation(w, DEVIATION, NEXT_DEVIATION, share, c, s, c_row, s_row)
    else:
        turn_by_offset(w, c, s, c_row, s_row)


@kernel
def copied(w, row, to):
    """Copy one row."""
    for j in range(LANES):
        w[to * LANES + j] = w[row * LANES + j]


@kernel
def edge_of(e, m):
    """Return one edge as numbers."""
    return e[m, 0], e[m, 1], e[m, 2], e[m, 3], e[m, 4]


@kernel
def deliver(w, features, table, edges, k, period):
    """Write the voltage to hold over period k."""
    if not features & INVERTER:
        for j in range(LANES):
            w[U_A * LANES + j], w[U_B * LANES + j] = (
                w[LINK * LANES + j] * table[k, MEAN_A],
                w[LINK * LANES + j] * table[k, MEAN_B],
            )
        return
    d_a, d_b, d_c, omega = table[k, D_A], table[k, D_B], table[k, D_C], table[k, OMEGA]
    b_a, b_b, b_c = (table[k - 1, D_A], table[k - 1, D_B], table[k - 1, D_C]) if k > 0 else (0.5, 0.5, 0.5)
    if features & LATE_PULSES:
        legs.late_voltage(w, d_a, d_b, d_c, b_a, b_b, b_c, omega, period)
    else:
        legs.mean_voltage(w, d_a, d_b, d_c)
    if features & (EDGES | DROP):
        e = edges[k]
        e_0, e_1, e_2 = edge_of(e, 0), edge_of(e, 1), edge_of(e, 2)
        e_3, e_4, e_5 = edge_of(e, 3), edge_of(e, 4), edge_of(e, 5)
        if features & DROP:
            legs.dead_time_and_drop(w, e_0, e_1, e_2, e_3, e_4, e_5, omega, period)
        else:
            legs.dead_time(w, e_0, e_1, e_2, e_3, e_4, e_5, omega, period)
    if features & FILTER:
        legs.keep_ripple(w, FLAG_A, FILTER_TIME, FILTER_INV, FILTER_KEEP, d_a, d_b, d_c, b_a, b_b, b_c, period)
    if features & IRON:
        legs.keep_ripple(w, CLAG_A, CORE_TIME, CORE_INV, CORE_KEEP, d_a, d_b, d_c, b_a, b_b, b_c, period)


@kernel
def sample(w, features, table, k, period):
    """Set currents, torque and the three readings of sample k."""
    full = features & (MACHINE | INVERTER) != 0
    if features & INVERTER:
        legs.links(w, k * period, period, table[k, D_A], table[k, D_B], table[k, D_C], features & LINK_RIPPLE != 0)
    if full:
        machine.full_sample(w)
        if k > 0 and features & (SKIN | FILTER):
            machine.close_lags(w)
    else:
        plain_sample(w)
    if features & SHIFTED_SAMPLE:
        d_a, d_b, d_c = table[k, D_A], table[k, D_B], table[k, D_C]
        b_a, b_b, b_c = (table[k - 1, D_A], table[k - 1, D_B], table[k - 1, D_C]) if k > 0 else (0.5, 0.5, 0.5)
        legs.shifted_sample(w, d_a, d_b, d_c, b_a, b_b, b_c, table[k, OMEGA], period)
    if features & SAMPLED:
        machine.hold_sample(w, features & IRON != 0, features & FILTER != 0, features & SHIFTED_SAMPLE != 0)
    machine.read_sensors(w, features & SAMPLED == 0)


@kernel
def run(w, features, table, edges, turns, period, steps, motion, out, moved, first):
    """Replay one recording; readings (A) go to out[k, 0:3, first:first + LANES], innovations to moved[k, first:].

    turns[k, m]: cos, sin of the encoder's angle at t_k + m period/(2 steps); `moved` is filled where `motion`.
    """
    h, share = period / steps, 0.5 / steps
    eccentric, twisted = features & ECCENTRIC != 0, features & SHAFT_TWIST != 0
    machine_effects = features & (MACHINE | FILTER) != 0
    if eccentric:
        machine.deviations(w, table[0, SINE], table[0, COSINE], DEVIATION)
        copied(w, DEVIATION, NEXT_DEVIATION)
    angle(w, eccentric, 0.0, turns[0, 0, 0], turns[0, 0, 1], C_0, S_0)
    last = len(table) - 1
    for k in range(last + 1):
        sample(w, features, table, k, period)
        for j in range(LANES):
            out[k, 0, first + j] = w[READ_A * LANES + j]
            out[k, 1, first + j] = w[(READ_A + 1) * LANES + j]
            out[k, 2, first + j] = w[(READ_A + 2) * LANES + j]
        if motion:
            if k == 0:
                for j in range(LANES):
                    w[KF_ANGLE * LANES + j] = table[0, READ] - w[OFFSET * LANES + j] - w[DEVIATION * LANES + j]
                    w[LAST_TORQUE * LANES + j] = w[TORQUE * LANES + j]
            else:
                load, mid, speed = table[k - 1, LOAD], table[k - 1, MID_ANGLE], table[k - 1, MID_SPEED]
                machine.predict_motion(w, period, load, mid, speed, twisted)
            machine.correct_motion(w, table[k, READ], table[k, GAIN_ANGLE], table[k, GAIN_SPEED], table[k, SCALE])
            for j in range(LANES):
                moved[k, first + j] = w[MISS * LANES + j]
        if k == last:
            break
        if eccentric:
            machine.deviations(w, table[k + 1, SINE], table[k + 1, COSINE], NEXT_DEVIATION)
        deliver(w, features, table, edges, k, period)
        for m in range(steps):
            angle(w, eccentric, (2 * m + 1) * share, turns[k, 2 * m + 1, 0], turns[k, 2 * m + 1, 1], C_1, S_1)
            angle(w, eccentric, (2 * m + 2) * share, turns[k, 2 * m + 2, 0], turns[k, 2 * m + 2, 1], C_2, S_2)
            if machine_effects:
                if m > 0:
                    machine.full_sample(w)
                    machine.close_lags(w)
                machine.full_step(w, h)
            else:
                if m > 0:
                    plain_sample(w)
                plain_step(w, h)
            copied(w, C_2, C_0)
            copied(w, S_2, S_0)
        if eccentric:
            copied(w, NEXT_DEVIATION, DEVIATION)

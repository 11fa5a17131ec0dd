"""One recording through LANES parameter sets: sample, period, sample, ... (see `sandbox.replay` for the meaning)."""

from __future__ import annotations

from model.compiled import kernel
from sandbox.replay import edges as late
from sandbox.replay import filtered, kicks, legs, machine, memory, sensors
from sandbox.replay.curvature import bend, bend_late
from sandbox.replay.lanes import (
    ASYMMETRY,
    DEVIATION,
    DROP,
    DRY,
    ECCENTRIC,
    EDGES,
    FILTER,
    HARMONICS,
    IRON,
    KF_ANGLE,
    LANES,
    LAST_TORQUE,
    LATE_PULSES,
    LINK_RIPPLE,
    LINK_SAG,
    MISS,
    NEXT_DEVIATION,
    OFFSET,
    READ_A,
    ROWS,
    SHAFT_TWIST,
    SHIFTED_SAMPLE,
    SKIN,
    TORQUE,
    hold,
    plain_sample,
    plain_step,
    turn_by_offset,
)  # fmt: skip

# columns of the table that all sets share, one row a sample
(
    MEAN_A,
    MEAN_B,
    D_A,
    D_B,
    D_C,
    OMEGA,
    SINE,
    COSINE,
    LOAD,
    READ,
    GAIN_ANGLE,
    GAIN_SPEED,
    SCALE,
    MID_ANGLE,
    MID_SPEED,
    FIRST_A,
    FIRST_B,
    SQUARE_AA,
    SQUARE_AB,
    SQUARE_BB,
) = range(20)
COLUMNS = 20
EDGE = 5  # instant, unit flux (2), unit vector of the leg (2)
MACHINE = HARMONICS | IRON | SKIN | ASYMMETRY  # what `plain_step` cannot do
SAMPLED = IRON | FILTER | SHIFTED_SAMPLE
INVERTER = EDGES | DROP | LATE_PULSES | LINK_RIPPLE | LINK_SAG | FILTER | IRON | SHIFTED_SAMPLE


@kernel
def edge_of(e, m):
    """Return one edge as numbers."""
    return e[m, 0], e[m, 1], e[m, 2], e[m, 3], e[m, 4]


@kernel
def deliver(w, features, table, edges, k, period, width):
    """Write the voltage to hold over period k."""
    d_a, d_b, d_c, omega = table[k, D_A], table[k, D_B], table[k, D_C], table[k, OMEGA]
    b_a, b_b, b_c = (table[k - 1, D_A], table[k - 1, D_B], table[k - 1, D_C]) if k > 0 else (0.5, 0.5, 0.5)
    if features & LATE_PULSES:
        legs.late_voltage(w, d_a, d_b, d_c, b_a, b_b, b_c, omega, period)
    else:
        legs.mean_voltage(w, d_a, d_b, d_c, width)
    e = edges[k]
    e_0, e_1, e_2, e_3, e_4, e_5 = (
        edge_of(e, 0),
        edge_of(e, 1),
        edge_of(e, 2),
        edge_of(e, 3),
        edge_of(e, 4),
        edge_of(e, 5),
    )
    if features & DROP:
        late.dead_time_and_drop(w, e_0, e_1, e_2, e_3, e_4, e_5, omega, period)
    elif features & EDGES:
        late.dead_time(w, e_0, e_1, e_2, e_3, e_4, e_5, omega, period, features & IRON != 0)
    if features & FILTER:
        mean_a, mean_b = table[k, MEAN_A], table[k, MEAN_B]
        if features & LATE_PULSES:
            memory.keep_late_ripple(
                w, d_a, d_b, d_c, b_a, b_b, b_c, mean_a, mean_b, e_0, e_1, e_2, e_3, e_4, e_5, period
            )
            if k > 0:
                memory.carry(w, edges[k - 1], b_a, b_b, b_c, table[k - 1, MEAN_A], table[k - 1, MEAN_B], period)
        else:
            memory.keep_filter_ripple(w, mean_a, mean_b, e_0, e_1, e_2, e_3, e_4, e_5, period)
        if features & EDGES:
            kicks.kick_filter(w, e_0, e_1, e_2, e_3, e_4, e_5, period)
        filtered.open_filter_ripple(w, omega * period)
    if features & IRON:
        legs.keep_core_ripple(w, d_a, d_b, d_c, b_a, b_b, b_c, period)
        if features & EDGES:
            kicks.kick_core(w, e_0, e_1, e_2, e_3, e_4, e_5, period)


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
        if k > 0 and features & FILTER:
            filtered.close_filter_ripple(w)
    else:
        plain_sample(w)
    if features & LINK_SAG:
        legs.sag(w, table[k, D_A], table[k, D_B], table[k, D_C])
    if features & SHIFTED_SAMPLE:
        d_a, d_b, d_c = table[k, D_A], table[k, D_B], table[k, D_C]
        b_a, b_b, b_c = (table[k - 1, D_A], table[k - 1, D_B], table[k - 1, D_C]) if k > 0 else (0.5, 0.5, 0.5)
        legs.shifted_sample(w, d_a, d_b, d_c, b_a, b_b, b_c, table[k, OMEGA], period)
    if features & SAMPLED:
        sensors.hold_sample(w, features & IRON != 0, features & FILTER != 0, features & SHIFTED_SAMPLE != 0)
    sensors.read_sensors(w, features & SAMPLED == 0)


@kernel
def move(w, table, k, period, dry, twisted):
    """Bring the motion filter of a free rotor to sample k and set the innovation of its reading."""
    if k == 0:
        for j in range(LANES):
            w[KF_ANGLE * LANES + j] = table[0, READ] - w[OFFSET * LANES + j] - w[DEVIATION * LANES + j]
            w[LAST_TORQUE * LANES + j] = w[TORQUE * LANES + j]
    else:
        load, mid, speed = table[k - 1, LOAD], table[k - 1, MID_ANGLE], table[k - 1, MID_SPEED]
        sensors.predict_motion(w, period, load, mid, speed, dry, twisted)
    sensors.correct_motion(w, table[k, READ], table[k, GAIN_ANGLE], table[k, GAIN_SPEED], table[k, SCALE])


@kernel
def substep_start(w, machine_effects):
    """Set current and lags at the start of a further step within the period."""
    if machine_effects:
        machine.full_sample(w)
        machine.close_lags(w)
    else:
        plain_sample(w)


@kernel
def run(w, features, table, edges, turns, period, steps, motion, out, moved, first):
    """Replay one recording; readings (A) go to out[k, 0:3, first:first + LANES], innovations to moved[k, first:].

    turns[k, m]: cos, sin of the encoder's angle at t_k + m period/(2 steps); `moved` is filled where `motion`.
    """
    h, share, width = period / steps, 0.5 / steps, len(w) // ROWS
    eccentric, twisted, dry = features & ECCENTRIC != 0, features & SHAFT_TWIST != 0, features & DRY != 0
    machine_effects = features & (MACHINE | FILTER) != 0
    c, s = turns[0, 0, 0], turns[0, 0, 1]
    sensors.deviations(w, table[0, SINE], table[0, COSINE], width)
    for j in range(LANES):
        w[DEVIATION * LANES + j] = w[NEXT_DEVIATION * LANES + j]
    sensors.turn_by_deviation(w, 0.0, 0.0, c, s, c, s)
    last = len(table) - 1
    for k in range(last + 1):
        sample(w, features, table, k, period)
        for j in range(LANES):
            out[k, 0, first + j] = w[READ_A * LANES + j]
            out[k, 1, first + j] = w[(READ_A + 1) * LANES + j]
            out[k, 2, first + j] = w[(READ_A + 2) * LANES + j]
        if motion:
            move(w, table, k, period, dry, twisted)
            for j in range(LANES):
                moved[k, first + j] = w[MISS * LANES + j]
        if k == last:
            break
        if features & INVERTER:
            deliver(w, features, table, edges, k, period, width)
        else:
            hold(w, table[k, MEAN_A], table[k, MEAN_B])
        t = table[k]
        f_a, f_b, s_aa, s_ab, s_bb = t[FIRST_A], t[FIRST_B], t[SQUARE_AA], t[SQUARE_AB], t[SQUARE_BB]
        if features & LATE_PULSES:
            bend_late(w, t[D_A], t[D_B], t[D_C], f_a, f_b, s_aa, s_ab, s_bb, t[OMEGA], period)
        else:
            bend(w, f_a, f_b, s_aa, s_ab, s_bb, t[OMEGA])
        if eccentric:
            sensors.deviations(w, table[k + 1, SINE], table[k + 1, COSINE], width)
        for m in range(steps):
            c_1, s_1 = turns[k, 2 * m + 1, 0], turns[k, 2 * m + 1, 1]
            c_2, s_2 = turns[k, 2 * m + 2, 0], turns[k, 2 * m + 2, 1]
            if m > 0:
                substep_start(w, machine_effects)
            if features & FILTER:
                filtered.start_slope(w, t[OMEGA], h, features & HARMONICS != 0)
            if eccentric:
                sensors.turn_by_deviation(w, (2 * m + 1) * share, (2 * m + 2) * share, c_1, s_1, c_2, s_2)
            else:
                turn_by_offset(w, c_1, s_1, c_2, s_2)
            if machine_effects:
                machine.full_step(w, h)
            else:
                plain_step(w, h)
        if eccentric:
            for j in range(LANES):
                w[DEVIATION * LANES + j] = w[NEXT_DEVIATION * LANES + j]

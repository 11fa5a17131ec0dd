"""Current sensors, encoder and shaft with all their effects, LANES parameter sets at once.

Readings follow `sandbox/switched/AVERAGING.md` (2 to 4).  A free rotor's motion is a filter with fixed gains: torque
predicts the angle one sample ahead, the encoder corrects; what it corrects is the residual.
"""

from __future__ import annotations

import math

from model.compiled import kernel
from sandbox.replay.lanes import (
    ACCELERATION,
    BACK_DECAY,
    BACK_NEW,
    BACK_OLD,
    C_1,
    C_2,
    CLAG_A,
    CLAG_B,
    COG,
    COG_ORDER,
    COG_PHASE,
    COMMON,
    CORE_FILTER,
    CORE_G,
    CORE_INV,
    CORE_SHIFT,
    COULOMB,
    DEVIATION,
    ECC_COS,
    ECC_SIN,
    FILTER_A,
    FILTER_B,
    FLAG_A,
    FLAG_B,
    FRICTION,
    GAIN_A,
    GAIN_B,
    GAIN_C,
    I_A,
    I_B,
    KF_ANGLE,
    KF_SPEED,
    LANES,
    LAST_TORQUE,
    LOAD_GAIN,
    LOAD_INV,
    LOAD_OFFSET,
    LOAD_SHARE,
    M_A,
    M_B,
    MISS,
    MOTOR_INV,
    NEXT_DEVIATION,
    OFF_C,
    OFF_S,
    OFFSET,
    OFFSET_A,
    OFFSET_B,
    OSC_11,
    OSC_12,
    OSC_21,
    OSC_22,
    OSC_REST,
    PAIRS,
    PULSE_A,
    PULSE_B,
    PULSE_TORQUE,
    READ_A,
    READ_B,
    READ_C,
    RESISTANCE,
    S_1,
    S_2,
    SAMPLE_A,
    SAMPLE_B,
    SLIP,
    STRIBECK,
    STRIBECK_INV,
    TORQUE,
    TWIST,
    WIDTH_INV,
    fading,
    sine_cosine,
)

ROOT = math.sqrt(3.0)


@kernel
def deviations(w, sine, cosine, width):
    """Write the coming sample's error of an eccentric encoder, p A sin(theta_mech + phase) (rad, electrical)."""
    for j in range(width):
        w[NEXT_DEVIATION * LANES + j] = w[ECC_COS * LANES + j] * sine + w[ECC_SIN * LANES + j] * cosine


@kernel
def turn_by_deviation(w, mid, end, c_1, s_1, c_2, s_2):
    """Write cos and sin of the true angle, offset and eccentricity off; mid, end: shares of the way between samples."""
    for j in range(LANES):
        x, y, last = w[OFF_C * LANES + j], w[OFF_S * LANES + j], w[DEVIATION * LANES + j]
        change = w[NEXT_DEVIATION * LANES + j] - last
        e_s, e_c = sine_cosine(last + mid * change)
        c, s = c_1 * x + s_1 * y, s_1 * x - c_1 * y
        w[C_1 * LANES + j], w[S_1 * LANES + j] = c * e_c + s * e_s, s * e_c - c * e_s
        e_s, e_c = sine_cosine(last + end * change)
        c, s = c_2 * x + s_2 * y, s_2 * x - c_2 * y
        w[C_2 * LANES + j], w[S_2 * LANES + j] = c * e_c + s * e_s, s * e_c - c * e_s


@kernel
def hold_sample(w, iron, filtered, shifted):
    """Set the current (A) that the samplers hold: iron loss and filter under pulses, instant of sampling."""
    for j in range(LANES):
        i_a, i_b = w[I_A * LANES + j], w[I_B * LANES + j]
        g, lag_a, lag_b = w[CORE_G * LANES + j], w[CLAG_A * LANES + j], w[CLAG_B * LANES + j]
        if iron:
            i_a -= g * w[CORE_INV * LANES + j] * lag_a
            i_b -= g * w[CORE_INV * LANES + j] * lag_b
        s_a, s_b = i_a, i_b
        if shifted:
            s_a, s_b = i_a + w[SAMPLE_A * LANES + j], i_b + w[SAMPLE_B * LANES + j]
            if iron:  # the iron-loss current goes towards that of the mean flux slope, in the zero vector the drop's
                r, k = g * w[RESISTANCE * LANES + j], w[CORE_SHIFT * LANES + j]
                s_a += k * (i_a - w[M_A * LANES + j] + r * w[I_A * LANES + j] - g * w[PULSE_A * LANES + j])
                s_b += k * (i_b - w[M_B * LANES + j] + r * w[I_B * LANES + j] - g * w[PULSE_B * LANES + j])
        if filtered:
            o_a, o_b = w[FILTER_A * LANES + j], w[FILTER_B * LANES + j]
            if iron:
                o_a -= g * w[CORE_FILTER * LANES + j] * (lag_a - w[FLAG_A * LANES + j])
                o_b -= g * w[CORE_FILTER * LANES + j] * (lag_b - w[FLAG_B * LANES + j])
            if shifted:
                back, old, new = w[BACK_DECAY * LANES + j], w[BACK_OLD * LANES + j], w[BACK_NEW * LANES + j]
                o_a, o_b = back * o_a + old * i_a + new * s_a, back * o_b + old * i_b + new * s_b
            s_a, s_b = o_a, o_b
        w[READ_A * LANES + j], w[READ_B * LANES + j] = s_a, s_b


@kernel
def read_sensors(w, plain):
    """Turn the sampled vector (or, plain, the current itself) into three readings (A): gains and offsets."""
    for j in range(LANES):
        i_a, i_b = w[READ_A * LANES + j], w[READ_B * LANES + j]
        if plain:
            i_a, i_b = w[I_A * LANES + j], w[I_B * LANES + j]
        side, half = 0.5 * ROOT * i_b, -0.5 * i_a
        off_a, off_b, common = w[OFFSET_A * LANES + j], w[OFFSET_B * LANES + j], w[COMMON * LANES + j]
        w[READ_A * LANES + j] = w[GAIN_A * LANES + j] * i_a + off_a + common
        w[READ_B * LANES + j] = w[GAIN_B * LANES + j] * (half + side) + off_b + common
        w[READ_C * LANES + j] = w[GAIN_C * LANES + j] * (half - side) - off_a - off_b + common


@kernel
def predict_motion(w, period, load, angle, speed, dry, twisted):
    """Advance the motion filter of a free rotor to this sample: mean torque of two samples and what late pulses add.

    angle, speed: smoothed electrical angle (rad) and speed (rad/s) in the middle of the interval, for friction and
    cogging; load: asked of the load machine over it.
    """
    for j in range(LANES):
        pairs, total = w[PAIRS * LANES + j], w[ACCELERATION * LANES + j]  # p/J
        taken = load * (1.0 + w[LOAD_GAIN * LANES + j]) + w[LOAD_OFFSET * LANES + j]
        omega = speed / pairs
        net = 0.5 * (w[LAST_TORQUE * LANES + j] + w[TORQUE * LANES + j]) + w[PULSE_TORQUE * LANES + j]
        net -= w[FRICTION * LANES + j] * omega
        if dry:
            slow = omega * w[STRIBECK_INV * LANES + j]
            level = w[COULOMB * LANES + j] + w[STRIBECK * LANES + j] * fading(-slow * slow)
            x = omega * w[WIDTH_INV * LANES + j]
            e = fading(-2.0 * abs(x))
            side = (1.0 - e) / (1.0 + e)
            turn = (angle - w[OFFSET * LANES + j] - w[DEVIATION * LANES + j]) / pairs
            turned = w[COG_ORDER * LANES + j] * turn + w[COG_PHASE * LANES + j]
            sine, _ = sine_cosine(turned)
            net += w[COG * LANES + j] * sine - level * (side if x >= 0.0 else -side)
        a = total * (net - taken)
        w[KF_ANGLE * LANES + j] += period * (w[KF_SPEED * LANES + j] + 0.5 * period * a)
        w[KF_SPEED * LANES + j] += period * a
        w[LAST_TORQUE * LANES + j] = w[TORQUE * LANES + j]
        if twisted:  # twist and slip (difference of speeds) swing about rest
            rest = w[OSC_REST * LANES + j] * (net * w[MOTOR_INV * LANES + j] + taken * w[LOAD_INV * LANES + j])
            t, v = w[TWIST * LANES + j] - rest, w[SLIP * LANES + j]
            w[TWIST * LANES + j] = rest + w[OSC_11 * LANES + j] * t + w[OSC_12 * LANES + j] * v
            w[SLIP * LANES + j] = w[OSC_21 * LANES + j] * t + w[OSC_22 * LANES + j] * v


@kernel
def correct_motion(w, read, gain_angle, gain_speed, scale):
    """Set the innovation of the encoder's reading over its standard deviation, and correct the filter with it."""
    for j in range(LANES):
        predicted = w[KF_ANGLE * LANES + j] + w[PAIRS * LANES + j] * w[LOAD_SHARE * LANES + j] * w[TWIST * LANES + j]
        miss = read - w[OFFSET * LANES + j] - w[DEVIATION * LANES + j] - predicted
        w[KF_ANGLE * LANES + j] += gain_angle * miss
        w[KF_SPEED * LANES + j] += gain_speed * miss
        w[MISS * LANES + j] = scale * miss

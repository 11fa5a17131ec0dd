"""Parameter sets side by side: one workspace, LANES sets wide, and the arithmetic that compilers turn into vectors.

The workspace `w` is one flat array; row r of lane j is w[r * LANES + j], rows named below.  One array and constant
offsets are what lets a compiler see that rows do not overlap, so every loop over lanes becomes vector code without
checks.  Strict IEEE arithmetic: a set's numbers do not depend on its lane, its block or the thread.
"""

from __future__ import annotations

import math

from model.compiled import inlined, kernel

LANES = 16
HALF_PI = 0.5 * math.pi
PI_HIGH, PI_LOW = 1.5707963267341256, 6.077100506506192e-11  # pi/2 in two parts

# state: fluxes (V s) and currents (A) in the stationary frame
(PSI_A, PSI_B, CORE_A, CORE_B, SLOW_A, SLOW_B, FILTER_A, FILTER_B, FLAG_A, FLAG_B, CLAG_A, CLAG_B) = range(12)
(CORE_RATE_A, CORE_RATE_B, KF_ANGLE, KF_SPEED, TWIST, SLIP, LAST_TORQUE, DEVIATION) = range(12, 20)
# scratch of one period
(I_A, I_B, M_A, M_B, TORQUE, U_A, U_B, GAMMA_DD, GAMMA_DQ, GAMMA_QQ, I_D, I_Q, X_D, X_Q) = range(20, 34)
(READ_A, READ_B, READ_C, MISS, SPILL_A, SPILL_B, C_1, S_1, C_2, S_2, LINK_A, LINK_B, LINK_C, STEEP_A, STEEP_B) = range(
    34, 49
)
C_0, S_0 = C_2, S_2  # the end of one step is the start of the next
SAMPLE_A, SAMPLE_B, NEXT_DEVIATION, PULSE_TORQUE = range(49, 53)
# parameters, as `sandbox.replay.sets` compiles them
(RESISTANCE, GAMMA_D, GAMMA_Q, A3, B2, A4, C2, B4, MAGNET) = range(56, 65)  # 3 a30, a12, 4 a40, a22, 4 a04
(PSI_D6, PSI_Q6, GAMMA_6, CORE_G, CORE_INV, CORE_DECAY, CORE_OLD, CORE_NEW, CORE_KEEP) = range(65, 74)
(SKIN_R, SKIN_DECAY, SKIN_OLD, SKIN_NEW, DELTA_A, DELTA_B, LINK, RIPPLE, RIPPLE_RATE, RIPPLE_PHASE) = range(74, 84)
(DEAD, THRESHOLD, SOFT, DELAY, LATE, FILTER_TIME, FILTER_INV, FILTER_DECAY, FILTER_OLD, FILTER_NEW) = range(84, 94)
(FILTER_KEEP, SAMPLING, BACK_DECAY, BACK_OLD, BACK_NEW, GAIN_A, GAIN_B, GAIN_C, OFFSET_A, OFFSET_B) = range(94, 104)
(OFF_C, OFF_S, ECC_COS, ECC_SIN, OFFSET, FRICTION, COULOMB, WIDTH_INV, STRIBECK, STRIBECK_INV) = range(104, 114)
(COG, COG_ORDER, COG_PHASE, ACCELERATION, LOAD_GAIN, LOAD_OFFSET, LOAD_SHARE) = range(114, 121)
(OSC_11, OSC_12, OSC_21, OSC_22, OSC_REST, MOTOR_INV, LOAD_INV, PAIRS, CORE_FILTER, CORE_TIME, COMMON, FILTER_MID) = (
    range(121, 133)
)
LATE_0, LATE_1, LATE_2, LATE_3, LATE_4, LATE_5 = range(133, 139)  # of the period's edges, scratch
CORE_SHIFT, SWING_D, SWING_Q = 139, 140, 141  # the last two: slope of the magnet's harmonics, Wb/rad, scratch
SAG, PULSE_A, PULSE_B = 142, 143, 144  # the last two: mean voltage until a shifted sample, V, scratch
# ripple in the filter, scratch: now and from early on (V s), squared, the late pattern's mean flux (V s), slope (A)
(NOW_A, NOW_B, EARLY_A, EARLY_B, BENT_AA, BENT_AB, BENT_BB, MOVED_A, MOVED_B, SLOPE_A, SLOPE_B) = range(145, 156)
FILTER_SLOPE, CURVED_A, CURVED_B = 156, 157, 158
(EDGE_0, EDGE_1, EDGE_2, EDGE_3, EDGE_4, EDGE_5) = range(159, 165)  # how much of each edge the filter still knows
PATTERN_A, PATTERN_B = 165, 166  # mean voltage of the late pattern (V)
ROWS = 167

# features that a block of sets can need
ECCENTRIC, HARMONICS, IRON, SKIN, ASYMMETRY, EDGES, DROP, LATE_PULSES, LINK_RIPPLE, FILTER = (1 << k for k in range(10))
SHIFTED_SAMPLE, SHAFT_TWIST, DRY, LINK_SAG = 1 << 10, 1 << 11, 1 << 12, 1 << 13


@inlined
def sine_cosine(x):
    """Return sin x, cos x without a library call (|x| below 1e5, error below 1e-15 or so)."""
    n = math.floor(x * (1.0 / HALF_PI) + 0.5)
    r = (x - n * PI_HIGH) - n * PI_LOW
    a = r * r
    s = 1.0 / 6227020800.0 - a / 1307674368000.0
    s = r * (
        1.0 - a * (1.0 / 6 - a * (1.0 / 120 - a * (1.0 / 5040 - a * (1.0 / 362880 - a * (1.0 / 39916800 - a * s)))))
    )
    c = 1.0 / 479001600.0 - a * (1.0 / 87178291200.0 - a / 20922789888000.0)
    c = 1.0 - a * (0.5 - a * (1.0 / 24 - a * (1.0 / 720 - a * (1.0 / 40320 - a * (1.0 / 3628800 - a * c)))))
    turn = n - 4.0 * math.floor(0.25 * n)
    swap = (turn == 1.0) | (turn == 3.0)
    sine, cosine = (c if swap else s), (s if swap else c)
    return (-sine if turn >= 2.0 else sine), (-cosine if (turn == 1.0) | (turn == 2.0) else cosine)


@inlined
def fading(x):
    """Return exp(x) for x <= 0 without a library call: relative error below 1e-13 down to exp(-8), absolute beyond."""
    y = max(x, -60.0) * (1.0 / 64.0)
    e = 1.0 + y * (1.0 / 8 + y * (1.0 / 72 + y * (1.0 / 720 + y / 7920.0)))
    e = 1.0 + y * (
        1.0 + y * (0.5 + y * (1.0 / 6 + y * (1.0 / 24 + y * (1.0 / 120 + y * (1.0 / 720 + y / 5040.0 * e)))))
    )
    e *= e
    e *= e
    e *= e
    e *= e
    e *= e
    return e * e


@inlined
def magnetising(w, j, d, q):
    """Return i_d, i_q (A) of lane j at current-induced fluxes (Wb), eqs. (id), (iq)."""
    qq = q * q
    b_2, c_2 = w[B2 * LANES + j], w[C2 * LANES + j]
    i_d = d * (w[GAMMA_D * LANES + j] + d * (w[A3 * LANES + j] + w[A4 * LANES + j] * d)) + qq * (b_2 + 2.0 * c_2 * d)
    i_q = q * (w[GAMMA_Q * LANES + j] + 2.0 * d * (b_2 + c_2 * d) + w[B4 * LANES + j] * qq)
    return i_d, i_q


@inlined
def incremental(w, j, d, q):
    """Return Gamma_dd, Gamma_dq, Gamma_qq (1/H) of lane j."""
    b_2, c_2 = w[B2 * LANES + j], w[C2 * LANES + j]
    dd = w[GAMMA_D * LANES + j] + d * (2.0 * w[A3 * LANES + j] + 3.0 * w[A4 * LANES + j] * d) + 2.0 * c_2 * q * q
    qq = w[GAMMA_Q * LANES + j] + 2.0 * d * (b_2 + c_2 * d) + 3.0 * w[B4 * LANES + j] * q * q
    return dd, 2.0 * q * (b_2 + 2.0 * c_2 * d), qq


@inlined
def current(w, j, c, s, a, b):
    """Return the magnetising current (A, stationary) at total flux (a, b) (V s) and the rotor angle of cos c, sin s."""
    i_d, i_q = magnetising(w, j, c * a + s * b - w[MAGNET * LANES + j], c * b - s * a)
    return c * i_d - s * i_q, s * i_d + c * i_q


@kernel
def plain_sample(w):
    """Set current and torque of the sample from the fluxes: no effect inside the machine."""
    for j in range(LANES):
        a, b = w[PSI_A * LANES + j], w[PSI_B * LANES + j]
        i_a, i_b = current(w, j, w[C_0 * LANES + j], w[S_0 * LANES + j], a, b)
        w[I_A * LANES + j], w[I_B * LANES + j] = i_a, i_b
        w[TORQUE * LANES + j] = 1.5 * w[PAIRS * LANES + j] * (a * i_b - b * i_a)


@kernel
def plain_step(w, h):
    """Move the fluxes on by one Runge-Kutta step of h (s): dpsi/dt = u - R i(psi, theta) in the stationary frame.

    The current of the sample is the first stage; angles of start, middle and end are prescribed.
    """
    half, sixth = 0.5 * h, h / 6.0
    for j in range(LANES):
        r = w[RESISTANCE * LANES + j]
        a, b, u_a, u_b = w[PSI_A * LANES + j], w[PSI_B * LANES + j], w[U_A * LANES + j], w[U_B * LANES + j]
        c, s = w[C_1 * LANES + j], w[S_1 * LANES + j]
        p_a, p_b = u_a - r * w[I_A * LANES + j], u_b - r * w[I_B * LANES + j]
        i_a, i_b = current(w, j, c, s, a + half * p_a, b + half * p_b)
        q_a, q_b = u_a - r * i_a, u_b - r * i_b
        i_a, i_b = current(w, j, c, s, a + half * q_a, b + half * q_b)
        r_a, r_b = u_a - r * i_a, u_b - r * i_b
        i_a, i_b = current(w, j, w[C_2 * LANES + j], w[S_2 * LANES + j], a + h * r_a, b + h * r_b)
        w[PSI_A * LANES + j] = a + sixth * (p_a + 2.0 * (q_a + r_a) + (u_a - r * i_a))
        w[PSI_B * LANES + j] = b + sixth * (p_b + 2.0 * (q_b + r_b) + (u_b - r * i_b))


@kernel
def turn_by_offset(w, c_1, s_1, c_2, s_2):
    """Write cos and sin of the true rotor angle in the middle and at the end of a step: encoder's less the offset."""
    for j in range(LANES):
        x, y = w[OFF_C * LANES + j], w[OFF_S * LANES + j]
        w[C_1 * LANES + j], w[S_1 * LANES + j] = c_1 * x + s_1 * y, s_1 * x - c_1 * y
        w[C_2 * LANES + j], w[S_2 * LANES + j] = c_2 * x + s_2 * y, s_2 * x - c_2 * y


@kernel
def hold(w, mean_a, mean_b):
    """Write the voltage of a period without effects of the inverter: link times mean duties."""
    for j in range(LANES):
        v = w[LINK * LANES + j]
        w[U_A * LANES + j], w[U_B * LANES + j] = v * mean_a, v * mean_b

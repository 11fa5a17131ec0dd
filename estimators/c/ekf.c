/* ekf: extended Kalman filter on flux, speed and angle with the energy model, in C99.
 * Translated from estimators/kalman.py by estimators/c/generate.py: do not edit, write it anew.
 *
 * Extended Kalman filter with the energy model, compiled.
 *
 * State x = (psi_alpha, psi_beta, omega, theta): total stator flux linkage (Wb), electrical speed and
 * angle.
 *   d psi / dt = u - R i,   d omega / dt = noise,   d theta / dt = omega,
 *   i = R(theta) grad H(R(-theta) psi - (phi_m, 0)),
 * one Heun step a sampling period.  Injection makes theta observable at standstill: the ripple changes
 * the Jacobian of i by theta through Gamma_dd - Gamma_qq.  Twin on filterpy:
 * `estimators.kalman_filterpy`.
 *
 * Source: Bolognani, Tubiana, Zigliotto, IEEE Trans. Ind. Appl. 39 (2003), with the energy of IEMDC 2011.
 * Cost of a step, tracking: 898 mul, 657 add, 11 div, 0 sqrt, 32 trig, 0 compare (mean of 120 steps at rated
 * load, 8 samples a period).
 * Memory: 560 numbers of state, and the setup.  Of libm it calls sin, cos, sqrt and atan2, in float or double. */
#include "sensorless_estimator.h"

#include <math.h>

typedef sensorless_real real;

#ifdef SENSORLESS_FLOAT64
#define R(x) x
#define EITHER(wide, narrow) wide
#define ATAN2(x, y) atan2(x, y)
#define COS(x) cos(x)
#define SIN(x) sin(x)
#define SQRT(x) sqrt(x)
#else
#define R(x) x##f
#define EITHER(wide, narrow) R(narrow)
#define ATAN2(x, y) atan2f(x, y)
#define COS(x) cosf(x)
#define SIN(x) sinf(x)
#define SQRT(x) sqrtf(x)
#endif

#define PI R(3.141592653589793)

static inline real smaller(real a, real b) { return b < a ? b : a; }
static inline real larger(real a, real b) { return b > a ? b : a; }
static inline int32_t smaller_whole(int32_t a, int32_t b) { return b < a ? b : a; }
static inline int32_t larger_whole(int32_t a, int32_t b) { return b > a ? b : a; }
static inline real square(real x) { return x * x; }
static inline real cube(real x) { return x * x * x; }
static inline real fourth(real x) { return x * x * (x * x); }
static inline real length(real x, real y) { return SQRT(x * x + y * y); }
static inline real magnitude(real x) { return x < R(0.0) ? -x : x; }
static inline real down(real x) {
    const real whole = (real)(int32_t)x;
    return whole > x ? whole - R(1.0) : whole;
}
#define HYPOT(x, y) length(x, y)
#define FABS(x) magnitude(x)
#define FLOOR(x) down(x)

/* Places in the state and other numbers, then functions. */
typedef struct { real _0; real _1; } tuple_rr;
typedef struct { real _0; real _1; real _2; real _3; } tuple_rrrr;
typedef struct { real _0; real _1; real _2; } tuple_rrr;
typedef struct { real _0; real _1; int32_t _2; } tuple_rri;
typedef struct { real _0; real _1; real _2; real _3; real _4; } tuple_rrrrr;

enum {
    ALONG_ALPHA = 0,
    COUNT = 0,
    SOLVED = 0,
    ALONG_BETA = 1,
    OUTSIDE = 1,
    PHASE = 1,
    AXIS = 2,
    BIAS_PLUS = 2,
    BIAS_MINUS = 3,
    OMEGA = 3,
    TRACKING = 4,
    TOLD = 5,
    CURSOR = 7,
    SUM_D = 8,
    SUM_Q = 9,
    M_11 = 10,
    M_21 = 11,
    RISE = 12,
    RING_ALPHA = 20,
    NEWTON_STEPS = 60,
    RING_BETA = 116,
    RING_F = 212,
    RING_C = 308,
    RING_S = 404,
    X = 500,
    P = 504,
    F = 520,
    W = 536,
    K = 552,
};

#define TOLERANCE EITHER(4e-15, 2e-06)
#define START_FLUX R(0.02)
#define START_SPEED R(1.0)
#define START_ANGLE R(0.1)

/* Take one sample; return mean_d, mean_q (A) and ripple y_d, y_q (1/H) in the axis' frame.
 *
 * The mean is looked at from one frame, the present axis turned back at the estimated speed, and
 * taken off first: in frames that carry the tracking loop's jitter, mean current times jitter
 * would come out
 * as ripple. The ripple is then looked at from the present frame or from the axis of its own time
 * (`tuning.present`). */
static tuple_rrrr demodulate(real *state, const sensorless_sample *sample, real axis, real omega,
    const sensorless_tuning *tuning) {
    real weight = R(0.0);
    int32_t half = tuning->period / 2;
    int32_t n = 3 * half;
    int32_t newest = (int32_t)state[CURSOR];
    state[RING_ALPHA + newest] = sample->i_alpha;
    state[RING_BETA + newest] = sample->i_beta;
    state[RING_F + newest] = sample->carrier;
    state[RING_C + newest] = COS(axis);
    state[RING_S + newest] = SIN(axis);
    state[CURSOR] = (real)((newest + 1) % n);
    real dc = COS(tuning->sampling_period * omega);
    real ds = SIN(tuning->sampling_period * omega);
    real c = state[RING_C + newest];
    real s = state[RING_S + newest];
    int32_t j = newest;
    real mean_d = R(0.0);
    real mean_q = R(0.0);
    real y_d = R(0.0);
    real y_q = R(0.0);
    /* from the newest sample back */
    for (int32_t k = 0; k < n; k++) {
        weight = (half <= k && k < 2 * half) ? R(1.0) : R(0.5);
        mean_d += weight * (c * state[RING_ALPHA + j] + s * state[RING_BETA + j]);
        mean_q += weight * (c * state[RING_BETA + j] - s * state[RING_ALPHA + j]);
        const real got_1 = c * dc + s * ds;
        const real got_2 = s * dc - c * ds;
        c = got_1;
        s = got_2;
        j = j > 0 ? j - 1 : n - 1;
    }
    mean_d = mean_d / (real)(2 * half);
    mean_q = mean_q / (real)(2 * half);
    c = state[RING_C + newest];
    s = state[RING_S + newest];
    j = newest;
    for (int32_t k = 0; k < n; k++) {
        weight = (half <= k && k < 2 * half) ? state[RING_F + j] : R(0.5) * state[RING_F + j];
        real r_alpha = weight * (state[RING_ALPHA + j] - (c * mean_d - s * mean_q));
        real r_beta = weight * (state[RING_BETA + j] - (s * mean_d + c * mean_q));
        const tuple_rr got_3 = tuning->present ? (tuple_rr){c, s} : (tuple_rr){state[RING_C + j],
            state[RING_S + j]};
        real v_c = got_3._0;
        real v_s = got_3._1;
        y_d += v_c * r_alpha + v_s * r_beta;
        y_q += v_c * r_beta - v_s * r_alpha;
        const real got_4 = c * dc + s * ds;
        const real got_5 = s * dc - c * ds;
        c = got_4;
        s = got_5;
        j = j > 0 ? j - 1 : n - 1;
    }
    real scale = R(1.0) / (tuning->amplitude * tuning->power);
    return (tuple_rrrr){mean_d, mean_q, y_d * scale, y_q * scale};
}

/* Return Gamma_dd, Gamma_dq, Gamma_qq in 1/H: the inverse of the incremental inductance
 * matrix. */
static tuple_rrr hessian(const sensorless_energy *m, real d, real q) {
    real dd = m->gamma_d + d * (R(6.0) * m->alpha_30 + R(12.0) * m->alpha_40 * d) + R(2.0) *
        m->alpha_22 * q * q;
    real dq = R(2.0) * q * (m->alpha_12 + R(2.0) * m->alpha_22 * d);
    real qq = m->gamma_q + R(2.0) * d * (m->alpha_12 + m->alpha_22 * d) + R(12.0) * m->alpha_04 * q
        * q;
    return (tuple_rrr){dd, dq, qq};
}

/* Return the smaller eigenvalue of a symmetric 2x2 matrix. */
static real min_eigenvalue(real dd, real dq, real qq) {
    return R(0.5) * (dd + qq) - SQRT(R(0.25) * square(dd - qq) + dq * dq);
}

/* Return i_d, i_q in A, eqs. (id), (iq). */
static tuple_rr currents(const sensorless_energy *m, real d, real q) {
    real qq = q * q;
    real i_d = d * (m->gamma_d + d * (R(3.0) * m->alpha_30 + R(4.0) * m->alpha_40 * d)) + qq *
        (m->alpha_12 + R(2.0) * m->alpha_22 * d);
    real i_q = q * (m->gamma_q + R(2.0) * d * (m->alpha_12 + m->alpha_22 * d) + R(4.0) * m->alpha_04
        * qq);
    return (tuple_rr){i_d, i_q};
}

/* Tell whether H is strictly convex at the quarter points between two fluxes: no step jumps
 * over a gap. */
static int32_t convex_between(const sensorless_energy *m, real d, real q, real n_d, real n_q) {
    for (int32_t at_k = 0; at_k < 3; at_k++) {
        static const real k_of[3] = {R(0.25), R(0.5), R(0.75)};
        real k = k_of[at_k];
        const tuple_rrr got_1 = hessian(m, d + k * (n_d - d), q + k * (n_q - q));
        real dd = got_1._0;
        real dq = got_1._1;
        real qq = got_1._2;
        if (!(min_eigenvalue(dd, dq, qq) > R(0.0))) {
            return 0;
        }
    }
    return 1;
}

/* Solve grad H = i by Newton's method from (d, q), staying where H is strictly convex.
 *
 * Returns phi_d, phi_q, status.  Full steps wherever they reduce the residual (so the rate is
 * quadratic), halved otherwise; OUTSIDE when no step inside the convex region reduces it. */
static tuple_rri flux_newton(const sensorless_energy *m, real i_d, real i_q, real d, real q) {
    real n_d = R(0.0);
    real n_q = R(0.0);
    real trial = R(0.0);
    const tuple_rrr got_1 = hessian(m, d, q);
    real dd = got_1._0;
    real dq = got_1._1;
    real qq = got_1._2;
    /* also catches NaN */
    if (!(min_eigenvalue(dd, dq, qq) > R(0.0))) {
        d = R(0.0);
        q = R(0.0);
        const tuple_rrr got_2 = hessian(m, d, q);
        dd = got_2._0;
        dq = got_2._1;
        qq = got_2._2;
    }
    const tuple_rr got_3 = currents(m, d, q);
    real c_d = got_3._0;
    real c_q = got_3._1;
    real r_d = i_d - c_d;
    real r_q = i_q - c_q;
    real residual = HYPOT(r_d, r_q);
    real goal = TOLERANCE * (HYPOT(i_d, i_q) + FABS(m->gamma_d * d) + FABS(m->gamma_q * q)) +
        EITHER(1e-290, 1e-37);
    for (int32_t round = 0; round < NEWTON_STEPS; round++) {
        if (residual <= goal) {
            return (tuple_rri){d, q, SOLVED};
        }
        real det = dd * qq - dq * dq;
        real s_d = (qq * r_d - dq * r_q) / det;
        real s_q = (dd * r_q - dq * r_d) / det;
        real t = R(1.0);
        for (;;) {
            n_d = d + t * s_d;
            n_q = q + t * s_q;
            const tuple_rrr got_4 = hessian(m, n_d, n_q);
            dd = got_4._0;
            dq = got_4._1;
            qq = got_4._2;
            const tuple_rr got_5 = currents(m, n_d, n_q);
            c_d = got_5._0;
            c_q = got_5._1;
            r_d = i_d - c_d;
            r_q = i_q - c_q;
            trial = HYPOT(r_d, r_q);
            if (trial < residual && convex_between(m, d, q, n_d, n_q) && min_eigenvalue(dd, dq, qq)
                > R(0.0)) {
                break;
            }
            /* stalled at rounding level */
            if (trial <= R(16.0) * goal && trial >= residual) {
                return (tuple_rri){d, q, SOLVED};
            }
            t *= R(0.5);
            if (t < R(1e-09)) {
                return (tuple_rri){d, q, OUTSIDE};
            }
        }
        d = n_d;
        q = n_q;
        residual = trial;
    }
    return (tuple_rri){d, q, OUTSIDE};
}

/* Return Gamma_dd (1/H) at +bias less that at -bias (A) on the d axis: how much larger the
 * ripple is there. */
static real polarity_rise(const sensorless_energy *energy, real bias) {
    const tuple_rri got_1 = flux_newton(energy, bias, R(0.0), R(0.0), R(0.0));
    real d_plus = got_1._0;
    real q_plus = got_1._1;
    const tuple_rri got_2 = flux_newton(energy, -bias, R(0.0), R(0.0), R(0.0));
    real d_minus = got_2._0;
    real q_minus = got_2._1;
    return hessian(energy, d_plus, q_plus)._0 - hessian(energy, d_minus, q_minus)._0;
}

/* Return the angle brought into [-pi, pi). */
static real wrap(real angle) {
    return angle - R(2.0) * R(3.141592653589793) * FLOOR((angle + R(3.141592653589793)) / (R(2.0) *
        R(3.141592653589793)));
}

/* Move on to the next measurement, y being the averaged ripple of the one that ends. */
static void next_phase(real *state, const sensorless_belief *belief,
    const sensorless_tuning *tuning, real y_d, real y_q) {
    int32_t phase = (int32_t)state[PHASE];
    if (phase == ALONG_ALPHA) {
        state[M_11] = y_d;
        state[M_21] = y_q;
        state[AXIS] = R(0.5) * R(3.141592653589793);
    } else {
        /* here d is beta and q is minus alpha */
        if (phase == ALONG_BETA) {
            real sign = belief->energy.gamma_d >= belief->energy.gamma_q ? R(1.0) : -R(1.0);
            state[AXIS] = R(0.5) * ATAN2(sign * (state[M_21] - y_q), sign * (state[M_11] - y_d));
        } else if (phase == BIAS_PLUS) {
            state[RISE] = y_d;
        } else {
            real expected = polarity_rise(&belief->energy, tuning->bias) < R(0.0) ? -R(1.0) :
                R(1.0);
            if ((state[RISE] - y_d) * expected < R(0.0)) {
                state[AXIS] = wrap(state[AXIS] + R(3.141592653589793));
            }
            state[OMEGA] = R(0.0);
        }
    }
    state[PHASE] = (real)(phase + 1);
    state[COUNT] = R(0.0);
    state[SUM_D] = R(0.0);
    state[SUM_Q] = R(0.0);
}

/* Take one sample while starting up; state[PHASE] reaches TRACKING when position and polarity
 * are known. */
static sensorless_estimate start(real *state, const sensorless_sample *sample,
    const sensorless_belief *belief, const sensorless_tuning *tuning) {
    real amplitude = R(0.0);
    real axis = state[AXIS];
    if (state[PHASE] == TOLD) {
        state[PHASE] = (real)TRACKING;
        return (sensorless_estimate){axis, R(0.0), axis, R(0.0), R(0.0), R(0.0), R(0.0), R(1.0)};
    }
    const tuple_rrrr got_1 = demodulate(state, sample, axis, R(0.0), tuning);
    real y_d = got_1._2;
    real y_q = got_1._3;
    real bias = R(0.0);
    if (state[PHASE] == BIAS_PLUS) {
        bias = tuning->bias;
    } else if (state[PHASE] == BIAS_MINUS) {
        bias = -tuning->bias;
    }
    state[COUNT] += R(1.0);
    if (state[COUNT] > tuning->settle * tuning->period) {
        state[SUM_D] += y_d;
        state[SUM_Q] += y_q;
    }
    if (state[COUNT] >= (tuning->settle + tuning->average) * tuning->period) {
        int32_t n = tuning->average * tuning->period;
        next_phase(state, belief, tuning, state[SUM_D] / (real)n, state[SUM_Q] / (real)n);
        if (state[PHASE] != TRACKING) {
            bias = R(0.0);
        }
    }
    amplitude = tuning->amplitude * tuning->peak;
    return (sensorless_estimate){state[AXIS], R(0.0), state[AXIS], bias, R(0.0), y_d * amplitude,
        y_q * amplitude, R(1.0)};
}

/* Return the vector (x, y) turned by `angle` rad: dq to alpha-beta with +theta, back
 * with -theta. */
static tuple_rr rotate(real x, real y, real angle) {
    real c = COS(angle);
    real s = SIN(angle);
    return (tuple_rr){c * x - s * y, s * x + c * y};
}

/* Return i_alpha, i_beta (A) of the believed motor. */
static tuple_rr stator_current(real psi_alpha, real psi_beta, real theta,
    const sensorless_belief *belief) {
    const tuple_rr got_1 = rotate(psi_alpha, psi_beta, -theta);
    real d = got_1._0;
    real q = got_1._1;
    const tuple_rr got_2 = currents(&belief->energy, d - belief->magnet_flux, q);
    real i_d = got_2._0;
    real i_q = got_2._1;
    return rotate(i_d, i_q, theta);
}

/* Return G_aa, G_ab, G_bb (1/H) and j_a, j_b (A/rad): derivatives of i by psi and by theta. */
static tuple_rrrrr current_jacobian(real psi_alpha, real psi_beta, real theta,
    const sensorless_belief *belief) {
    const tuple_rr got_1 = rotate(psi_alpha, psi_beta, -theta);
    real d = got_1._0;
    real q = got_1._1;
    d -= belief->magnet_flux;
    const tuple_rrr got_2 = hessian(&belief->energy, d, q);
    real dd = got_2._0;
    real dq = got_2._1;
    real qq = got_2._2;
    /* the traceless part turns by twice the angle */
    const tuple_rr got_3 = rotate(dd - qq, R(2.0) * dq, R(2.0) * theta);
    real x = got_3._0;
    real y = got_3._1;
    real g_aa = R(0.5) * (dd + qq + x);
    real g_ab = R(0.5) * y;
    real g_bb = R(0.5) * (dd + qq - x);
    const tuple_rr got_4 = stator_current(psi_alpha, psi_beta, theta, belief);
    real i_alpha = got_4._0;
    real i_beta = got_4._1;
    /* J i - G J psi */
    real j_alpha = -i_beta - (-g_aa * psi_beta + g_ab * psi_alpha);
    real j_beta = i_alpha - (-g_ab * psi_beta + g_bb * psi_alpha);
    return (tuple_rrrrr){g_aa, g_ab, g_bb, j_alpha, j_beta};
}

/* Set the covariance from starting up: a variance of the first two states, those of speed and
 * angle. */
static void doubt(real *s, real variance) {
    for (int32_t k = 0; k < 16; k++) {
        s[P + k] = R(0.0);
    }
    s[P] = variance;
    s[P + 5] = variance;
    s[P + 10] = square(START_SPEED);
    s[P + 15] = square(START_ANGLE);
}

/* Set mean and covariance from the position found by starting up. */
static void begin(real *s, const sensorless_sample *sample, const sensorless_belief *belief) {
    real theta = s[AXIS];
    const tuple_rr got_1 = rotate(belief->magnet_flux, R(0.0), theta);
    real x = got_1._0;
    real y = got_1._1;
    const tuple_rrrrr got_2 = current_jacobian(x, y, theta, belief);
    real g_aa = got_2._0;
    real g_ab = got_2._1;
    real g_bb = got_2._2;
    real det = g_aa * g_bb - g_ab * g_ab;
    s[X] = x + (g_bb * sample->i_alpha - g_ab * sample->i_beta) / det;
    s[X + 1] = y + (g_aa * sample->i_beta - g_ab * sample->i_alpha) / det;
    s[X + 2] = R(0.0);
    s[X + 3] = theta;
    doubt(s, square(START_FLUX * belief->magnet_flux));
}

/* Take one sample while starting up; begin the filter at the position found. */
static sensorless_estimate started(real *state, const sensorless_sample *sample,
    const sensorless_belief *belief, const sensorless_tuning *tuning) {
    sensorless_estimate estimate = start(state, sample, belief, tuning);
    if (state[PHASE] == TRACKING) {
        begin(state, sample, belief);
    }
    return estimate;
}

/* Write left middle left^T (4 x 4, offsets into s) to `out`, through the scratch W; out may be
 * middle. */
static void sandwich(real *s, int32_t left, int32_t middle, int32_t out) {
    real total = R(0.0);
    for (int32_t i = 0; i < 4; i++) {
        for (int32_t j = 0; j < 4; j++) {
            total = R(0.0);
            for (int32_t k = 0; k < 4; k++) {
                total += s[left + 4 * i + k] * s[middle + 4 * k + j];
            }
            s[W + 4 * i + j] = total;
        }
    }
    for (int32_t i = 0; i < 4; i++) {
        for (int32_t j = 0; j < 4; j++) {
            total = R(0.0);
            for (int32_t k = 0; k < 4; k++) {
                total += s[W + 4 * i + k] * s[left + 4 * j + k];
            }
            s[out + 4 * i + j] = total;
        }
    }
}

/* Add a period's process noise to the covariance. */
static void blur(real *s, const sensorless_tuning *tuning) {
    s[P] += tuning->flux_variance;
    s[P + 5] += tuning->flux_variance;
    s[P + 10] += tuning->speed_variance;
}

/* Propagate mean (Heun) and covariance (Jacobian at the start) over one sampling period. */
static void predict(real *s, real u_alpha, real u_beta, const sensorless_belief *belief,
    const sensorless_tuning *tuning) {
    real t = tuning->sampling_period;
    real r = belief->resistance;
    real a = s[X];
    real b = s[X + 1];
    real omega = s[X + 2];
    real theta = s[X + 3];
    const tuple_rrrrr got_1 = current_jacobian(a, b, theta, belief);
    real g_aa = got_1._0;
    real g_ab = got_1._1;
    real g_bb = got_1._2;
    real j_alpha = got_1._3;
    real j_beta = got_1._4;
    const tuple_rr got_2 = stator_current(a, b, theta, belief);
    real i_alpha = got_2._0;
    real i_beta = got_2._1;
    real da = u_alpha - r * i_alpha;
    real db = u_beta - r * i_beta;
    const tuple_rr got_3 = stator_current(a + t * da, b + t * db, theta + t * omega, belief);
    real n_alpha = got_3._0;
    real n_beta = got_3._1;
    s[X] = a + R(0.5) * t * (da + u_alpha - r * n_alpha);
    s[X + 1] = b + R(0.5) * t * (db + u_beta - r * n_beta);
    s[X + 3] = theta + t * omega;
    for (int32_t k = 0; k < 16; k++) {
        s[F + k] = R(0.0);
    }
    s[F] = R(1.0) - t * r * g_aa;
    s[F + 1] = -t * r * g_ab;
    s[F + 3] = -t * r * j_alpha;
    s[F + 4] = -t * r * g_ab;
    s[F + 5] = R(1.0) - t * r * g_bb;
    s[F + 7] = -t * r * j_beta;
    s[F + 10] = R(1.0);
    s[F + 15] = R(1.0);
    s[F + 14] = t;
    sandwich(s, F, P, P);
    blur(s, tuning);
}

/* Correct the covariance (Joseph form) with I - K H in F and the gains in K; v (A^2): variance
 * of a reading. */
static void shrink(real *s, real v) {
    sandwich(s, F, P, P);
    for (int32_t i = 0; i < 4; i++) {
        for (int32_t j = 0; j < 4; j++) {
            s[P + 4 * i + j] += v * (s[K + i] * s[K + j] + s[K + 4 + i] * s[K + 4 + j]);
        }
    }
}

/* Correct with one current sample (Joseph form). */
static void update(real *s, real i_alpha, real i_beta, const sensorless_belief *belief,
    const sensorless_tuning *tuning) {
    const tuple_rrrrr got_1 = current_jacobian(s[X], s[X + 1], s[X + 3], belief);
    real g_aa = got_1._0;
    real g_ab = got_1._1;
    real g_bb = got_1._2;
    real j_alpha = got_1._3;
    real j_beta = got_1._4;
    const tuple_rr got_2 = stator_current(s[X], s[X + 1], s[X + 3], belief);
    real e_alpha = got_2._0;
    real e_beta = got_2._1;
    e_alpha = i_alpha - e_alpha;
    e_beta = i_beta - e_beta;
    real v = tuning->current_variance;
    real s_aa = R(0.0);
    real s_ab = R(0.0);
    real s_bb = R(0.0);
    /* P H^T, two columns into the scratch W */
    for (int32_t k = 0; k < 4; k++) {
        int32_t p = P + 4 * k;
        s[W + k] = s[p] * g_aa + s[p + 1] * g_ab + s[p + 3] * j_alpha;
        s[W + 4 + k] = s[p] * g_ab + s[p + 1] * g_bb + s[p + 3] * j_beta;
    }
    s_aa = g_aa * s[W] + g_ab * s[W + 1] + j_alpha * s[W + 3] + v;
    s_ab = g_aa * s[W + 4] + g_ab * s[W + 5] + j_alpha * s[W + 7];
    s_bb = g_ab * s[W + 4] + g_bb * s[W + 5] + j_beta * s[W + 7] + v;
    real det = s_aa * s_bb - s_ab * s_ab;
    /* I - K H into F */
    for (int32_t k = 0; k < 4; k++) {
        real k_alpha = (s[W + k] * s_bb - s[W + 4 + k] * s_ab) / det;
        real k_beta = (s[W + 4 + k] * s_aa - s[W + k] * s_ab) / det;
        s[K + k] = k_alpha;
        s[K + 4 + k] = k_beta;
        s[X + k] += k_alpha * e_alpha + k_beta * e_beta;
        s[F + 4 * k] = -(k_alpha * g_aa + k_beta * g_ab);
        s[F + 4 * k + 1] = -(k_alpha * g_ab + k_beta * g_bb);
        s[F + 4 * k + 2] = R(0.0);
        s[F + 4 * k + 3] = -(k_alpha * j_alpha + k_beta * j_beta);
        s[F + 5 * k] += R(1.0);
    }
    shrink(s, v);
}

/* Return the estimate at the filter's mean, and the ripple there, which is shown, not used. */
static sensorless_estimate estimate_of(real *state, const sensorless_sample *sample,
    const sensorless_tuning *tuning) {
    real amplitude = R(0.0);
    real theta = state[X + 3];
    real omega = state[X + 2];
    state[AXIS] = theta;
    state[OMEGA] = omega;
    const tuple_rrrr got_1 = demodulate(state, sample, theta, omega, tuning);
    real y_d = got_1._2;
    real y_q = got_1._3;
    amplitude = tuning->amplitude * tuning->peak;
    return (sensorless_estimate){theta, omega, theta, R(0.0), R(1.0), y_d * amplitude, y_q *
        amplitude, R(1.0)};
}

/* Take one sample; see the module's text. */
static sensorless_estimate step(real *state, const sensorless_sample *sample,
    const sensorless_belief *belief, const sensorless_tuning *tuning) {
    if (state[PHASE] != TRACKING) {
        return started(state, sample, belief, tuning);
    }
    predict(state, sample->u_alpha, sample->u_beta, belief, tuning);
    update(state, sample->i_alpha, sample->i_beta, belief, tuning);
    return estimate_of(state, sample, tuning);
}

typedef struct {
    sensorless_belief belief;
    sensorless_tuning tuning;
    real state[560];
} ekf;

/* Return the angle (rad) within a turn: a float keeps its digits. */
static real within_a_turn(real angle) {
    if (angle > PI) {
        return angle - R(2.0) * PI;
    }
    return angle < -PI ? angle + R(2.0) * PI : angle;
}

int32_t sensorless_init(void *state, const sensorless_setup *setup) {
    ekf *own = state;
    const sensorless_tuning *tuning = &setup->tuning;
    if (tuning->period < 2 || tuning->period > 64 || !(tuning->power > R(0.0))) {
        return 1; /* no injection that fits the rings */
    }
    if (!(setup->belief.energy.gamma_d > R(0.0)) || !(setup->belief.energy.gamma_q > R(0.0))) {
        return 2; /* no motor */
    }
    own->belief = setup->belief;
    own->tuning = setup->tuning;
    for (int32_t k = 0; k < 560; k++) {
        own->state[k] = R(0.0);
    }
    if (setup->angle_known) {
        own->state[PHASE] = TOLD;
        own->state[AXIS] = setup->angle;
    }
    return 0;
}

void sensorless_step(void *state, const sensorless_sample *sample, sensorless_estimate *estimate) {
    ekf *own = state;
    *estimate = step(own->state, sample, &own->belief, &own->tuning);
    own->state[X + 3] = within_a_turn(own->state[X + 3]);
}

SENSORLESS_ESTIMATOR("ekf_c", ekf, SENSORLESS_PULSATING);

/* inversion: both ripple components inverted through the believed Hessian, in C99.
 * Translated from estimators/inversion.py by estimators/c/generate.py: do not edit, write it anew.
 *
 * Direct inversion of both ripple components through the believed Hessian.
 *
 * With injection along the estimated d axis, the believed ripple at error e is
 *   S(e) = R(e) Gamma_R(R(-e) i) R(-e) (1, 0),    Gamma_R = Gamma (1 - lag (R Gamma + omega J)^2),
 * the second term being the first effect of resistance and speed on the in-phase ripple (the one of
 * first order in R is in quadrature with F and drops out); of it, R^2 Gamma^2 and R omega (Gamma J + J
 * Gamma) = R omega trace(Gamma) J are taken, omega^2 is small.  The error that minimises |y - S(e)|
 * feeds the phase-locked loop: one Gauss-Newton step a sample.  It needs a non-zero slope vector S',
 * not a saliency of a given sign.
 *
 * Source: Jebai, Malrait, Martin, Rouchon, IEMDC 2011, eqs. of the ripple; Gauss-Newton on both components.
 * Cost of a step, tracking: 1657 mul, 1006 add, 24 div, 54 sqrt, 28 trig, 62 compare (mean of 120 steps at
 * rated load, 8 samples a period).
 * Memory: 500 numbers of state, and the setup.  Of libm it calls sin, cos, sqrt and atan2, in float or double. */
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
    FLUX_D = 5,
    TOLD = 5,
    FLUX_Q = 6,
    CURSOR = 7,
    SUM_D = 8,
    SUM_Q = 9,
    M_11 = 10,
    M_21 = 11,
    RISE = 12,
    DEMODULATION_OUTSIDE = 13,
    SLOW_OMEGA = 16,
    RING_ALPHA = 20,
    NEWTON_STEPS = 60,
    RING_BETA = 116,
    RING_F = 212,
    RING_C = 308,
    RING_S = 404,
};

#define TOLERANCE EITHER(4e-15, 2e-06)
#define SLOW R(0.05)
#define DELTA R(0.02)
#define LEAST R(0.3)
#define LARGEST_ERROR R(0.5)
#define UNCERTAIN R(2.0)
#define TRACKED R(1.0)

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

/* Advance the angle to t_k with the last speed; return it.  SLOW_OMEGA is that speed without
 * its noise. */
static real predict(real *state, const sensorless_tuning *tuning) {
    state[SLOW_OMEGA] += SLOW * tuning->sampling_period * tuning->kp * (state[OMEGA] -
        state[SLOW_OMEGA]);
    state[AXIS] += tuning->sampling_period * state[OMEGA];
    return state[AXIS];
}

/* Return the vector (x, y) turned by `angle` rad: dq to alpha-beta with +theta, back
 * with -theta. */
static tuple_rr rotate(real x, real y, real angle) {
    real c = COS(angle);
    real s = SIN(angle);
    return (tuple_rr){c * x - s * y, s * x + c * y};
}

/* Return phi_d, phi_q (Wb) at a current (A) of the rotor frame, the last one where the belief
 * has none.
 *
 * state[OUTSIDE] says which of both; a second try from zero flux catches a start that had gone
 * astray. */
static tuple_rr believed_flux(real *state, const sensorless_energy *energy, real i_d, real i_q) {
    const tuple_rri got_1 = flux_newton(energy, i_d, i_q, state[FLUX_D], state[FLUX_Q]);
    real d = got_1._0;
    real q = got_1._1;
    int32_t status = got_1._2;
    if (status != SOLVED) {
        const tuple_rri got_2 = flux_newton(energy, i_d, i_q, R(0.0), R(0.0));
        d = got_2._0;
        q = got_2._1;
        status = got_2._2;
    }
    state[DEMODULATION_OUTSIDE] = status == SOLVED ? R(0.0) : R(1.0);
    if (status == SOLVED) {
        state[FLUX_D] = d;
        state[FLUX_Q] = q;
    }
    return (tuple_rr){state[FLUX_D], state[FLUX_Q]};
}

/* Return Gamma_dd, Gamma_dq, Gamma_qq (1/H) there. */
static tuple_rrr believed_hessian(real *state, const sensorless_energy *energy, real i_d, real i_q)
    {
    const tuple_rr got_1 = believed_flux(state, energy, i_d, i_q);
    real d = got_1._0;
    real q = got_1._1;
    return hessian(energy, d, q);
}

/* Return the ripple (y_d, y_q) in 1/H per unit flux ripple along the estimated d axis, at error
 * e (rad). */
static tuple_rr ripple(real dd, real dq, real qq, real e) {
    real c = COS(e);
    real s = SIN(e);
    real r_d = dd * c - dq * s;
    real r_q = dq * c - qq * s;
    return (tuple_rr){c * r_d - s * r_q, s * r_d + c * r_q};
}

/* Return S(e) in 1/H for the mean current (A) of the estimated frame. */
static tuple_rr believed_ripple(real *state, real mean_d, real mean_q, real e,
    const sensorless_belief *belief, const sensorless_tuning *tuning) {
    const sensorless_energy *m = &belief->energy;
    const tuple_rr got_1 = rotate(mean_d, mean_q, -e);
    real i_d = got_1._0;
    real i_q = got_1._1;
    const tuple_rrr got_2 = believed_hessian(state, m, i_d, i_q);
    real dd = got_2._0;
    real dq = got_2._1;
    real qq = got_2._2;
    real c = tuning->lag * belief->resistance * belief->resistance;
    /* Gamma^2 */
    real s_dd = dd * dd + dq * dq;
    real s_dq = dq * (dd + qq);
    real s_qq = dq * dq + qq * qq;
    real r_dd = dd - c * (s_dd * dd + s_dq * dq);
    real r_dq = dq - c * (s_dd * dq + s_dq * qq);
    real r_qq = qq - c * (s_dq * dq + s_qq * qq);
    const tuple_rr got_3 = ripple(r_dd, r_dq, r_qq, e);
    real y_d = got_3._0;
    real y_q = got_3._1;
    c = COS(e);
    real s = SIN(e);
    real w = tuning->lag * belief->resistance * state[SLOW_OMEGA] * (dd + qq);
    /* Gamma J times the injection */
    const tuple_rr got_4 = rotate(dd * s + dq * c, dq * s + qq * c, e);
    real t_d = got_4._0;
    real t_q = got_4._1;
    return (tuple_rr){y_d - w * t_d, y_q - w * t_q};
}

/* Return a Gauss-Newton step (rad): its numerator over the slope's square (1/H^2), less of it
 * where that is small.
 *
 * Noise goes through one over the slope, so a step is taken in full at the slope of zero current,
 * by half at LEAST of it, where damping of the tracking loop has gone from 1 to 0.7, and not at
 * all where the matrix carries no angle. */
static real damped(real step, real power, const sensorless_energy *energy) {
    real usual = energy->gamma_d - energy->gamma_q;
    real least = LEAST * LEAST;
    return (R(1.0) + least) * step / (power + least * usual * usual);
}

/* Return the Gauss-Newton step (rad) from e = 0 towards the minimum of |y - S(e)|. */
static real believed_error(real *state, real mean_d, real mean_q, real y_d, real y_q,
    const sensorless_belief *belief, const sensorless_tuning *tuning) {
    const tuple_rr got_1 = believed_ripple(state, mean_d, mean_q, -DELTA, belief, tuning);
    real a_d = got_1._0;
    real a_q = got_1._1;
    const tuple_rr got_2 = believed_ripple(state, mean_d, mean_q, DELTA, belief, tuning);
    real b_d = got_2._0;
    real b_q = got_2._1;
    const tuple_rr got_3 = believed_ripple(state, mean_d, mean_q, R(0.0), belief, tuning);
    real s_d = got_3._0;
    real s_q = got_3._1;
    real g_d = (b_d - a_d) / (R(2.0) * DELTA);
    real g_q = (b_q - a_q) / (R(2.0) * DELTA);
    return damped(g_d * (y_d - s_d) + g_q * (y_q - s_q), g_d * g_d + g_q * g_q, &belief->energy);
}

/* Type-2 phase-locked loop: proportional and integral action on the error signal (rad). */
static void correct(real *state, real error, const sensorless_tuning *tuning) {
    error = smaller(larger(error, -LARGEST_ERROR), LARGEST_ERROR);
    state[AXIS] += tuning->sampling_period * tuning->kp * error;
    state[OMEGA] += tuning->sampling_period * tuning->ki * error;
}

/* Return what Estimate.tracking says: TRACKED, or UNCERTAIN while the belief has no answer. */
static real trust(real *state) {
    return state[DEMODULATION_OUTSIDE] != R(0.0) ? UNCERTAIN : TRACKED;
}

/* Return the estimate of a tracking loop: an angle (rad), injected along its axis, and the
 * ripple y (1/H) seen.
 *
 * injection: how much of it is wanted, 0 to 1. */
static sensorless_estimate tracked(real *state, real theta, real y_d, real y_q,
    const sensorless_tuning *tuning, real injection) {
    real size = tuning->amplitude * tuning->peak;
    return (sensorless_estimate){theta, state[OMEGA], state[AXIS], R(0.0), trust(state), y_d * size,
        y_q * size, injection};
}

/* Take one sample; see the module's text. */
static sensorless_estimate step(real *state, const sensorless_sample *sample,
    const sensorless_belief *belief, const sensorless_tuning *tuning) {
    if (state[PHASE] != TRACKING) {
        return start(state, sample, belief, tuning);
    }
    real axis = predict(state, tuning);
    const tuple_rrrr got_1 = demodulate(state, sample, axis, state[OMEGA], tuning);
    real mean_d = got_1._0;
    real mean_q = got_1._1;
    real y_d = got_1._2;
    real y_q = got_1._3;
    correct(state, believed_error(state, mean_d, mean_q, y_d, y_q, belief, tuning), tuning);
    return tracked(state, state[AXIS], y_d, y_q, tuning, R(1.0));
}

typedef struct {
    sensorless_belief belief;
    sensorless_tuning tuning;
    real state[500];
} inversion;

/* Return the angle (rad) within a turn: a float keeps its digits. */
static real within_a_turn(real angle) {
    if (angle > PI) {
        return angle - R(2.0) * PI;
    }
    return angle < -PI ? angle + R(2.0) * PI : angle;
}

int32_t sensorless_init(void *state, const sensorless_setup *setup) {
    inversion *own = state;
    const sensorless_tuning *tuning = &setup->tuning;
    if (tuning->period < 2 || tuning->period > 64 || !(tuning->power > R(0.0))) {
        return 1; /* no injection that fits the rings */
    }
    if (!(setup->belief.energy.gamma_d > R(0.0)) || !(setup->belief.energy.gamma_q > R(0.0))) {
        return 2; /* no motor */
    }
    own->belief = setup->belief;
    own->tuning = setup->tuning;
    for (int32_t k = 0; k < 500; k++) {
        own->state[k] = R(0.0);
    }
    if (setup->angle_known) {
        own->state[PHASE] = TOLD;
        own->state[AXIS] = setup->angle;
    }
    return 0;
}

void sensorless_step(void *state, const sensorless_sample *sample, sensorless_estimate *estimate) {
    inversion *own = state;
    *estimate = step(own->state, sample, &own->belief, &own->tuning);
    own->state[AXIS] = within_a_turn(own->state[AXIS]);
}

SENSORLESS_ESTIMATOR("inversion_c", inversion, SENSORLESS_PULSATING);

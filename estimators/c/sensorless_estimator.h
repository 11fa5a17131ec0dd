/* sensorless_estimator.h: a position estimator in C99, for the sandbox and for the target.  ABI version 1.
 *
 * Write sensorless_init and sensorless_step, end the file with SENSORLESS_ESTIMATOR(...), and build
 *     cc -std=c99 -O2 -fPIC -shared -I "$(sensorless include)" -o mine.so mine.c -lm                          float
 *     cc -std=c99 -O2 -fPIC -shared -DSENSORLESS_FLOAT64 -I "$(sensorless include)" -o mine.so mine.c -lm     double
 * The same file, without the macro if you like, is compiled into the firmware.
 *
 * Angles are electrical radians of the magnet (d) axis, from phase a; currents and voltages are amplitude-invariant.
 * Nothing allocates: the caller owns the state and zeroes it before sensorless_init.  Keep no variables outside of
 * it: the sandbox runs several drives at once, in threads.
 */
#ifndef SENSORLESS_ESTIMATOR_H
#define SENSORLESS_ESTIMATOR_H

#include <stdint.h>

#define SENSORLESS_ABI 1 /* goes up when a structure or a function below changes */

#ifdef SENSORLESS_FLOAT64
typedef double sensorless_real;
#else
typedef float sensorless_real;
#endif

/* H(phi_d, phi_q) = gamma_d d^2/2 + gamma_q q^2/2 + alpha_30 d^3 + alpha_12 d q^2 + alpha_40 d^4 + alpha_22 d^2 q^2
 * + alpha_04 q^4, of the flux linkages that currents cause; i = grad H.  A linear belief has all alphas zero. */
typedef struct {
    sensorless_real gamma_d, gamma_q;             /* 1/H: 1/L_d, 1/L_q at zero current */
    sensorless_real alpha_30, alpha_12;           /* A/Wb^2 */
    sensorless_real alpha_40, alpha_22, alpha_04; /* A/Wb^3 */
} sensorless_energy;

/* What the estimator believes of the motor; never the truth. */
typedef struct {
    sensorless_energy energy;
    sensorless_real magnet_flux; /* Wb */
    sensorless_real resistance;  /* ohm */
    sensorless_real pole_pairs;
    sensorless_real inertia; /* kg m^2 */
} sensorless_belief;

/* Injection and gains, as the drive designed them; an estimator may use its own. */
typedef struct {
    int32_t period;                   /* samples in an injection period, N */
    int32_t present;                  /* 1: look at the whole window from the present frame */
    int32_t settle, average;          /* injection periods waited, averaged, in each of the four steps of starting up */
    sensorless_real sampling_period;  /* s */
    sensorless_real amplitude;        /* V injected */
    sensorless_real power, peak, lag; /* s^2, s, s^2: sum F^2, max |F|, weight of the (R Gamma)^2 correction */
    sensorless_real kp, ki;           /* 1/s, 1/s^2: tracking loop */
    sensorless_real bias;             /* A, rated current: polarity test */
    sensorless_real current_variance; /* A^2, one axis */
    sensorless_real flux_variance;    /* Wb^2 a step */
    sensorless_real speed_variance;   /* (rad/s)^2 a step */
} sensorless_tuning;

typedef struct {
    sensorless_belief belief;
    sensorless_tuning tuning;
    int32_t angle_known;   /* 1: the rotor starts at `angle`; 0: find it while starting up */
    sensorless_real angle; /* rad */
} sensorless_setup;

/* What the drive knows at t_k. */
typedef struct {
    sensorless_real i_alpha, i_beta; /* A, as the sensors read them at t_k */
    sensorless_real u_alpha, u_beta; /* V, commanded for the interval that ends at t_k */
    sensorless_real carrier;         /* s, zero-mean primitive F of the injected waveform: flux ripple per volt */
} sensorless_sample;

/* What the estimator makes of it.  Before each step all is 0 but injection, which is 1. */
typedef struct {
    sensorless_real theta;              /* rad, of the magnet axis at t_k; any multiple of 2 pi may be added */
    sensorless_real omega;              /* rad/s, electrical */
    sensorless_real axis;               /* rad, along which to inject */
    sensorless_real bias;               /* A, to hold along theta while starting up */
    sensorless_real tracking;           /* 0 while starting up (no load yet), 1 after, 2 where it does not know */
    sensorless_real ripple_d, ripple_q; /* A, along and across the axis; shown, not used */
    sensorless_real injection;          /* 0 to 1, share of the amplitude that is wanted */
} sensorless_estimate;

/* How the estimator injects after starting up. */
#define SENSORLESS_NONE 0
#define SENSORLESS_PULSATING 1
#define SENSORLESS_ROTATING 2

#ifdef _WIN32
#define SENSORLESS_EXPORT __declspec(dllexport)
#else
#define SENSORLESS_EXPORT
#endif

/* Yours.  init: the setup is gone afterwards, copy what you need; 0 ready, another number: this motor is refused. */
SENSORLESS_EXPORT int32_t sensorless_init(void *state, const sensorless_setup *setup);
SENSORLESS_EXPORT void sensorless_step(void *state, const sensorless_sample *sample, sensorless_estimate *estimate);

/* Made by SENSORLESS_ESTIMATOR("name", state_type, SENSORLESS_PULSATING). */
SENSORLESS_EXPORT int32_t sensorless_abi(void);
SENSORLESS_EXPORT int32_t sensorless_real_bytes(void);
SENSORLESS_EXPORT int32_t sensorless_state_bytes(void);
SENSORLESS_EXPORT int32_t sensorless_injection(void);
SENSORLESS_EXPORT const char *sensorless_name(void);

#define SENSORLESS_ESTIMATOR(NAME, STATE, INJECTION)                                     \
    int32_t sensorless_abi(void) { return SENSORLESS_ABI; }                              \
    int32_t sensorless_real_bytes(void) { return (int32_t)sizeof(sensorless_real); }     \
    int32_t sensorless_state_bytes(void) { return (int32_t)sizeof(STATE); }              \
    int32_t sensorless_injection(void) { return INJECTION; }                             \
    const char *sensorless_name(void) { return NAME; }                                   \
    typedef STATE sensorless_state

#endif

/* The flux observer of VESC and ODrive, from its published equations, behind the sandbox's start-up.
 *
 * Lee, Hong, Nam, Ortega, Praly, Astolfi, IEEE Trans. Power Electron. 25 (2010) 290-297, equations (4), (6), (8) (so
 * numbered in ODrive's source, which cites them), for a surface-magnet motor:
 *     d x / dt = u - R i + g/2 eta (psi_m^2 - |eta|^2),    eta = x - L i,    theta = angle of eta.
 * x is the stator flux linkage (Wb, alpha beta), eta the magnet's part of it, which the last term draws to its known
 * length.  Here L is L_q and psi_m is psi_m + (L_d - L_q) i_d: then eta is the active flux of Boldea, Paicu, Andreescu
 * (IEEE Trans. Power Electron. 23, 2008) and the observer serves salient motors, too.  Speed: a phase-locked loop.
 * It believes in constant inductances and injects nothing; at standstill it only integrates.
 *
 * Own code after the papers: nothing is taken from either project. */
#include "startup.h"

#define DRAWN R(0.25) /* g psi_m^2 over the bandwidth of the tracking loop */

typedef struct {
    sensorless_belief belief;
    sensorless_tuning tuning;
    real start[START_UP_SLOTS];
    real x_alpha, x_beta, i_alpha, i_beta; /* Wb, A: flux, current of the last sample */
    real theta, omega;                     /* rad, rad/s */
    int32_t begun;
} observer;

int32_t sensorless_init(void *state, const sensorless_setup *setup) {
    observer *o = state;
    if (!(setup->belief.magnet_flux > R(0.0))) {
        return 1;
    }
    o->belief = setup->belief;
    o->tuning = setup->tuning;
    if (setup->angle_known) {
        o->start[PHASE] = TOLD;
        o->start[AXIS] = setup->angle;
    }
    return 0;
}

/* Begin at an angle (rad) with the flux that the current makes there. */
static void begin(observer *o, const sensorless_sample *sample, real active, real l_q) {
    o->theta = o->start[AXIS];
    o->x_alpha = active * COS(o->theta) + l_q * sample->i_alpha;
    o->x_beta = active * SIN(o->theta) + l_q * sample->i_beta;
    o->i_alpha = sample->i_alpha;
    o->i_beta = sample->i_beta;
    o->begun = 1;
}

/* Bring the flux to t_k: trapezoidal in the current. */
static void integrate(observer *o, const sensorless_sample *sample, real active, real l_q) {
    const real h = o->tuning.sampling_period, r = o->belief.resistance;
    const real eta_alpha = o->x_alpha - l_q * o->i_alpha, eta_beta = o->x_beta - l_q * o->i_beta;
    const real miss = R(1.0) - (eta_alpha * eta_alpha + eta_beta * eta_beta) / (active * active);
    const real drawn = R(0.5) * DRAWN * o->tuning.kp * miss;
    o->x_alpha += h * (sample->u_alpha - R(0.5) * r * (o->i_alpha + sample->i_alpha) + drawn * eta_alpha);
    o->x_beta += h * (sample->u_beta - R(0.5) * r * (o->i_beta + sample->i_beta) + drawn * eta_beta);
    o->i_alpha = sample->i_alpha;
    o->i_beta = sample->i_beta;
}

void sensorless_step(void *state, const sensorless_sample *sample, sensorless_estimate *estimate) {
    observer *o = state;
    const real h = o->tuning.sampling_period, l_q = R(1.0) / o->belief.energy.gamma_q;
    const real l_d = R(1.0) / o->belief.energy.gamma_d;
    real i_d, active, error;
    if (o->start[PHASE] != TRACKING) {
        *estimate = start(o->start, sample, &o->belief, &o->tuning);
        return;
    }
    if (!o->begun) {
        o->theta = o->start[AXIS];
    }
    o->theta = wrap(o->theta + h * o->omega);
    i_d = COS(o->theta) * sample->i_alpha + SIN(o->theta) * sample->i_beta;
    active = o->belief.magnet_flux + (l_d - l_q) * i_d;
    if (o->begun) {
        integrate(o, sample, active, l_q);
    } else {
        begin(o, sample, active, l_q);
    }
    error = wrap(ATAN2(o->x_beta - l_q * sample->i_beta, o->x_alpha - l_q * sample->i_alpha) - o->theta);
    o->theta += h * o->tuning.kp * error;
    o->omega += h * o->tuning.ki * error;
    estimate->theta = estimate->axis = o->theta;
    estimate->omega = o->omega;
    estimate->tracking = R(1.0);
    estimate->injection = R(0.0);
}

SENSORLESS_ESTIMATOR("flux_observer_c", observer, SENSORLESS_NONE);

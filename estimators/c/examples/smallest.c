#include "sensorless_estimator.h"

#include <math.h>

typedef struct { /* all memory there is: zero before sensorless_init */
    float l, r, h, kp, ki;
    float psi_alpha, psi_beta, i_alpha, i_beta; /* Wb, A */
    float theta, omega;                         /* rad, rad/s */
} mine;

int32_t sensorless_init(void *state, const sensorless_setup *setup) {
    mine *m = state;
    if (!setup->angle_known) {
        return 1; /* refused: this one cannot find its first position */
    }
    m->l = 1.0f / (float)setup->belief.energy.gamma_q;
    m->r = (float)setup->belief.resistance;
    m->h = (float)setup->tuning.sampling_period;
    m->kp = (float)setup->tuning.kp;
    m->ki = (float)setup->tuning.ki;
    m->theta = (float)setup->angle;
    m->psi_alpha = (float)setup->belief.magnet_flux * cosf(m->theta);
    m->psi_beta = (float)setup->belief.magnet_flux * sinf(m->theta);
    return 0;
}

void sensorless_step(void *state, const sensorless_sample *sample, sensorless_estimate *estimate) {
    mine *m = state;
    const float i_alpha = (float)sample->i_alpha, i_beta = (float)sample->i_beta;
    float error;
    m->psi_alpha += m->h * ((float)sample->u_alpha - 0.5f * m->r * (i_alpha + m->i_alpha));
    m->psi_beta += m->h * ((float)sample->u_beta - 0.5f * m->r * (i_beta + m->i_beta));
    m->i_alpha = i_alpha;
    m->i_beta = i_beta;
    m->theta += m->h * m->omega;
    /* the angle between the magnet's flux, psi - L i, and the estimate */
    error = atan2f(m->psi_beta - m->l * i_beta, m->psi_alpha - m->l * i_alpha) - m->theta;
    error -= 6.2831853f * floorf(error / 6.2831853f + 0.5f);
    m->omega += m->h * m->ki * error;
    m->theta += m->h * m->kp * error;
    estimate->theta = estimate->axis = m->theta;
    estimate->omega = m->omega;
    estimate->tracking = 1;  /* 0 while looking for the first position */
    estimate->injection = 0; /* nothing is injected for it */
}

SENSORLESS_ESTIMATOR("mine", mine, SENSORLESS_NONE);

/* The loop closed in C alone: $motor under currents that an estimator orients, its rotor driven by a load machine.
 * Needs an estimator of the same motor beside it: sensorless export-estimator NAME --motor ... into this folder.
 *     cc -std=c99 -O2 closed_loop.c sensorless_drive.c NAME.c -lm && ./a.out      (or all with -DSENSORLESS_FLOAT64) */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include "motor.h"
#include "sensorless_drive.h"

enum { START = 400, SAMPLES = 4000 };
static sensorless_drive drive;
static union { double aligned; unsigned char bytes[SENSORLESS_STATE_BYTES]; } memory;

int main(void) {
    const sensorless_drive_parameters is = sensorless_drive_parameters_of_$cname;
    const sensorless_tuning tuning = sensorless_motor.tuning;
    const double h = is.drive_sampling_period, n = tuning.period, bandwidth = 0.3 / (n * h), turn = 6.283185307179586;
    const double kp[2] = {bandwidth * is.drive_inductance_d, bandwidth * is.drive_inductance_q};
    double i_dq[2], mean[2] = {0, 0}, sum[2] = {0, 0}, u[2] = {0, 0}, before[2] = {0, 0}, next[2], worst = 0, square = 0;
    double ring[$ring][2] = {{0}}, c, s, pulse;
    sensorless_setup setup = sensorless_motor;
    sensorless_drive_input in = {{0.5, 0.5, 0.5}, 0, 0, 0, 0, {0}};
    sensorless_drive_output out = {0};
    setup.angle_known = 1;
    if (sensorless_init(&memory, &setup) || sensorless_drive_init(&drive, &is, SENSORLESS_DRIVEN, 0, 0, 0)) return 2;
    for (int k = 0; k < SAMPLES; k++) {
        const int step = k % tuning.period, then = (k + 1) % tuning.period, half = tuning.period / 2;
        const double i_q = k < START ? 0 : $load, wanted[2] = {0, i_q};
        sensorless_sample sample = {0};
        sensorless_estimate now = {.injection = 1};
        in.omega_then = in.omega_after = k < START ? 0 : $speed;
        sensorless_drive_duties(u[0], u[1], is.drive_dc_bus_voltage, in.duty);
        if (sensorless_drive_step(&drive, &in, &out)) return 3;
        sample.i_alpha = (2 * out.read_a - out.read_b - out.read_c) / 3;
        sample.i_beta = (out.read_b - out.read_c) / 1.7320508075688772;
        sample.u_alpha = before[0], sample.u_beta = before[1];
        sample.carrier = h * ((step <= half ? step : tuning.period - step) - 0.25 * n); /* primitive of the square wave */
        sensorless_step(&memory, &sample, &now);
        c = cos(now.theta), s = sin(now.theta);
        i_dq[0] = c * sample.i_alpha + s * sample.i_beta, i_dq[1] = c * sample.i_beta - s * sample.i_alpha;
        c = cos(now.theta + 1.5 * h * now.omega), s = sin(now.theta + 1.5 * h * now.omega);
        for (int a = 0; a < 2; a++) { /* mean over an injection period, then PI */
            mean[a] += (i_dq[a] - ring[step][a]) / n;
            ring[step][a] = i_dq[a];
            sum[a] += h * bandwidth * is.stator_resistance_resistance * (wanted[a] - mean[a]);
            next[a] = kp[a] * (wanted[a] - mean[a]) + sum[a] + (a ? now.omega * is.magnet_flux_magnet_flux : 0);
        }
        pulse = tuning.amplitude * now.injection * (then < half ? 1 : -1);
        memcpy(before, u, sizeof(u));
        u[0] = c * next[0] - s * next[1] + pulse * cos(now.axis + 1.5 * h * now.omega);
        u[1] = s * next[0] + c * next[1] + pulse * sin(now.axis + 1.5 * h * now.omega);
        if (k > SAMPLES / 2) {
            const double error = 57.29577951308232 * remainder(now.theta - out.theta_read, turn);
            worst = fmax(worst, fabs(error)), square += error * error / (SAMPLES / 2);
        }
    }
    printf("$motor: error rms %.3f, largest %.3f degrees at %.3g A\n", sqrt(square), worst, (double)mean[1]);
    return worst < 5 ? 0 : 1;
}

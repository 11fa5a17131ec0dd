/* sensorless_drive.h: a motor with its inverter, shaft and sensors, in C99; made by sensorless-sandbox $version.
 *
 * Motor: $motor.  The plant with all effects is that of the sandbox, translated from its kernels: PWM edge by PWM edge,
 * nothing averaged.  It allocates nothing; all memory is one sensorless_drive, which may be copied as it is.
 *
 *     cc -std=c99 -O2 -c sensorless_drive.c                          float
 *     cc -std=c99 -O2 -DSENSORLESS_FLOAT64 -c sensorless_drive.c     double, as the sandbox computes
 *
 * SI units.  Angles and speeds are electrical and of the magnet (d) axis, from phase a; alpha, beta are
 * amplitude-invariant.  A period goes on from t_k to t_k+1; readings are those of its beginning, t_k, so that what a
 * controller makes of them acts from t_k+1 on, as in a drive. */
#ifndef SENSORLESS_DRIVE_H
#define SENSORLESS_DRIVE_H

#include <stdint.h>

#ifdef SENSORLESS_FLOAT64
typedef double drive_real;
#else
typedef float drive_real;
#endif

/* What the drive is: begin with sensorless_drive_parameters_of_$cname and change what you like. */
typedef struct {
$parameters
} sensorless_drive_parameters;

#define SENSORLESS_DRIVE_PARAMETERS $count
extern const sensorless_drive_parameters sensorless_drive_parameters_of_$cname;
extern const sensorless_drive_parameters sensorless_drive_lowest, sensorless_drive_highest; /* bounds, inclusive */

/* What is done with the rotor. */
enum { SENSORLESS_LOCKED, SENSORLESS_DRIVEN, SENSORLESS_FREE };

typedef struct {
    drive_real duty[3];                 /* of legs a, b, c over the period that begins, 0 to 1 */
    drive_real load, load_then;         /* N m, asked of the load: up to t_k+1, and after it (where pulses come late) */
    drive_real omega_then, omega_after; /* rad/s, of a driven rotor: at t_k+1, at t_k+2 (where pulses come late) */
    drive_real chance[5]; /* standard normal numbers, 0 without noise: instant of the sample t_k+1 (of init: t_0),
                           * readings a, b, c, link; those of a period are used once in it */
} sensorless_drive_input;

typedef struct {
    drive_real read_a, read_b, read_c; /* A, readings of the sample t_k */
    drive_real theta_read, omega_read; /* rad, rad/s, of the encoder at t_k */
    drive_real u_dc_read;              /* V, of the link */
    drive_real i_a, i_b, i_c;          /* A, at the terminals when the step ends */
    drive_real theta, omega;           /* rad (within a turn of the shaft), rad/s, of the rotor when the step ends */
    drive_real torque;                 /* N m, of the air gap when the step ends */
    drive_real u_dc;                   /* V, of the link in the last segment of the step */
} sensorless_drive_output;

$applied_torque

$rotor_trajectory

$timing

$plant

$room

typedef struct {
    drive_plant plant;
    drive_room room;
    drive_timing timing;
    sensorless_drive_parameters is;
    double time; /* s since init, of the period's beginning */
    drive_real span, instant, next_instant, period; /* s: last segment, instants of sampling, PWM period */
    drive_real duty[3], ahead[2], held[2]; /* of this period; currents sampled for the next and this one */
    drive_applied_torque applied; /* what moves the rotor in this period */
    int32_t features, rotor, turns; /* turns: of the shaft taken off the angle */
} sensorless_drive;

/* Begin at rest without current at an angle (rad) and a speed (rad/s).  Returns 0, or k where the k-th parameter is out
 * of bounds (from 1), or -1 where parameters together are no drive. */
int32_t sensorless_drive_init(sensorless_drive *drive, const sensorless_drive_parameters *is, int32_t rotor,
                              drive_real theta, drive_real omega, drive_real chance);

/* Go on by one PWM period.  Returns 0, 1 where the magnetic model is left (no longer convex), 2 where a number is not
 * finite, -2 where a part is shorter than an edge may be late. */
int32_t sensorless_drive_step(sensorless_drive *drive, const sensorless_drive_input *in, sensorless_drive_output *out);

/* Go on by one of several equal parts of a period (0 .. parts - 1, in order), as hardware in the loop does.  Duties,
 * load and chance are taken over in part 0; readings of t_k are there after the part in which they are sampled. */
int32_t sensorless_drive_part(sensorless_drive *drive, const sensorless_drive_input *in, sensorless_drive_output *out,
                              int32_t part, int32_t parts);

/* Write the outputs that are those of a step's end, as they are now. */
void sensorless_drive_look(const sensorless_drive *drive, sensorless_drive_output *out);

/* Duties of three legs for a voltage (V), centred, on a link of u_dc (V). */
void sensorless_drive_duties(drive_real u_alpha, drive_real u_beta, drive_real u_dc, drive_real duty[3]);

#endif

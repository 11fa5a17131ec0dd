/* The drive as a functional mock-up unit (FMI $fmi, co-simulation): what both versions of the interface share.
 * A step is a whole number of PWM periods, or an equal part of one. */
#include "$header"

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define TOKEN "$token"
#define OWN SENSORLESS_DRIVE_PARAMETERS /* value references: parameters, then these */
enum { THETA_START = OWN, OMEGA_START, INPUTS, LOAD = INPUTS + 3, OMEGA, OUTPUTS = INPUTS + 5, ALL = OUTPUTS + 13 };
enum { ROTOR = ALL, SEED, EVERY }; /* EVERY: time at the period's beginning */
#define INFINITE 1e300 /* as variables of an FMU have to be finite */
#define MOST_PARTS 1000

typedef struct {
    sensorless_drive drive;
    sensorless_drive_parameters is;
    sensorless_drive_input in;
    sensorless_drive_output out;
    double start[2]; /* theta, omega */
    int32_t rotor, seed, part, parts, begun;
    uint64_t random;
} unit_state;

typedef struct {
    unit_state now;
    void *environment;
    void *log;
} unit;

static void tell(unit *u, const char *message);

static void begin_anew(unit *u) {
    memset(&u->now, 0, sizeof(u->now));
    u->now.is = sensorless_drive_parameters_of_$cname;
    u->now.rotor = SENSORLESS_FREE;
    for (int k = 0; k < 3; k++) {
        u->now.in.duty[k] = 0.5;
    }
}

static unit *unit_new(const char *token, void *environment, void *log) {
    unit *u = token != NULL && strcmp(token, TOKEN) == 0 ? calloc(1, sizeof(*u)) : NULL;
    if (u != NULL) {
        u->environment = environment;
        u->log = log;
        begin_anew(u);
    }
    return u;
}

/* A standard normal number: xorshift64*, Box and Muller. */
static double chance(unit_state *n) {
    double uniform[2];
    if (n->seed == 0) {
        return 0.0;
    }
    for (int k = 0; k < 2; k++) {
        n->random ^= n->random >> 12;
        n->random ^= n->random << 25;
        n->random ^= n->random >> 27;
        uniform[k] = ((double)((n->random * 2685821657736338717u) >> 11) + 0.5) / 9007199254740992.0;
    }
    return sqrt(-2.0 * log(uniform[0])) * cos(6.283185307179586 * uniform[1]);
}

/* Begin with the parameters and start values given; return whether that is a drive. */
static int unit_begin(unit *u) {
    unit_state *n = &u->now;
    int32_t status;
    n->random = 88172645463325252u ^ ((uint64_t)(uint32_t)n->seed << 32 | (uint32_t)n->seed);
    status = sensorless_drive_init(&n->drive, &n->is, n->rotor, n->start[0], n->start[1], chance(n));
    if (status != 0) {
        tell(u, status > 0 ? "a parameter is out of its bounds" : "the parameters together are no drive");
        return 0;
    }
    sensorless_drive_look(&n->drive, &n->out);
    n->begun = 1;
    n->part = 0;
    n->parts = 1;
    return 1;
}

static double *place(unit_state *n, uint32_t reference) {
    if (reference < OWN) {
        return (double *)&n->is + reference;
    }
    if (reference < INPUTS) {
        return &n->start[reference - OWN];
    }
    if (reference < LOAD) {
        return &n->in.duty[reference - INPUTS];
    }
    if (reference < OUTPUTS) {
        return reference == LOAD ? &n->in.load : &n->in.omega_then;
    }
    return reference < ALL ? (double *)&n->out + (reference - OUTPUTS) : NULL;
}

static int unit_get(unit *u, uint32_t reference, double *value) {
    const double *at = reference == EVERY ? &u->now.drive.time : place(&u->now, reference);
    if (at == NULL) {
        return 0;
    }
    *value = isinf(*at) ? (*at > 0.0 ? INFINITE : -INFINITE) : *at;
    return 1;
}

static int unit_set(unit *u, uint32_t reference, double value) {
    double *at = place(&u->now, reference);
    if (at == NULL || reference >= OUTPUTS || (reference < INPUTS && u->now.begun) || isnan(value)) {
        tell(u, "a variable cannot be set now, or not to this");
        return 0;
    }
    *at = fabs(value) >= INFINITE ? copysign(INFINITY, value) : value;
    return 1;
}

static int32_t *whole(unit_state *n, uint32_t reference) {
    return reference == ROTOR ? &n->rotor : reference == SEED ? &n->seed : NULL;
}

static int unit_get_whole(unit *u, uint32_t reference, int32_t *value) {
    const int32_t *at = whole(&u->now, reference);
    if (at == NULL) {
        return 0;
    }
    *value = *at;
    return 1;
}

static int unit_set_whole(unit *u, uint32_t reference, int32_t value) {
    int32_t *at = whole(&u->now, reference);
    if (at == NULL || u->now.begun || value < 0 || (reference == ROTOR && value > SENSORLESS_FREE)) {
        tell(u, "rotor (0 locked, 1 driven, 2 free) and noise_seed are set before initialization");
        return 0;
    }
    *at = value;
    return 1;
}

static int unit_part(unit *u) {
    unit_state *n = &u->now;
    int32_t status;
    if (n->part == 0) {
        n->in.load_then = n->in.load;
        n->in.omega_after = n->in.omega_then;
        for (int k = 0; k < 5; k++) {
            n->in.chance[k] = chance(n);
        }
    }
    status = sensorless_drive_part(&n->drive, &n->in, &n->out, n->part, n->parts);
    n->part = n->part + 1 == n->parts ? 0 : n->part + 1;
    if (status != 0) {
        tell(u, status == 1   ? "the motor's magnetic model is left: it is no longer convex there"
                : status == 2 ? "a number is no longer finite"
                              : "parts of a period are shorter than an edge may be late");
    }
    return status == 0;
}

/* Go on by a step (s). */
static int unit_step(unit *u, double step) {
    unit_state *n = &u->now;
    const double period = n->is.drive_sampling_period;
    const double periods = floor(step / period + 0.5), parts = floor(period / step + 0.5);
    if (step > 0.0 && n->part == 0 && fabs(periods * period - step) <= 1e-6 * period && periods >= 1.0) {
        n->parts = 1;
        for (double k = 0.0; k < periods; k += 1.0) {
            if (!unit_part(u)) {
                return 0;
            }
        }
        return 1;
    }
    if (step > 0.0 && parts <= MOST_PARTS && fabs(parts * step - period) <= 1e-6 * period &&
        (n->part == 0 || (int32_t)parts == n->parts)) {
        n->parts = (int32_t)parts;
        return unit_part(u);
    }
    tell(u, "a step is a whole number of PWM periods, or one of equal parts of a period, all of it alike");
    return 0;
}

/* States kept outside: a copy, and the same as bytes. */
static int unit_keep(unit *u, void **state) {
    if (*state == NULL) {
        *state = malloc(sizeof(unit_state));
    }
    if (*state != NULL) {
        memcpy(*state, &u->now, sizeof(unit_state));
    }
    return *state != NULL;
}

static int unit_restore(unit *u, const void *state) {
    if (state == NULL) {
        return 0;
    }
    memcpy(&u->now, state, sizeof(unit_state));
    return 1;
}

static int state_forget(void **state) {
    free(*state);
    *state = NULL;
    return 1;
}

static int state_to_bytes(const void *state, void *bytes, size_t size) {
    if (state == NULL || size < sizeof(unit_state)) {
        return 0;
    }
    memcpy(bytes, state, sizeof(unit_state));
    return 1;
}

static int state_from_bytes(const void *bytes, size_t size, void **state) {
    *state = size == sizeof(unit_state) ? malloc(size) : NULL;
    if (*state != NULL) {
        memcpy(*state, bytes, size);
    }
    return *state != NULL;
}

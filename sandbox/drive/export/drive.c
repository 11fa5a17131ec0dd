/* Of the plant's numbers, those that parameters say; the order of further parts: those that are there come first. */
static void set_rows(drive_plant *w, const sensorless_drive_parameters *is) {
$rows
}

/* What the plant needs beside the bare motor. */
static int32_t features_of(const sensorless_drive_parameters *is) {
    int32_t bits = ADDITIONS_MOVED;
$needs
    return bits;
}

/* Return 0, or which parameter (from 1) is out of bounds. */
static int32_t out_of_bounds(const sensorless_drive_parameters *is) {
    const drive_real *value = (const drive_real *)is;
    const drive_real *lowest = (const drive_real *)&sensorless_drive_lowest;
    const drive_real *highest = (const drive_real *)&sensorless_drive_highest;
    for (int32_t k = 0; k < SENSORLESS_DRIVE_PARAMETERS; k++) {
        if (!(value[k] >= lowest[k] && value[k] <= highest[k])) {
            return k + 1;
        }
    }
    return 0;
}

/* Return when the next sample is taken, s after its pattern's start. */
static drive_real sampled(const sensorless_drive *drive, drive_real chance) {
    const drive_plant *w = &drive->plant;
    drive_real late = w->sample + w->delay + w->jitter * chance;
    if (w->jitter == R(0.0)) {
        return w->sample;
    }
    late = larger(late, SENSING_SOONEST * drive->period);
    return smaller(late, SENSING_LATEST * drive->period) - w->delay;
}

static int32_t sound(const drive_plant *w) {
    return $sound;
}

int32_t sensorless_drive_init(sensorless_drive *drive, const sensorless_drive_parameters *is, int32_t rotor,
                              drive_real theta, drive_real omega, drive_real chance) {
    const int32_t wrong = out_of_bounds(is);
    drive_plant *w = &drive->plant;
    drive_real rest[2], c = COS(theta), s = SIN(theta);
    if (wrong) {
        return wrong;
    }
    memset(drive, 0, sizeof(*drive));
    drive->is = *is;
    drive->rotor = rotor;
    drive->period = is->drive_sampling_period;
    drive->features = features_of(is);
    set_rows(w, is);
    fixed_fix(w, is->drive_dc_bus_voltage, is->drive_sampling_period);
    if (!sound(w)) {
        return -1;
    }
    if (rotor == SENSORLESS_FREE) {
        drive->features |= ADDITIONS_MOTION;
    } else {
        drive->features &= ~ADDITIONS_TWIST;
        w->inertia_inv = w->motor_inv = w->load_inv = w->load_share = R(0.0);
    }
    w->link = w->supply;
    w->off_c = R(1.0);
    drive->timing.period = drive->period;
    drive->timing.longest = smaller(R(0.5) * drive->period, is->drive_longest_step);
    drive->timing.max_edge_delay = commutation_latest(w);
    drive->timing.first = w->jitter > R(0.0) ? R(-1.0) : w->sample;
    drive->timing.last = w->jitter > R(0.0) ? R(1.0) : w->sample;
    additions_at_rest(w, &c, &s, rest);
    w->psi_alpha = c * (w->magnet + rest[0]) - s * rest[1];
    w->psi_beta = s * (w->magnet + rest[0]) + c * rest[1];
    w->eddy_alpha = w->psi_alpha;
    w->eddy_beta = w->psi_beta;
    w->angle = theta;
    w->speed = omega;
    for (int32_t leg = 0; leg < 3; leg++) {
        drive->duty[leg] = drive->room.duty[leg] = R(0.5);
    }
    for (int32_t m = 0; m < EDGES_EDGES + 4; m++) {
        drive->room.until[m] = BATCH_NEVER;
    }
    drive->instant = sampled(drive, chance);
    return 0;
}

/* The pulses of one of several equal parts of a period: a leg that is high when it begins rises there without an edge. */
static void write_part(drive_room *room, const drive_real *duty, drive_real period, int32_t part, int32_t parts) {
    const drive_real length = period / (drive_real)parts, begin = (drive_real)part * length;
    const drive_real end = part + 1 == parts ? period : begin + length;
    int32_t n = 0;
    for (int32_t leg = 0; leg < 3; leg++) {
        const drive_real rise = R(0.5) * (R(1.0) - duty[leg]) * period, fall = period - rise;
        const int32_t on = duty[leg] > R(0.0), always = duty[leg] >= R(1.0);
        const int32_t high = on && (rise < begin || (rise <= begin && always && room->before[leg] >= R(1.0)));
        if (high && fall > begin) {
            n = edges_put(room, n, R(0.0), leg, R(1.0), R(0.0));
        } else if (on && rise >= begin && rise < end) {
            n = edges_put(room, n, rise - begin, leg, R(1.0), R(1.0));
        } else {
            n = edges_put(room, n, length, leg, R(0.0), R(0.0));
        }
        if (on && !always && fall >= begin && fall < end) {
            n = edges_put(room, n, fall - begin, leg, R(-1.0), R(1.0));
        } else {
            n = edges_put(room, n, length, leg, R(0.0), R(0.0));
        }
    }
    for (int32_t g = 0; g < EDGES_EDGES; g++) {
        room->x[g] = EDGES_LEG_X[room->leg[g]];
        room->y[g] = EDGES_LEG_Y[room->leg[g]];
        room->mate[g] = -1;
        for (int32_t m = 0; m < g && room->side[g] < R(0.0); m++) {
            if (room->leg[m] == room->leg[g] && room->real[m] > R(0.0)) {
                room->mate[g] = m;
            }
        }
    }
}

/* What is at the terminals when the step ends: the next segment's start, which no duty changes, on a copy. */
void sensorless_drive_look(const sensorless_drive *drive, sensorless_drive_output *out) {
    drive_plant now = drive->plant, *w = &now;
    const tuple_rr rotor = loop_rotor(w);
    const drive_real c = COS(rotor._0), s = SIN(rotor._0);
    const drive_applied_torque still = {R(0.0), R(0.0), R(0.0), R(0.0), R(0.0)};
    const drive_rotor_trajectory trajectory = {c, s, R(0.0), R(0.0), rotor._1, R(0.0), R(0.0), rotor._1, still};
    drive_real across;
    period_at_start(w$map, drive->features, c, s, R(0.0), trajectory, drive->span);
    w->mid_alpha = w->psi_alpha;
    w->mid_beta = w->psi_beta;
    w->j_alpha = w->i_alpha;
    w->j_beta = w->i_beta;
    w->turning = R(0.0);
    if (drive->features & ADDITIONS_ANGULAR) {
        additions_turning(w, c, s);
    }
    across = w->psi_alpha * (w->i_beta - w->core_beta) - w->psi_beta * (w->i_alpha - w->core_alpha);
    out->torque = R(1.5) * w->pairs * (across - w->turning);
    out->i_a = w->i_alpha;
    out->i_b = R(-0.5) * w->i_alpha + ELECTRICAL_HALF_ROOT * w->i_beta;
    out->i_c = R(-0.5) * w->i_alpha - ELECTRICAL_HALF_ROOT * w->i_beta;
    out->theta = rotor._0;
    out->omega = rotor._1;
    out->u_dc = w->link;
}

/* A reading of a phase current: noise, then counts. */
static drive_real counted(const sensorless_drive *drive, drive_real value, drive_real chance) {
    const drive_real count = drive->is.drive_current_resolution;
    value += drive->is.drive_current_noise * chance;
    return count > R(0.0) ? count * FLOOR(value / count + R(0.5)) : value;
}

static void read_sensors(sensorless_drive *drive, const sensorless_drive_input *in, sensorless_drive_output *out) {
    drive_plant *w = &drive->plant;
    w->held_alpha = drive->held[0];
    w->held_beta = drive->held[1];
    sampling_read(w);
    out->read_a = counted(drive, w->read_a, in->chance[1]);
    out->read_b = counted(drive, w->read_b, in->chance[2]);
    out->read_c = counted(drive, w->read_c, in->chance[3]);
}

/* What moves the rotor over this period's pattern. */
static drive_applied_torque applied_in(sensorless_drive *drive, const sensorless_drive_input *in) {
    const drive_real left = drive->period - drive->plant.delay, omega = loop_rotor(&drive->plant)._1;
    drive_applied_torque applied = {in->load, R(0.0), left, in->load, R(0.0)};
    if (drive->rotor == SENSORLESS_DRIVEN) {
        applied.imposed = applied.imposed_after = (in->omega_then - omega) / left;
    }
    if (drive->plant.delay > R(0.0)) {
        applied.load_after = in->load_then;
        if (drive->rotor == SENSORLESS_DRIVEN) {
            applied.imposed_after = (in->omega_after - in->omega_then) / drive->period;
        }
    }
    return applied;
}

/* Begin a period: take over what acts in it, read encoder and link. */
static void begin(sensorless_drive *drive, const sensorless_drive_input *in, sensorless_drive_output *out) {
    drive_room *room = &drive->room;
    const loop_rig rig = {drive->rotor};
    tuple_rr motion, angle;
    for (int32_t leg = 0; leg < 3; leg++) {
        room->before[leg] = drive->duty[leg];
        drive->duty[leg] = smaller(larger(in->duty[leg], R(0.0)), R(1.0));
    }
    drive->applied = applied_in(drive, in);
    motion = loop_at_sample(&drive->plant, rig, drive->applied);
    angle = sensing_encoder(&drive->plant, drive->features, motion._0, motion._1, drive->is.drive_encoder_step);
    out->theta_read = angle._0;
    out->omega_read = angle._1;
    out->u_dc_read = drive->is.drive_dc_bus_voltage + drive->is.drive_link_noise * in->chance[4];
    drive->next_instant = sampled(drive, in->chance[0]);
    if (drive->instant < R(0.0)) {
        drive->held[0] = drive->ahead[0];
        drive->held[1] = drive->ahead[1];
    }
}

/* Return s since the beginning; a float cannot count long, so it begins anew with the link's ripple. */
static drive_real clock_of(const sensorless_drive *drive) {
    const double ripple = (double)drive->is.dc_link_ripple_frequency;
    if (sizeof(drive_real) < sizeof(double) && ripple > 0.0) {
        const double cycles = drive->time * ripple;
        return (drive_real)((cycles - floor(cycles)) / ripple);
    }
    return (drive_real)drive->time;
}

/* Keep the angle within a turn of the shaft, so that it keeps its digits. */
static void keep_within_a_turn(sensorless_drive *drive) {
    const drive_real turn = R(6.283185307179586) * drive->plant.pairs;
    if (FABS(drive->plant.angle) >= turn) {
        const int32_t sign = drive->plant.angle > R(0.0) ? 1 : -1;
        drive->plant.angle -= (drive_real)sign * turn;
        drive->turns += sign;
    }
}

/* Return an instant of the period (s) as one of a part's, -1 where it is not in it. */
static drive_real inside(drive_real at, drive_real from, drive_real to) {
    return at >= from && at < to ? at - from : R(-1.0);
}

int32_t sensorless_drive_part(sensorless_drive *drive, const sensorless_drive_input *in, sensorless_drive_output *out,
                              int32_t part, int32_t parts) {
    drive_plant *w = &drive->plant;
    drive_room *room = &drive->room;
    drive_timing timing = drive->timing;
    const int32_t plain = timing.first == R(0.0) && timing.last == R(0.0), last = part + 1 == parts;
    const drive_real length = drive->period / (drive_real)parts, from = (drive_real)part * length;
    drive_real looks[2], seen[4] = {R(0.0)}, surge, beyond = last ? R(2.0) * drive->period : from + length;
    const tuple_rr nothing = {R(0.0), R(0.0)};
    drive_rotor_trajectory trajectory;
    tuple_rr rotor;
    if (parts > 1 && timing.max_edge_delay > length) {
        return -2;
    }
    if (part == 0) {
        begin(drive, in, out);
    }
    for (int32_t leg = 0; leg < 3; leg++) {
        room->before[leg] = part == 0 ? room->before[leg] : R(0.5);
        room->duty[leg] = drive->duty[leg];
    }
    room->half = 0;
    if (parts == 1) {
        edges_write_edges(room, drive->period);
    } else {
        write_part(room, drive->duty, drive->period, part, parts);
        room->half = part > 0 ? -1 : 0;
    }
    rotor = loop_rotor(w);
    trajectory.applied = drive->applied;
    trajectory.applied.until -= from;
    surge = drive->rotor == SENSORLESS_DRIVEN ? R(0.5) * trajectory.applied.imposed : w->surge;
    trajectory.cos = COS(rotor._0);
    trajectory.sin = SIN(rotor._0);
    trajectory.origin = trajectory.lead = trajectory.jerk = R(0.0);
    trajectory.rate = trajectory.speed = rotor._1;
    trajectory.bend = surge;
    timing.period = length;
    looks[0] = drive->instant < R(0.0) ? R(-1.0) : inside(drive->instant, from, beyond);
    looks[1] = drive->next_instant < R(0.0) ? inside(drive->period + drive->next_instant, from, beyond) : R(-1.0);
    if (plain) {
        drive->span = period_travel(w$map, timing, drive->features, room, trajectory, clock_of(drive) + from, drive->span,
                                    looks, seen);
        if (part == 0) {
            drive->held[0] = w->held_alpha;
            drive->held[1] = w->held_beta;
        }
    } else {
        drive->span = $travel_looking(w$map, timing, drive->features, room, trajectory, clock_of(drive) + from, drive->span,
                                      looks, seen);
        if (looks[0] >= R(0.0)) {
            drive->held[0] = seen[0];
            drive->held[1] = seen[1];
        }
        if (looks[1] >= R(0.0)) {
            drive->ahead[0] = seen[2];
            drive->ahead[1] = seen[3];
        }
    }
    sensorless_drive_look(drive, out);
    read_sensors(drive, in, out);
    if (last) {
        drive->instant = drive->next_instant;
        drive->time += (double)drive->period;
        keep_within_a_turn(drive);
    }
    return loop_judge(w, nothing);
}

int32_t sensorless_drive_step(sensorless_drive *drive, const sensorless_drive_input *in, sensorless_drive_output *out) {
    return sensorless_drive_part(drive, in, out, 0, 1);
}

void sensorless_drive_duties(drive_real u_alpha, drive_real u_beta, drive_real u_dc, drive_real duty[3]) {
    const tuple_rrr found = edges_duties(u_alpha, u_beta, u_dc);
    duty[0] = found._0;
    duty[1] = found._1;
    duty[2] = found._2;
}

"""One period of the plant, event by event: three legs rise and fall, samplers hold, nothing is
averaged.

Time in a period runs from its pattern's start, t_k + delay: the edges then come in one order and at
one instant for all sets side by side, whatever their delays.  What differs from set to set is when
a commanded edge acts: late by what the effects at the port `edge` say of the current there.
Volt-seconds of late edges are exact wherever they fall: before the next edge, beyond it, or in the
next period (`wait`).  A pulse cannot be negative.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from model.compiled import inlined, kernel
from model.kernels.borrowed import borrowed
from model.lanes import SHORT_TURN, turned, turned_a_little
from sandbox.plant import additions as add
from sandbox.plant import iron, lags, losses
from sandbox.plant.batch import CORE, FILTER, NEVER, SKIN
from sandbox.plant.commutation import commutate
from sandbox.plant.edges import EDGES, LEG_X, LEG_Y
from sandbox.plant.electrical import (
    begin,
    bend,
    dropped,
    lose,
    middle,
    nothing_lost,
    plain_step,
    stiffen,
)
from sandbox.plant.gates.blocked import PARTS, float_legs
from sandbox.plant.layers import close_layers, kink_layers, layers_in_middle, weigh_layers
from sandbox.plant.mechanics import step_shaft
from sandbox.plant.sampling import SHORTEST, hold_start, looked_at, peek, slope

TWO_THIRDS = 2.0 / 3.0
NO_TIME = 1e-11  # s: speed over a shorter one is rounding
# of the period: what curvature makes of shorter segments is far below 1e-9 of the current
BENDING = 1e-3
# what a plain step knows nothing of
ADDED = ~(
    add.MOTION
    | add.TWIST
    | add.BACKLASH
    | add.DRAWN
    | add.RING
    | add.CHANNELS
    | add.DELAYED
    | add.RUB
    | add.COMMUTE
)
# of the way from a segment's middle to its ends: two places give means of third degree
GAUSS = 0.5773502691896258
LAST = EDGES + 3


class Timing(NamedTuple):
    """How a batch's periods run: period and longest step (s), the latest that any edge acts (s),
    and the first and last instant of sampling of all lanes, less t_k and each lane's delay (s)."""

    period: float
    longest: float
    max_edge_delay: float
    first: float
    last: float


class AppliedTorque(NamedTuple):
    """What moves a rotor beside its own torque, over a period: load asked for (N m) and
    acceleration imposed (rad/s^2, electrical), as they are up to an instant (s after the pattern's
    start) and from there on."""

    load: float
    imposed: float
    until: float
    load_after: float
    imposed_after: float


STILL = AppliedTorque(0.0, 0.0, 0.0, 0.0, 0.0)


class RotorTrajectory(NamedTuple):
    """The rotor's angle handed in, over a period: theta = that of (cos, sin) + lead + rate z + bend
    z^2 + jerk z^3, z the time from `origin` (s after the pattern's start); speed at the start,
    rad/s electrical."""

    cos: float
    sin: float
    origin: float
    lead: float
    rate: float
    bend: float
    jerk: float
    speed: float
    applied: AppliedTorque  # of a rotor that the plant moves


@inlined
def facing_at(trajectory, t):
    """Return cos and sin of the angle handed in, t (s) after the pattern's start."""
    z = t - trajectory.origin
    angle = trajectory.lead + z * (trajectory.rate + z * (trajectory.bend + z * trajectory.jerk))
    if abs(angle) < SHORT_TURN:
        return turned_a_little(trajectory.cos, trajectory.sin, angle)
    return turned(trajectory.cos, trajectory.sin, angle)


@kernel
def open_period(w, room, max_edge_delay, rate):
    """Begin a period: legs that were on to the end fall now, late by what the current says; with
    double update those rise that were off to the end of the half before."""
    u_alpha = u_beta = 0.0
    for leg in range(3):
        if room.before[leg] >= 1.0 or (room.half < 0 and room.before[leg] > 0.0):
            u_alpha, u_beta = u_alpha + TWO_THIRDS * LEG_X[leg], u_beta + TWO_THIRDS * LEG_Y[leg]
    for leg in range(3):
        side = -1.0
        if room.half < 0:
            side = 1.0 if room.before[leg] <= 0.0 and room.duty[leg] > 0.0 else 0.0
        elif not (room.before[leg] >= 1.0 and room.duty[leg] < 1.0):
            side = 0.0
        if side != 0.0:
            x, y, acts = LEG_X[leg], LEG_Y[leg], room.acts[EDGES + leg]
            latest = 0.0
            commutate(w, room, 0.0, max_edge_delay, rate, u_alpha, u_beta, (x, y, side, 1.0), False)
            for j in range(w.psi_alpha.size):
                acts[j] = w.late[j]
                latest = max(latest, acts[j])
                w.late[j] = 0.0
            wait(room, EDGES + leg, latest, x, y, side)


@inlined
def wait(room, m, until, x, y, side):
    """Enter an edge among those that may still wait."""
    room.until[m], room.until[LAST] = until, max(until, room.until[LAST])
    room.change_x[m], room.change_y[m] = TWO_THIRDS * side * x, TWO_THIRDS * side * y


@kernel
def take_turn(w, room, g, t, max_edge_delay):
    """Enter edge g, taken at t: pulses stay positive, and what acts after its segment waits."""
    mate, leg = room.mate[g], room.leg[g]
    own = room.acts[g]
    if mate >= 0 and room.until[mate] > t:
        before = room.acts[mate]
        for j in range(w.psi_alpha.size):
            w.late[j] = max(w.late[j], before[j] - t)
    elif room.half < 0 and room.until[EDGES + leg] > t:  # its rise, in the half before, still waits
        left = room.acts[EDGES + leg]
        for j in range(w.psi_alpha.size):
            w.late[j] = max(w.late[j], left[j] - t)
    for j in range(w.psi_alpha.size):
        own[j] = t + w.late[j]
    if room.side[g] > 0.0 and room.until[EDGES + leg] > t:
        left = room.acts[EDGES + leg]
        for j in range(w.psi_alpha.size):
            left[j] = min(left[j], own[j])
    wait(room, g, t + max_edge_delay, room.x[g], room.y[g], room.side[g])


@kernel
def lose_waiting(w, room, t, span, but):
    """Take what edges that still wait lose in a segment from t on, of all but one; return whether
    any did."""
    any_lost = False
    for m in range(EDGES + 3):
        if m != but and room.until[m] > t:
            lose(w, room.acts[m], t, span, room.change_x[m], room.change_y[m])
            any_lost = True
    return any_lost


@kernel
def close_period(w, room, period):
    """End a period: falling edges that act after it are left to the next."""
    over = room.until[LAST] > period
    for m in range(3):
        room.until[EDGES + m] = NEVER
    room.until[LAST] = NEVER
    for g in range(EDGES if over else 0):
        if room.until[g] > period:
            leg = (
                0
                if room.change_y[g] == 0.0
                else (1 if room.change_y[g] * room.change_x[g] < 0.0 else 2)
            )
            acts, left = room.acts[g], room.acts[EDGES + leg]
            latest = 0.0
            for j in range(w.psi_alpha.size):
                left[j] = max(acts[j] - period, 0.0)
                latest = max(latest, left[j])
            if latest > 0.0:
                room.until[EDGES + leg], room.until[LAST] = latest, max(latest, room.until[LAST])
                room.change_x[EDGES + leg], room.change_y[EDGES + leg] = (
                    room.change_x[g],
                    room.change_y[g],
                )
    for g in range(EDGES):
        room.until[g] = NEVER


@inlined
def at_start(w, flux_map, features, c, s, share, trajectory, span):
    """End the last segment and write all that holds at the start of the next."""
    if features & add.WOBBLE:
        add.orient(w, share, trajectory.rate)
    if features & add.MAGNETS:
        add.magnets(w, c, s)
    if features & add.LAGS:
        lags.remember(w, span)
        if features & add.IRON and span > 0.0:
            lags.close_iron(w, span)
            if features & add.CORE_LOSS:
                iron.close_core(w, span)
    begin(w, flux_map, c, s, span)
    if features & add.ENERGY:
        add.energy_at_start(w, c, s)
    if features & add.FILTER and span > 0.0:
        lags.close_filter(w)
    if features & add.SKIN:
        lags.close_skin(w)
    if features & add.LAYERS:
        close_layers(w)
    if features & add.WINDING:
        losses.winding_at_start(w)
    if features & add.LEG:
        losses.legs_at_start(w, features & add.ROUND != 0)
    if features & add.CURVE:
        losses.curves_at_start(w)
    if w.table_points > 0:
        losses.table_at_start(w)


@inlined
def in_middle(
    w, flux_map, features, c, s, share, trajectory, span, long, u_alpha, u_beta, x, y, any_late
):
    """Write all that holds in the middle of a segment; long, any_late: whether its curvature
    counts, and late edges."""
    if features & add.WOBBLE:
        add.orient(w, share, trajectory.rate)
    if features & add.MAGNETS:
        add.magnets(w, c, s)
    if features & add.IRON:
        lags.iron_in_middle(w, span, u_alpha, u_beta, x, y)
        if features & add.CORE_LOSS:
            iron.core_in_middle(w, span)
    middle(w, flux_map, c, s, span, span * trajectory.rate, u_alpha, u_beta, x, y)
    if flux_map is None and long:
        bend(w, c, s, span * trajectory.rate)
    if features & add.ENERGY:
        add.energy_in_middle(w, c, s, span, span * trajectory.rate)
        for share in (-GAUSS, GAUSS):
            c_0, s_0 = turned(c, s, 0.5 * share * span * trajectory.rate)
            add.energy_at(w, c_0, s_0, share)
    if features & add.IRON:
        lags.iron_stays(w, span * trajectory.rate)
    if features & (add.SKIN | add.LAYERS | add.LEG | add.CURVE) or w.table_points > 0:
        lags.swelling(w)
    if features & add.SKIN:
        lags.skin_in_middle(w, span)
    if features & add.LAYERS:
        layers_in_middle(w, span)
    if features & add.WINDING:
        losses.winding_in_middle(w)
    if features & add.LEG:
        losses.legs_in_middle(w, span, features & add.ROUND != 0, any_late)
    if features & add.CURVE:
        losses.curves_in_middle(w, span)
    if w.table_points > 0:
        losses.table_in_middle(w, span)
    if features & add.IRON:
        lags.iron_bends(w)
    if features & add.MOTION:
        if features & add.ANGULAR:
            add.turning(w, c, s)
        add.air_gap(w, span)


@inlined
def lag_through(w, room, lag, rates, max_edge_delay, but, t, span, x, y):
    """Write what a lag (rates: (lanes,) 1/s) makes of a segment begun at t (s): its moments, and
    the kinks of the edge just taken (place `but`, -1: none) and of those that still wait."""
    lags.weigh(w, lag, rates, span)
    if max_edge_delay > 0.0:
        if but >= 0:
            lags.kink(w, lag, rates, w.late, 0.0, span, x, y)
        for m in range(EDGES + 3 if room.until[LAST] > t else 0):
            if m != but and room.until[m] > t:
                lags.kink(w, lag, rates, room.acts[m], t, span, room.change_x[m], room.change_y[m])


@kernel
def layers_through(w, room, max_edge_delay, but, t, span, x, y):
    """Write the same of all branches of a winding's layers."""
    weigh_layers(w, span)
    if max_edge_delay > 0.0:
        if but >= 0:
            kink_layers(w, w.late, 0.0, span, x, y)
        for m in range(EDGES + 3 if room.until[LAST] > t else 0):
            if m != but and room.until[m] > t:
                kink_layers(w, room.acts[m], t, span, room.change_x[m], room.change_y[m])


@inlined
def enter(w, room, g, t, span, max_edge_delay):
    """Take edge g at t; return whether edges before it that still wait take volt-seconds from its
    segment."""
    if (
        room.real[g] > 0.0
        and max_edge_delay > 0.0
        and (span < max_edge_delay or room.until[LAST] > t)
    ):
        take_turn(w, room, g, t, max_edge_delay)
    return room.until[LAST] > t and lose_waiting(w, room, t, span, g)


@inlined
def first_instant(w, features, timing, room, rate):
    """Do what belongs to the pattern's start, its current known: sag of the link, legs that fall
    now, sampling."""
    if features & add.DRAWN:
        add.draw(w, room.duty[0], room.duty[1], room.duty[2])
        if features & add.RING:
            add.ring(w, room.duty[0], room.duty[1], room.duty[2])
    if features & add.CHANNELS:
        slope(w, rate)
    if timing.max_edge_delay > 0.0:
        least = min(room.before[0], room.before[1], room.before[2])
        most = max(room.before[0], room.before[1], room.before[2])
        if (least <= 0.0) if room.half < 0 else (most >= 1.0):
            open_period(w, room, timing.max_edge_delay, rate)
    if timing.first == 0.0 and timing.last == 0.0:
        hold_start(w, features)
    for j in range(w.psi_alpha.size):
        w.first_alpha[j], w.first_beta[j] = w.i_alpha[j], w.i_beta[j]


@inlined
def acting_in(applied, t, span):
    """Return load (N m) and imposed acceleration (rad/s^2, electrical), means of a segment (s) from
    t on, and by how much more load it ends."""
    after = min(max((t + span - applied.until) / span, 0.0), 1.0)
    load = applied.load + after * (applied.load_after - applied.load)
    rest = applied.load_after - load if after > 0.0 else 0.0
    return load, applied.imposed + after * (applied.imposed_after - applied.imposed), rest


@inlined
def moved(w, features, trajectory, t, span):
    """Move the rotor itself on by a segment (s) from t and return its trajectory from there."""
    load, imposed, rest = acting_in(trajectory.applied, t, span)
    if not features & add.MOTION:  # held, or driven by the acceleration imposed
        on, omega = (
            span * (trajectory.rate + 0.5 * span * imposed),
            trajectory.rate + span * imposed,
        )
        w.angle[0], w.speed[0] = w.angle[0] + on, omega
        lead, bend = trajectory.lead + on, 0.5 * imposed
        return RotorTrajectory(
            trajectory.cos,
            trajectory.sin,
            t + span,
            lead,
            omega,
            bend,
            0.0,
            trajectory.speed,
            trajectory.applied,
        )
    w.turn[0] = (
        w.angle[0] + w.pairs[0] * w.load_share[0] * w.twist[0] + 0.5 * span * trajectory.rate
    ) / w.pairs[0]
    w.omega[0] = (trajectory.rate + span * trajectory.bend) / w.pairs[0]
    swing = w.pairs[0] * w.load_share[0]
    before = w.angle[0] + swing * w.twist[0]
    step_shaft(w, features, span, load, imposed)
    omega, on = w.speed[0] + swing * w.slip[0], w.angle[0] + swing * w.twist[0] - before
    if span > NO_TIME:
        w.surge[0] = 0.5 * (omega - trajectory.rate) / span
        if rest != 0.0 and not features & add.TWIST:
            w.surge[0] -= 0.5 * rest * (1.0 + w.load_gain[0]) * w.pairs[0] * w.inertia_inv[0]
    lead, bend = trajectory.lead + on, w.surge[0]
    return RotorTrajectory(
        trajectory.cos,
        trajectory.sin,
        t + span,
        lead,
        omega,
        bend,
        0.0,
        trajectory.speed,
        trajectory.applied,
    )


@inlined
def travel(w, flux_map, timing, features, room, trajectory, clock, span, looks, seen):
    """Move a batch on by one period of its room's edges along a trajectory of the rotor; return its
    last segment (s).

    clock: of the pattern less its delay, s after the recording began; span: the last period's last
    segment, whose end is still to be taken (0 at the beginning); looks: (m,)
    instants (s) at which the first lane's current is held besides, seen (m, 2); features with
    MOVED: the plant moves the rotor.
    """
    period, magnetics = timing.period, borrowed(flux_map)
    t, u_alpha, u_beta, begun = 0.0, 0.0, 0.0, False
    c_0, s_0 = facing_at(trajectory, 0.0)
    peeking = timing.first != 0.0 or timing.last != 0.0
    looking = peeking or len(looks) > 0
    plain = (
        flux_map is None
        and features & ADDED == 0
        and len(looks) == 0
        and w.table_points == 0
        and room.blocked == 0
    )
    longest = timing.longest if room.blocked == 0 else min(timing.longest, period / PARTS)
    for g in range(EDGES + 1):
        x = y = side = real = 0.0
        if g > 0:
            x, y, side, real = room.x[g - 1], room.y[g - 1], room.side[g - 1], room.real[g - 1]
        end = room.time[g] if g < EDGES else period
        left = max(end - t, SHORTEST)
        while left > 0.0:
            if not begun:
                if t == 0.0 and g == 0 and features & add.DELAYED and not features & add.MOVED:
                    add.orient(w, 0.0, trajectory.rate)
                c, s = facing_at(trajectory, t)
                at_start(w, magnetics, features, c, s, t / period, trajectory, span)
                if room.blocked != 0 or (t == 0.0 and g == 0):
                    stiffen(w, magnetics, c, s)
                if t == 0.0 and g == 0:
                    if features & add.ENERGY and features & add.MOVED:
                        add.stiffen_further(w, c, s)
                    first_instant(w, features, timing, room, trajectory.rate)
                if features & add.COMMUTE:
                    commutate(
                        w,
                        room,
                        t,
                        timing.max_edge_delay,
                        trajectory.rate,
                        u_alpha,
                        u_beta,
                        (x, y, side, real),
                        False,
                    )
            span = left if left <= longest else left / math.ceil(left / longest)
            x, y = TWO_THIRDS * side * x, TWO_THIRDS * side * y
            u_alpha, u_beta = u_alpha + x, u_beta + y
            taken = g - 1 if side != 0.0 else -1
            if features & add.LINK:
                early = clock + t + 0.5 * (1.0 - GAUSS) * span
                add.supply(w, early, early + GAUSS * span)
            if room.blocked != 0:
                x = y = 0.0
                u_alpha, u_beta = float_legs(w, room, span, trajectory.rate)
            lossy = timing.max_edge_delay > 0.0 and (
                enter(w, room, taken, t, span, timing.max_edge_delay)
                if taken >= 0
                else room.until[LAST] > t and lose_waiting(w, room, t, span, -1)
            )
            long, whole = span > BENDING * period, span >= left
            until = 2.0 * period if g == EDGES and whole else t + span
            peeks = peeking and len(looks) == 0 and looked_at(w, t, until)
            plainly = plain and g < EDGES and not (lossy or peeks)
            if begun and not plainly:
                dropped(w)
            begun = plainly
            c, s = facing_at(trajectory, t + 0.5 * span)
            if begun:
                k, turn = (g if whole else -1), span * trajectory.rate
                edge = (
                    (room.x[k], room.y[k], room.side[k], room.real[k])
                    if whole
                    else (0.0, 0.0, 0.0, 0.0)
                )
                pulled = features & add.MOTION != 0
                plain_step(
                    w,
                    (c, s),
                    facing_at(trajectory, t + span),
                    span,
                    turn,
                    long,
                    pulled,
                    u_alpha,
                    u_beta,
                    x,
                    y,
                )
                if features & add.COMMUTE:
                    commutate(
                        w,
                        room,
                        t + span,
                        timing.max_edge_delay,
                        trajectory.rate,
                        u_alpha,
                        u_beta,
                        edge,
                        True,
                    )
            else:
                if features & add.LAGS or looking:
                    lags.face(w, c * c_0 + s * s_0, s * c_0 - c * s_0)
                if features & add.IRON:
                    lag_through(
                        w, room, CORE, w.core_rate, timing.max_edge_delay, taken, t, span, x, y
                    )
                if features & add.SKIN:
                    lag_through(
                        w, room, SKIN, w.skin_rate, timing.max_edge_delay, taken, t, span, x, y
                    )
                if features & add.LAYERS:
                    layers_through(w, room, timing.max_edge_delay, taken, t, span, x, y)
                if features & add.FILTER:
                    lag_through(
                        w, room, FILTER, w.filter_rate, timing.max_edge_delay, taken, t, span, x, y
                    )
                if features & add.CORE_LOSS:
                    iron.core_ahead(w, room, taken, t, span, u_alpha, u_beta, x, y)
                share, any_late = (t + 0.5 * span) / period, timing.max_edge_delay > 0.0
                in_middle(
                    w,
                    magnetics,
                    features,
                    c,
                    s,
                    share,
                    trajectory,
                    span,
                    long,
                    u_alpha,
                    u_beta,
                    x,
                    y,
                    any_late,
                )
                if features & add.CORE_LOSS:
                    iron.core_drags(w, room, taken, t, span, u_alpha, u_beta, x, y)
            if peeks:
                peek(
                    w,
                    magnetics,
                    features,
                    room,
                    taken,
                    trajectory,
                    t,
                    span,
                    until,
                    u_alpha,
                    u_beta,
                    x,
                    y,
                    period,
                )
            for m in range(len(looks)):
                if t <= looks[m] < until:
                    w.when[0] = looks[m]
                    peek(
                        w,
                        magnetics,
                        features,
                        room,
                        taken,
                        trajectory,
                        t,
                        span,
                        until,
                        u_alpha,
                        u_beta,
                        x,
                        y,
                        period,
                    )
                    seen[m, 0], seen[m, 1] = w.held_alpha[0], w.held_beta[0]
            if features & add.MOVED:
                trajectory = moved(w, features, trajectory, t, span)
            if lossy:
                nothing_lost(w)
            t, left = t + span, left - span
            x = y = side = real = 0.0
        t = end
    if room.until[LAST] != NEVER:
        close_period(w, room, period)
    return span

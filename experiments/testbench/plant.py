"""The drive as a set of differential equations, integrated between events; see README.md for the
equations.

State y: 0-1 flux (alpha, beta) · 2 rotor angle (electrical) · 3 rotor speed (mech) · 4 twist of the
shaft (load less rotor, mech) · 5 load speed · 6 link voltage · 7 source current · 8-10 leg voltages
while floating · 11-14 current filter · 15-20 eddy modes · 21-28 skin branches · 29 heat of the
contact (A^2).  The bristle of LuGre friction and the play operators are updated exactly between the
steps (`memory`: bristle, play alpha, play beta).
"""

import math

from numba import njit

from .compiled import piece
from .magnetics import field
from .types import DRIVEN, FLOATING, HIGH, LOCKED

STATES = 30
FEW = 11  # states of a bench without filter, core loss, skin effect and hot contact
ROOT3 = math.sqrt(3.0)


@piece
def _knee(v, current):
    """Forward voltage of a device with knee and slope, 0 at zero current."""
    if v[0] == 0.0:
        return v[2] * current
    return v[0] * (1.0 - math.exp(-current / v[1])) + v[2] * current


@piece
def leg_voltage(inv, mode, clamp, current, link, floating):
    """Voltage of a leg's output (V) by what its switches do and where its current flows."""
    if mode == FLOATING:
        if clamp == 0:
            return floating
        if clamp > 0:
            return link + _knee(inv.diode, max(-current, 0.0))
        return -_knee(inv.diode, max(current, 0.0))
    s = max(-1.0, min(1.0, current / inv.zone))
    drop = inv.drop_ideal[0] * s + inv.drop_ideal[1] * current
    if mode == HIGH:
        if current > 0.0:
            return link - drop - _knee(inv.switch, current)
        return link - drop + _knee(inv.diode, -current)
    if current > 0.0:
        return -drop - _knee(inv.diode, current)
    return -drop + _knee(inv.switch, -current)


@njit(cache=True)
def play(x, y, to_x, to_y, threshold):
    """Vector play: (x, y) follows its target at the distance `threshold` (Bergqvist, Physica B 233,
    1997)."""
    d0, d1 = to_x - x, to_y - y
    d = math.sqrt(d0 * d0 + d1 * d1)
    if d <= threshold:
        return x, y
    f = (d - threshold) / d
    return x + f * d0, y + f * d1


@njit(cache=True)
def currents(mag, loss, y, memory):
    """Terminal currents alpha, beta and torque over 3/2 p at a state."""
    i_alpha, i_beta, torque = field(mag, y[0], y[1], y[2])
    if not loss.core:
        return i_alpha, i_beta, torque
    e_alpha, e_beta, g = 0.0, 0.0, 0.0
    for k in range(3):
        e_alpha += y[15 + 2 * k]
        e_beta += y[16 + 2 * k]
        g += loss.eddy[k][0]
    if loss.excess != 0.0 and g > 0.0:
        r_alpha, r_beta = e_alpha / g, e_beta / g
        f = loss.excess / math.sqrt(math.sqrt(r_alpha * r_alpha + r_beta * r_beta) + 1e-6)
        e_alpha += f * r_alpha
        e_beta += f * r_beta
    if loss.hysteresis[0] != 0.0:
        p_alpha, p_beta = play(memory[1], memory[2], y[0], y[1], loss.hysteresis[1])
        e_alpha += loss.hysteresis[0] * (y[0] - p_alpha)
        e_beta += loss.hysteresis[0] * (y[1] - p_beta)
    return i_alpha + e_alpha, i_beta + e_beta, torque


@piece
def link_voltage(inv, t, y):
    """True link voltage (V)."""
    if inv.source[0] > 0.0:
        return y[6]
    return inv.link * (1.0 + inv.link_gain) + inv.ripple[0] * math.sin(
        2 * math.pi * inv.ripple[1] * t + inv.ripple[2]
    )


@piece
def rectifier(inv, t):
    """Open-circuit voltage of the source: a six-pulse bridge whose ripple is scaled to what the
    choke lets through."""
    x = 2 * math.pi * inv.source[5] * t
    x = x - math.floor(x / (math.pi / 3)) * (math.pi / 3) - math.pi / 6
    return inv.link * (1.0 + inv.link_gain) * (1.0 + inv.source[4] * (math.cos(x) - 3.0 / math.pi))


@piece
def shaft_torque(mech, twist, slip):
    """Torque of the shaft on the rotor: a spring and damper beyond the gap (dead zone)."""
    gap = mech.shaft[2]
    if twist > gap:
        return mech.shaft[0] * (twist - gap) + mech.shaft[1] * slip
    if twist < -gap:
        return mech.shaft[0] * (twist + gap) + mech.shaft[1] * slip
    return 0.0


@njit(cache=True)
def friction(mech, speed, bristle):
    """Friction torque against the speed."""
    t = mech.viscous * speed + mech.fan * speed * abs(speed)
    if mech.coulomb[0] != 0.0:
        t += mech.coulomb[0] * math.tanh(speed / mech.coulomb[1])
    if mech.lugre[3] > 0.0:
        g = mech.lugre[0] + (mech.lugre[1] - mech.lugre[0]) * math.exp(
            -((speed / mech.lugre[2]) ** 2)
        )
        rate = speed - mech.lugre[3] * abs(speed) / g * bristle
        t += mech.lugre[3] * bristle + mech.lugre[4] * rate
    return t


@njit(cache=True)
def relax_bristle(mech, speed, h, memory):
    """Exact step of dz/dt = w - sigma_0 |w|/g(w) z at constant speed (Canudas de Wit et al., IEEE
    TAC 40(3), 1995)."""
    if mech.lugre[3] <= 0.0 or speed == 0.0:
        return
    g = mech.lugre[0] + (mech.lugre[1] - mech.lugre[0]) * math.exp(-((speed / mech.lugre[2]) ** 2))
    end = math.copysign(g / mech.lugre[3], speed)
    memory[0] = end + (memory[0] - end) * math.exp(-mech.lugre[3] * abs(speed) / g * h)


@piece
def _turn(mech, world, t, y, dy, torque, bristle):
    """Derivatives of angle, speeds and twist."""
    if world.rotor == LOCKED:
        return
    mech_angle = y[2] / mech.pole_pairs
    if world.rotor == DRIVEN:
        speed, uneven = world.speed + world.slope * (t - world.since), world.uneven
        w = speed
        for n in range(2):
            w += speed * uneven[n][0] * math.sin(uneven[n][1] * mech_angle + uneven[n][2])
        dy[2] = mech.pole_pairs * w
        dy[3] = world.slope
        return
    load = world.load
    dy[2] = mech.pole_pairs * y[3]
    t_e = 1.5 * mech.pole_pairs * torque - friction(mech, y[3], bristle)
    for n in range(4):
        if mech.cogging[n][0] == 0.0:
            break
        t_e += mech.cogging[n][0] * math.sin(mech.cogging[n][1] * mech_angle + mech.cogging[n][2])
    if mech.load_inertia > 0.0:
        s = shaft_torque(mech, y[4], y[5] - y[3])
        dy[3] = (t_e + s) / mech.inertia
        dy[4] = y[5] - y[3]
        turned = mech_angle + y[4]
        p = mech.periodic[0] * math.sin(mech.periodic[1] * turned + mech.periodic[2])
        dy[5] = (-s - load - p) / mech.load_inertia
    else:
        p = mech.periodic[0] * math.sin(mech.periodic[1] * mech_angle + mech.periodic[2])
        dy[3] = (t_e - load - p) / mech.inertia


@njit(cache=True)
def slopes(t, y, dy, legs, mag, loss, inv, mech, sens, world, memory):
    """dy/dt.  `legs` (2, 3): what the switches do, which diode clamps."""
    dy[:] = 0.0
    i_alpha, i_beta, torque = currents(mag, loss, y, memory)
    link = link_voltage(inv, t, y)
    hot = 1.0 + loss.drift * t
    u0, u1, u2, drawn = 0.0, 0.0, 0.0, 0.0
    for x in range(3):
        i = i_alpha if x == 0 else (-0.5 * i_alpha + (0.5 if x == 1 else -0.5) * ROOT3 * i_beta)
        v = leg_voltage(inv, legs[0, x], legs[1, x], i, link, y[8 + x])
        drawn += v * i
        r = loss.phases[x] * hot
        if x == 0 and loss.contact[0] > 0.0:  # a bench without hot contact has no y[29]
            r += loss.contact[0] * (1.0 + loss.contact[1] * y[29])
        if legs[0, x] == FLOATING and legs[1, x] == 0:
            dy[8 + x] = -i / inv.capacitance
        v -= r * i
        if x == 0:
            u0 = v
        elif x == 1:
            u1 = v
        else:
            u2 = v
    dy[0] = (2 * u0 - u1 - u2) / 3.0
    dy[1] = (u1 - u2) / ROOT3
    for k in range(4 if loss.rise else 0):
        if loss.skin[k][0] > 0.0:
            a, b = i_alpha - y[21 + 2 * k], i_beta - y[22 + 2 * k]
            dy[0] -= loss.skin[k][0] * a
            dy[1] -= loss.skin[k][0] * b
            dy[21 + 2 * k] = a / loss.skin[k][1]
            dy[22 + 2 * k] = b / loss.skin[k][1]
    for k in range(3 if loss.core else 0):
        if loss.eddy[k][0] > 0.0:
            dy[15 + 2 * k] = (loss.eddy[k][0] * dy[0] - y[15 + 2 * k]) / loss.eddy[k][1]
            dy[16 + 2 * k] = (loss.eddy[k][0] * dy[1] - y[16 + 2 * k]) / loss.eddy[k][1]
    if loss.contact[0] > 0.0:
        dy[29] = (i_alpha * i_alpha - y[29]) / loss.contact[2]
    if inv.source[0] > 0.0:
        dy[7] = (rectifier(inv, t) - inv.source[1] * y[7] - y[6]) / inv.source[2]
        dy[6] = (y[7] - drawn / y[6]) / inv.source[3]
    if sens.filter[0] == 1.0:
        dy[11] = (i_alpha - y[11]) / sens.filter[1]
        dy[12] = (i_beta - y[12]) / sens.filter[1]
    elif sens.filter[0] == 2.0:
        w = 1.0 / sens.filter[1]
        dy[11], dy[12] = y[13], y[14]
        dy[13] = w * w * (i_alpha - y[11]) - 2 * sens.filter[2] * w * y[13]
        dy[14] = w * w * (i_beta - y[12]) - 2 * sens.filter[2] * w * y[14]
    _turn(mech, world, t, y, dy, torque, memory[0])


@piece
def rk4(t, y, h, out, work, legs, mag, loss, inv, mech, sens, world, memory):
    """One classical Runge-Kutta step from y into `out`; `work`: five arrays."""
    n = y.size
    k1, k2, k3, k4, z = work
    slopes(t, y, k1, legs, mag, loss, inv, mech, sens, world, memory)
    for i in range(n):
        z[i] = y[i] + 0.5 * h * k1[i]
    slopes(t + 0.5 * h, z, k2, legs, mag, loss, inv, mech, sens, world, memory)
    for i in range(n):
        z[i] = y[i] + 0.5 * h * k2[i]
    slopes(t + 0.5 * h, z, k3, legs, mag, loss, inv, mech, sens, world, memory)
    for i in range(n):
        z[i] = y[i] + h * k3[i]
    slopes(t + h, z, k4, legs, mag, loss, inv, mech, sens, world, memory)
    for i in range(n):
        out[i] = y[i] + h / 6.0 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i])


@piece
def phase_current(mag, loss, y, memory, x):
    """Current of phase x out of its leg."""
    i_alpha, i_beta, _ = currents(mag, loss, y, memory)
    if x == 0:
        return i_alpha
    return -0.5 * i_alpha + (0.5 if x == 1 else -0.5) * ROOT3 * i_beta


@piece
def _guard(x, t, y, legs, mag, loss, inv, memory):
    """Positive while a floating leg stays as it is, over its natural scale; crosses zero at the
    event."""
    i = phase_current(mag, loss, y, memory, x)
    if legs[1, x] > 0:
        return -i / inv.zone
    if legs[1, x] < 0:
        return i / inv.zone
    link = link_voltage(inv, t, y)
    if i > 0.0:  # the voltage falls
        return y[8 + x] / link
    return (link - y[8 + x]) / link


@piece
def _clamp(x, t, y, legs, inv):
    """The event of a floating leg: its voltage has reached a rail, or its diode's current has
    ceased."""
    link = link_voltage(inv, t, y)
    if legs[1, x] == 0:
        up = y[8 + x] > 0.5 * link
        legs[1, x] = 1 if up else -1
        y[8 + x] = link if up else 0.0
    else:
        y[8 + x] = link if legs[1, x] > 0 else 0.0
        legs[1, x] = 0


@njit(cache=True)
def advance(t, end, y, step, work, trial, legs, mag, loss, inv, mech, sens, world, memory):
    """Integrate from t to `end` with the gates as they are; diode events of floating legs are
    located on the way."""
    guards = 0
    while t < end - 1e-13:
        floating = False
        for x in range(3):
            floating = floating or legs[0, x] == FLOATING
        h = min(step, end - t)
        if floating:
            h = min(h, max(inv.dead_time / 12.0, 2e-8))
        relax_bristle(mech, y[3], 0.5 * h, memory)
        rk4(t, y, h, trial, work, legs, mag, loss, inv, mech, sens, world, memory)
        event = -1
        if floating:
            for x in range(3):
                if legs[0, x] != FLOATING:
                    continue
                hit = _locate(
                    x, t, y, h, trial, work, legs, mag, loss, inv, mech, sens, world, memory
                )
                if hit < h:
                    h, event = hit, x
        relax_bristle(mech, trial[3], 0.5 * h, memory)
        y[:] = trial
        if loss.hysteresis[0] != 0.0:
            memory[1], memory[2] = play(memory[1], memory[2], y[0], y[1], loss.hysteresis[1])
        t += h
        if event >= 0:
            _clamp(event, t, y, legs, inv)
            guards += 1
            if guards > 60:  # chatter at zero current: hold until the dead time ends
                break
    if t < end - 1e-13:
        _creep(t, end, y, step, work, trial, legs, mag, loss, inv, mech, sens, world, memory)


@piece
def _creep(t, end, y, step, work, trial, legs, mag, loss, inv, mech, sens, world, memory):
    """The rest of an interval without events."""
    while t < end - 1e-13:
        h = min(step, end - t)
        rk4(t, y, h, trial, work, legs, mag, loss, inv, mech, sens, world, memory)
        y[:] = trial
        t += h


@piece
def _locate(x, t, y, h, trial, work, legs, mag, loss, inv, mech, sens, world, memory):
    """Time within (0, h] at which leg x has its event (h where it has none); `trial` is left at
    that time."""
    late = _guard(x, t + h, trial, legs, mag, loss, inv, memory)
    if late >= 0.0:
        return h
    low, high = 0.0, h
    early = max(_guard(x, t, y, legs, mag, loss, inv, memory), 0.0)
    at = h * early / (early - late)
    if legs[1, x] == 0 and early < 1e-9:  # leaves its rail the wrong way: clamps at once
        at = 1e-12
    for n in range(12):
        at = max(at, 1e-13)
        rk4(t, y, at, trial, work, legs, mag, loss, inv, mech, sens, world, memory)
        g = _guard(x, t + at, trial, legs, mag, loss, inv, memory)
        if abs(g) < 1e-7 or at <= 1e-12 or high - low < 1e-13:
            break
        if g > 0.0:
            low, early = at, g
            if n % 2 == 1:
                late *= 0.5
        else:
            high, late = at, g
            if n % 2 == 1:
                early *= 0.5
        at = low + (high - low) * early / (early - late)
    return at


@njit(cache=True)
def switch(x, on, t, y, legs, mag, loss, inv, memory):
    """A gate signal of leg x: `on` HIGH or LOW closes a switch, FLOATING opens both: current and
    diodes decide."""
    if on != FLOATING:
        legs[0, x] = on
        legs[1, x] = 0
        return
    i = phase_current(mag, loss, y, memory, x)
    was_high = legs[0, x] == HIGH
    y[8 + x] = link_voltage(inv, t, y) if was_high else 0.0
    legs[0, x] = FLOATING
    if was_high:
        legs[1, x] = 1 if i < 0.0 else 0
    else:
        legs[1, x] = -1 if i > 0.0 else 0

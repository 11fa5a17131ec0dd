"""Current read several times inside the PWM period, and pulses shifted leg by leg so that there is a ripple to read.

Centred pulses of equal duty switch together: at standstill without load the three legs leave next to no voltage
between them. Moving one leg's pulse late and another's early by the same time puts an active vector at either end of
the pulses and leaves every leg's volt-seconds of the period as they were. Which two legs move changes from period to
period, each pair in both senses before the next, so that over six periods the ripple has every direction and its mean
none; the reading at t_k stays in the zero vector. Phase-shifted carriers are one such shift for good, edge shifting
is what current reconstruction from one shunt does to gain time.
"""

from __future__ import annotations

from model.compiled import kernel
from model.parameters import Converter
from sandbox.validation.switched.advance import sensor
from sandbox.validation.switched.inverter import READINGS, SHIFT, duties, within
from sandbox.validation.switched.phase_machine import phase_currents, vector

USUAL_READINGS = 16  # a period
USUAL_SHIFT = 0.05  # of a period: 12.5 us at 4 kHz, a few times a dead time


def shift_of(converter: Converter) -> float:
    """Return by how much pulses are shifted (s)."""
    share = USUAL_SHIFT if converter.pulse_shift is None else converter.pulse_shift
    return share * converter.sampling_period


@kernel
def shift_pulses(state, k, shift):
    """Set the legs' shifts (s) of period k: leg k/2 late, the next one early; in odd periods the reverse."""
    first = (k // 2) % 3
    late = shift if k % 2 == 0 else -shift
    for leg in range(3):
        state[SHIFT + leg] = 0.0
    state[SHIFT + first] = late
    state[SHIFT + (first + 1) % 3] = -late


@kernel
def volt_seconds(t, period, duty, shift, u_dc):
    """Return what one leg has commanded t after its period began (V s)."""
    room = 0.5 * (1.0 - duty) * period
    return u_dc * min(max(t - room - within(room, shift), 0.0), duty * period)


@kernel
def gather(state, b, acting, u_dc, rng, readings):
    """Write the period just advanced over to readings (n, 4): currents as the sensors read them, V s as commanded.

    acting: the command (V); u_dc: the link as read, by which duties were formed.  A late sampler reads late here as
    well; jitter does not act on these readings.
    """
    d_a, d_b, d_c = duties(acting[0], acting[1], u_dc)
    n = readings.shape[0]
    for j in range(n):
        t, slot = (j + 0.5) * b.period / n, READINGS + 1 + 2 * j
        i_a, i_b, i_c = phase_currents(complex(state[slot], state[slot + 1]))
        i = vector(
            sensor(b, i_a, b.gain_a, b.common_offset + b.offset_a, rng),
            sensor(b, i_b, b.gain_b, b.common_offset + b.offset_b, rng),
            sensor(b, i_c, b.gain_c, b.common_offset - b.offset_a - b.offset_b, rng),
        )
        psi = vector(
            volt_seconds(t, b.period, d_a, state[SHIFT], u_dc),
            volt_seconds(t, b.period, d_b, state[SHIFT + 1], u_dc),
            volt_seconds(t, b.period, d_c, state[SHIFT + 2], u_dc),
        )
        readings[j, 0], readings[j, 1], readings[j, 2], readings[j, 3] = i.real, i.imag, psi.real, psi.imag

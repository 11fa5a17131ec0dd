"""Six ideal switches and diodes, a capacitance across each, and three coils with back-emf in a
star: event-exact.

Shares nothing with the plant.  Between two events the circuit is linear with constant coefficients
(the back-emf's sine and cosine are states), so its matrix exponential is exact; events are found on
it by bisection.  Events: a switch is commanded off, its partner on a dead time later; a diode's
current comes to zero; a leg's voltage reaches a rail. Without capacitance a leg that nothing
carries has no current: its voltage follows from that.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import expm

PHASES = np.exp(2j * np.pi * np.arange(3) / 3.0)
LOW, FLOAT, HIGH = 0, 1, 2
PLACES, TIE, ROUNDING = 12, 1e-16, 1e-12  # looked at between two gate events; s; A, or of the link
AMPS, NODES, EMF, ONE = slice(0, 2), slice(2, 5), slice(5, 7), 7


@dataclass
class Circuit:
    """Resistance (ohm) and inductance (H) of a phase, magnet flux (Wb), rotor's speed (rad/s) and
    first angle (rad), link (V), period and dead time (s), capacitance across each switch (F)."""

    resistance: float
    inductance: float
    flux: float
    speed: float
    theta: float
    link: float
    period: float
    dead: float
    capacitance: float
    modes: list[int] = field(default_factory=lambda: [LOW] * 3)
    driven: list[bool] = field(default_factory=lambda: [True] * 3)  # by a switch that is on
    known: dict[tuple[int, ...], np.ndarray] = field(default_factory=dict)

    def slopes(self):
        """Return the matrix of the state's slopes: i (alpha, beta), node voltages, cos and sin of
        the angle, 1."""
        key = tuple(self.modes)
        if key not in self.known:
            m = np.zeros((8, 8))
            u = (2.0 / 3.0) * np.array([PHASES.real, PHASES.imag])
            emf = self.speed * self.flux * np.array([[0.0, -1.0], [1.0, 0.0]])
            m[AMPS, AMPS], m[AMPS, NODES], m[AMPS, EMF] = -self.resistance * np.eye(2), u, -emf
            m[AMPS] /= self.inductance
            m[5, 6], m[6, 5] = -self.speed, self.speed
            legs = np.array([PHASES.real, PHASES.imag]).T
            floating = [k for k in range(3) if self.modes[k] == FLOAT]
            for k in floating if self.capacitance else ():
                m[2 + k, AMPS] = -legs[k] / (2.0 * self.capacitance)
            if floating and not self.capacitance:
                # their currents stay zero: i' = 0 gives the node voltages
                m = self.without(m, legs, floating)
            self.known[key] = m
        return self.known[key]

    def without(self, m, legs, floating):
        """Return the slopes with floating nodes' voltages replaced by what keeps their currents at
        zero."""
        keep = legs[floating] @ m[AMPS]
        nodes = [2 + k for k in floating]
        rest = np.delete(np.arange(8), nodes)
        gain = -np.linalg.pinv(keep[:, nodes]) @ keep[:, rest]  # v = gain x of the rest
        out = m.copy()
        out[:, rest] += m[:, nodes] @ gain
        out[:, nodes] = 0.0
        self.known[("v", *self.modes)] = (gain, rest)
        return out

    def at(self, x, t):
        """Return the state t (s) later."""
        x = expm(self.slopes() * t) @ x
        floating = [k for k in range(3) if self.modes[k] == FLOAT]
        if floating and not self.capacitance:
            gain, rest = self.known[("v", *self.modes)]
            x[[2 + k for k in floating]] = gain @ x[rest]
        return x

    def margins(self, x):
        """Return for each leg without a switch how far (A or V over link) it is from its next
        event; others inf."""
        out = np.full((3, 2), np.inf)
        i = (complex(*x[AMPS]) * PHASES.conj()).real
        for k in range(3):
            if not self.driven[k]:
                if self.modes[k] == LOW:
                    out[k, 0] = i[k]
                elif self.modes[k] == HIGH:
                    out[k, 0] = -i[k]
                else:
                    out[k] = x[2 + k] / self.link, 1.0 - x[2 + k] / self.link
        return out

    def change(self, x, k, which):
        """Take the event of a leg's margin."""
        if self.modes[k] == FLOAT:
            self.modes[k] = LOW if which == 0 else HIGH
            x[2 + k] = 0.0 if which == 0 else self.link
        else:
            self.modes[k] = FLOAT
            if not self.capacitance:
                self.settle(x)

    def settle(self, x):
        """Without capacitance: give floating legs their voltages, or the rails that those are
        beyond."""
        for _ in range(3):
            x[:] = self.at(x, 0.0)
            beyond = [
                k for k in range(3) if self.modes[k] == FLOAT and not 0.0 <= x[2 + k] <= self.link
            ]
            for k in beyond[:1]:
                self.modes[k] = LOW if x[2 + k] < 0.0 else HIGH
                x[2 + k] = 0.0 if x[2 + k] < 0.0 else self.link
            if not beyond:
                return

    def go(self, x, span):
        """Return the state after a span (s) in which no switch is commanded."""
        while span > TIE:
            grid, at, before, end = np.linspace(0.0, span, PLACES + 1)[1:], x, 0.0, None
            if all(self.driven):
                return self.at(x, span)
            for t in grid:
                at = self.at(x, t)
                if (self.margins(at) < -ROUNDING).any():
                    end = t
                    break
                before = t
            if end is None:
                return at
            low, high = before, end
            for _ in range(50):
                half = 0.5 * (low + high)
                crossed = (self.margins(self.at(x, half)) < -ROUNDING).any()
                low, high = (low, half) if crossed else (half, high)
            k, which = np.argwhere(self.margins(self.at(x, high)) < -ROUNDING)[0]
            x = self.at(x, high)
            span -= high
            self.change(x, k, which)
        return x

    def off(self, x, k):
        """Turn off what switch of a leg is on."""
        i = (complex(*x[AMPS]) * PHASES[k].conjugate()).real
        self.driven[k] = False
        stays = i > 0.0 if self.modes[k] == LOW else i < 0.0
        if not stays and self.capacitance:
            self.modes[k] = FLOAT
        elif not stays:
            self.modes[k] = HIGH if self.modes[k] == LOW else LOW
            x[2 + k] = self.link if self.modes[k] == HIGH else 0.0

    def on(self, x, k, mode):
        """Turn on a leg's upper (HIGH) or lower switch."""
        self.driven[k], self.modes[k] = True, mode
        x[2 + k] = self.link if mode == HIGH else 0.0

    def run(self, duty):
        """Return currents (n, 3) at the starts of periods with duties (n, 3), centred pulses, from
        no current on."""
        x = np.array([0.0, 0.0, 0.0, 0.0, 0.0, np.cos(self.theta), np.sin(self.theta), 1.0])
        out, events, serial = [], [], [0] * 3
        for n, legs in enumerate(duty):
            for k, d in enumerate(legs):
                for t, mode in ((0.5 * (1.0 - d), HIGH), (0.5 * (1.0 + d), LOW)):
                    events.append(((n + t) * self.period, k, mode))
        events = sorted(events + [(n * self.period, -1, 0) for n in range(len(duty))], reverse=True)
        now = 0.0
        while events:
            t, k, mode, *number = events.pop()
            x, now = self.go(x, t - now), t
            if k < 0:
                out.append((complex(*x[AMPS]) * PHASES.conj()).real)
            elif not number:  # commanded: off now, on a dead time later unless commanded again
                serial[k] += 1
                self.off(x, k)
                later = (t + self.dead, k, mode, serial[k])
                events.append(later)
                events.sort(reverse=True)
            elif number[0] == serial[k]:
                self.on(x, k, mode)
        return np.array(out)

"""The legs of the readable reference: late edges by a sign of the current, or switches, diodes and
a capacitance.

A leg between its switches (`Commutating`): the current keeps it where it is, or moves it with i/(2
C) until the other diode clamps it; where the current comes to zero it floats again.  Without
capacitance a floating leg has no current, and its level follows from that.  Without any capacitance
given, an edge is late by the sign of its current alone (`Late`): a pulse, or a gap between two, is
then never shorter than nothing.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from sandbox.plant.sets import zone_of

Array = NDArray[np.float64]
A = cmath.exp(2j * math.pi / 3.0)
NONE = 1e-14  # F: a smaller capacitance is none, no leg takes time to slew
LEVEL = 15  # first of three places in the state
SHORT, NUDGE = 1e-15, 1e-10  # s: no time is left; over which a current's slope is looked at


class Machine(Protocol):
    """What legs need of the plant that they feed: parameters, the PWM period (s), and where it puts
    legs that move."""

    v: Mapping[str, float]
    legs: Commutating | None

    @property
    def period(self) -> float:
        """The PWM period, s."""
        ...

    def current(self, t: float, y: Array) -> complex:
        """Return the current (A) in the stator's frame."""
        ...

    def supply(self, t: float) -> float:
        """Return the link's voltage (V)."""
        ...

    def slopes(self, t: float, y: Array, algebra: bool = True) -> Array:
        """Return the state's time derivative."""
        ...


class Legs:
    """Commanded edges of three legs, and integration from one to the next."""

    def __init__(self, plant: Machine) -> None:
        self.plant, self.before = plant, [0.5, 0.5, 0.5]

    def commanded(self, t: float, duty: Array) -> list[Any]:
        """Return the events of edges commanded in the period from t on."""
        out, period = [], self.plant.period
        for leg, d in enumerate(duty):
            if self.before[leg] >= 1.0 > d:
                out.append((t, "fall", 0, leg))
            if d > 0.0 and not (d >= 1.0 and self.before[leg] >= 1.0):
                out.append((t + 0.5 * (1.0 - d) * period, "rise", 0, leg))
            if 0.0 < d < 1.0:
                out.append((t + 0.5 * (1.0 + d) * period, "fall", 0, leg))
            self.before[leg] = d
        return out

    def taken(self, t: float, y: Array, leg: int, kind: str) -> Any:
        """Return the event at which an edge acts that is commanded now."""
        raise NotImplementedError

    def act(self, y: Array, leg: int, number: int) -> None:
        """Let an edge act."""
        raise NotImplementedError

    def go(self, t: float, y: Array, until: float) -> Array:
        """Return the state at a later time (s)."""
        return np.asarray(
            solve_ivp(
                self.plant.slopes,
                (t, until),
                y,
                "DOP853",
                rtol=1e-10,
                atol=1e-12,
                max_step=self.plant.longest,
            ).y[:, -1]
        )


class Late(Legs):
    """Edges late by the sign of the current."""

    def __init__(self, plant: Machine) -> None:
        super().__init__(plant)
        # act, number; level by leg, number
        self.last, self.waiting = [(-1.0, 0)] * 3, dict[tuple[int, int], float]()

    def taken(self, t: float, y: Array, leg: int, kind: str) -> Any:
        """Return the event; the edge and one that it overtakes act no more."""
        rises, blank = kind == "rise", self.plant.v["dead_time.time"]
        current = (self.plant.current(t, y) * A ** (-leg)).real
        act = t + 0.5 * (abs(blank) + blank * self.sign(current if rises else -current))
        before, number = self.last[leg]
        overtaken = before > t and act <= before
        self.last[leg] = (-1.0 if overtaken else act, number + 1)
        if overtaken:
            del self.waiting[leg, number]
        else:
            self.waiting[leg, number + 1] = 1.0 if rises else 0.0
        return act, "z act", number + 1, leg

    def sign(self, hold: float) -> float:
        """Return the sign of the current (A) that keeps a leg where it is, in its zone."""
        zone = zone_of(self.plant.v)
        x, shape = hold / zone["width"] - zone["center"], zone["shape"]
        return (1.0 - shape) * min(max(x, -1.0), 1.0) + shape * math.tanh(x)

    def act(self, y: Array, leg: int, number: int) -> None:
        """Set a leg's level by an edge that nothing has overtaken."""
        y[LEVEL + leg] = self.waiting.pop((leg, number), y[LEVEL + leg])


class Commutating(Legs):
    """Both switches of a leg off for the dead time behind each commanded edge."""

    def __init__(self, plant: Machine) -> None:
        super().__init__(plant)
        self.off, self.floats, self.number, self.wanted = (
            [False] * 3,
            [False] * 3,
            [0] * 3,
            [0.0] * 3,
        )
        plant.legs = self
        given = plant.v["dead_time.capacitance"]
        self.capacitance = given if given > NONE else 0.0

    def taken(self, t: float, y: Array, leg: int, kind: str) -> Any:
        """Turn off what is on; return the event at which the partner turns on."""
        self.off[leg], self.wanted[leg] = True, 1.0 if kind == "rise" else 0.0
        self.number[leg] += 1
        self.floats[leg] = self.pulled(t, y, leg) > 0.0
        if self.floats[leg] and not self.capacitance:
            self.floats[leg], y[LEVEL + leg] = False, 1.0 - y[LEVEL + leg]
        return t + self.plant.v["dead_time.time"], "z act", self.number[leg], leg

    def act(self, y: Array, leg: int, number: int) -> None:
        """Turn a leg's switch on, unless it was commanded again since."""
        if number == self.number[leg]:
            y[LEVEL + leg], self.off[leg], self.floats[leg] = self.wanted[leg], False, False

    def pulled(self, t: float, y: Array, leg: int) -> float:
        """Return the current (A) that takes a leg off its rail: out of a high one, into a low
        one."""
        current = float((self.plant.current(t, y) * A ** (-leg)).real)
        return current if y[LEVEL + leg] > 0.5 else -current

    def moves(self, t: float, y: Array) -> Array:
        """Return the slopes of the three levels (1/s)."""
        charge = 2.0 * self.capacitance * self.plant.supply(t)
        i = self.plant.current(t, y)
        return np.array(
            [-(i * A ** (-k)).real / charge if self.floats[k] and charge else 0.0 for k in range(3)]
        )

    def settled(self, t: float, y: Array) -> Array:
        """Return the state, floating legs without capacitance at levels that leave their currents
        as they are."""
        free = [k for k in range(3) if self.floats[k]]
        if not free or self.capacitance:
            return y

        def slopes(levels: Array) -> Array:
            """Return the slopes of the floating legs' currents (A/s) at levels of theirs."""
            z = y.copy()
            z[[LEVEL + k for k in free]] = levels
            on = z + NUDGE * self.plant.slopes(t, z, algebra=False)
            change = self.plant.current(t + NUDGE, on) - self.plant.current(t, z)
            return np.array([(change * A ** (-k)).real for k in free]) / NUDGE

        start = slopes(np.zeros(len(free)))
        gain = np.array([slopes(row) - start for row in np.eye(len(free))]).T
        out = y.copy()
        out[[LEVEL + k for k in free]] = np.linalg.lstsq(gain, -start, rcond=None)[0]
        return out

    def stops(self) -> list[Callable[[float, Array], float]]:
        """Return functions that fall through zero where a diode begins or ends to conduct."""

        def ends(leg: int) -> Callable[[float, Array], float]:
            return lambda t, y: -self.pulled(t, y, leg)

        def clamps(leg: int, rail: float) -> Callable[[float, Array], float]:
            return lambda t, y: abs(self.settled(t, y)[LEVEL + leg] - (1.0 - rail)) * -1.0 + 1.0

        out = []
        for leg in range(3):
            if self.off[leg] and self.floats[leg]:
                out += [clamps(leg, 1.0), clamps(leg, 0.0)]
            elif self.off[leg]:
                out.append(ends(leg))
        for stop in out:
            stop.terminal, stop.direction = True, -1.0  # type: ignore[attr-defined]
        return out

    def go(self, t: float, y: Array, until: float) -> Array:
        """Return the state at a later time (s), diode by diode."""
        while until - t > SHORT:
            self.clamp(t, y)
            found = solve_ivp(
                self.plant.slopes,
                (t, until),
                y,
                "DOP853",
                rtol=1e-10,
                atol=1e-12,
                max_step=self.plant.longest,
                events=self.stops() or None,
            )
            t, y = float(found.t[-1]), found.y[:, -1]
            if found.status == 1:
                self.turn(t, y)
        self.clamp(until, y)
        return y

    def clamp(self, t: float, y: Array) -> None:
        """Without capacitance: give floating legs their levels, or the rails that these are
        beyond."""
        for _ in range(3):
            y[:] = self.settled(t, y)
            beyond = [k for k in range(3) if self.floats[k] and not 0.0 <= y[LEVEL + k] <= 1.0]
            for leg in beyond[:1]:
                self.floats[leg], y[LEVEL + leg] = False, float(y[LEVEL + leg] > 0.5)

    def turn(self, t: float, y: Array) -> None:
        """Let a leg float whose diode's current came to zero, or clamp one that came to a rail."""
        y[:] = self.settled(t, y)
        margin = [math.inf] * 3
        for k in range(3):
            if self.off[k]:
                margin[k] = (
                    min(abs(y[LEVEL + k]), abs(1.0 - y[LEVEL + k]))
                    if self.floats[k]
                    else self.pulled(t, y, k)
                )
                margin[k] = abs(margin[k])
        leg = int(np.argmin(margin))
        if self.floats[leg]:
            y[LEVEL + leg] = float(y[LEVEL + leg] > 0.5)
        self.floats[leg] = not self.floats[leg]

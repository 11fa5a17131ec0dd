"""What of the shaft's equation is an effect of the library: one number each, what it shows, what a
motion has to have.

Names, units and subsystems are those of the effects' cards.  The inertia and a late reading of the
current stand in the equation itself; the others are torques beside it.  A user's effects are
candidates, too, where they are torques at the plant's ports and proportional to one number.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from model.array_types import Array
from model.effects import library, own
from model.effects.card import Effect, Parameter

# at which a torque enters, and its sign against the motion
PORTS = {"friction": 1.0, "load": 1.0, "torque": -1.0}
# rad, rad/s: where a torque has to be proportional
TRIED = np.array([0.1, -2.0, 3.0]), np.array([-30.0, 0.5, 200.0])


@dataclass(frozen=True)
class Number:
    """One effect as a number of the shaft's equation.

    size: what the fit calls it; parameter: the library's name for it; shows: what it does to the
    motion; hidden: why a motion may not tell it, and after the semicolon what to record; brakes: it
    takes power from the motion.
    """

    size: str
    parameter: str
    shows: str
    hidden: str = ""
    brakes: bool = False

    @property
    def effect(self) -> str:
        """The effect's name."""
        return self.parameter.partition(".")[0]

    @property
    def card(self) -> Effect:
        """The effect's card."""
        return library.load_effect(self.effect)

    @property
    def of_library(self) -> Parameter:
        """The parameter's entry on the card."""
        return library.parameters()[self.parameter]

    @property
    def unit(self) -> str:
        """The parameter's unit."""
        return self.of_library.unit

    @property
    def stated(self) -> str:
        """The key under which a campaign states its ordinary deviation; empty where it has none."""
        ordinary = self.of_library.ordinary
        return ordinary.stated if ordinary else ""


DRY = Number(
    "dry",
    "coulomb_friction.torque",
    "a torque against the motion, whatever the speed",
    "the motion goes one way only, so dry friction and a constant torque (or an offset of the "
    "current) are one number; record the same backwards",
    brakes=True,
)
# two sizes for each order
COGGING = Number("", "cogging_torque.amplitude", "a torque bound to the rotor's angle")
VISCOUS = Number(
    "viscous",
    "viscous_friction.coefficient",
    "a torque that grows with speed",
    "speed hardly varies beside what else it could be; record at several speeds",
    brakes=True,
)
INERTIA = Number(
    "inertia",
    "inertia.inertia",
    "torque missing while the speed changes",
    "the speed hardly changes; record accelerations",
)
LAG = Number(
    "lag",
    "current_filter.time_constant",
    "the current's readings come late",
    "the current hardly varies; record with load steps or accelerations",
)
OF_LIBRARY = (DRY, COGGING, VISCOUS, INERTIA, LAG)


def numbers() -> dict[str, Number]:
    """Return all candidates by their effects' names: the library's, then the user's."""
    return {n.effect: n for n in (*OF_LIBRARY, *users())}


def users() -> tuple[Number, ...]:
    """Return the user's effects that are torques proportional to one number."""
    return tuple(n for n in map(_of_card, _torques()) if n is not None)


def unidentifiable() -> dict[str, str]:
    """Return the user's effects that are torques of another kind, each with the reason why no
    motion tells them."""
    why = "its torque is not proportional to one number; record voltages, too"
    return {card.name: why for card in _torques() if _of_card(card) is None}


def against(n: Number, angle: Array, speed: Array, size: float = 1.0) -> Array:
    """Return the torque against the motion (N m) of a user's effect of some size, at mechanical
    angles (rad) and speeds (rad/s), what else it has being neutral."""
    values = {p.name: p.neutral for p in n.card.parameters} | {n.of_library.name: size}
    total = np.zeros(speed.size)
    for at in n.card.at:
        fixed = [values[name] for name in at.numbers]
        places = (
            zip(np.ravel(angle).tolist(), np.ravel(speed).tolist(), strict=True)
            if at.port == "torque"
            else zip(np.ravel(speed).tolist())
        )
        total += PORTS[at.port] * np.array([at.equation(*fixed, *place) for place in places])
    return total.reshape(speed.shape)


def _torques() -> list[Effect]:
    """Return the user's cards whose equations all enter as torques."""
    return [card for card, _ in own.cards() if card.at and all(at.port in PORTS for at in card.at)]


def _of_card(card: Effect) -> Number | None:
    """Return a card's effect as one number, None where its torque is not proportional to any."""
    free = [p for p in card.parameters if p.fit != "fixed" and p.predicted]
    of_motor = any(p.neutral is None or p.neutral_relative_to for p in card.parameters)
    if len(free) != 1 or card.repeats > 1 or of_motor:
        return None
    hidden = f"other torques can stand in for it on this motion; record {card.separated_by}"
    name = card.public(1, free[0].name)
    brakes = free[0].low >= 0.0 and all(at.port != "torque" for at in card.at)
    n = Number(name, name, card.summary, hidden, brakes)
    once, twice = against(n, *TRIED), against(n, *TRIED, 2.0)
    return n if np.any(once) and np.allclose(twice, 2.0 * once, rtol=1e-9) else None

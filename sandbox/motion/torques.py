"""What of the shaft's equation is an effect of the library: one number each, what it shows, what a motion has to have.

Names, units and subsystems are those of the effects' cards.  The inertia and a late reading of the current stand in the
equation itself; the others are torques beside it.
"""

from __future__ import annotations

from dataclasses import dataclass

from model.effects import library
from model.effects.card import Effect, Parameter


@dataclass(frozen=True)
class Number:
    """One effect as a number of the shaft's equation.

    size: what the fit calls it; parameter: the library's name for it; shows: what it does to the motion; hidden: why a
    motion may not tell it, and after the semicolon what to record; brakes: it takes power from the motion.
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
    "dry", "coulomb_friction.torque", "a torque against the motion, whatever the speed",
    "the motion goes one way only, so dry friction and a constant torque (or an offset of the current) are one number; "
    "record the same backwards",
    brakes=True,
)  # fmt: skip
COGGING = Number("", "cogging_torque.amplitude", "a torque bound to the rotor's angle")  # two sizes for each order
VISCOUS = Number(
    "viscous", "viscous_friction.coefficient", "a torque that grows with speed",
    "speed hardly varies beside what else it could be; record at several speeds",
    brakes=True,
)  # fmt: skip
INERTIA = Number(
    "inertia", "inertia.inertia", "torque missing while the speed changes",
    "the speed hardly changes; record accelerations",
)  # fmt: skip
LAG = Number(
    "lag", "current_filter.time_constant", "the current's readings come late",
    "the current hardly varies; record with load steps or accelerations",
)  # fmt: skip
NUMBERS = {n.effect: n for n in (DRY, COGGING, VISCOUS, INERTIA, LAG)}

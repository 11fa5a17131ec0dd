"""The plant: inverter, machine, sensors and shaft, exact between the events of each PWM period."""

from model.effects import own
from model.effects.adopt import inherit

inherit()
if own.cards():
    from sandbox.plant.compose import with_own_effects

    with_own_effects()

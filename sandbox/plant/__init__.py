"""The plant: inverter, machine, sensors and shaft, exact between the events of each PWM period."""

from model.effects.adopt import inherit
from sandbox.plant.compose import ports_module

inherit()
ports = ports_module()  # of the effects' cards

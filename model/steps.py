"""How long a step of the plant may be in a closed loop, by what changes within it.

The step is of third order: at these shares its error in the resistive drop stays below 1e-5 of it
(tests).
"""

from __future__ import annotations

from collections.abc import Iterable

from model.energy import AnyEnergy

LARGEST_TURN = 0.1  # rad of the rotor, and of a harmonic of its angle thrice that, in one step
LARGEST_DECAY = 0.1  # of the winding's time constant at zero current, in one step
SIXTH = 6.0  # the order of harmonics that have none to give


def step_for_winding(resistance: float, energy: AnyEnergy) -> float:
    """Return the longest step (s) for a current that decays by a resistance (ohm)."""
    return LARGEST_DECAY / (resistance * max(energy.gamma_d, energy.gamma_q))


def step_for_turn(omega: float) -> float:
    """Return the longest step (s) at a speed (rad/s, electrical)."""
    return LARGEST_TURN / max(abs(omega), 1.0)


def step_for_orders(orders: Iterable[float], omega: float) -> float:
    """Return the longest step (s) for harmonics of electrical orders, the sixth if there are none,
    at a speed."""
    highest = max(map(abs, orders), default=SIXTH)
    return 3.0 * LARGEST_TURN / (highest * max(abs(omega), 1.0))

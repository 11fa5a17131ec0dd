"""A fan on the load's shaft: an effect of one's own, as the tutorial writes it."""

from model.compiled import inlined
from model.effects.card import At, Effect, Parameter


@inlined
def drag(coefficient, omega):
    """Return the fan's torque (N m) at the load's mechanical speed (rad/s)."""
    return coefficient * omega * abs(omega)


FAN = Effect(
    name="fan",
    summary="a fan on the shaft: torque by the square of speed",
    subsystem="mechanics",
    equation="load torque += k w |w|",
    source="affinity laws of turbomachines",
    parameters=(Parameter("coefficient", "N m s^2/rad^2", 0.0, 0.0, 1.0, 2e-5),),
    axis="motion",
    order="0",
    region="grows with the square of speed",
    confused_with=("viscous_friction", "coulomb_friction"),
    separated_by="coasting from high speed: neither straight nor exponential",
    at=(At("load", drag, ("coefficient",)),),
)
EFFECTS = (FAN,)

"""Two effects of one's own: a fan on the load's shaft, and a resolver whose windings are not square
(the library has its order as a further part of `encoder_eccentricity`)."""

from model.compiled import inlined
from model.effects.card import At, Effect, Parameter
from model.lanes import sine_cosine


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


@inlined
def wobble(amplitude, phase, turn, pairs):
    """Return the reading's error (rad, electrical) at a mechanical angle (rad)."""
    sine, _ = sine_cosine(2.0 * turn + phase)
    return pairs * amplitude * sine


RESOLVER = Effect(
    name="resolver",
    summary="second-order error of a resolver: its windings are not square",
    subsystem="sensor",
    equation="theta_read = theta + p a sin(2 theta_mech + phase)",
    source="Hanselman, Resolver signal requirements for high accuracy resolver-to-digital "
    "conversion, 1990",
    parameters=(
        Parameter("amplitude", "rad", 0.0, 0.0, 0.1, 0.003),
        Parameter("phase", "rad", 0.0, -6.3, 6.3, 0.5),
    ),
    axis="d from q and q from d",
    order="2/p (twice a mechanical turn)",
    region="all, bound to position",
    confused_with=("encoder_eccentricity",),
    separated_by="slow driven turns at constant speed",
    at=(At("angle", wobble, ("amplitude", "phase")),),
    switches=("amplitude",),
    polar=("amplitude", "phase"),
)
EFFECTS = (FAN, RESOLVER)

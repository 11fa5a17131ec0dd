"""Values that stand at a bound, told: in the files for the simulator, and as what a reader has to
know."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from model.effects import library
from sandbox.gap.posterior.estimates import Estimate, Held
from sandbox.gap.words import quantity
from sandbox.output.sentences import capital

OF_SEARCH = "at the bound of the search"
TITLES = {  # of what is no effect's
    "bench.common_offset": "common offset of the three current sensors",
    "bench.load_torque_offset": "offset of the load's torque",
    "bench.soft_current": "half-width of the zone in which a current changes its sign",
}


def at_bound(found: Mapping[str, Estimate], held: Sequence[Held]) -> dict[str, str]:
    """Return what is said of the values that stand at a bound, by public name; values of the motor
    by their names in [motor], too."""
    out = {name: OF_SEARCH for name, e in found.items() if e.at_bound}
    of_motor = {**library.replaced(), **library.scaled()}
    for h in held:
        out |= dict.fromkeys(
            {h.name, of_motor.get(h.name, h.name)}, f"at its bound of {_deviations(h)}"
        )
    return out


def sentence(held: Sequence[Held]) -> str:
    """Return which ordinary deviations stand at their bounds, and what that means; "" where none
    does."""
    if not held:
        return ""
    texts = [
        f"the {_title(h.name)} stands at its bound of {_deviations(h)}: {_value(h)}" for h in held
    ]
    they, them, go = ("it", "it", "goes") if len(held) == 1 else ("they", "them", "go")
    return (
        f"{capital('; '.join(texts))}. Either {they} may be further off than [uncertainty] or "
        "[background] of the campaign says (usual sizes where they say nothing), or something that "
        f"is not named pushes {them}: as an ordinary deviation {they} {go} no further."
    )


def _value(h: Held) -> str:
    """Return a value without interval or flag."""
    e = h.estimate
    return quantity(Estimate(e.value, e.value, e.value, e.unit))


def _deviations(h: Held) -> str:
    return f"{h.deviations:g} standard deviations"


def _title(name: str) -> str:
    if name.startswith("angles."):
        return f"angle of {name.removeprefix('angles.')}"
    return TITLES.get(name, library.title(name))

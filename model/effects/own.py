"""Effects of one's own: a Python file outside the project whose cards join the library of this
process.

    sensorless diagnose CAMPAIGN --effects-from my_effects.py

The file holds cards like those of this folder and names them in EFFECTS.  Its equations are
compiled into the plant, so the file has to be given before the plant is first used; processes
started from this one take it over.
"""

from __future__ import annotations

import sys

from model.effects.card import Effect
from model.kernels.sources import ROOT

VARIABLE = "SENSORLESS_EFFECTS_FROM"  # by which processes started from this one are told
PLANT = "sandbox.plant.electrical"  # the first of the plant's kernels
# kernels that depend on it hold the effects taken over
EQUATIONS = ROOT / "sandbox" / "plant" / "compose.py"
FILES: dict[str, str] = {}  # module of each file taken over so far, by the file


def cards() -> list[tuple[Effect, str]]:
    """Return all cards taken over, each with the module that holds its equations."""
    return [(card, name) for name in FILES.values() for card in sys.modules[name].EFFECTS]

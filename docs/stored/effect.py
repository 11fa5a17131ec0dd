"""Make what the tutorial on effects shows: `python docs/stored/effect.py` (some minutes: it
compiles)."""

from __future__ import annotations

import datetime
import json
from pathlib import Path

import numpy as np

from sandbox import Scenario, Segment, simulate, use_effects

HERE = Path(__file__).resolve().parent
SPEEDS = (0.2, 0.35, 0.5, 0.65, 0.8)
COEFFICIENT = 2e-5  # N m s^2/rad^2


def main() -> None:
    """Hold five speeds with and without the fan; keep the mean current along q of each."""
    use_effects(HERE / "my_effects.py")
    segments = tuple(Segment(0.8, speed=speed, ramp=0.3, settle=0.6) for speed in SPEEDS)
    steps = Scenario("steps", segments, rotor="free", reference="speed")
    found = {}
    for name, effects in (("without", {}), ("with", {"fan.coefficient": COEFFICIENT})):
        run = simulate("ipm_exchanged", steps, "ekf", effects=effects)
        t, i_q = run.recording.t, run.recording.i_q
        found[name] = [float(np.mean(i_q[(t >= r.t_start) & (t < r.t_end)])) for r in run.rows]
    kept = {
        "date": datetime.date.today().isoformat(),
        "speed": SPEEDS,
        "coefficient": COEFFICIENT,
        "i_q": found,
    }
    (HERE / "effect.json").write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

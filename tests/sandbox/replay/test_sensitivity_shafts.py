"""Sets that differ in the motion alone: only their shafts are moved, under the base set's
torque."""

import dataclasses

import numpy as np
import pytest

from model.effects import library
from sandbox.replay.replay import prepare, replay
from sandbox.replay.sensitivity import all_parameters, displaced, mechanical_only, sensitivities
from tests.sandbox.replay.benches import CASES, campaign, typical

# Both add up the same torques in the same order, and innovations are of the size of 1: what an ulp
# of each sample's angle makes of them, 1e-16 of some 100 rad over 1e-4 rad of a count, added up
# over 1000 samples.
ROUNDING = 1e-7
SIZES = (
    "inertia.inertia",
    "viscous_friction.coefficient",
    "coulomb_friction.torque",
    "bench.load_torque_offset",
)
FIRST = 300  # samples that settle


def every():
    """Return all effects at typical size."""
    named = [n for n in library.effect_names() if n != "cross_saturation"]
    return {k: v for name in named for k, v in typical(name).items()}


def settled(prepared):
    """Return the same whose states settle in its first samples."""
    (whole,) = prepared.recordings
    own = dataclasses.replace(whole.cut(FIRST, whole.samples), settling=whole.cut(0, FIRST))
    return dataclasses.replace(prepared, recordings=(own,))


def slow(prepared):
    """Return the same with a row of the log for every third period."""
    (r,) = prepared.recordings
    motion = dataclasses.replace(r.motion, angle=r.motion.angle[::3], speed=r.motion.speed[::3])
    return dataclasses.replace(
        prepared, recordings=(dataclasses.replace(r, read=r.read[::3], motion=motion, held=3),)
    )


def of(name, effects):
    """Return a free rotor's recording: as it is, one whose states settle first, or a slow log."""
    prepared = prepare(
        campaign({}, [c for c in CASES if c[0] == "free"][:1], n=900), effects, steps=1
    )
    return {"whole": lambda p: p, "settled": settled, "slow": slow}[name](prepared)


@pytest.mark.parametrize("name", ["whole", "settled", "slow"])
@pytest.mark.parametrize(
    "effects", [{}, {"pwm_delay.delay": 25e-6, "dead_time.time": 1e-6}, every()]
)
def test_slopes_of_shafts_alone_are_differences_of_whole_replays(name, effects):
    """Innovations of a displaced set, the base's slopes times the step added, beside those of its
    own replay."""
    prepared = of(name, effects)
    compliant = "shaft_compliance.stiffness" in effects
    names = [n for n in all_parameters() if mechanical_only(n)]
    if not compliant:  # by two numbers together: there is no slope by one of them
        names = [n for n in names if not n.startswith("shaft_compliance")]
    found = sensitivities(prepared, names, effects)
    moved = [displaced(prepared, found.base, n, 1e-4) for n in names]
    base = {
        k: v for k, v in found.base.items() if compliant or not k.startswith("shaft_compliance")
    }
    got = replay(
        prepared, [base, *({**base, n: m.values[n]} for n, m in zip(names, moved, strict=True))]
    )
    (there,), (slope,) = got.motion, found.motion
    away = there[:, :1] + slope * found.steps - there[:, 1:]
    print(float(np.abs(away).max()), float(np.abs(there).max()))
    assert np.abs(away).max() < ROUNDING * max(1.0, np.abs(there).max())
    assert all(np.any(slope[:, names.index(n)] != 0.0) for n in SIZES)

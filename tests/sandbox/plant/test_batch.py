"""Sets side by side: what is neutral, and what lanes know of each other; one lane without a
compiler."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from model.drive_files import load_drive
from model.effects import library
from model.effects.card import PORTS, flux_scale
from sandbox.plant import additions as add
from sandbox.plant.fixed import FASTEST
from sandbox.plant.sets import complete, features_of
from sandbox.replay.replay import replay
from tests.sandbox.plant import interpreted
from tests.sandbox.plant.stated_duties import DRIVE, duties, from_duties, turning

PREPARED = from_duties(DRIVE, duties(40), *turning(40))
ROOT = Path(__file__).resolve().parents[3]


def readings(sets):
    """Return readings (n, 3, sets)."""
    return replay(PREPARED, sets).currents[0]


def without_compiler(what):
    """Return what `interpreted` prints in a process of its own."""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(ROOT)}
    call = [sys.executable, "-m", "tests.sandbox.plant.interpreted", what]
    return json.loads(
        subprocess.run(
            call, env=environment, cwd=ROOT, capture_output=True, check=True, text=True
        ).stdout
    )


def test_a_drive_without_effects_needs_nothing():
    # its own viscous friction
    assert features_of(DRIVE.motor, complete(DRIVE.motor, DRIVE.converter)) == add.RUB


# the sample then lies inside a segment for all lanes: other sums
ROUNDED = ("current_sampling", "pwm_delay")


@pytest.mark.parametrize("name", library.effect_names())
def test_a_neutral_lane_beside_one_that_is_on(name):
    """The plant then does for both what the effect needs, and asks its equations in both: the bits
    of a lane alone.

    But for three.  Timing: the same sample by other sums, to a few roundings of the largest
    current.  Filter: one without time constant has 1e-12 s, so it reads what the current was then;
    no current of this motor moves faster than by 2/3 of the link on its smaller inductance.
    """
    plain = readings([{}])[:, :, 0]
    beside = readings([{}, library.typical(name, DRIVE.motor, DRIVE.converter)])[:, :, 0]
    off = float(np.abs(beside - plain).max())
    if name == "current_filter":
        least = min(DRIVE.motor.inductance_d, DRIVE.motor.inductance_q)
        assert off < 1.0 / FASTEST * 2.0 / 3.0 * DRIVE.converter.dc_bus_voltage / least
    elif name in ROUNDED:
        assert off < 8.0 * np.finfo(float).eps * np.abs(plain).max()
    else:
        assert np.array_equal(beside, plain)


def test_a_neutral_lane_beside_all_that_is_on():
    """As before, the filter among them."""
    plain, beside = readings([{}])[:, :, 0], readings([{}, interpreted.every()])[:, :, 0]
    least = min(DRIVE.motor.inductance_d, DRIVE.motor.inductance_q)
    assert (
        np.abs(beside - plain).max()
        < 1.0 / FASTEST * 2.0 / 3.0 * DRIVE.converter.dc_bus_voltage / least
    )


@pytest.mark.parametrize("name", library.effect_names())
def test_companions_of_an_effect_that_is_off_change_no_bit(name):
    """What says how, not how much (phase, frequency, time constant, width, ...), does nothing
    alone."""
    card, typical = library.load_effect(name), library.typical(name, DRIVE.motor, DRIVE.converter)
    companions = {
        k: v
        for k, v in typical.items()
        if card.switches and k.partition(".")[2] not in card.switches
    }
    if name == "shaft_compliance":
        del companions["shaft_compliance.load_inertia"]  # refused without stiffness
    assert np.array_equal(readings([companions]), readings([{}]))


def test_a_lane_knows_nothing_of_its_neighbours():
    """The same set in each of sixteen lanes, beside others that need the same: the same bits."""
    effects = interpreted.every()
    others = [{**effects, "stator_resistance.resistance": 8.0 + 0.3 * k} for k in range(15)]
    alone = readings([effects])[:, :, 0]
    for lane in (0, 5, 15):
        beside = readings([*others[:lane], effects, *others[lane:]])[:, :, lane]
        assert np.array_equal(beside, alone)


def test_one_lane_without_a_compiler_is_sixteen_with_one():
    """Strict arithmetic: vector code of sixteen lanes and an interpreter of one give the same
    bits."""
    n = interpreted.SHORT
    prepared = from_duties(DRIVE, duties(n), *turning(n))
    compiled = replay(prepared, [interpreted.every()]).currents[0][:, :, 0]
    assert [float(x).hex() for x in compiled.ravel()] == without_compiler("bits")


def test_energy_of_an_electrical_turn_closes():
    """Input = copper + skin + windings + core + shaft at steady state, all machine effects on.

    Four times the steps bring what is left down fourfold or more: it is the steps', and the meter's
    (Simpson's rule, the skin effect's lag in the middle taken as the mean of both ends).
    """
    left = []
    for turn in without_compiler("energy"):
        left.append(
            abs(turn["input"] - sum(v for k, v in turn.items() if k != "input")) / turn["input"]
        )
        assert min(turn.values()) > 1e-3 * turn["input"]
    print("energy left over input:", left)
    assert left[-1] < 1e-5
    assert left[0] > 4.0 * left[1]
    assert left[1] > 4.0 * left[2]


@pytest.mark.parametrize("name", library.effect_names())
def test_every_effect_has_an_equation_or_replaces_values_of_the_motor(name):
    """What no equation is handed is a value of the motor, under its own name or that of another
    effect."""
    card, of_motor = library.load_effect(name), library.replaced() | library.scaled()
    handed = {n for at in card.at for n in at.numbers}
    others = {p.same_as or f"{name}.{p.name}" for p in card.parameters if p.name not in handed}
    assert others <= set(of_motor), name


@pytest.mark.parametrize("port", [name for name, port in PORTS.items() if port.once])
def test_what_is_asked_once_is_zero_in_neutral_lanes(port):
    """The card of an effect that is off returns 0 first, whatever its companions say (their typical
    sizes)."""
    drive = load_drive("ipm")
    neutral, found, flux = library.neutral(drive.motor), 0, flux_scale(drive.motor)
    sizes = {"inertia": drive.motor.inertia, "flux": flux, "slope": drive.motor.rated_omega * flux}
    for card in map(library.load_effect, library.effect_names()):
        typical = library.typical(card.name, drive.motor, drive.converter)
        off = {**neutral, **{n: x for n, x in typical.items() if n not in card.switched_by[0]}}
        more = [sizes[name] for name in PORTS[port].quantities]
        for at in (at for at in card.at if at.port == port):
            got = at.equation(*(off[card.public(1, n)] for n in at.numbers), *more)
            found += 1
            assert (got[0] if isinstance(got, tuple) else got) == 0.0
    assert found

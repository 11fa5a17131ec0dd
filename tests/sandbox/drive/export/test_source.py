"""An exported drive in C beside the Python plant: the same commands, the same chances, the same
numbers."""

import dataclasses
import subprocess

import numpy as np
import pytest

from estimators.c.build import STRICT, compiler
from model.effects import library
from sandbox import export_estimator, load_motor
from sandbox.drive.export.source import HEADER, SOURCE
from sandbox.public.exports.drive import LOOP, export_drive
from tests.balance import on_a_map
from tests.sandbox.drive.export.driven import (
    CURRENT,
    READ,
    ROTORS,
    THETA,
    Exported,
    differences,
    python_run,
    quiet,
    scene,
    sizes,
    top_speed,
    within,
)

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler")
GOAL = 1e-9  # of rated current, and rad
MECHANICS = {
    "cogging_torque",
    "coulomb_friction",
    "viscous_friction",
    "shaft_compliance",
    "inertia",
}


@pytest.fixture(scope="module")
def drive():
    """The usual motor, its readings with noise but without counts: one would turn a last digit into
    a whole count."""
    usual = load_motor("ipm_exchanged")
    return dataclasses.replace(
        usual, converter=dataclasses.replace(usual.converter, current_resolution=0.0)
    )


@pytest.fixture(scope="module")
def plain(drive, tmp_path_factory):
    """It in C without effects, which all stay parameters."""
    return Exported(drive, tmp_path_factory.mktemp("drive"))


def shortened(drive, effects):
    """Return the step that the Python plant takes with effects, as a parameter of the exported
    drive."""
    from sandbox.drive.export.source import own_numbers
    from sandbox.plant.sets import complete

    values = complete(drive.motor, drive.converter, effects)
    return {
        n.name: n.value
        for n in own_numbers(drive, values, top_speed(drive))
        if n.name == "drive.longest_step"
    }


def compared(drive, exported, rotor, effects):
    recording = python_run(drive, rotor, effects)
    found = exported.run(recording, rotor, effects | shortened(drive, effects))
    return differences(drive, found, recording)


@pytest.mark.parametrize("rotor", ROTORS)
def test_every_effect_at_once(drive, plain, rotor):
    effects = {
        k: v
        for k, v in sizes(drive).items()
        if rotor == "free" or k.partition(".")[0] not in MECHANICS
    }
    assert max(compared(drive, plain, rotor, effects)) < GOAL


@pytest.mark.parametrize("effect", library.effect_names())
def test_each_effect_alone(drive, plain, effect):
    """Set as a parameter of a drive exported without it: the bits that the plant needs are found in
    C."""
    effects = sizes(drive, [effect]) or {
        f"{effect}.{p.name}": 1.05 * p.neutral_for(drive.motor)
        for p in library.load_effect(effect).parameters
        if not p.same_as
    }
    assert max(compared(drive, plain, "free", effects)) < GOAL


@pytest.mark.parametrize("effect", ["leg_voltage", "current_linearity", "friction_torque"])
def test_a_curves_reference_that_is_left_out_is_the_drives_rating(drive, plain, effect):
    effects = sizes(drive, [effect])
    del effects[f"{effect}.reference"]
    assert max(compared(drive, plain, "free", effects)) < GOAL


def test_bristles_bend_in_c_too(drive, plain):
    effects = sizes(drive, ["coulomb_friction"]) | {
        "coulomb_friction.stribeck_torque": 0.02,
        "coulomb_friction.presliding": 3e-3,
        "coulomb_friction.presliding_damping": 0.2,
    }
    assert max(compared(drive, plain, "free", effects)) < GOAL


FURTHER = {
    "flux_harmonics.2.order": 12.0,
    "flux_harmonics.2.psi_d": 4e-4,
    "flux_harmonics.2.phase": 0.3,
    "flux_harmonics.4.order": 2.0,
    "flux_harmonics.4.psi_q": 3e-4,
    "inductance_harmonics.3.order": 12.0,
    "inductance_harmonics.3.gamma": 0.05,
    "cogging_torque.5.amplitude": 0.02,
    "cogging_torque.5.order_mech": 12.0,
    "encoder_eccentricity.amplitude_mech": 0.005,
    "encoder_eccentricity.2.amplitude_mech": 0.003,
    "encoder_eccentricity.2.phase": 0.9,
    "encoder_eccentricity.4.amplitude_mech": 0.002,
    "encoder_eccentricity.4.order_mech": 5.0,
}


REST = (
    FURTHER,
    {"current_sampling.delay": -3e-6},
    {
        "iron_loss.excess_current": 0.04,
        "iron_loss.hysteresis_current": 0.04,
        "dead_time.time": 2e-6,
        "current_sampling.delay": 5e-6,
    },
    {"current_sampling.jitter": 2e-6},
    {"pwm_delay.delay": 2e-5, "current_sampling.delay": 5e-6},
    {"bench.soft_shape": 0.5, "dead_time.time": 2e-6, "bench.load_torque_gain": 0.02},
    {"dead_time.time": 3e-6, "dead_time.zone_width": 0.1, "dead_time.zone_shape": 1.0},
    {"dead_time.time": 3e-6, "bench.soft_center": 0.7, "dead_time.zone_shape": 0.5},
    {
        "shaft_compliance.stiffness": 50.0,
        "shaft_compliance.load_inertia": 4e-4,
        "shaft_compliance.backlash": 1e-3,
    },
    {
        "skin_effect.resistance": 5.0,
        "skin_effect.layers": 3.0,
        "skin_effect.time_constant": 3e-5,
        "current_sampling.delay": 5e-6,
    },
)


@pytest.mark.parametrize("extra", REST)
def test_what_typical_sizes_do_not_reach(drive, plain, extra):
    """Further orders, excess loss and hysteresis, samples before their pattern, jitter by the same
    chances, the sign around zero current, backlash, layers of
    conductors."""
    assert max(compared(drive, plain, "free", extra)) < GOAL


def test_an_inverter_by_its_table(drive, tmp_path):
    table = ((0.0, 0.0), (0.1, 0.8), (0.5, 1.4), (2.0, 1.9))
    measured = dataclasses.replace(
        drive, converter=dataclasses.replace(drive.converter, inverter_table=table)
    )
    assert max(compared(measured, Exported(measured, tmp_path), "free", {})) < GOAL


def test_a_flux_map(tmp_path):
    mapped = quiet(on_a_map())
    effects = {"dead_time.time": 1e-6, "iron_loss.core_resistance": 800.0}
    assert max(compared(mapped, Exported(mapped, tmp_path), "free", effects)) < GOAL


def test_in_float(drive, tmp_path):
    """24 bits: fluxes of 0.1 Wb keep 6e-9 Wb, over 45 mH 1.3e-7 A; 400 periods of 12 steps add up
    as chance does (70 times as much), and the rotor's angle as much again: 1e-4 of rated
    current."""
    exported, effects = Exported(quiet(drive), tmp_path, double=False), {"dead_time.time": 1e-6}
    true, read, angle = compared(quiet(drive), exported, "driven", effects)
    assert max(true, read) < 1e-4
    assert angle < 1e-4


def test_parts_of_a_period(drive, plain):
    """Eight parts make a period: with steps of any length the same but for the error of a step, of
    third order."""
    effects = {"dead_time.time": 3e-6, "dc_link_ripple.amplitude": 2.0}
    recording, found = python_run(drive, "free", effects), {}
    for parts, steps in ((1, 16), (8, 16), (1, 64), (8, 64)):
        step = {"drive.longest_step": 0.5 * drive.converter.sampling_period / steps}
        found[parts, steps] = plain.run(recording, "free", effects | step, parts)
    rated = drive.motor.rated_current
    coarse, fine = (
        np.abs(found[8, n][:, CURRENT] - found[1, n][:, CURRENT]).max() / rated for n in (16, 64)
    )
    assert fine < 1e-6
    assert fine < coarse / 8.0 or coarse < GOAL
    assert (
        np.abs(
            within(found[8, 64][:, THETA] - found[1, 64][:, THETA], drive.motor.pole_pairs)
        ).max()
        < 1e-6
    )
    assert np.abs(found[8, 64][:, READ] - found[1, 64][:, READ]).max() / rated < 1e-6


def test_parts_that_are_too_short(drive, plain):
    """An edge may be late by no more than one part."""
    memory, status = plain.begin("locked", {"dead_time.time": 2e-6})
    given, out = (plain.real * 12)(*3 * (0.5,)), (plain.real * 13)()
    assert status == 0
    assert plain.library.sensorless_drive_part(memory, given, out, 0, 500) == -2


def test_parameters_out_of_bounds_are_named(plain):
    names = [n.name for n in plain.source.numbers]
    _, status = plain.begin("free", {"dead_time.time": 1.0})
    assert names[status - 1] == "dead_time.time"
    _, status = plain.begin(
        "free", {"shaft_compliance.stiffness": 10.0, "shaft_compliance.load_inertia": 1e3}
    )
    assert status != 0


def test_it_compiles_strictly(drive, plain, tmp_path):
    """In float nothing is promoted to double but the clock; no warning of any kind."""
    for name, text in ((HEADER, plain.source.header), (SOURCE, plain.source.source)):
        (tmp_path / name).write_text(text)
    for more in (["-DSENSORLESS_FLOAT64"], []):
        call = [compiler(), *STRICT, "-Wconversion", "-O1", *more, "-c", SOURCE]
        done = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("estimator", ["qnull", "inversion", "ekf"])
def test_the_loop_closes_in_c_alone(estimator, tmp_path):
    """A program of at most 60 lines, no Python: with the exported estimator it keeps the rotor
    within 5 degrees."""
    export_drive("ipm_exchanged", {"device_drop.on_resistance": 0.05}, fmu=False).save(
        tmp_path / "drive"
    )
    for name, text in export_estimator(estimator, "ipm_exchanged").files.items():
        (tmp_path / "drive" / name).write_text(text)
    folder = tmp_path / "drive"
    assert len((folder / LOOP).read_text().splitlines()) <= 60
    call = [
        compiler(),
        "-std=c99",
        "-Wall",
        "-Wextra",
        "-O2",
        LOOP,
        SOURCE,
        f"{estimator}.c",
        "-lm",
    ]
    subprocess.run(call, cwd=folder, check=True)
    done = subprocess.run(["./a.out"], cwd=folder, capture_output=True, text=True, check=True)
    assert done.stdout.startswith("ipm_exchanged: error rms ")


def test_scenes_turn_as_they_say(drive):
    """The free rotor must turn, or cogging and friction were compared at rest."""
    assert np.ptp(python_run(drive, "free", {}).theta) > 0.5
    assert scene("free").rotor == "free"

"""The way of somebody who owns a flux map: map -> plan -> record -> check -> diagnose -> simulate,
beside a motor with alphas; the map lies in a folder of its own, outside the motor's."""

import shutil

import pytest

import sandbox
from model.effects.library import effect_names
from sandbox import Scenario, Segment
from tests.data import real_data

SCENE = Scenario(
    "bench",
    (
        Segment(0.02),
        Segment(0.12, load=0.6, ramp=0.05),
        Segment(0.12, load=-0.4, speed=0.05, ramp=0.08),
    ),
    rotor="driven",
    start_up=False,
)
# what can stand for a dead time, and two more
LEFT = ("dead_time", "device_drop", "stator_resistance", "inductance")
# file, [flux_map], [motor], [drive] as printed in model/motors/mapped; SEW: chosen, no data sheet
MAP = {
    "baldor": (
        "baldor_pmsyrm/ABB_400rpm_map.mat",
        "cells = [20, 16]\nsmooth = 0.0003",
        (2, 0.63, 0.05, 12.4, 29.7, 1800.0),
        (125e-6, 540.0),
        2e-6,
    ),
    "brusa": (
        "brusa_hsm1/brusa_meas.npz",
        "cells = [20, 16]\nsmooth = 0.0003",
        (5, 0.03, 0.02, 72.5, 35.0, 4896.0),
        (1e-4, 400.0),
        1e-6,
    ),
    "thor": (
        "thor_fea/thor_fea.npz",
        'magnet = "-q"\ncells = [20, 16]\nsmooth = 0.0003',
        (2, 0.2, 0.0084, 22.0, 19.0, 2550.0),
        (125e-6, 310.0),
        2e-6,
    ),
    "sew": (
        "sew_map/LUT_SEW_jax_grad.mat",
        "angle = 0.0439\ncells = [6, 6]\nsmooth = 0.1",
        (4, 0.208, 0.02, 8.0, 4.4, 3000.0),
        (1e-4, 550.0),
        5e-7,
    ),
}
OF_MOTOR = (
    "pole_pairs",
    "resistance",
    "inertia",
    "rated_current",
    "rated_torque",
    "rated_speed_rpm",
)


def mapped(name, folder):
    """Return a motor's file that names a map in a folder beside its own, and the dead time (s) of
    its drive."""
    file, of_map, motor, (period, link), true = MAP[name]
    (folder / "maps").mkdir()
    place = folder / "maps" / file.rpartition("/")[2]
    shutil.copyfile(real_data() / file, place)
    (folder / "bench").mkdir()
    own = folder / "bench" / f"{name}.toml"
    values = "\n".join(f"{key} = {value}" for key, value in zip(OF_MOTOR, motor, strict=True))
    own.write_text(
        f'[motor]\n{values}\n[flux_map]\nfile = "../maps/{place.name}"\n{of_map}\n'
        f"[drive]\nsampling_period = {period}\ndc_bus_voltage = {link}\n"
    )
    return own, true


@pytest.mark.parametrize("name", ["baldor", "quartic"])
def test_a_plan_with_a_free_rotor_is_made_for_a_map_as_for_alphas(name, tmp_path):
    motor, _ = ("ipm_exchanged", None) if name == "quartic" else mapped(name, tmp_path)
    assert sandbox.plan(motor, can=("free",)).plan.experiments


@pytest.mark.parametrize("scenario", ["staircase", "creep_reversal"])
def test_a_drive_without_a_fault_is_not_suspicious_where_the_iron_saturates(scenario, tmp_path):
    """Nothing was planted. Up to 180 % load L_q falls to a seventh of that at no current; the
    start-up turned the injection."""
    motor, _ = mapped("brusa", tmp_path)
    sandbox.simulate(motor, scenario, "qnull", seed=3, record=tmp_path / "record")
    found = sandbox.check(tmp_path / "record", effects=False)
    assert found.mistakes == ()
    assert not any("give theta in electrical rad" in n.finding.text for n in found.noticed)
    assert not any("alphas" in n.finding.text for n in found.noticed)  # a map has none


# thor: a map turned to the magnets; sew: a table with gradients
@pytest.mark.parametrize("name", ["baldor", "brusa", "thor", "sew", "quartic"])
def test_from_a_map_to_a_simulator_that_has_what_was_found(name, tmp_path):
    """Size within four of the stated standard deviations; the two files leave the noise, as the
    truth does."""
    motor, true = ("ipm_exchanged", 2e-6) if name == "quartic" else mapped(name, tmp_path)
    assert sandbox.plan(motor, can=("locked",)).plan.experiments
    record = tmp_path / "record"
    planted = {"dead_time.time": true}
    sandbox.simulate(
        motor, SCENE, "qnull", closed_loop=False, effects=planted, seed=3, record=record
    )
    assert ("[flux_map]" in (record / "campaign.toml").read_text()) == (name != "quartic")
    assert sandbox.check(record, effects=False).mistakes == ()
    found = sandbox.diagnose(record, exclude=[e for e in effect_names() if e not in LEFT], jobs=1)
    best = found.as_json()["hypotheses"][0]
    assert best["effects"] == ["dead_time"]
    time = best["parameters"]["dead_time.time"]
    low, high = time["ci95"]
    assert time["value"] == pytest.approx(true, abs=4.0 * (high - low) / 3.92)
    out = tmp_path / "out"
    out.mkdir()
    found.refitted.write(out)  # what `save` writes for the simulator, without pages and traces
    files = out / "motor.toml", out / "effects.toml"
    assert sandbox.simulate(
        files[0], SCENE, "qnull", closed_loop=False, effects=files[1], seed=3
    ).rows
    again = sandbox.replay(record, motor=files[0], effects=files[1]).as_json()
    assert again["recordings"][0]["rms"] < 1.1

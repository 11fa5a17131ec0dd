"""A simulated run as a campaign: what it states is what was simulated, and a replay meets it at its
noise floor."""

import dataclasses

import numpy as np
import pytest

from estimators.registry import load_estimator
from model.drive_files import ASSUMED, INJECTED, MOTORS, load_drive
from model.errors import BadInput
from model.frames import wrapped
from model.levels import NoStaircase
from sandbox.drive.record import COUNTS, bench_of, campaign_of, injection_axis
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate
from sandbox.recordings.campaign import read_folder
from sandbox.recordings.importing import read_recordings
from sandbox.recordings.staircase import levels_of
from sandbox.recordings.writing import write_campaign
from sandbox.replay.replay import prepare, replay, residuals

DRIVE = bench_of(load_drive("ipm_exchanged"))
EFFECTS = {
    "stator_resistance.resistance": 13.5,
    "dead_time.time": 1e-6,
    "dc_link_error.sag": 10.0,
    "encoder_offset.offset": 0.04,
}
COUNT = 2 * np.pi * DRIVE.motor.pole_pairs / COUNTS


def run(rotor, plant, effects, seed=3):
    speed, mode = (0.0 if rotor == "locked" else 0.05), ("speed" if rotor == "free" else "current")
    scenario = Scenario(
        "run", (Segment(0.1), Segment(0.4, 0.5, speed, ramp=0.2)), rotor=rotor, reference=mode
    )
    return scenario, simulate(
        DRIVE, scenario, load_estimator("qnull"), plant=plant, effects=effects, seed=seed
    )


@pytest.mark.parametrize("effects", [{}, EFFECTS], ids=["none", "effects"])
@pytest.mark.parametrize("rotor", ["locked", "driven", "free"])
@pytest.mark.parametrize("plant", ["exact", "switched"])
def test_written_read_and_replayed_at_the_noise_floor(plant, rotor, effects, tmp_path):
    """With what was simulated: rms 1 within 3 % (5000 readings: 1 %, dead time's soft sign 2 %);
    without: far off."""
    scenario, done = run(rotor, plant, effects)
    write_campaign(tmp_path / "c", campaign_of(DRIVE, scenario, done.recording, "c"))
    campaign = read_folder(tmp_path / "c")
    assert campaign.drive.converter == DRIVE.converter
    prepared = prepare(campaign, effects)
    found = residuals(prepared, replay(prepared, [effects, {}]))[0]
    moved = 1.0 if found.motion is None else float(np.sqrt(np.mean(found.motion[:, 0] ** 2)))
    print(f"{plant} {rotor}: current {found.rms()}, motion {moved:.3f}")
    assert found.rms()[0] == pytest.approx(1.0, abs=0.04)
    assert moved == pytest.approx(1.0, abs=0.06)
    if effects:
        assert found.rms()[1] > 20.0


@pytest.mark.parametrize("plant", ["exact", "switched"])
def test_duties_are_formed_with_the_recorded_link(plant):
    """A reading with 5 % noise: met at the floor with the column, missed by 0.05 u T_s/L (some
    floors) without it."""
    drive = dataclasses.replace(
        DRIVE, converter=dataclasses.replace(DRIVE.converter, link_noise=20.0)
    )
    scenario = Scenario("run", (Segment(0.1), Segment(0.2, 0.5)))
    campaign = campaign_of(
        drive,
        scenario,
        simulate(drive, scenario, load_estimator("qnull"), plant=plant).recording,
        "c",
    )
    flat = dataclasses.replace(
        campaign.recordings[0],
        columns={
            **campaign.recordings[0].columns,
            "u_dc": np.full_like(campaign.recordings[0].t, 400.0),
        },
    )
    rms = [
        residuals(p, replay(p, [{}]))[0].rms()[0]
        for p in (prepare(campaign), prepare(dataclasses.replace(campaign, recordings=(flat,))))
    ]
    print(plant, rms)
    assert rms[0] == pytest.approx(1.0, abs=0.04)
    assert rms[1] > 1.5


def test_what_a_campaign_states_is_what_was_simulated():
    scenario, done = run("driven", "exact", {"encoder_offset.offset": 0.04})
    campaign = campaign_of(DRIVE, scenario, done.recording, "c")
    r = campaign.recordings[0]
    miss = r.theta - done.recording.theta - 0.04  # of the reading from the truth: counts, uniform
    assert np.abs(miss).max() <= 0.5 * COUNT * (1 + 1e-9)
    assert miss[len(miss) // 2 :].std() == pytest.approx(COUNT / np.sqrt(12), rel=0.1)
    assert np.abs(r.theta / COUNT - np.round(r.theta / COUNT)).max() < 1e-9
    u = r.u_dc / DRIVE.converter.dc_bus_voltage - 1.0
    assert u.std() == pytest.approx(7.5e-4, rel=0.1)
    assert abs(u.mean()) < 5 * 7.5e-4 / np.sqrt(len(u))
    assert campaign.uncertainty["resistance"] == 0.01
    assert campaign.background["current_offset"] == pytest.approx(8e-4 * DRIVE.motor.rated_current)
    keys = {
        "current_gain",
        "current_offset",
        "encoder_offset",
        "dead_time",
        "load_torque_gain",
        "load_torque_offset",
    }
    assert set(campaign.background) == keys


def test_columns_belong_to_the_interval_that_starts_there():
    """u acts from its own sample on: what starts at rest moves first after the first u that is not
    0."""
    _, done = run("locked", "exact", {})
    r = done.recording
    first = int(np.argmax(np.hypot(r.u_alpha, r.u_beta) > 1.0))
    i = np.hypot(r.i_d, r.i_q)
    # edges at one instant are taken 1e-14 s apart: 400 V for so long, six times, over 45 mH
    assert i[first] < 1e-9
    h = DRIVE.converter.sampling_period
    u = np.hypot(r.u_alpha[first], r.u_beta[first])
    # between L_d and L_q
    assert i[first + 1] == pytest.approx(u * h / DRIVE.motor.inductance_q, rel=0.6)


def test_drive_file_that_states_its_encoder_and_link_keeps_them():
    stated = dataclasses.replace(DRIVE.converter, encoder_counts=1000, link_noise=0.7)
    drive = dataclasses.replace(DRIVE, converter=stated)
    assert bench_of(drive) == drive
    with pytest.raises(BadInput, match=r"link_noise = 50 V is out of range.*tenth"):
        dataclasses.replace(DRIVE.converter, link_noise=50.0)


def test_a_campaign_states_the_values_that_its_drive_did_not(tmp_path):
    """Noise of a motor's file without [drive] is a usual value; the run had it, and the campaign
    says so. So a motor's file that was written with a note on it states it, too."""
    text = "".join(
        f"{line}\n"
        for line in (MOTORS / "ipm_exchanged.toml").read_text(encoding="utf-8").splitlines()
        if not line.startswith(("current_noise", "amplitude"))
    )
    (tmp_path / "own.toml").write_text(text)
    drive = load_drive(tmp_path / "own.toml")
    assert (drive.provenance[ASSUMED], INJECTED in drive.provenance) == ("current_noise", True)
    scene, done = run("locked", "exact", {})
    found = campaign_of(bench_of(drive), scene, done.recording, "one").drive.provenance
    assert not {ASSUMED, INJECTED} & set(found)
    (tmp_path / "own.toml").write_text(
        (MOTORS / "ipm_exchanged.toml").read_text(encoding="utf-8")
        + f'"{ASSUMED}" = "current_noise"\n'
    )
    assert ASSUMED not in load_drive(tmp_path / "own.toml").provenance


def test_injection_axis_is_where_the_injection_lay():
    _, done = run("locked", "exact", {})
    assert injection_axis(done.recording) == "d"
    turned = dataclasses.replace(done.recording, table=done.recording.table.copy())
    turned.theta_hat[:] = wrapped(turned.theta + 1.5)
    assert injection_axis(turned) == "q"


def test_link_reading_noise_alone_changes_what_is_delivered():
    """Duties are formed with the reading: the noise is in the currents, and its absence leaves
    every bit."""
    silent = dataclasses.replace(
        DRIVE, converter=dataclasses.replace(DRIVE.converter, current_noise=0.0)
    )
    scenario = Scenario("s", (Segment(0.05),))
    out = []
    for noise in (0.0, 1e-9, 0.3):
        drive = dataclasses.replace(
            silent, converter=dataclasses.replace(silent.converter, link_noise=noise)
        )
        out.append(simulate(drive, scenario, load_estimator("qnull"), seed=1).recording)
    assert np.abs(out[0].u_dc - 400.0).max() == 0.0
    assert np.abs(out[0].i_d - out[1].i_d).max() < 1e-6
    assert np.abs(out[0].i_d - out[2].i_d).max() > 1e-5


def test_a_drive_that_modulates_is_replayed_as_it_does(tmp_path):
    """At the noise floor with the modulation that the campaign states."""
    stated = dataclasses.replace(DRIVE.converter, modulation="dpwm_60", least_pulse=4e-6)
    drive = dataclasses.replace(DRIVE, converter=stated)
    scenario = Scenario("run", (Segment(0.1), Segment(0.4, 0.5, 0.05, ramp=0.2)), rotor="driven")
    done = simulate(drive, scenario, load_estimator("qnull"), seed=3)
    write_campaign(tmp_path / "c", campaign_of(drive, scenario, done.recording, "c"))
    prepared = prepare(read_folder(tmp_path / "c"))
    found = residuals(prepared, replay(prepared, [{}]))[0]
    assert found.rms()[0] == pytest.approx(1.0, abs=0.04)


def test_a_recorded_motor_keeps_its_name(tmp_path):
    """So that the motor.toml of a diagnosis is called as the motor, not as the campaign."""
    drive, scenario = bench_of(DRIVE), Scenario("run", (Segment(0.1),))
    done = simulate(drive, scenario, load_estimator("qnull"), seed=3)
    write_campaign(tmp_path / "c", campaign_of(drive, scenario, done.recording, "monday"))
    own = read_folder(tmp_path / "c")
    assert (own.name, own.drive.name) == ("monday", DRIVE.name)


def test_blocked_gates_are_not_recorded():
    blocked = Scenario("run", (Segment(0.1), Segment(0.1, blocked=True)))
    with pytest.raises(BadInput, match="blocks the gates"):
        bench_of(DRIVE, None, blocked)


@pytest.mark.parametrize("angle", [0.0, -0.1, 4.0])
def test_start_up_of_the_estimate_is_no_mistake_of_the_recording(angle, tmp_path):
    """The estimate steps alpha, beta, axis found, and at 4 rad half a turn as its polarity
    shows."""
    scenario = Scenario("run", (Segment(0.3),), start_angle=angle)
    done = simulate(bench_of(DRIVE), scenario, load_estimator("qnull"), seed=3)
    write_campaign(tmp_path / "c", campaign_of(bench_of(DRIVE), scenario, done.recording, "c"))
    (own,) = read_recordings(tmp_path / "c").recordings
    hat = own.columns["theta_hat"]
    assert np.max(np.abs(np.diff(hat))) > 1.0
    assert abs(wrapped(hat[-1] - own.theta[-1])) < 0.05


def test_injection_that_an_estimator_turned_is_not_blamed_on_the_angle():
    """180 % load turns the saliency of spm_exchanged by 15 degrees; the current loop's answer adds
    to it."""
    drive = bench_of(load_drive("spm_exchanged"))
    scenario = Scenario("run", (Segment(0.5, load=1.8, ramp=0.05), Segment(0.3)), start_up=False)
    own = campaign_of(
        drive, scenario, simulate(drive, scenario, load_estimator("qnull"), seed=3).recording, "c"
    )
    with pytest.raises(
        NoStaircase, match=r"degrees off axis d, where the recorded estimate .* turned it"
    ):
        levels_of(own)
    (r,) = own.recordings
    bare = {n: x for n, x in r.columns.items() if n != "theta_hat"}
    turned = {**r.columns, "theta": r.theta + 1.2}
    for columns in (bare, turned):  # without an estimate, or far from it, the angle is to blame
        with pytest.raises(BadInput, match="give theta in electrical rad") as found:
            levels_of(
                dataclasses.replace(own, recordings=(dataclasses.replace(r, columns=columns),))
            )
        assert not isinstance(found.value, NoStaircase)

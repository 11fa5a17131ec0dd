"""What an effect does to the position error, against theory."""

import dataclasses
import math
from types import SimpleNamespace

import pytest

from model.drive_files import load_drive
from model.effects.library import complete, true_motor
from model.errors import BadInput, Diverged, PhysicsError
from model.saliency import local_angle
from sandbox.gap.pages.listed import not_run_sentences, position_rows
from sandbox.gap.report import position_moved
from sandbox.gap.report.position_moved import Moved, moved

SATURATED = {"saturation.alpha_30": 8.0}


def listing(moved, **shares):
    """A ranking of these moves, all effects likely, with shares."""
    of = {e: SimpleNamespace(value=x) for e, x in shares.items()}
    return SimpleNamespace(
        moved=moved,
        inclusion=SimpleNamespace(chances=dict.fromkeys(moved, 1.0)),
        shares=SimpleNamespace(of=of),
    )


@pytest.fixture(scope="module")
def found():
    return moved(
        load_drive("spm_exchanged"),
        {
            "saturation": SATURATED,
            "encoder_offset": {"encoder_offset.offset": 0.1},
            "odd": {"odd.x": 1.0},
        },
    )


def test_an_encoder_that_controls_nothing_moves_nothing(found):
    """The estimate controls, and its error is against the true angle: an encoder's offset enters
    nowhere."""
    assert set(found["encoder_offset"]) == {"qnull", "ekf", "active_flux"}
    assert all(m == Moved(0.0, 0.0) for m in found["encoder_offset"].values())


def test_another_saturation_turns_the_null_by_the_difference_of_two_angles(found):
    """The null stands at the true motor's cross-saturation angle, the belief takes off that of its
    own: e = angle of the true motor at (I sin e, I cos e) - angle of the believed one at (0, I),
    model.saliency, solved by iteration. Ripple of the motion and the speed's turn of the null leave
    some hundredths of a degree."""
    motor = load_drive("spm_exchanged").motor
    values = complete(motor, load_drive("spm_exchanged").converter, SATURATED)
    true, current, e = true_motor(motor, values).energy, motor.rated_current, 0.0
    for _ in range(50):
        at = current * math.sin(e), current * math.cos(e)
        e = float(local_angle(true, *at) - local_angle(motor.energy, 0.0, current))
    assert math.degrees(e) < -0.5  # there is something to see
    assert found["saturation"]["qnull"].mean_deg == pytest.approx(math.degrees(e), abs=0.1)


@pytest.mark.parametrize(
    ("estimator", "rpm", "speed", "seconds"),
    [
        ("qnull", 1200.0, 0.05, 1.0),
        ("ekf", 1200.0, 0.05, 1.0),
        ("ekf", 400.0, 0.05, 2.0),
        ("active_flux", 120.0, 0.5, 1.0),
    ],
)
def test_a_mechanical_turn_at_the_speed_that_the_page_names(estimator, rpm, speed, seconds):
    """At a twentieth of 1200 rpm a turn takes 1 s, at half of 120 rpm, too; of 400 rpm two of its
    three seconds."""
    drive = load_drive("spm_exchanged")
    drive = dataclasses.replace(drive, motor=dataclasses.replace(drive.motor, rated_speed_rpm=rpm))
    start, turn = position_moved.ready(drive, estimator).scenario.segments
    assert (start.load, turn.load, start.speed, turn.speed) == (0.0, 1.0, speed, speed)
    assert turn.duration - position_moved.RAMP - position_moved.SETTLE == pytest.approx(seconds)


def test_values_no_drive_can_have_are_said_to_be_none(found):
    assert set(found["odd"]) == {"qnull", "ekf", "active_flux"}
    got = found["odd"]["qnull"].as_json()
    assert "no drive can have" in got.pop("not_run")
    assert got == {"mean_deg": None, "ripple_deg": None, "lost": False}


@pytest.mark.parametrize(
    ("fails", "why"), [(True, "on this drive: no saliency"), (False, "loses the rotor")]
)
def test_an_estimator_that_cannot_run_says_so(monkeypatch, fails, why):
    """No gains can be designed, or the rotor is lost without any effect: each effect says why, the
    page once."""

    def ready(drive, name):
        if fails:
            raise BadInput("no saliency")

    monkeypatch.setattr(position_moved, "ready", ready)
    monkeypatch.setattr(position_moved, "error_of", lambda setup, values: None)
    found = moved(None, {"inertia": {}})["inertia"]
    assert set(found) == set(position_moved.ESTIMATORS)
    assert all(why in m.not_run for m in found.values())
    got = list(not_run_sentences(SimpleNamespace(moved={"inertia": found, "saturation": found})))
    assert len(got) == 1
    assert got[0].startswith("`qnull`, `ekf` and `active_flux` were not run: ")
    assert position_rows(listing({"inertia": found}))[1] == [["inertia", *["not run"] * len(found)]]


def test_a_rotor_that_is_lost_is_said_to_be():
    ranking = {"dead_time": {"qnull": Moved(math.nan, math.nan), "ekf": Moved(1.234, 0.1)}}
    assert position_rows(listing(ranking)) == (
        ["effect", "qnull", "ekf"],
        [["dead time", "lost", "+1.23° (+0.10°)"]],
    )
    assert Moved(math.nan, math.nan).as_json() == {
        "mean_deg": None,
        "ripple_deg": None,
        "lost": True,
        "not_run": None,
    }


def test_rows_stand_in_the_order_of_the_list():
    own = {e: {"ekf": Moved(1.0, 0.0)} for e in ("dead_time", "inertia", "saturation")}
    rows = position_rows(listing(own, dead_time=0.1, inertia=0.2, saturation=0.7))[1]
    assert [r[0] for r in rows] == ["saturation", "inertia", "dead time"]


@pytest.mark.parametrize(
    ("error", "lost"), [(Diverged("not finite"), True), (PhysicsError("needs 900 V"), False)]
)
def test_lost_is_said_only_where_a_run_breaks_off(monkeypatch, error, lost):
    """What is refused before a run begins is no lost rotor; the page names the effect where the
    others were run."""

    def run(setup, values):
        if values:
            raise error
        return 0.0, 0.0

    monkeypatch.setattr(position_moved, "error_of", run)
    own = moved(
        load_drive("spm_exchanged"), {"inertia": {"inertia.inertia": 1.0}, "saturation": {}}
    )
    assert own["saturation"]["ekf"] == Moved(0.0, 0.0)
    got = own["inertia"]["ekf"].as_json()
    assert got["lost"] == lost
    assert bool(got["not_run"]) != lost
    said = list(not_run_sentences(SimpleNamespace(moved=own)))
    assert said == (
        []
        if lost
        else [
            "`qnull`, `ekf` and `active_flux` were not run with inertia: "
            "the drive cannot run so with the effect: needs 900 V."
        ]
    )

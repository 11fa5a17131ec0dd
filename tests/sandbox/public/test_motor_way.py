"""The whole way of a motor that another tool or a data sheet states: convert, simulate, record,
check, diagnose; what is planted is named, with its size.

Of each kind one or two: with and without saliency, a tool's file and a data sheet's numbers; what
else a form has is tested where it is read (tests/model/tools).  Without saliency an estimator
without injection runs, and the refusal of the others says so.
"""

import json

import pytest

import sandbox
from model.effects.library import effect_names
from sandbox import BadInput, Scenario, Segment
from tests.model.tool_files import ODRIVE, VESC

FORMS = {
    "VESC": (VESC, []),
    "ODrive": (json.dumps(ODRIVE), ["voltage=24V"]),
    "terminals": (
        "",
        ["poles=8", "r_ll=0.72 ohm", "l_ll=0.5 mH", "kt=0.0543 Nm/A rms", "i=5 A rms", "u=48"],
    ),
}
NAMES = {"i": "current", "u": "voltage"}
SCENE = Scenario(
    "bench",
    (
        Segment(0.02),
        Segment(0.1, load=0.5, speed=0.1, ramp=0.03),
        Segment(0.1, load=-0.4, speed=0.2, ramp=0.03),
    ),
    rotor="driven",
    start_up=False,
)
LEFT = ("dead_time", "stator_resistance", "inductance", "magnet_flux")
LOST = 0.005  # of a sampling period: the dead time planted


@pytest.fixture(scope="module", params=FORMS)
def motor(request, tmp_path_factory):
    """Return the file that `motor` writes."""
    folder = tmp_path_factory.mktemp("motor")
    text, words = FORMS[request.param]
    if text:
        (folder / "config").write_text(text)
    words = [f"{NAMES.get(k, k)}={v}" for k, _, v in (w.partition("=") for w in words)]
    return sandbox.convert_motor([*([folder / "config"] if text else []), *words]).save(folder)


def test_a_motor_without_magnets_says_so_in_its_file(tmp_path):
    """A file without magnet_flux is refused, so a flux of zero is written."""
    words = ["pole_pairs=3", "resistance=0.5 ohm", "inductance_d=50 mH", "inductance_q=10 mH"]
    words += ["magnet_flux=0 Wb", "current=10 A", "voltage=400", "torque=2 Nm", "speed=3000"]
    file = sandbox.convert_motor(words).save(tmp_path / "synrm") / "motor.toml"
    assert sandbox.load_motor(file).motor.magnet_flux == 0.0


def test_a_converted_motor_goes_the_whole_way(motor, tmp_path):
    file = motor / "motor.toml"
    drive = sandbox.load_motor(file)
    lost = LOST * drive.converter.sampling_period
    run = sandbox.simulate(
        file,
        SCENE,
        "active_flux",
        closed_loop=False,
        effects={"dead_time.time": lost},
        record=tmp_path / "bench",
    )
    assert not any(row.lost_lock for row in run.rows)
    found = sandbox.check(tmp_path / "bench")
    assert not found.as_json()["findings"]
    told = sandbox.diagnose(
        tmp_path / "bench", exclude=[e for e in effect_names() if e not in LEFT], jobs=1
    ).as_json()
    (first,) = told["hypotheses"][0]["effects"]
    assert (told["verdict"], first) == ("explained", "dead_time")
    low, high = told["hypotheses"][0]["parameters"]["dead_time.time"]["ci95"]
    assert 0.9 * low < lost < 1.1 * high


def test_a_refusal_says_how_such_a_motor_runs(motor):
    """Without saliency or saturation injection finds no angle, or not its polarity: the estimator
    and the scenario that the sentence names run."""
    drive = sandbox.load_motor(motor / "motor.toml")
    with pytest.raises(BadInput, match="start_up = false") as refused:
        sandbox.simulate(drive, "staircase", "qnull")
    salient = drive.motor.inductance_d != drive.motor.inductance_q
    assert ("active_flux" in str(refused.value)) != salient
    assert "raise the injection" not in str(refused.value)
    if salient:
        known = Scenario("known", (Segment(0.2, load=0.5, settle=0.1),), start_up=False)
        assert not sandbox.simulate(drive, known, "qnull").rows[0].lost_lock

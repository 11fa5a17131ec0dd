"""What a person and a script get: findings, contract, report, trace, command; and that no truth is
read."""

import dataclasses
import json
import math
import re
import shutil
import tomllib
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest

from estimators.registry import load_estimator
from experiments import releases
from model.drive_files import load_drive
from model.effects import library
from model.effects.card import SUBSYSTEMS
from model.errors import BadInput
from sandbox.cli import main
from sandbox.drive.design import design
from sandbox.drive.record import campaign_of
from sandbox.drive.scenario import Scenario, Segment
from sandbox.drive.simulate import simulate
from sandbox.gap.diagnose import out_of_sight
from sandbox.gap.evidence.spectrum import shown
from sandbox.gap.location import where as places
from sandbox.gap.location.decompose import decompose
from sandbox.gap.location.where import subsystems
from sandbox.gap.pages.page import print_answers, write_report
from sandbox.gap.planning.menu import menu, settings
from sandbox.gap.planning.next_recording import Next
from sandbox.gap.posterior.estimates import Estimate
from sandbox.gap.report.answers import (
    answer,
    caveats,
    far_text,
    linear,
    next_text,
    where_text,
    which_text,
)
from sandbox.gap.report.diagnosis_json import document
from sandbox.gap.report.position import carrier_at, errors
from sandbox.gap.words import quantity, times
from sandbox.output.files import plain
from sandbox.public.campaigns.diagnosed import DiagnosisResult, diagnose
from sandbox.public.campaigns.replayed import replay
from sandbox.recordings.campaign import read_folder
from sandbox.recordings.injection import carrier
from tests.data import recordings_folder
from tests.sandbox.gap.conftest import DEAD_TIME
from tests.schemas import misfits
from tests.traces import read_trace


def content_of(a):
    return plain(document(a.diagnosis, a.where, a.position, a.following, a.remains, a.alike))


def test_where_names_the_inverter_in_a_plain_sentence(small_answers):
    first = small_answers.where[0]
    print([f.text for f in small_answers.where])
    assert first.subsystem == "inverter"
    assert first.share > 0.95
    assert "along the current" in first.text
    assert first.text.endswith("inverter.")
    shares = [f.share for f in small_answers.where]
    assert shares == sorted(shares, reverse=True)
    assert sum(subsystems(small_answers.diagnosis).values()) == pytest.approx(1.0)


def test_one_verdict_and_one_advice_everywhere(small_answers, tmp_path, capsys):
    """Terminal, page and JSON: the same word, and the same sentence about the dead time (2 us)."""
    print_answers(small_answers)
    printed = capsys.readouterr().out
    write_report(tmp_path / "r.html", small_answers)
    page, c = (tmp_path / "r.html").read_text(encoding="utf-8"), content_of(small_answers)
    assert c["verdict"] == c["badge"] == small_answers.verdict == "explained"
    assert printed.splitlines()[0] == "small: explained"
    assert ">Explained</span></h1>" in page
    said = next(e["do"] for e in c["effects"] if e["name"] == "dead_time")
    assert re.match(r"set the dead-time compensation to [12]\.\d µs", said)
    assert f"Do?        Dead time: {said}." in printed
    assert f"<h2>What to do</h2><ul><li>Dead time: {said}.</li>" in page


def test_contract_has_the_keys_of_the_contract(small_answers):
    """Keys and types that scripts rely on, listed here once more by hand."""
    c = content_of(small_answers)
    assert misfits("diagnosis", {"schema": 1, "command": "diagnose", "version": "", **c}) == []
    assert set(c) == {
        "campaign",
        "verdict",
        "badge",
        "gap",
        "where",
        "hypotheses",
        "ambiguity_set",
        "alike",
        "next_recording",
        "excluded",
        "out_of_sight",
        "excerpts",
        "cost",
        "effects",
        "groups",
        "unknown",
        "waterfall",
        "at_bound",
    }
    assert set(c["gap"]) == {
        "raw",
        "before",
        "after",
        "floor",
        "closed",
        "closed_ci95",
        "recordings",
        "position_error_deg",
        "remains",
        "noise",
    }
    assert set(c["gap"]["position_error_deg"]) == {
        "recorded",
        "simulated_before",
        "simulated_after",
    }
    assert [set(r) for r in c["gap"]["recordings"]] == 4 * [{"file", "before", "after", "held_out"}]
    assert {frozenset(f) for f in c["where"]} == {
        frozenset({"subsystem", "channel", "region", "order", "share", "text"})
    }
    assert {f["subsystem"] for f in c["where"]} <= set(SUBSYSTEMS)
    assert sum(h["probability"] for h in c["hypotheses"]) == pytest.approx(1.0)
    best = c["hypotheses"][0]
    assert set(best) == {"effects", "probability", "closed", "shares", "parameters"}
    assert best["effects"] == ["dead_time"]
    assert c["verdict"] == ("explained" if len(c["ambiguity_set"]) == 1 else "ambiguous")
    assert best["parameters"]["dead_time.time"]["value"] == pytest.approx(DEAD_TIME, rel=0.05)
    assert best["parameters"]["dead_time.time"]["unit"] == "s"
    assert best["closed"] == c["gap"]["closed"] > 0.99
    unknown = next(h for h in c["hypotheses"] if h["effects"] == ["unknown"])
    assert unknown["closed"] is None
    before, after = c["gap"]["before"], c["gap"]["after"]
    assert c["gap"]["closed"] == pytest.approx((before**2 - after**2) / (before**2 - 1.0))


def test_electrical_recordings_alone_judge_no_mechanics(small_folder, tmp_path):
    """Locked and driven rotors, nothing known of the shaft, nothing injected: the electrical cause
    is found as with all that stated, effects of mechanics are no candidates, and the answer says
    so."""
    shutil.copytree(small_folder, tmp_path / "c")
    text = (
        (tmp_path / "c" / "campaign.toml")
        .read_text()
        .replace('injection_axis = "d"', 'injection_axis = "none"')
    )
    text = re.sub(r"\[injection\]\n(\w+ = .*\n)+", "", text)
    kept = [
        x for x in text.splitlines() if not x.startswith(("inertia", "viscous_friction", "rated_"))
    ]
    (tmp_path / "c" / "campaign.toml").write_text("\n".join(kept) + "\n")
    assert not any(word in "\n".join(kept) for word in ("inertia =", "[injection]"))
    shaft = {
        "coulomb_friction",
        "viscous_friction",
        "friction_torque",
        "cogging_torque",
        "inertia",
        "shaft_compliance",
    }
    left_out = (
        set(library.effect_names()) - shaft - {"dead_time", "stator_resistance", "encoder_offset"}
    )
    found = diagnose(tmp_path / "c", exclude=sorted(left_out), jobs=1)
    told = plain(found.as_json())
    assert set(told["out_of_sight"]) == shaft
    assert set(told["excluded"]) == left_out  # what the user left out is told apart
    assert not shaft & {e["name"] for e in told["effects"]}
    assert not any(shaft & set(h["effects"]) for h in told["hypotheses"])
    assert told["hypotheses"][0]["effects"] == ["dead_time"]
    text = which_text(found.answers)
    assert "No rotor turned freely" in text
    assert all(e.replace("_", " ") in text for e in shaft)


def test_mechanics_are_candidates_where_a_rotor_is_free(small_answers):
    campaign = small_answers.diagnosis.campaign
    assert len(out_of_sight(campaign)) == 6
    one = dataclasses.replace(campaign.recordings[0], rotor="free")
    assert (
        out_of_sight(dataclasses.replace(campaign, recordings=(*campaign.recordings[1:], one)))
        == ()
    )


def test_the_files_for_the_simulator_meet_the_recordings(small_answers, tmp_path):
    """motor.toml and effects.toml put the recordings where the fit left them, to rounding: nothing
    of it is lost."""
    found = DiagnosisResult(small_answers)
    found.refitted.write(tmp_path)
    stated = found.as_json()["simulator"]
    campaign = small_answers.diagnosis.campaign
    again = replay(campaign, tmp_path / stated["effects"], motor=tmp_path / stated["motor"])
    assert again.rms == pytest.approx({r["file"]: r["rms"] for r in stated["residual"]}, rel=1e-6)
    # as many readings as noise: 3 phases x 1200 samples, of which fits take up some: rms 1 within 4
    # / sqrt(2 x 3600)
    assert max(again.rms.values()) < 1.05
    assert min(replay(campaign).rms.values()) > 20.0  # as `gap.raw`: what dead time makes
    # the line leaves the bench's own deviations and angles within a count out: still the cause is
    # taken away
    assert max(replay(campaign, stated["line"], motor=tmp_path / "motor.toml").rms.values()) < 1.5
    told = tomllib.loads((tmp_path / "motor.toml").read_text())
    own = campaign.drive.motor
    assert (
        told["ci95"]["resistance"][0] < told["motor"]["resistance"] < told["ci95"]["resistance"][1]
    )
    assert (
        told["ci95"]["resistance"][0] < own.resistance < told["ci95"]["resistance"][1]
    )  # the plant had the nominal one
    assert load_drive(tmp_path / "motor.toml").motor.rated_current == own.rated_current


def test_no_gap_is_said_plainly(quiet_answers):
    c = content_of(quiet_answers)
    assert c["verdict"] == "no_gap"
    for finding in c["where"]:  # nothing but what a gap would be that cannot be told from none
        assert finding["text"].startswith("If there is a gap at all")
    chance = 1.0 - sum(h["probability"] for h in c["hypotheses"] if not h["effects"])
    assert sum(f["share"] for f in c["where"]) <= chance * (1.0 + 1e-12)
    assert c["gap"]["closed"] is None
    # over next to nothing any share came out
    assert all(h["closed"] is None for h in c["hypotheses"])
    assert "None" in which_text(quiet_answers)
    assert "nothing to close" in far_text(quiet_answers)
    assert "Nothing is needed" in next_text(quiet_answers)
    assert any("held out" in text for text in caveats(quiet_answers))  # a campaign of one recording
    assert caveats(quiet_answers)[-1].startswith(
        "Values of the nominal model that are assumed, as no source states them: "
        "magnet_flux, inertia"
    )
    # what is known is no caveat
    assert not any("printed" in text for text in caveats(quiet_answers))


def test_beside_something_unknown_names_come_second(small_answers):
    """Doubtful names must not lead the answer (issue 21): the same diagnosis, its best hypothesis
    left open."""
    d = small_answers.diagnosis
    best = d.hypotheses[0]
    open_to_more = dataclasses.replace(best, effects=(*best.effects, "unknown"), probability=0.9)
    found = dataclasses.replace(
        d, hypotheses=(open_to_more, dataclasses.replace(best, probability=0.1))
    )
    text = which_text(dataclasses.replace(small_answers, diagnosis=found))
    assert text.startswith("Something outside the library is at work, 90 % probable")
    assert text.index("less surely") < text.index("dead time")


def test_a_recommended_recording_is_told_as_it_is_set(small_answers):
    campaign = small_answers.diagnosis.campaign
    entry = next(e for e in menu(campaign.drive, 2.0) if e.name == "driven_idle_half_link")
    told = settings(entry, campaign.drive)
    rpm = 0.4 * campaign.drive.motor.rated_speed_rpm
    assert told == (
        f"{-rpm:.0f} to {rpm:.0f} rpm, DC link {0.5 * campaign.drive.converter.dc_bus_voltage:g} V"
    )
    asked = Next(
        entry.name, f"turn it ({told})", 2.0, (("dead_time",), ("device_drop",)), 12.0, 0.96
    )
    text = next_text(dataclasses.replace(small_answers, following=asked))
    assert text == (
        f"Record: turn it ({told}), for 2 s. That it leaves only the true one of these is 96 % "
        "probable: dead time; device drop."
    )


def test_few_recordings_that_do_not_foretell_each_other_are_no_closed_matter(quiet_answers):
    d = quiet_answers.diagnosis
    size = dataclasses.replace(d.size, before=2.05)
    apart = dataclasses.replace(quiet_answers, diagnosis=dataclasses.replace(d, size=size))
    assert "2.05 times" in far_text(apart)
    assert "too few recordings" in far_text(apart)
    assert "nothing to close" not in far_text(apart)
    assert where_text(apart).startswith("Nowhere that these recordings show: fitted to all of them")
    assert "2.05" not in where_text(apart)
    assert next_text(apart).startswith("Record more operating points")


def test_position_error_follows_the_diagnosis(small_answers):
    """Dead time moves the estimator: simulated currents show that once it is in the model, and
    before only what ordinary deviations imitate of it."""
    p = small_answers.position
    assert abs(p.recorded - p.simulated_after) < 0.05 * p.recorded
    assert abs(p.recorded - p.simulated_before) > 5.0 * abs(p.recorded - p.simulated_after)


class Page(HTMLParser):
    """Collects what a page shows and what it would load."""

    def __init__(self):
        super().__init__()
        self.text, self.loads, self.open = [], [], []

    def handle_starttag(self, tag, attrs):
        if tag in ("script", "img", "link", "iframe"):
            self.loads += [v for k, v in attrs if k in ("src", "href") and v]
        if tag not in ("meta", "br", "img", "link", "wbr"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def test_report_is_one_page_with_the_answers_first(small_answers, tmp_path):
    path = tmp_path / "report.html"
    write_report(path, small_answers)
    page, text = Page(), path.read_text(encoding="utf-8")
    page.feed(text)
    assert page.loads == []
    assert page.open == []
    assert "url(http" not in text
    assert 'name="viewport"' in text
    said = "".join(page.text)
    order = [
        said.index(t)
        for t in ("Where does", "Which effect", "How far", "Hypotheses", "The gap, recording")
    ]
    assert order == sorted(order)
    for wanted in (
        "inverter",
        "dead_time.time",
        "µs",
        "held out",
        "What remains",
        "Before you rely on it",
    ):
        assert wanted in said, wanted
    assert text.count("<svg") >= 3


def test_report_escapes_names(quiet_answers, tmp_path):
    d = quiet_answers.diagnosis
    evil = dataclasses.replace(d, campaign=dataclasses.replace(d.campaign, name="<b>&"))
    write_report(tmp_path / "r.html", dataclasses.replace(quiet_answers, diagnosis=evil))
    assert "&lt;b&gt;&amp;" in (tmp_path / "r.html").read_text()
    assert "<b>&:" not in (tmp_path / "r.html").read_text()


def test_command_reads_no_truth(quiet_folder, tmp_path, capsys):
    """The same recordings with a truth file beside and inside and notes in campaign.toml give the
    same answers."""
    out = tmp_path / "one"
    assert main(["diagnose", str(quiet_folder), "--out", str(out), "--jobs", "1"]) == 0
    said = capsys.readouterr().out
    assert "Where?" in said and "How far?" in said  # noqa: PT018
    assert sorted(p.name for p in out.iterdir()) == [
        "diagnosis.json",
        "diagnosis.rrd",
        "effects.toml",
        "motor.toml",
        "report.html",
    ]
    copy = tmp_path / "campaign"
    shutil.copytree(quiet_folder, copy)
    truth = 'effects = ["dead_time"]\n[dead_time]\ntime = 3e-6\n'
    for place in (copy.with_suffix(".truth.toml"), copy / "truth.toml", copy / "quiet.truth.toml"):
        place.write_text(truth)
    text = (copy / "campaign.toml").read_text()
    text = text.replace("[[recording]]\n", '[[recording]]\nnote = "dead_time was put in"\n')
    (copy / "campaign.toml").write_text(text)
    assert main(["diagnose", str(copy), "--out", str(tmp_path / "two"), "--quiet"]) == 0
    assert capsys.readouterr().out == ""
    first, second = (
        json.loads((tmp_path / k / "diagnosis.json").read_text()) for k in ("one", "two")
    )
    assert (first["schema"], first["command"]) == (1, "diagnose")
    for found in (first, second):
        # which folder it was, and hashes of its files
        del found["cost"]["seconds"], found["made_by"]
    assert first == second


def test_a_diagnosis_goes_on_from_an_earlier_one(quiet_folder, quiet_answers, tmp_path, capsys):
    """A set that the earlier one left is fitted and weighed, though the search alone does not come
    upon it."""
    rival = ("dead_time", "magnet_flux")
    assert rival not in [j.effects for j in quiet_answers.diagnosis.evaluated]
    left = {
        "verdict": "ambiguous",
        "ambiguity_set": [list(rival), [], ["unknown"]],
        "next_recording": None,
    }
    (tmp_path / "diagnosis.json").write_text(json.dumps(left))
    out = tmp_path / "out"
    call = [
        "diagnose",
        str(quiet_folder),
        "--out",
        str(out),
        "--jobs",
        "1",
        "--continue",
        str(tmp_path),
    ]
    assert main(call) == 0
    assert (
        "The earlier diagnosis said: ambiguous (dead_time + magnet_flux; or no effect; or unknown)."
        in capsys.readouterr().out
    )
    found = json.loads((out / "diagnosis.json").read_text())
    assert misfits("diagnosis", found) == []
    assert found["continued"] == {
        "verdict": "ambiguous",
        "ambiguity_set": left["ambiguity_set"],
        "recommended": None,
    }
    assert found["verdict"] == "no_gap"
    assert list(rival) in [h["effects"] for h in found["hypotheses"]]


def test_trace_holds_recorded_and_both_simulations(quiet_folder, quiet_answers, tmp_path):
    from sandbox.gap.pages.traces import write_traces

    write_traces(tmp_path / "d.rrd", quiet_answers)
    found = read_trace(tmp_path / "d.rrd")
    t, values = found["driven_fast/current_d"]
    r = read_folder(quiet_folder).recordings[0]
    assert np.allclose(t, r.t, atol=1e-8)
    assert values.shape == (len(r.t), 3)
    i_alpha, i_beta = r.current
    # smoothed angle against counts of 4e-4 rad
    i_d = np.cos(r.theta) * i_alpha + np.sin(r.theta) * i_beta
    assert np.allclose(values[:, 0], i_d, atol=5e-3)
    assert {"driven_fast/residual_q", "driven_fast/angle"} <= set(found)
    # before and after
    assert np.allclose(values[:, :1] - values[:, 1:], found["driven_fast/residual_d"][1], atol=1e-6)


@pytest.mark.parametrize(
    ("call", "part"),
    [
        (["nowhere"], "nowhere"),
        (["{quiet}", "--exclude", "dead_tim"], "dead_time"),
        (["{quiet}", "--columns", "none.toml"], "none.toml"),
        (["{quiet}", "--continue", "nowhere"], "'nowhere' does not exist; give the folder"),
    ],
)
def test_bad_calls_get_one_sentence(quiet_folder, tmp_path, capsys, call, part):
    call = [c.format(quiet=quiet_folder) for c in call]
    assert main(["diagnose", *call, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert part in said
    assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_linear_nominal_model(quiet_folder):
    own = linear(read_folder(quiet_folder))
    assert [getattr(own.drive.motor, f"alpha_{k}") for k in ("30", "12", "40", "22", "04")] == 5 * [
        0.0
    ]
    assert read_folder(quiet_folder).drive.motor.alpha_30 != 0.0


def test_estimator_outside_the_loop_is_the_one_inside():
    """Recorded samples handed over once more give the angles that the loop's own estimator had."""
    drive = load_drive("ipm_exchanged")
    scenario = Scenario("turn", (Segment(0.3), Segment(0.4, 0.5, ramp=0.05)), start_up=False)
    run = simulate(drive, scenario, load_estimator("ekf"), seed=2)
    r = campaign_of(drive, scenario, run.recording, "turn").recordings[0]
    assert design(drive, start_up=False).tuning == run.design.tuning
    again = errors(drive, r, None, "ekf")
    inside = r.theta - run.recording.theta_hat
    # the loop writes its command one sample later
    assert np.allclose(again, inside[-len(again) :], atol=1e-4)


@pytest.mark.parametrize("theta", [0.0, math.pi / 2.0])
def test_carrier_s_phase_is_read_along_the_rotor(theta):
    """Injected along d three samples late: in u_alpha where the rotor lies there, in u_beta a
    quarter turn on."""
    drive = load_drive("ipm_exchanged")
    wave = carrier(drive.injection, drive.converter)
    late, n = np.resize(np.roll(wave.waveform, 3), 4 * len(wave.waveform)), 4 * len(wave.waveform)
    r = SimpleNamespace(
        theta=np.full(n, theta),
        t=np.arange(n),
        injection_axis="d",
        u_alpha=np.cos(theta) * late,
        u_beta=np.sin(theta) * late,
    )
    assert np.array_equal(carrier_at(drive, r), np.resize(np.roll(wave.primitive, 3), n))


def test_carrier_is_found_in_the_commands():
    drive = load_drive("ipm_exchanged")
    scenario = Scenario("still", (Segment(0.3),), start_up=False)
    run = simulate(drive, scenario, load_estimator("ekf"), seed=2)
    r = campaign_of(drive, scenario, run.recording, "still").recordings[0]
    wave = carrier(drive.injection, drive.converter)
    assert np.array_equal(carrier_at(drive, r), np.resize(wave.primitive, len(r.t)))


@pytest.mark.parametrize(
    ("e", "text"),
    [
        (Estimate(1.1374e-6, 1.1173e-6, 1.1577e-6, "s"), "1.137 µs [1.117, 1.158]"),
        (Estimate(12.35, 12.31, 12.39, "ohm"), "12.350 Ω [12.310, 12.390]"),
        (Estimate(0.0, -0.002, 0.002, ""), "0 [-0.0020, 0.0020]"),
        (Estimate(math.inf, 1e3, math.inf, "ohm"), "∞ kΩ [1.00, ∞]"),
        (Estimate(300.0, 300.0, 300.0, "Hz"), "300 Hz"),
    ],
)
def test_quantities_are_written_as_people_do(e, text):
    assert quantity(e) == text


def test_linear_model_as_nominal_is_found_to_lack_saturation():
    """The project's first story as a gap: three recordings of a saturated motor, the linear model
    as nominal."""
    campaign = read_folder(recordings_folder() / "practice" / "p01")
    some = tuple(campaign[f] for f in ("locked_d", "locked_q_inject_q", "run_slow"))
    found = answer(linear(dataclasses.replace(campaign, recordings=some)))
    print(which_text(found), far_text(found))
    assert found.where[0].subsystem == "machine"
    assert found.diagnosis.best.effects == ("saturation",)
    p = found.position
    assert abs(p.recorded - p.simulated_after) < 0.2 * abs(p.recorded - p.simulated_before)
    assert p.believing_after < p.recorded


def test_a_point_that_no_drive_can_have_is_not_shown(small_answers, monkeypatch):
    """Leaving a subsystem out by the equations may lead anywhere: then the place is told from where
    it all began."""
    d = small_answers.diagnosis
    assert places.without(d, "inverter", alone=False) is not d.before.point

    def refused(*_):
        raise BadInput("none a drive can have")

    monkeypatch.setattr(places, "complete", refused)
    assert places.without(d, "inverter", alone=False) is d.before.point


def with_size(a, **changes):
    d = a.diagnosis
    return dataclasses.replace(
        a, diagnosis=dataclasses.replace(d, size=dataclasses.replace(d.size, **changes))
    )


def test_what_grows_is_not_said_to_fall(small_answers):
    assert small_answers.verdict != "no_gap"
    worse = with_size(small_answers, before=43.1, after=85.4, closed=-2.927, closed_ci95=None)
    assert far_text(worse).startswith(
        "Not at all: residuals grow from 43.1 times to 85.4 times the noise floor"
    )
    lost = with_size(small_answers, before=215.0, after=math.nan, closed=math.nan, closed_ci95=None)
    assert far_text(lost).startswith(
        "Not at all: what was fitted to the others predicts nothing finite"
    )
    assert "nan" not in far_text(lost)


@pytest.mark.parametrize(
    ("x", "text"), [(1.0, "1.00 times"), (12.34, "12.3 times"), (1.7e6, "1,700,000 times")]
)
def test_multiples_have_no_exponents(x, text):
    assert times(x) == text


def test_a_file_keeps_its_name_in_a_sentence(small_answers):
    """Its capitals, too; a subsystem's details are shares of its own part."""
    part = dataclasses.replace(
        decompose(
            small_answers.diagnosis.before.point, shown(small_answers.diagnosis.before.point)
        ),
        recordings={"Locked_STEPS.parquet": 0.8} | dict.fromkeys(map(str, range(11)), 0.0),
        directions={"along the voltage command": 0.7},
    )
    told = [f.text for f in places.sentences("sensor", 0.5, part)]
    assert any("Of the sensors' part 80 % is in Locked_STEPS.parquet" in t for t in told)
    whole = [f.text for f in places.sentences("sensor", 1.0, part)]
    assert all(t.count("mostly") <= 1 for t in [*told, *whole])
    assert any("80 % of the gap is in Locked_STEPS.parquet" in t for t in whole)


def test_a_diagnosis_is_a_result_of_the_page(quiet_answers, tmp_path):
    """Table, figure and one line, from the same answers as the JSON."""
    result = DiagnosisResult(quiet_answers)
    rows = result.to_table().to_pylist()
    hypotheses = result.as_json()["hypotheses"]
    assert {row["effects"] for row in rows} == {", ".join(h["effects"]) for h in hypotheses}
    assert len(rows) == sum(max(1, len(h["parameters"])) for h in hypotheses)
    assert result.verdict == "no_gap"
    assert "no effect, probability" in repr(result)
    assert len(result.plot(tmp_path / "gap.png").axes) == 1


def test_the_diagnosis_got_no_worse_since_the_last_release(small_answers):
    """By more than five standard deviations over draws of the noise
    (experiments/results/releases.md)."""
    kept, own = releases.last(), releases.scores(small_answers, "dead_time")
    assert set(own) == set(kept["diagnosis"])
    assert releases.worse(kept, "diagnosis", own) == []
    lost = own | {"probability of the truth": 0.3}
    assert [x.partition(":")[0] for x in releases.worse(kept, "diagnosis", lost)] == [
        "probability of the truth"
    ]

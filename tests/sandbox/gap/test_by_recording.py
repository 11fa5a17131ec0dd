"""Offsets that differ between recordings are named as an effect, beside others."""

import dataclasses

import pytest

from model.effect_files import effects_and_angles
from sandbox.gap.by_recording import parting, with_offset, with_offsets
from sandbox.gap.diagnose import diagnosis_of, verdict
from sandbox.gap.location.where import where
from sandbox.gap.planning.next_recording import Next
from sandbox.gap.report.answers import Answers, where_text, which_text
from sandbox.gap.report.diagnosis_json import document
from sandbox.gap.report.ranking import ranking
from sandbox.gap.report.simulator import refitted
from tests.sandbox.gap.conftest import TURNING, small_campaign

# which so little data cannot tell from each other
DELAYS = ("pwm_delay", "current_sampling", "current_filter")
OFF = {"slow.parquet": -0.012, "fast.parquet": 0.012}  # A, of sensor a


@pytest.fixture(scope="module")
def told():
    """Dead time on the switched bench, and offsets that differ."""
    cases = (("locked", "locked", 0.0, 25.0), *TURNING)
    plain = small_campaign({"dead_time.time": 2e-6}, cases)
    moved = tuple(
        dataclasses.replace(r, columns={**r.columns, "i_a": r.i_a + OFF.get(r.file, 0.0)})
        for r in plain.recordings
    )
    d = diagnosis_of(dataclasses.replace(plain, recordings=moved), exclude=DELAYS)
    return d, with_offsets(
        Answers(d, where(d), None, None, None, ranking=ranking(d, position=False))
    )


def test_both_are_named(told):
    d, a = told
    assert d.best.effects == ("dead_time",)
    assert a.diagnosis.best.effects == ("current_offset", "dead_time")
    # that the campaign's own offset is one as well counts, too
    own = sum(
        h.probability for h in d.hypotheses if set(h.effects) - {"current_offset"} == {"dead_time"}
    )
    assert a.diagnosis.best.probability == pytest.approx(own, rel=1e-6)
    assert verdict(a.diagnosis) == "explained"
    assert "offset of current sensor a -1" in which_text(a)
    assert "taken off" not in where_text(a) + which_text(a)


def test_shares_are_of_the_gap_as_recorded(told):
    """Squares of the offsets add to those of the rest: both shares sum to what is explained."""
    d, a = told
    shares = a.ranking.shares.of
    assert set(shares) == {"current_offset", "dead_time"}
    left = 1.0 + a.diagnosis.remainder.after
    gap, rest = a.diagnosis.remainder.before, d.remainder.before
    assert shares["current_offset"].value == pytest.approx(1.0 - rest / gap)
    assert sum(s.value for s in shares.values()) == pytest.approx(1.0 - max(left - 1.0, 0.0) / gap)
    steps = [j for _, j in a.ranking.shares.waterfall]
    assert a.diagnosis.size.before > steps[0] > steps[1]
    assert steps[1] == pytest.approx(a.diagnosis.size.after)


def test_json_holds_each_recording(told):
    d, a = told
    content = document(a.diagnosis, a.where, None, whole=a.ranking)
    first = {e["name"]: e for e in content["effects"][:2]}
    assert set(first) == {"current_offset", "dead_time"}
    own = first["current_offset"]
    assert own["probability"] > 0.999
    assert "in slow.parquet" in own["do"]
    assert first["dead_time"]["by_recording"] is None
    for r in own["by_recording"]:
        for sensor, true in zip("abc", (OFF[r["file"]], 0.0, 0.0), strict=True):
            x = r["parameters"][f"current_offset.offset_{sensor}"]
            assert abs(x["value"] - true) < x["ci95"][1] - x["ci95"][0]
    assert content["verdict"] == "explained"
    assert content["gap"]["before"] > d.size.before


def test_effects_toml_takes_them_off(told, tmp_path):
    _, a = told
    refitted(a.diagnosis).write(tmp_path)
    found = effects_and_angles(tmp_path / "effects.toml")
    assert found.offsets == {f: pytest.approx(x) for f, x in a.diagnosis.drifting.offsets.items()}


def test_the_name_stands_once():
    assert with_offset(()) == ("current_offset",)
    assert with_offset(("current_offset",)) == ("current_offset",)
    assert with_offset(("dead_time", "unknown")) == ("current_offset", "dead_time", "unknown")


def test_a_planned_recording_parts_sets_that_still_differ():
    planned = Next("locked", "locked rotor", 1.0, ((), ("current_offset",)), 9.0, 0.9)
    assert parting(planned) is None
    other = dataclasses.replace(planned, separates=((), ("dead_time",)))
    assert parting(other).separates == (("current_offset",), ("current_offset", "dead_time"))
    assert parting(None) is None


def test_where_nothing_differs_answers_stay(small_answers):
    assert with_offsets(small_answers) is small_answers

"""The simulator's error told in effects: what is beyond the noise, by the size of the gap; seals
and truths."""

import json

import pytest

from experiments.ordinary_size import RESULTS, summary, values_of
from sandbox.gap.settings import USUAL


def row(share, deviation, rms=1.0, campaign="a"):
    return {"campaign": campaign, "rms": rms, "share": share, "deviation": deviation}


def test_what_noise_explains_is_taken_off():
    """sqrt(0.005^2 - 0.003^2) = 0.004; a share below its deviation has nothing left; the mean
    square of both counts."""
    (told,) = summary([row(0.005, 0.003), row(0.001, 0.003, campaign="b")])
    assert (told["coordinates"], told["campaigns"]) == (2, 2)
    assert told["half_below"] == pytest.approx(0.002)  # of 0 and 0.004
    assert told["rms"] == pytest.approx(((0.016 - 0.008) / 2e3) ** 0.5)
    assert told["assumed"] == USUAL.trace_at(1.0)


def test_what_noise_leaves_unknown_says_nothing():
    """At rms 1 the ordinary size is 0.0114: a coordinate known to 0.006 is left out; each gap has
    its own line."""
    told = summary([row(0.5, 0.006), row(0.01, 0.001, rms=5.0), row(0.02, 0.001, rms=50.0)])
    assert [(t["from"], t["coordinates"]) for t in told] == [(3.0, 1), (30.0, 1)]


def test_values_of_a_truth_beside_its_campaign(tmp_path):
    text = 'effects = ["dead_time"]\n[dead_time]\ntime = 1e-6\n[true_motor]\nR = 1.0\n'
    (tmp_path / "p01.truth.toml").write_text(text)
    assert values_of(tmp_path, "p01") == {"dead_time.time": 1e-6}


def test_the_simulators_error_as_measured_is_within_what_is_assumed():
    """On each of the five plants and at each size of the gap, rms of all effects
    (`experiments.ordinary_size`)."""
    kept = json.loads((RESULTS / "ordinary_size.json").read_text())
    assert (kept["small"], kept["largest"]) == (USUAL.trace, USUAL.trace_most)
    rows = [(plant, row) for plant, own in kept["summary"].items() for row in own]
    assert len(kept["summary"]) >= 6  # five plants, and all of them together
    for plant, row in rows:
        assert row["rms"] <= row["assumed"], (plant, row)

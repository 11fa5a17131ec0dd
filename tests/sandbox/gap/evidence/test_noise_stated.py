"""The same answer where the noise of the sensors is stated a fifth too small or too large."""

import dataclasses

import pytest

from experiments.stated_noise import misstated
from model.effects import library
from sandbox.gap.diagnose import diagnosis_of, verdict
from sandbox.gap.evidence import noise
from sandbox.gap.evidence.noise import Noise, noise_of, parting
from sandbox.gap.evidence.priors import ordinary
from sandbox.gap.evidence.sensor_noise import SensorNoise
from sandbox.gap.report.answers import caveats
from sandbox.gap.report.diagnosis_json import document
from sandbox.gap.report.which import chance_of_unknown
from sandbox.output.files import plain
from sandbox.recordings.campaign import read_folder
from tests.schemas import misfits

CANDIDATES = {"dead_time", "stator_resistance", "encoder_offset"}
SMALL = {"current_offset", "dead_time", "stator_resistance"}


def test_a_fifth_of_stated_noise_changes_no_answer(small_folder):
    """A fifth is more than ten errors of the vote, so the stated value weighs exp(-74) at most:
    with 0.8 and 1.2 times the noise the floor is the same to rounding, the one that readings show,
    and with it all that follows; `unknown` to what fits that end within the same tolerance leave.
    What is overruled is said, and stands in `diagnosis.json`."""
    campaign = read_folder(small_folder)
    others = sorted(set(library.effect_names()) - CANDIDATES)
    low, high = (
        diagnosis_of(misstated(campaign, x), exclude=others, workers=1) for x in (0.8, 1.2)
    )
    shown = noise_of(campaign).seen
    assert (low.noise.used, high.noise.used) == (pytest.approx(shown), pytest.approx(shown))
    assert low.best.effects == high.best.effects == ("dead_time",)
    assert verdict(low) == verdict(high) == "explained"
    assert chance_of_unknown(low) == pytest.approx(chance_of_unknown(high), abs=1e-4)
    for d, share in ((low, 0.8), (high, 1.2)):
        assert "follows the readings more than the file" in d.caution
        c = plain(document(d, (), None))
        assert misfits("diagnosis", {"schema": 1, "command": "diagnose", "version": "", **c}) == []
        own = c["gap"]["noise"]
        assert own["stated"] == pytest.approx(share * noise_of(campaign).stated)
        assert (own["used"], c["gap"]["floor"]) == (pytest.approx(own["seen"]), 1.0)


@pytest.mark.parametrize("share", [0.8, 0.975, 1.0, 1.2])
def test_stated_noise_makes_no_gap_and_hides_none(quiet_folder, share):
    """Every effect of the library a candidate: without a gap none is found, nor `unknown` (0.05 is
    what a list that holds 95 % may leave out); an offset of one phase, ten times what is usual, is
    found by each."""
    quiet = read_folder(quiet_folder)
    found = diagnosis_of(misstated(quiet, share), workers=1)
    assert verdict(found) == "no_gap"
    assert chance_of_unknown(found) < 0.1
    offset = 10.0 * next(
        c.deviation for c in ordinary(quiet) if c.names[0].startswith("current_offset.")
    )
    moved = dataclasses.replace(
        quiet,
        recordings=tuple(
            dataclasses.replace(r, columns={**r.columns, "i_b": r.i_b + offset})
            for r in quiet.recordings
        ),
    )
    got = diagnosis_of(
        misstated(moved, share), exclude=sorted(set(library.effect_names()) - SMALL), workers=1
    )
    assert got.best.effects == ("current_offset",)
    assert chance_of_unknown(got) < 0.1


@pytest.mark.parametrize(
    ("seen", "said"),
    [
        (None, ""),
        (1.0, ""),
        (1.0177, ""),
        (1.0179, "follows the readings"),
        (0.975, "follows the readings"),
        (2.9, "follows the readings"),
        (0.34, "follows the readings"),
        (3.1, "may look larger"),
        (0.33, "may look smaller"),
    ],
)
def test_a_stated_noise_that_is_overruled_or_stands_against_the_readings_is_told(seen, said):
    """The seen one counts for more than half from 1.5 % x sqrt(2 ln 2) = 1.766 % on (0.975: the
    issue's campaign), and not at all beyond three times."""
    shown = None if seen is None else SensorNoise(seen, (), 0.015)
    found = parting(Noise(1.0, seen, noise.voted(1.0, shown)))
    assert said in found
    assert bool(found) == bool(said)


@pytest.mark.parametrize(
    ("seen", "chance", "told"), [(None, 0.2, True), (None, 0.01, False), (0.004, 0.2, False)]
)
def test_noise_that_only_the_file_knows_is_told_where_unknown_hangs_on_it(
    small_answers, seen, chance, told
):
    """Issue 19: 2.5 % less stated noise moved `unknown` from 0.002 to 0.446 without a caution."""
    d = small_answers.diagnosis
    more = dataclasses.replace(d.best, effects=(*d.best.effects, "unknown"), probability=chance)
    hypotheses = (dataclasses.replace(d.best, probability=1.0 - chance), more)
    found = dataclasses.replace(d, hypotheses=hypotheses, noise=Noise(0.004, seen, 0.004))
    text = " ".join(caveats(dataclasses.replace(small_answers, diagnosis=found)))
    assert ("so the stated 0.004 A counts alone" in text) == told

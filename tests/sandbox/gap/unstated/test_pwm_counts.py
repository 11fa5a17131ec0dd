"""Counts of a PWM timer to which duties are rounded, found where a campaign does not state them."""

import dataclasses

import numpy as np
import pytest

import sandbox
from model.drive_files import load_drive
from sandbox.gap.diagnose import diagnosis_of
from sandbox.gap.evidence.fit import fit, rms_of
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.gap.posterior.holdout import weights_of
from sandbox.gap.posterior.search import Problem, Search
from sandbox.gap.report.answers import where_text
from sandbox.gap.unstated.pwm_counts import Counted, added, parts_of, pwm_counts, with_counts
from sandbox.plant.sets import complete
from sandbox.replay.replay import prepare, replay
from tests.sandbox.gap.conftest import CASES, DRIVE, TURNING, small_campaign
from tests.schemas import misfits

# which so little data cannot tell from each other
DELAYS = ("pwm_delay", "current_sampling", "current_filter")
LOW = dataclasses.replace(
    DRIVE, motor=dataclasses.replace(DRIVE.motor, resistance=0.1 * DRIVE.motor.resistance)
)
WEAK = tuple((name, rotor, speed, 0.3 * size) for name, rotor, speed, size in CASES)
MORE = {"dead_time.time": 2e-6}


def small(counts, effects=(), cases=WEAK):
    """Return a campaign of a motor of small resistance on the switched bench, which rounds duties
    to counts."""
    return small_campaign(dict(effects), cases, drive=LOW, counts=counts)


def start(campaign):
    """Return a campaign's nominal point."""
    return ParameterPoint(
        prepare(campaign), complete(campaign.drive.motor, campaign.drive.converter)
    )


def null(campaign):
    """Return the point of ordinary deviations alone."""
    return fit(start(campaign), (), weights_of(len(campaign.recordings))).point


@pytest.mark.parametrize("counts", [300, 1000, 4000])
def test_predicted_is_what_a_replay_with_counts_adds(counts):
    """Two replays, with duties as they are and rounded, differ by what transitions foretell: to
    first order, so within some per cent of it (the flux's slope of the inductances), and within the
    second order of rounding itself."""
    campaign = small(counts)
    point = start(campaign)
    rounded = prepare(
        dataclasses.replace(campaign, drive=with_counts(LOW, counts)), steps=point.prepared.steps
    )
    before, after = (replay(p, [point.values]).currents for p in (point.prepared, rounded))
    for part, a, b in zip(parts_of(point), before, after, strict=True):
        moved, found = (b - a)[:, :, 0] / point.prepared.noise_std, added(part, counts)
        assert np.std(found - moved) < 0.03 * np.std(moved)


@pytest.mark.parametrize("counts", [300, 1000, 2000])
def test_counts_are_found_and_nothing_else(counts):
    """On the switched bench, whose equations are its own: the number itself, and J at the noise (14
    400 readings)."""
    d = diagnosis_of(small(counts), exclude=DELAYS, workers=1)
    assert (d.counted.value, d.counted.low, d.counted.high) == (counts, counts, counts)
    assert d.counted.clock == pytest.approx(2.0 * counts * 4000.0)
    assert d.best.effects == ()
    assert d.size.after == pytest.approx(1.0, abs=0.04)
    assert d.campaign.drive.converter.pwm_counts == counts


def test_an_effect_beside_them_is_named_alone_and_all_is_said(tmp_path):
    result = sandbox.diagnose(small(1000, MORE), exclude=DELAYS, jobs=1)
    d = result.answers.diagnosis
    assert d.counted.value == 1000
    assert d.best.effects == ("dead_time",)
    assert d.size.after == pytest.approx(1.0, abs=0.04)
    assert where_text(result.answers).startswith(d.counted.text)
    result.save(tmp_path / "out")
    assert misfits("diagnosis", tmp_path / "out" / "diagnosis.json") == []
    assert load_drive(tmp_path / "out" / "motor.toml").converter.pwm_counts == 1000


def test_offsets_that_drift_and_counts_are_both_stated():
    """Rounding shifts the means of turns, so offsets that were found before the counts are mended
    by what is left."""
    cases = (*WEAK, *TURNING)
    plain, off = small(1000, cases=cases), {"slow.parquet": -0.012, "fast.parquet": 0.012}
    moved = tuple(
        dataclasses.replace(r, columns={**r.columns, "i_a": r.i_a + off.get(r.file, 0.0)})
        for r in plain.recordings
    )
    search = Search(
        Problem(start(dataclasses.replace(plain, recordings=moved)), weights_of(len(moved)), DELAYS)
    )
    here, last = search.null, None
    while here is not None:
        last, here = here, search.restated(here, excerpts=False)
    known = search.problem.known
    assert known.counts.value == 1000
    for file, x in off.items():
        assert known.drifting.offsets[file] == pytest.approx(
            (x, 0.0, 0.0), abs=4.0 * known.drifting.errors[file]
        )
    assert rms_of(last) == pytest.approx(1.0, abs=0.04)
    steady = known.in_campaign(dataclasses.replace(plain, recordings=moved))
    for mine, true in zip(steady.recordings, plain.recordings, strict=True):
        # taken off twice it would differ by more
        assert np.allclose(mine.i_a, true.i_a, atol=1e-3)


def test_without_rounding_none_are_found():
    d = diagnosis_of(small(None, MORE), exclude=DELAYS, workers=1)
    assert d.counted is None
    assert d.best.effects == ("dead_time",)


@pytest.mark.parametrize("cases", [WEAK, WEAK[:2], WEAK[2:]])
@pytest.mark.parametrize(
    "effects",
    [
        {},
        MORE,
        {"current_offset.offset_b": 0.1},
        {"device_drop.on_resistance": 3.0},
        {"dc_link_error.sag": 0.5},
    ],
)
def test_what_is_missed_is_no_rounding(effects, cases):
    """What an effect adds that nobody fitted (J up to 200): dead time alone has 24 nats for 25
    counts, weighed by its misfit only, as counts so rough take the voltage away where the current
    is small."""
    assert pwm_counts(null(small(None, effects, cases))) is None


def test_stated_counts_and_slow_logs_are_left():
    point = null(small(1000))
    assert pwm_counts(point).value == 1000
    campaign = point.prepared.campaign
    for said in ({"pwm_counts": 1000}, {"pwm_frequency": 8000.0}):
        drive = dataclasses.replace(LOW, converter=dataclasses.replace(LOW.converter, **said))
        own = dataclasses.replace(
            point.prepared, campaign=dataclasses.replace(campaign, drive=drive)
        )
        assert pwm_counts(dataclasses.replace(point, prepared=own)) is None


def test_it_is_said():
    sure = Counted(3125, 3125, 3125, 75e6, 0.95, 30.0)
    assert "to 3125 counts of half a PWM period, a timer of 75 MHz" in sure.text
    assert "to about 3125 counts (3121 to 3127)" in sure._replace(low=3121, high=3127).text
    assert sure.as_json()["range"] == [3125, 3125]

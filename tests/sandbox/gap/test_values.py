"""Numbers of the diagnosis by hand: what its constants do to small equations that fit on a line."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from model.drive_files import load_drive
from model.effects import library
from model.effects.current_offset import OF_THREE
from model.errors import BadInput
from sandbox.gap.evidence import noise, priors
from sandbox.gap.evidence.algebra import Algebra, Prior, algebra, prior_of
from sandbox.gap.evidence.holdout import worst_share
from sandbox.gap.evidence.normal import Normal, block_length, turns
from sandbox.gap.evidence.priors import Coordinate
from sandbox.gap.evidence.spike_slab import Table, ordinary_share
from sandbox.gap.search.estimates import estimates
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign
from sandbox.replay.segments import Segment, blocks

US = 1e-6  # s


def equations(coordinates, *parts):
    """Return normal equations of (recording, A, g) each, one block, around zero."""
    p = len(coordinates)
    segments = tuple(
        Segment(k, "current", np.arange(p), np.array([a], dtype=float), np.array([g], dtype=float), np.zeros(1),
                np.ones(1)) for k, a, g in parts
    )  # fmt: skip
    return Normal(tuple(coordinates), np.zeros(p), segments, 1.0)


def dead_time(deviation=US):
    return Coordinate("dead_time.time", 0.0, deviation, "linear", ("dead_time.time",))


@pytest.mark.parametrize("moved", [0.0, 0.8])
def test_an_interval_by_hand(moved):
    """Curve 3, pull 6, prior deviation 1 (units of 1 us): value 6/(3 + 1) = 1.5, variance 1/4; scores that scatter less
    than that leave it.  Half the interval: the normal's 97.5 % point times the root of 1.15^2/4 and the square of half
    the 0.8 by which other effects' traces would move it."""
    own = equations([dead_time()], (0, [[3.0 / US**2]], [6.0 / US]))
    beside = equations([dead_time()], (0, [[3.0 / US**2]], [(6.0 - 4.0 * moved) / US]))  # at 1.5 - moved
    prior = prior_of(own.coordinates)
    fit = SimpleNamespace(normal=own, coordinates=own.coordinates, point=SimpleNamespace(values={}))
    j = SimpleNamespace(fit=fit, equations=algebra(beside), normal=beside, prior=prior, effects=("dead_time",))
    found = estimates(j)["dead_time.time"]
    half = norm.ppf(0.975) * np.sqrt(1.15**2 / 4.0 + (0.5 * moved) ** 2)
    assert found.value == pytest.approx(1.5 * US)
    assert (found.low, found.high) == (pytest.approx((1.5 - half) * US), pytest.approx((1.5 + half) * US))
    assert found.unit == "s"
    assert not found.at_bound


@pytest.mark.parametrize(("left", "share"), [((1,), 0.4), ((0,), 11.0 / 101.0), ((2,), 0.0)])
def test_what_holding_out_a_recording_costs(left, share):
    """One coordinate of deviation 1, A = 90, 10 and 0.  Without the second recording the fit keeps 91/101 of its
    variance and the check feels 10/100, which counts four times: 0.4.  Without the first the fit keeps 11/101 (and the
    check 4 times 0.9).  The third feels nothing."""
    own = [Coordinate("x", 0.0, 1.0, "linear", ("bench.x",))]
    n = equations(own, (0, [[90.0]], [0.0]), (1, [[10.0]], [0.0]), (2, [[0.0]], [0.0]))
    assert worst_share(n, left, [["x"]]) == pytest.approx(share)


def test_what_the_campaign_cannot_tell_spares_no_recording():
    """Information below 1 over the prior's variance: the group does not count; of no group the share is 0."""
    own = [Coordinate("x", 0.0, 1.0, "linear", ("bench.x",)), Coordinate("y", 0.0, 0.1, "linear", ("bench.y",))]
    n = equations(own, (0, np.diag([2.0, 99.0]), [0.0] * 2), (1, np.diag([2.0, 0.0]), [0.0] * 2))
    assert worst_share(n, (1,), [["x"], ["y"]]) == pytest.approx(3.0 / 5.0)
    assert worst_share(n, (1,), [["y"]]) == 0.0


@pytest.mark.parametrize(
    ("form", "to", "expected"),
    [
        ("linear", 4.0, {"bench.x": 4.0}), ("log", 0.0, {"bench.x": 1.0}), ("reciprocal", 4.0, {"bench.x": 0.25}),
        ("reciprocal", 0.0, {"bench.x": np.inf}), ("cosine", 4.0, {"bench.x": 5.0, "bench.p": np.arctan2(3.0, 4.0)}),
        ("sine", -4.0, {"bench.x": 4.0, "bench.p": -np.pi / 2}),
    ],
)  # fmt: skip
def test_where_a_coordinate_brings_its_parameters(form, to, expected):
    """From (x, p) = (3, 90 degrees): cosine part 0, sine part 3."""
    c = Coordinate("x", 0.0, 1.0, form, ("bench.x", "bench.p"))
    assert c.changes({"bench.x": 3.0, "bench.p": np.pi / 2}, to) == pytest.approx(expected)


def test_bounds_by_hand():
    """Mean 1, deviation 0.5, within 4: from -1 to 3; an inverse never below zero."""
    c = Coordinate("x", 1.0, 0.5, "linear", ("bench.x",), within=4.0)
    assert c.bounds() == (-1.0, 3.0)
    assert Coordinate("x", 1.0, 0.5, "reciprocal", ("bench.x",), within=4.0).bounds() == (0.0, 3.0)


def test_a_value_comes_within_a_millionth_of_what_no_drive_can_have():
    """A delay has to stay below six periods of 125 us (0.75 ms): of the range that a delay of 0.6 ms asks for, the part
    above is cut off, however wide the prior is; a drive with what is left can be simulated."""
    drive = load_drive("ipm_exchanged")
    values = complete(drive.motor, drive.converter)
    (delay,) = priors.of_effect("pwm_delay", drive, values, {**values, "pwm_delay.delay": 6e-4})
    assert delay.mean + delay.within * delay.deviation > 7.5e-4
    highest = delay.bounds()[1]
    assert highest == pytest.approx(7.5e-4 * (1.0 - 1e-6), rel=1e-9)
    complete(drive.motor, drive.converter, {"pwm_delay.delay": highest})
    with pytest.raises(BadInput, match="delay"):
        complete(drive.motor, drive.converter, {"pwm_delay.delay": 7.5e-4})


def test_how_far_a_search_goes():
    """Four deviations; from 99 % of them on twice as far as a point that is there.  An effect's prior is 1.5 typical
    sizes wide, an ordinary deviation is ordinary up to four of its own."""
    c = Coordinate("x", 0.0, 2.0, "linear", ("bench.x",))
    assert [priors.reach(c, {"bench.x": 2.0 * d}) for d in (1.0, 3.95, 3.97)] == pytest.approx([4.0, 4.0, 7.94])
    drive = load_drive("ipm_exchanged")
    own = library.neutral(drive.motor)
    (found,) = priors.of_effect("dead_time", drive, own)[:1]
    (time,) = (p for p in library.load_effect("dead_time").parameters if p.name == "time")
    assert found.deviation == pytest.approx(1.5 * time.reach_for(drive.motor, drive.converter))
    campaign = Campaign("c", drive, (), {}, {}, False)
    soft = {"bench.soft_current", "bench.soft_shape"}
    assert {c.within for c in priors.ordinary(campaign) if c.label not in soft} == {4.0}


def test_an_offset_is_a_thousandth_of_rated_current_unless_a_campaign_states_it():
    """Each axis of a vector of which all three phases have the deviation: the root of two thirds of it."""
    drive = load_drive("ipm_exchanged")
    for background, each in (({}, 1e-3 * drive.motor.rated_current), ({"current_offset": 0.03}, 0.03)):
        own = priors.ordinary(Campaign("c", drive, (), {}, background, False))
        found = [c.deviation for c in own if c.label.startswith("current_offset.")]
        assert found == pytest.approx([OF_THREE * each] * 2)


def test_a_load_cell_is_off_by_two_thousandths_of_rated_torque_unless_a_campaign_states_it():
    """Accuracy class 0.2 of a torque transducer."""
    drive = load_drive("ipm_exchanged")
    for background, deviation in (({}, 2e-3 * drive.motor.rated_torque), ({"load_torque_offset": 0.05}, 0.05)):
        own = priors.ordinary(Campaign("c", drive, (), {}, background, False))
        (found,) = (c for c in own if c.label == "bench.load_torque_offset")
        assert found.deviation == pytest.approx(deviation)


def test_the_widest_published_zone_of_a_sign_is_within_two_deviations():
    """0.54 A of 4.5 A, 12 % of rated current: eight times the usual width, beyond one deviation and within two."""
    drive = load_drive("ipm_exchanged")
    (width,) = (c for c in priors.soft_sign(drive.motor) if c.form == "log")
    away = (np.log(0.12 * drive.motor.rated_current) - width.mean) / width.deviation
    assert away == pytest.approx(np.log(8.0) / width.deviation)
    assert 1.0 < away < 2.0


def test_blocks_by_hand():
    """50 ms at 10 kHz are 500 samples; the last block takes what is left, half to one and a half long."""
    slow = SimpleNamespace(campaign=SimpleNamespace(drive=SimpleNamespace(converter=SimpleNamespace())), samples=10**6)
    slow.campaign.drive.converter.sampling_period = 1e-4
    assert block_length(slow) == 500
    slow.samples = 6_000_000  # ten minutes: 2000 blocks of 0.3 s
    assert block_length(slow) == 3000
    assert blocks(1249, 500) == [(0, 500), (500, 1249)]
    assert blocks(1251, 500) == [(0, 500), (500, 1000), (1000, 1251)]
    assert blocks(100, 500) == [(0, 100)]


def test_an_angle_is_known_to_its_floor_at_rest_and_to_three_tenths_of_it_in_motion():
    own = [SimpleNamespace(file=r, angle_name=r, rotor=r, angle_floor=2.0) for r in ("locked", "free", "driven")]
    assert [(c.deviation, c.within) for c in turns(SimpleNamespace(recordings=own))] == [
        (2.0, 4.0), (pytest.approx(0.6), 4.0), (pytest.approx(0.6), 4.0),
    ]  # fmt: skip


@pytest.mark.parametrize("mean", [0.0, 2.0])
@pytest.mark.parametrize(("bound", "pull"), [(-np.inf, 3.0), (0.0, 3.0), (0.0, -8.0)])
def test_evidence_is_the_integral_wherever_the_prior_stands(mean, bound, pull):
    """One coordinate, data exp(pull s - s^2) of s = x - 0.7, prior N(mean, 0.6) or its half above the mean, where a
    pull of -8 holds it."""
    own = Algebra(np.array([[2.0]]), np.array([pull]), 0.0, np.array([0.7]))
    low = mean + bound
    prior = Prior(np.array([mean]), np.array([0.6]), np.array([low]), np.array([np.inf]))

    def density(x):
        return np.exp(pull * (x - 0.7) - (x - 0.7) ** 2) * norm.pdf(x, mean, 0.6) * (2.0 if bound == 0.0 else 1.0)

    whole = quad(density, max(low, -20.0), 20.0, points=[mean + 1.0], limit=400)[0]
    assert own.log_evidence(prior) == pytest.approx(np.log(whole), abs=1e-6)


def test_ordinary_sizes_grow_with_what_is_left():
    """1 % of the wide prior near the floor, 2 % where ordinary deviations leave seven floors, never above 6 %."""
    assert [ordinary_share(r) for r in (0.0, 7.0, 21.0, 1000.0)] == pytest.approx([0.01, 0.02, 0.04, 0.06])


def test_a_trace_has_at_most_four_deviations():
    """Pull to 0.2 where the narrow prior is 0.02: held at 0.08, evidence that of a Gaussian cut there."""
    own = Algebra(np.array([[1e8]]), np.array([0.2e8]), 0.0, np.zeros(1))
    far = np.full(1, np.inf)
    narrow, wide = (Prior(np.zeros(1), np.full(1, sd), -far, far) for sd in (0.02, 1.5))
    t = Table(None, None, own, narrow, wide, {"x": (0,)}, np.array([True]))
    cut = Prior(np.zeros(1), np.full(1, 0.02), np.full(1, -0.08), np.full(1, 0.08))
    assert t.log_evidence([]) == own.log_evidence(cut) != own.log_evidence(narrow)


def test_a_quarter_of_the_blocks_of_white_noise_lie_below():
    """The 25th percentile of blocks' rms over the noise, drawn: 0.967 (1500 blocks: known to 0.15 %)."""
    rng = np.random.default_rng(4)
    i = 0.01 * rng.standard_normal((3, 400 * 1500 + 2))
    campaign = SimpleNamespace(recordings=(SimpleNamespace(i_a=i[0], i_b=i[1], i_c=i[2]),))
    own = noise._of_blocks(campaign, 25.0)
    assert own / 0.01 == pytest.approx(0.967, rel=5e-3)


@pytest.mark.parametrize(("seen", "expected"), [(1.4, 1.4), (1.6, 1.0), (0.7, 0.7), (0.6, 1.0)])
def test_the_noise_seen_votes_up_to_one_and_a_half(monkeypatch, seen, expected):
    monkeypatch.setattr(noise, "_of_blocks", lambda campaign, percentile: seen * 0.967)
    assert noise.floor_of(None, 1.0) == pytest.approx(expected)


def test_one_error_of_the_vote_away_both_count(monkeypatch):
    """1.5 % away in the logarithm: the seen one counts 1 - exp(-1/2)."""
    monkeypatch.setattr(noise, "_of_blocks", lambda campaign, percentile: 2.0 * np.exp(0.015) * 0.967)
    assert noise.floor_of(None, 2.0) == pytest.approx(2.0 * np.exp(0.015 * (1.0 - np.exp(-0.5))))


@pytest.mark.parametrize(("scatter", "is_seen"), [(1.25e-6, True), (0.8e-6, False)])
def test_what_a_float_rounds_is_no_noise(scatter, is_seen):
    """A sum that alternates by x has second differences of 4 x; the limit is 1e-6 of the largest reading, here 2 A."""
    swing = np.where(np.arange(2000) % 2, 1.0, -1.0) * 3.0 * (2.0 * scatter) / 4.0
    r = SimpleNamespace(i_a=np.full(2000, 2.0), i_b=np.full(2000, -1.0) + swing, i_c=np.full(2000, -1.0))
    assert (noise._of_blocks(SimpleNamespace(recordings=(r,)), 10.0) is not None) is is_seen


@pytest.mark.parametrize(("shown", "said"), [(1.0, ""), (3.1, "look larger than it is"), (0.51, "look smaller than")])
def test_noise_far_from_the_stated_one_is_told(monkeypatch, shown, said):
    """A scatter of half the stated noise is no reason to refuse; below it, it is."""
    scatter = [shown]
    monkeypatch.setattr(noise, "noise_floor", lambda converter: 1.0)
    monkeypatch.setattr(noise, "counted", lambda campaign: False)
    monkeypatch.setattr(noise, "_of_blocks", lambda campaign, q: scatter[0] * (0.967 if q == 25.0 else 1.0))
    r = SimpleNamespace(i_a=np.arange(3.0), i_b=np.arange(3.0), i_c=np.arange(3.0))
    own = SimpleNamespace(recordings=(r,), drive=SimpleNamespace(converter=None))
    found = noise.noise_caution(own)
    assert said in found
    assert bool(found) == bool(said)
    scatter[0] = 0.49
    with pytest.raises(BadInput, match="nothing could be seen"):
        noise.noise_caution(own)

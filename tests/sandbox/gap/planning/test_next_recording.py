"""The recommended recording: nothing to learn between a hypothesis and itself, much between dead
time and none."""

import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from model.energy import flux_from_current
from model.frames import stationary as stationary_kernel
from model.parameters import Limits
from sandbox.gap.evidence.fit import fit
from sandbox.gap.evidence.normal import ParameterPoint, normal
from sandbox.gap.planning import next_recording as discriminate
from sandbox.gap.planning.bench_table import bench_table, stated, write_bench_table
from sandbox.gap.planning.menu import FULL, Entry, demand, menu, recording_of, shaft, usual_seconds
from sandbox.gap.planning.next_recording import (
    LEANS,
    SURE,
    Next,
    Tried,
    as_predicted,
    expected_evidence,
    power,
    recommend,
    simulate_experiment,
    surprise,
)
from sandbox.gap.planning.within import FASTEST, allowed, within
from sandbox.gap.posterior.candidates import at_typical
from sandbox.gap.posterior.evaluated import evaluate
from sandbox.gap.posterior.holdout import weights_of
from sandbox.gap.posterior.linear_model import Linearisation
from sandbox.gap.settings import USUAL
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import NO_LIMITS, Campaign, CampaignRecording, read_folder
from sandbox.replay.replay import prepare, replay
from tests.sandbox.gap.conftest import DRIVE, start

stationary = stationary_kernel.py_func
PAGE = Path(__file__).parents[4] / "sandbox" / "recordings" / "RECORDING.md"


@pytest.fixture(scope="module")
def pair(small_folder):
    at = start(small_folder)
    weights = weights_of(len(at.prepared.recordings))
    chosen = [
        p for p in at_typical(at) if p.effect in ("dead_time", "device_drop", "encoder_offset")
    ]
    return [
        evaluate(fit(at, effects, weights), chosen, Linearisation(USUAL.trace_at(1.0)), weights)
        for effects in (("dead_time",), ("device_drop",))
    ]


def left(campaign, entry, j, changes=None):
    """Return r'r of an experiment that a hypothesis has predicted, replayed at its own set or a
    changed one."""
    told, truth = simulate_experiment(campaign, entry, j)
    belief = {**j.fit.point.values, **(changes or {})}
    return normal(
        ParameterPoint(as_predicted(prepare(told, belief, steps=1), truth), belief), ()
    ).summed()[2]


def test_nothing_tells_a_hypothesis_from_itself(pair):
    """Not even a free rotor, whose wanted motion is not the one that predicted currents give."""
    campaign = pair[0].fit.point.prepared.campaign
    one = {e.rotor: e for e in menu(campaign.drive)}
    for entry in one.values():
        assert left(campaign, entry, pair[0]) == pytest.approx(0.0, abs=1e-6), entry.name
        assert left(campaign, entry, pair[0], {"dead_time.time": 1e-6}) > 1.0, entry.name
        assert recommend(campaign, [(0.5, pair[0]), (0.5, pair[0])], 1.0, [entry.name]) is None


def test_an_eccentric_encoder_is_the_same_for_both(small_folder):
    """A driven rotor's angle is read with the eccentricity that both hypotheses have: nothing to
    learn from it."""
    at = start(small_folder)
    values = {
        **at.values,
        "encoder_eccentricity.amplitude_mech": 0.01,
        "encoder_eccentricity.phase": 1.0,
    }
    at = replace(at, values=values)
    weights = weights_of(len(at.prepared.recordings))
    chosen = [p for p in at_typical(at) if p.effect == "encoder_eccentricity"]
    own = evaluate(
        fit(at, ("encoder_eccentricity",), weights),
        chosen,
        Linearisation(USUAL.trace_at(1.0)),
        weights,
    )
    entries = {e.name: e for e in menu(at.prepared.campaign.drive)}
    for entry in (entries["driven_fast_q"], entries["driven_slow_dq"]):
        # many turns, and less than one
        campaign = at.prepared.campaign
        assert left(campaign, entry, own) == pytest.approx(0.0, abs=2e-3), entry.name
        assert left(campaign, entry, own, {"encoder_eccentricity.amplitude_mech": 0.0}) > 1.0, (
            entry.name
        )


def test_the_link_is_as_tight_as_control_allows(small_folder):
    """Within the limit everywhere, and near it, by the equations of the machine; steps of current
    ask for less."""
    drive = start(small_folder).prepared.campaign.drive
    motor = drive.motor
    for entry in menu(drive):
        columns = recording_of(
            read_folder(small_folder), entry, lambda torque: np.zeros(len(torque))
        ).recordings[0]
        used = np.hypot(columns.u_alpha, columns.u_beta).max() / (
            entry.link * drive.converter.voltage_limit
        )
        if entry.name == "driven_tight_link":
            d = (
                flux_from_current(motor.energy, 0.4 * motor.rated_current, 0.0)[0]
                + motor.magnet_flux
            )
            assert used == pytest.approx(
                entry.speed.max() * d / (entry.link * drive.converter.voltage_limit), rel=0.02
            )
            assert used == pytest.approx(FULL, rel=0.02)
        assert used < 0.95, entry.name


def test_a_bench_can_play_what_is_recommended(small_folder, tmp_path):
    """Every experiment's table keeps the limits; its voltages, played to the motor, make the
    currents asked for."""
    campaign = read_folder(small_folder)
    drive = replace(campaign.drive, converter=replace(campaign.drive.converter, current_noise=1e-3))
    rated = drive.motor.rated_current
    for entry in menu(drive, 0.25):
        asked = Next(entry.name, entry.description, 0.25, (("dead_time",), ()), 20.0, 0.97)
        found = bench_table(campaign, asked, drive)
        c, n = found.columns, len(found.columns["t_s"])
        assert {len(x) for x in c.values()} == {n}, entry.name
        assert all(np.isfinite(x).all() for x in c.values()), entry.name
        assert np.max(np.hypot(c["i_d_A"], c["i_q_A"])) <= rated * (1.0 + 1e-9)
        assert np.max(np.hypot(*stationary(c["u_a_V"], c["u_b_V"], c["u_c_V"]))) <= c["link_V"][
            0
        ] / math.sqrt(3.0)
        assert c["link_V"][0] == found.limits["link"] <= drive.converter.dc_bus_voltage
        assert found.recording["rotor"] == entry.rotor
    found = bench_table(campaign, replace(asked, entry="locked_circle", seconds=1.0), drive)
    c = found.columns
    i_d, i_q = played_currents(campaign, drive, c)
    # a control that follows with a lag of 5 ms (FOLLOWS) is 2 pi 2 / s x 5 ms = 6 % of the circle
    # behind
    assert np.max(np.hypot(i_d - c["i_d_A"], i_q - c["i_q_A"])[200:]) < 0.08 * rated
    path = tmp_path / "next_recording.csv"
    write_bench_table(path, found, asked)
    lines = path.read_text().splitlines()
    high, low = c["i_d_A"].max(), c["i_d_A"].min()
    assert f"i_d {low:.3g} to {high:.3g} A" in lines[0]  # what the columns ask for
    assert lines[1] == "# tells apart, with probability 0.97: dead_time; or no effect"
    head = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    again = dict(
        zip(lines[head].split(","), np.loadtxt(lines[head + 1 :], delimiter=",").T, strict=True)
    )
    assert again.keys() == c.keys()
    np.testing.assert_allclose(again["u_a_V"], c["u_a_V"], rtol=1e-6, atol=1e-6)


def test_no_table_goes_beyond_a_benchs_limits(small_folder):
    """A bench of 40 % of rated current and 30 % of rated speed, on half the link: what the motor
    then does, with the ripple of an injection and a free rotor's own speed, stays within; without
    limits the same menu goes beyond all."""
    campaign = read_folder(small_folder)
    drive, motor = campaign.drive, campaign.drive.motor
    bench = Limits(
        0.4 * motor.rated_current, 0.3 * motor.rated_speed_rpm, 0.5 * drive.converter.dc_bus_voltage
    )
    open_ones, held = np.zeros(3), np.zeros(3)
    for entry in menu(drive, 0.5):
        asked = Next(entry.name, entry.description, 0.5, (("dead_time",), ()), 20.0, 0.97)
        for most, limits in ((open_ones, NO_LIMITS), (held, bench)):
            if (found := bench_table(replace(campaign, limits=limits), asked, drive)) is None:
                continue
            c = found.columns
            most[:] = np.maximum(
                most, [found.limits["current"], np.max(np.abs(c["speed_rpm"])), c["link_V"][0]]
            )
            assert found.limits["current"] >= np.max(np.hypot(c["i_d_A"], c["i_q_A"])) * (
                1.0 - 1e-9
            )
            assert np.max(np.hypot(*stationary(c["u_a_V"], c["u_b_V"], c["u_c_V"]))) <= c["link_V"][
                0
            ] / math.sqrt(3.0)
    stated = np.array([bench.current, bench.speed_rpm, bench.voltage])
    assert (open_ones > stated).all()
    # the speeds of a table are differences of angles of 250 us: rounding of 1e-6 of them is not
    # beyond a limit
    assert (held <= stated * (1.0 + 1e-6)).all()
    assert (held > 0.9 * stated).all()  # and it uses what there is


@pytest.mark.parametrize("name", ["locked_d_inject_q", "locked_q_inject_d"])
def test_an_injections_ripple_counts(small_folder, name):
    """The table's voltages, played to the exact plant, keep the current's limit where the setpoints
    alone would not tell; 0.8 of rated current leaves room for the ripple of 0.2
    (`injection_defaults`)."""
    campaign = read_folder(small_folder)
    drive, most = campaign.drive, 0.8 * campaign.drive.motor.rated_current
    found = bench_table(
        replace(campaign, limits=Limits(most)), Next(name, "", 0.5, (("a",), ()), 20.0, 0.97), drive
    )
    c = found.columns
    assert np.max(np.hypot(c["i_d_A"], c["i_q_A"])) < 0.95 * most
    assert 0.98 * most < found.limits["current"] <= most
    assert np.max(np.hypot(*played_currents(campaign, drive, c))) <= most


def test_the_page_on_recording_names_experiments_of_the_menu(small_folder):
    """And those it recommends for a kind of bench need no other kind of rotor than the bench
    has."""
    known = {e.name: e.rotor for e in menu(read_folder(small_folder).drive)}
    text = PAGE.read_text(encoding="utf-8")
    named = set(re.findall(r"`((?:locked|driven|free)_\w+)`", text))
    assert len(named) >= 4
    assert named <= set(known)
    rows = [
        line.split("|")[2]
        for line in text.splitlines()
        if line.startswith(("| lock the", "| let it"))
    ]
    assert [{known[n] for n in re.findall(r"`(\w+)`", row)} for row in rows] == [
        {"locked"},
        {"free"},
    ]


def test_a_bench_does_what_it_can(small_folder):
    """Kinds of rotor it cannot have are left out; limits too low for any current leave no
    experiment; a free rotor without a stated limit stays near its rated speed however long it is
    accelerated."""
    drive = read_folder(small_folder).drive
    assert {e.link for e in allowed(drive, Limits(fixed_link=True))} == {1.0}
    assert stated(Limits(current=3.0, fixed_link=True)).startswith("3 A peak, link fixed: ")
    assert {e.link for e in allowed(drive, NO_LIMITS)} != {1.0}
    assert {e.rotor for e in allowed(drive, Limits(can=("locked", "free")))} == {"locked", "free"}
    assert [e.name for e in allowed(drive, NO_LIMITS)] == [e.name for e in menu(drive)]
    one = next(e for e in menu(drive) if e.name == "locked_q_inject_d")
    assert within(one, drive, Limits(current=1e-3)) is None  # the injection's ripple alone is more
    fast = next(e for e in menu(drive) if e.name == "driven_fast_q")
    weak = within(fast, drive, Limits(current=0.3 * drive.motor.rated_current))
    assert np.max(np.abs(weak.i_q)) < np.max(np.abs(fast.i_q))
    assert np.array_equal(weak.speed, fast.speed)  # a limit of current slows no imposed speed
    light = replace(drive, motor=replace(drive.motor, inertia=0.2 * drive.motor.inertia))
    coast = next(e for e in menu(light) if e.name == "free_coast")
    slower = within(coast, light, NO_LIMITS)
    assert np.max(slower.i_q) < 0.9 * np.max(coast.i_q)
    speed = demand(slower, light, shaft(complete(light.motor, light.converter), light))[1]
    assert 0.9 * FASTEST < np.max(np.abs(speed)) / light.motor.rated_omega < 1.001 * FASTEST


def played_currents(campaign, drive, c):
    """Return i_d, i_q (n,) that a table's voltages make in the exact plant at a locked rotor."""
    u = dict(
        zip(("u_alpha", "u_beta"), stationary(c["u_a_V"], c["u_b_V"], c["u_c_V"]), strict=True)
    )
    bench = {"t": c["t_s"], "theta": c["theta_rad"], "u_dc": c["link_V"], **u}
    columns = {**bench, **dict.fromkeys(("i_a", "i_b", "i_c"), 0 * c["t_s"])}
    one = CampaignRecording("next.parquet", "locked", "none", columns)
    read = replay(
        prepare(replace(campaign, drive=drive, recordings=(one,)), steps=1), [{}]
    ).currents[0][:, :, 0]
    return turned(*stationary(*read.T), c["theta_rad"])


def turned(alpha, beta, theta):
    return np.cos(theta) * alpha + np.sin(theta) * beta, np.cos(theta) * beta - np.sin(
        theta
    ) * alpha


def test_an_experiment_is_recommended_that_the_wrong_hypothesis_cannot_follow(pair):
    """The cards' own advice: a second link voltage, or zero crossings, part dead time from a
    device's drop."""
    campaign = pair[0].fit.point.prepared.campaign
    entries = [e.name for e in menu(campaign.drive)[:4]]
    rivals = [(0.6, pair[0]), (0.4, pair[1])]
    best = recommend(campaign, rivals, 1.0, entries)
    assert best is not None
    assert best.seconds == usual_seconds(campaign.drive)
    assert best.separates == (("dead_time",), ("device_drop",))
    entry = next(e for e in menu(campaign.drive) if e.name == best.entry)
    both = [expected_evidence(campaign, entry, a, [b], 1.0)[0][0] for a, b in (pair, pair[::-1])]
    assert best.gain == pytest.approx(min(both))
    assert best.power > 0.95
    assert recommend(campaign, rivals[:1], 1.0, entries) is None
    low = 0.3 * campaign.drive.motor.rated_current
    held = replace(campaign, limits=Limits(low))
    limited = recommend(held, rivals, 1.0, ["locked_circle"])
    assert limited is not None
    # what was weighed is what is asked for
    assert f"i_d {-low:.3g} to {low:.3g} A" in limited.description
    assert bench_table(held, limited, campaign.drive).limits["current"] <= low * (1.0 + 1e-9)
    # all are locked
    assert recommend(replace(campaign, limits=Limits(can=("free",))), rivals, 1.0, entries) is None


def test_surprise_is_minus_the_log_density_of_what_was_predicted():
    """Readings r = J x + noise, x about 0 with covariance C: a Gaussian of covariance 1 + J C J'
    (SciPy's density), in the mean over noise on top of r, by its trace."""
    rng = np.random.default_rng(3)
    j, c, r = rng.normal(size=(9, 3)), np.diag([0.5, 2.0, 0.1]), 2.0 * rng.normal(size=9)
    told = sum(surprise(j.T @ j, j.T @ r, float(r @ r), np.linalg.inv(c)))
    wide = np.eye(9) + j @ c @ j.T
    expected = -multivariate_normal(np.zeros(9), wide).logpdf(r) + 0.5 * np.trace(
        np.linalg.inv(wide)
    )
    assert told == pytest.approx(expected - 4.5 * math.log(math.tau) - 4.5, rel=1e-9)


def tried(told, missed=0.0, name="x", seconds=1.0):
    """Return an entry that brings evidence of its own (n, n), all of it what the other cannot
    follow."""
    told = np.array(told, dtype=float)
    np.fill_diagonal(told, np.inf)
    apart = np.where(np.isinf(told), 0.0, told)
    entry = Entry(name, name, "locked", np.zeros(1), np.zeros(1), np.zeros(1), seconds=seconds)
    return Tried(entry, told, apart, np.full(len(told), missed))


# four standard deviations of a share of the draws
SAMPLING = 4.0 * math.sqrt(0.25 / discriminate.DRAWS)


@pytest.mark.parametrize("missed", [0.0, 30.0])
def test_power_is_the_chance_that_the_truth_comes_to_stand_alone(missed):
    """Two rivals: log odds are normal about what is expected, its variance twice that and what the
    simulator misses."""
    rivals = [(0.6, None), (0.3, None)]
    more = 1.0 + 2.0 * LEANS**2 * missed
    needs = [math.log(19.0) - math.log(2.0), math.log(19.0) + math.log(2.0)]
    each = [
        norm.sf(n, e, math.sqrt(2.0 * e * more)) for n, e in zip(needs, (5.0, 8.0), strict=True)
    ]
    found = power(rivals, tried([[0, 5], [8, 0]], missed))
    assert found == pytest.approx((0.6 * each[0] + 0.3 * each[1]) / 0.9, abs=SAMPLING)
    assert power([(0.5, None), (0.5, None)], tried([[0, 0], [0, 0]])) == 0.0


def test_power_among_several_is_that_of_readings():
    """Four rivals equally far from each other, each a vector of readings, with white noise:
    posteriors of draws."""
    rng = np.random.default_rng(8)
    at = np.eye(4) * math.sqrt(8.0)  # |a - b|^2 / 2 = 8
    read = at[0] + rng.standard_normal((20000, 4))
    square = np.sum((read[:, None, :] - at) ** 2, axis=2)
    share = 1.0 / np.exp(-0.5 * (square - square[:, :1])).sum(axis=1)
    even = [[0 if k == m else 8 for m in range(4)] for k in range(4)]
    assert power([(0.25, None)] * 4, tried(even)) == pytest.approx(
        np.mean(share >= 0.95), abs=SAMPLING + 0.015
    )


@pytest.fixture
def chosen(monkeypatch):
    """Return a function that recommends where an entry tells what a table says, {(name, seconds):
    Tried or None}; of an entry's rotor, on a campaign whose rotor turned or was locked, with or
    without a nameplate."""
    empty, tables = np.zeros(1), []

    def of(rivals, table, *, rotor="driven", turned=False, rated_from_data=True):
        tables[:] = [table, rotor]
        recordings = (SimpleNamespace(rotor="free" if turned else "locked"),)
        return recommend(Campaign("own", DRIVE, recordings, {}, {}, rated_from_data), rivals, 1.0)

    def entries(drive, limits, seconds=1.0):
        """Return a menu of the table's names."""
        names = sorted({name for name, _ in tables[0]})
        return [Entry(n, n, tables[1], empty, empty, empty, seconds=seconds) for n in names]

    told = {
        "allowed": entries,
        "settings": lambda entry, drive: "as told",
        "usual_seconds": lambda drive: 1.0,
        "_tried": lambda c, e, r, t, w: tables[0].get((e.name, e.seconds)),
    }
    for name, own in told.items():
        monkeypatch.setattr(discriminate, name, own)
    return of


def test_nothing_is_to_turn_whose_speed_nobody_knows(chosen):
    """Locked recordings without a nameplate: no driven entry; with either, or a locked entry, there
    is one."""
    pair = [(0.5, SimpleNamespace(effects=("a",))), (0.5, SimpleNamespace(effects=("b",)))]
    table = {("x", 1.0): tried(even(40.0))}
    assert chosen(pair, table, turned=False) is None
    assert chosen(pair, table, turned=True).description == "x (as told)"
    assert chosen(pair, table, rated_from_data=False) is not None
    assert chosen(pair, table, rotor="locked") is not None


def even(x, n=2):
    return [[x] * n for _ in range(n)]


def test_what_is_sure_with_the_least_gap_is_chosen(chosen):
    pair = [(0.5, SimpleNamespace(effects=("a",))), (0.5, SimpleNamespace(effects=("b",)))]
    table = {
        ("big", 1.0): tried(even(60.0), 9.0, "big"),
        ("small", 1.0): tried(even(40.0), 2.0, "small"),
    }
    best = chosen(pair, {**table, ("broken", 1.0): None}, turned=True)
    assert (best.entry, best.gain, best.separates) == ("small", 40.0, (("a",), ("b",)))
    assert best.power > SURE


def test_a_longer_recording_is_asked_for_only_if_it_tells_more(chosen):
    """Power 0.7 in a second: two seconds do, or tell less than they promised, or cannot be made."""
    pair = [(0.5, SimpleNamespace(effects=("a",))), (0.5, SimpleNamespace(effects=("b",)))]
    first = {("x", 1.0): tried(even(4.5), 0.0, "x")}
    longer = {("x", 2.0): tried(even(20.0), 0.0, "x", 2.0)}
    assert 0.5 < chosen(pair, first, turned=True).power < SURE
    assert chosen(pair, first, turned=True).seconds == 1.0
    assert chosen(pair, first | longer, turned=True).seconds == 2.0
    poor = {
        ("x", 2.0): tried(even(4.0), 0.0, "x", 2.0),
        ("x", 4.0): tried(even(3.0), 0.0, "x", 4.0),
    }
    assert chosen(pair, first | poor, turned=True).seconds == 1.0
    assert chosen(pair, {("x", 1.0): tried(even(0.2), 0.0, "x")}, turned=True) is None


def test_all_rivals_count(chosen):
    """What parts the first two from each other but not from the third settles little."""
    three = [
        (0.4, SimpleNamespace(effects=("a",))),
        (0.35, SimpleNamespace(effects=("b",))),
        (0.25, SimpleNamespace(effects=("c",))),
    ]
    apart = tried([[0, 90, 0.1], [90, 0, 90], [0.1, 90, 0]], 0.0, "two")
    table = {("two", 1.0): apart, ("all", 1.0): tried(even(40.0, 3), 0.0, "all")}
    assert chosen(three, table, turned=True).entry == "all"


def test_a_longer_menu_holds_the_same_experiments_slower(small_folder):
    drive = start(small_folder).prepared.campaign.drive
    usual = usual_seconds(drive)
    for once, twice in zip(menu(drive), menu(drive, 2.0 * usual), strict=True):
        assert (once.name, twice.seconds) == (twice.name, 2.0 * once.seconds)
        assert len(twice.i_q) == pytest.approx(2 * len(once.i_q), abs=1)
        assert np.max(np.abs(twice.speed)) == pytest.approx(np.max(np.abs(once.speed)), rel=1e-3)
    fast = replace(
        drive, converter=replace(drive.converter, sampling_period=1.0 / 16000.0, pwm_frequency=None)
    )
    assert usual_seconds(fast) == pytest.approx(0.5)

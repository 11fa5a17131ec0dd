"""Values that reach a bound: bounds of effects widen, and what still stands at one is told wherever
it is shown."""

import dataclasses
import math
import tomllib
from types import SimpleNamespace

import numpy as np
import pytest

from model.drive_files import load_drive
from model.effects import library
from sandbox.gap.diagnose import Diagnosis
from sandbox.gap.evidence.algebra import Algebra, Prior, algebra, prior_of
from sandbox.gap.evidence.fit import fit
from sandbox.gap.evidence.normal import NormalEquations
from sandbox.gap.evidence.priors import FARTHEST, Coordinate, of_effect, ordinary, reach
from sandbox.gap.posterior import estimates as estimating
from sandbox.gap.posterior.estimates import (
    Estimate,
    Held,
    Spread,
    _of_part,
    estimates_with,
    held_ordinary,
)
from sandbox.gap.posterior.holdout import weights_of
from sandbox.gap.report.bounds import at_bound, sentence
from sandbox.output.refitted import Refitted
from sandbox.plant.sets import complete
from sandbox.recordings.campaign import Campaign
from sandbox.recordings.writing import write_campaign
from sandbox.replay.segments import Segment
from tests.sandbox.gap.conftest import CASES, small_campaign, start

DRIVE = load_drive("ipm_exchanged")
RIPPLE = ("dc_link_ripple.amplitude", "dc_link_ripple.phase")
GAIN = "current_gain.gain_a"


def test_a_component_of_an_amplitude_goes_twice_as_far_as_a_point_at_its_bound():
    """Deviation 2 along the cosine: 7.94 is 3.97 deviations, at the bound; the sine, at nothing,
    stays at four.  Both together never exceed what the card allows the amplitude."""
    cosine, sine = (Coordinate(f"x {form}", 0.0, 2.0, form, RIPPLE) for form in ("cosine", "sine"))
    at = dict(zip(RIPPLE, (7.94, 0.0), strict=True))
    assert (reach(cosine, at), reach(sine, at)) == pytest.approx((7.94, FARTHEST))
    assert math.hypot(cosine.bounds()[1], sine.bounds()[1]) == pytest.approx(
        library.parameters()["dc_link_ripple.amplitude"].high
    )


def test_a_ripple_beyond_its_first_bound_is_found(tmp_path):
    """Eight typical amplitudes, where the components' bound of 4 x 1.5 typical sizes leaves six:
    found within its own uncertainty.  Its voltage acts through the commanded one: 0.2 V of it is
    some ten times what 4800 readings of 4 mA leave."""
    typical = next(
        p for p in library.load_effect("dc_link_ripple").parameters if p.name == "amplitude"
    )
    size = 8.0 * typical.typical_for(DRIVE.motor, DRIVE.converter)
    true = {
        "dc_link_ripple.amplitude": size,
        "dc_link_ripple.phase": 0.0,
        "dc_link_ripple.frequency": 300.0,
    }
    at = start(write_campaign(tmp_path / "c", small_campaign(true, CASES[:3])))
    begun = dataclasses.replace(at, values={**at.values, "dc_link_ripple.frequency": 300.0})
    found = fit(begun, ("dc_link_ripple",), weights_of(3)).point.values
    assert found["dc_link_ripple.amplitude"] == pytest.approx(size, rel=0.01)
    (cosine,) = [
        c for c in of_effect("dc_link_ripple", DRIVE, begun.values, found) if c.form == "cosine"
    ]
    assert cosine.bounds()[1] > size


def test_a_size_is_searched_below_what_no_drive_can_have():
    """A link sags by less than a fifth at rated current (its card).  The search goes to 4 x 1.5
    typical sizes, 0.12 of it; where a fit is there the bound widens to 0.24, and the card's counts.
    A load's inertia, of which the logarithm is fitted, stays below the whole; downwards it goes as
    far as ever."""
    whole = complete(DRIVE.motor, DRIVE.converter)
    limit = 0.2 * DRIVE.converter.dc_bus_voltage / DRIVE.motor.rated_current
    there = {**whole, "dc_link_error.sag": 0.6 * limit}
    (sag,) = [
        c
        for c in of_effect("dc_link_error", DRIVE, whole, there)
        if c.names[0] == "dc_link_error.sag"
    ]
    assert sag.within * sag.deviation > 1.1 * limit
    assert sag.bounds()[1] == pytest.approx(limit, rel=1e-5)
    assert sag.bounds()[1] < limit
    inertia = whole["inertia.inertia"]
    begun = {
        **whole,
        "shaft_compliance.load_inertia": 0.5 * inertia,
        "shaft_compliance.stiffness": 100.0,
    }
    (load,) = [
        c
        for c in of_effect("shaft_compliance", DRIVE, begun)
        if c.names[0].endswith("load_inertia")
    ]
    assert math.exp(load.bounds()[1]) == pytest.approx(inertia, rel=1e-5)
    assert load.bounds()[0] == load.mean - load.within * load.deviation


@pytest.mark.parametrize(
    ("free", "told"), [((True, True), False), ((False, True), True), ((True, False), True)]
)
def test_an_amplitude_of_which_a_component_is_held_is_at_its_bound(free, told):
    card = library.load_effect("dc_link_ripple")
    own = [Coordinate(f"{RIPPLE[0]} {form}", 0.0, 2.0, form, RIPPLE) for form in ("cosine", "sine")]
    x, sd = np.array([8.0, 1.0]), np.array([0.1, 0.1])
    found = _of_part(card, 1, Spread(own, {}, x, sd, (x - sd, x + sd), np.array(free)))
    assert [found[name].at_bound for name in RIPPLE] == [told, told]


def held_fit(pull, *, widened=False):
    """Return a stand-in of a fit whose sensor's gain is pulled (in its prior deviations of 0.0015;
    curve 99), beside a resistance that rests."""
    campaign = Campaign("c", DRIVE, (), {}, {"current_gain": 0.0015}, False)
    own = [c for c in ordinary(campaign) if c.label in (GAIN, "stator_resistance.resistance")]
    if widened:
        own = [
            dataclasses.replace(c, deviation=3.0 * c.deviation) if c.label == GAIN else c
            for c in own
        ]
    mean, sd = np.array([c.mean for c in own]), np.array([c.deviation for c in own])
    place = [c.label for c in own].index(GAIN)
    a, g = 99.0 * np.diag(sd**-2.0), np.zeros(2)
    g[place] = 100.0 * pull / sd[place]
    part = Segment(0, "current", np.arange(2), a[None], g[None], np.zeros(1), np.ones(1))
    n = NormalEquations(tuple(own), mean, (part,), 1.0)
    values = complete(DRIVE.motor, DRIVE.converter)
    point = SimpleNamespace(values=values, prepared=SimpleNamespace(campaign=campaign))
    fitted = SimpleNamespace(normal=n, coordinates=n.coordinates, point=point)
    return SimpleNamespace(
        fit=fitted, equations=algebra(n), normal=n, prior=prior_of(own), effects=()
    )


def test_an_ordinary_deviation_at_four_deviations_is_told():
    """The issue's gain: 1 - 4 x 0.0015 = 0.994, with an interval as if it were free: 1.96 x 1.15 x
    0.0015/10 (and half of what traces would move it, here nothing) inwards."""
    (h,) = held_ordinary(held_fit(-6.0))
    assert (h.name, h.estimate.value, h.deviations) == (GAIN, pytest.approx(0.994), 4.0)
    assert h.estimate.at_bound
    assert h.estimate.low == pytest.approx(0.994)
    assert h.estimate.high - 0.994 >= 1.959964 * 1.15 * 1.5e-4 * (1.0 - 1e-9)


@pytest.mark.parametrize(("pull", "widened"), [(-3.9, False), (3.9, False), (-6.0, True)])
def test_what_is_inside_or_an_effects_own_is_not_told(pull, widened):
    """3.9 deviations are ordinary; a gain that an effect has made wide is told with the effect's
    parameters."""
    assert held_ordinary(held_fit(pull, widened=widened)) == []


def test_a_held_value_beside_a_free_regression_has_an_interval(monkeypatch):
    """Curve 3 and prior 1 (units of 1 us), held at 1: known to 1.15/2 as if it were free, with the
    regression as without it; the ordinary interval is narrower here and does not count."""
    us, far = 1e-6, np.full(1, np.inf)
    own = Coordinate("dead_time.time", 0.0, us, "linear", ("dead_time.time",))
    table = SimpleNamespace(coordinates=[own], point=SimpleNamespace(values={}))
    j = SimpleNamespace(model=table, prior=Prior(np.zeros(1), np.full(1, us), -far, np.full(1, us)))
    j.effects = ("dead_time",)
    j.equations = Algebra(np.array([[3.0 / us**2]]), np.array([6.0 / us]), 0.0, np.zeros(1))
    usual = Spread(
        [own],
        {},
        np.ones(1),
        np.full(1, 0.3 * us),
        (np.zeros(1), np.ones(1)),
        np.ones(1, dtype=bool),
    )
    monkeypatch.setattr(estimating, "spread", lambda _: usual)
    found = estimates_with(j, j.equations)
    e, half = found["dead_time.time"], 1.959964 * 1.15 / 2.0 * us
    assert (e.value, e.low, e.high, e.at_bound) == (
        pytest.approx(us),
        pytest.approx(us - half),
        pytest.approx(us + half),
        True,
    )


HELD = [
    Held(GAIN, Estimate(0.994, 0.994, 0.9943, "", at_bound=True), 4.0),
    Held("stator_resistance.resistance", Estimate(13.5, 13.4, 13.5, "ohm", at_bound=True), 4.0),
    Held("angles.a b.parquet", Estimate(1e-3, 9e-4, 1e-3, "rad", at_bound=True), 4.0),
    Held("bench.soft_current", Estimate(0.02, 0.01, 0.02, "A", at_bound=True), 3.0),
]


def test_a_reader_is_told_in_a_sentence():
    assert sentence([]) == ""
    one = sentence(HELD[:1])
    assert one.startswith(
        "The gain of current sensor a stands at its bound of 4 standard deviations: "
        "0.994. Either it"
    )
    found = sentence(HELD)
    assert "the stator resistance stands at its bound of 4 standard deviations: 13.5 Ω" in found
    assert "the angle of a b.parquet stands at its bound of 4 standard deviations: 1 mrad" in found
    assert (
        "changes its sign stands at its bound of 3 standard deviations: 20 mA. Either they" in found
    )


def test_the_files_for_the_simulator_flag_values_at_their_bounds(tmp_path):
    """Each line that holds such a value says so, no other; the files read as before."""
    delay = {
        "pwm_delay.delay": Estimate(1e-4, 9e-5, 1e-4, "s", at_bound=True),
        "r": Estimate(1.0, 0.9, 1.1, ""),
    }
    bounds = at_bound(delay, HELD)
    drive = dataclasses.replace(DRIVE, motor=dataclasses.replace(DRIVE.motor, resistance=13.5))
    effects = {
        "pwm_delay.delay": 1e-4,
        GAIN: 0.994,
        "bench.soft_current": 0.02,
        "dead_time.time": 1e-6,
    }
    ends = {"pwm_delay.delay": (9e-5, 1e-4)}
    files = {"a b.parquet": 1e-3}
    Refitted(
        drive, effects, files, ends, {"pwm_delay.delay": "s"}, {"a b.parquet": 1.0}, "t", bounds
    ).write(tmp_path)
    four = "at its bound of 4 standard deviations"
    lines = {
        x.partition(" = ")[0]: x
        for x in (tmp_path / "effects.toml").read_text().splitlines()
        if " = " in x
    }
    assert lines["pwm_delay.delay"].endswith(
        "# s, 95 % interval 9e-05 to 0.0001, at the bound of the search"
    )
    assert lines[GAIN].endswith(f"# fitted beside, {four}")
    assert lines["soft_current"].endswith("# fitted beside, at its bound of 3 standard deviations")
    assert "bound" not in lines["dead_time.time"]
    text = (tmp_path / "effects.toml").read_text()
    assert text.count(f'"a b.parquet" = 0.001  # {four}\n') == 1
    assert text.endswith('[residual]\n"a b.parquet" = 1.0\n')
    motor = (tmp_path / "motor.toml").read_text()
    assert f"resistance = 13.5  # {four}\n" in motor
    assert motor.count(four) == 1
    assert tomllib.loads(motor)["motor"]["resistance"] == 13.5


def test_a_diagnosis_holds_what_stands_at_a_bound():
    """The names of the fields, which `diagnosis.json` and the page read."""
    assert {"at_bound", "noise"} <= {f.name for f in dataclasses.fields(Diagnosis)}

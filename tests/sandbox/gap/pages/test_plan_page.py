"""The page of a plan: every experiment with its setpoints over time, and what all of them tell."""

from dataclasses import replace

import numpy as np
import pytest

from model.drive_files import load_drive
from model.parameters import Limits
from model.ratings import assumed
from sandbox.gap.pages.plan_page import setpoint_lines, write_plan
from sandbox.gap.planning.bench_plan import Plan, Planned, over, setpoints, with_encoder
from sandbox.gap.planning.menu import menu, settings
from sandbox.gap.planning.visible import Visible
from sandbox.recordings.campaign import NO_LIMITS


@pytest.fixture(scope="module")
def planned():
    """Return a plan of two experiments of the menu, what they tell made up."""
    drive = load_drive("ipm_exchanged")
    found = Visible(
        {"dead_time": 40.0, "device_drop": 2.0, "viscous_friction": 0.1},
        (("dead_time", "device_drop", 0.999),),
    )
    chosen = {e.rotor: e for e in menu(drive)}
    own = [
        Planned(chosen[r], settings(chosen[r], drive), found, ("dead_time",))
        for r in ("locked", "driven")
    ]
    return Plan(drive, tuple(own), found, NO_LIMITS)


def test_setpoints_are_those_of_the_experiment(planned):
    for p in planned.experiments:
        panels = dict(setpoint_lines(p, planned.drive))
        assert set(panels["current (A)"]) == {"i_d", "i_q"}
        assert ("speed (rpm)" in panels) == (p.entry.rotor == "driven")
        t, i_q = panels["current (A)"]["i_q"]
        at = np.round(np.array(t) / planned.drive.converter.sampling_period).astype(int)
        np.testing.assert_array_equal(i_q, p.entry.i_q[at])


def test_the_page_shows_all_of_it(planned, tmp_path):
    write_plan(tmp_path / "plan.html", planned, 2)
    page = (tmp_path / "plan.html").read_text(encoding="utf-8")
    for p in planned.experiments:
        assert f"{p.entry.name}.csv" in page
    assert page.count("<svg") == len(planned.experiments) + 1
    assert "still look alike" in page
    assert "Not told: viscous_friction" in page
    for p in planned.experiments:  # a sentence begins with a capital
        assert f"<p>{p.entry.description[0].upper()}{p.entry.description[1:]};" in page
    assert "then: sensorless check CAMPAIGN" in page
    assert "All experiments run at a DC link of " in page


def test_the_page_says_when_the_link_is_taken_as_fixed(planned, tmp_path):
    """Fixed where the bench says so, else adjustable with the experiments that ask for another
    voltage."""
    bus = f"{planned.drive.converter.dc_bus_voltage:.4g} V"
    fixed = replace(planned, limits=Limits(fixed_link=True))
    assert fixed.link.startswith(f"the DC link is taken as fixed at {bus}: ")
    write_plan(tmp_path / "fixed.html", fixed, 2)
    assert f"The DC link is taken as fixed at {bus}" in (tmp_path / "fixed.html").read_text()
    half = next(e for e in menu(planned.drive) if e.name == "driven_idle_half_link")
    first = planned.experiments[0]
    other = replace(planned, experiments=(first, replace(first, entry=half)))
    volts = 0.5 * planned.drive.converter.dc_bus_voltage
    assert f"(driven_idle_half_link {volts:.4g} V)" in other.link
    assert f"where yours stays at {bus}, give --fixed-link" in other.link


def test_setpoints_are_written_as_a_person_reads_them(planned):
    """-7.4399999999999995 is -7.44, and within seven digits of the experiment's own current."""
    for p in planned.experiments:
        rows = setpoints(p.entry, planned.drive)
        assert all(
            len(repr(x).lstrip("-").partition("e")[0]) <= 9 for r in rows for x in r.values()
        )
        step = round(1e-3 / planned.drive.converter.sampling_period)
        np.testing.assert_allclose([r["i_q_A"] for r in rows], p.entry.i_q[::step], rtol=1e-6)


def test_an_encoder_that_nobody_stated_is_told():
    """4096 counts: ENCODER of bench_plan."""
    drive = load_drive("ipm_exchanged")
    open_ = replace(drive, converter=replace(drive.converter, encoder_counts=None))
    (said,) = assumed(with_encoder(open_))
    assert said == "[drive] does not state encoder_counts; usual values stand in: " + (
        "encoder_counts = 4096 a turn"
    )


def test_the_share_is_that_of_the_time():
    """80 s that compile once, then pieces of 0.6 s (a public report: 8 % was shown at 81 s of
    88)."""
    ends = [80.6 + 0.6 * k for k in range(12)]
    assert over([], 0.0, 12) == 0.0
    for k in range(1, 13):
        assert over(ends[:k], 80.0, 12) == pytest.approx(ends[k - 1] / ends[-1])
    assert over([0.0], 0.0, 4) == 0.25

"""The page of a plan: every experiment with its setpoints over time, and what all of them tell."""

import numpy as np
import pytest

from model.drive_files import load_drive
from sandbox.gap.pages.plan_page import setpoint_lines, write_plan
from sandbox.gap.planning.bench_plan import Plan, Planned, over
from sandbox.gap.planning.menu import menu, settings
from sandbox.gap.planning.visible import Visible


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
    return Plan(drive, tuple(own), found)


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
    assert "not told: viscous_friction" in page


def test_the_share_is_that_of_the_time():
    """80 s that compile once, then pieces of 0.6 s (a public report: 8 % was shown at 81 s of
    88)."""
    ends = [80.6 + 0.6 * k for k in range(12)]
    assert over([], 0.0, 12) == 0.0
    for k in range(1, 13):
        assert over(ends[:k], 80.0, 12) == pytest.approx(ends[k - 1] / ends[-1])
    assert over([0.0], 0.0, 4) == 0.25

"""Two effects that recordings cannot part, named as a group by a whole diagnosis of the switched
bench."""

import pytest

from model.effects import library
from sandbox.gap.diagnose import diagnosis_of
from sandbox.gap.report.ranking import ranking
from tests.sandbox.gap.conftest import CASES, small_campaign

ALIKE = {"current_filter", "current_sampling"}
OTHERS = {"dead_time", "device_drop", "current_offset", "stator_resistance", "pwm_delay"}


def test_a_short_filter_and_late_sampling_are_a_group():
    """5 us of filter at 4 kHz: readings lag as if they came 5 us later, but where a pulse reaches
    into the lag, and these voltages leave zero vectors of 100 us.  Together they are sure (0.99, as
    in issue 19), each of them is not;
    what parts them is what their cards say: a link nearly used up."""
    own = small_campaign({"current_filter.time_constant": 5e-6}, CASES[2:])
    d = diagnosis_of(own, exclude=sorted(set(library.effect_names()) - ALIKE - OTHERS), workers=1)
    found = ranking(d, position=False).as_json()
    (group,) = found["groups"]
    assert set(group["effects"]) == ALIKE
    assert group["probability"] > 0.99
    assert all("DC link nearly used up" in group["parted_by"][e] for e in group["effects"])
    chances = {e["name"]: e["probability"] for e in found["effects"]}
    assert 0.02 < chances["current_sampling"] < chances["current_filter"] < 0.98
    assert chances["current_filter"] + chances["current_sampling"] == pytest.approx(1.0, abs=0.05)

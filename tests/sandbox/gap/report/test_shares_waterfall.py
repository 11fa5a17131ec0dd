"""How the gap shrinks from effect to effect: on real fits, those that have not seen the recordings
held out."""

import dataclasses

import numpy as np
import pytest

from sandbox.gap.evidence.gap_size import rms
from sandbox.gap.evidence.normal import normal
from sandbox.gap.evidence.spectrum import shown
from sandbox.gap.location.decompose import decompose
from sandbox.gap.pages.listed import waterfall
from sandbox.gap.pages.page import write_report
from sandbox.gap.pages.traces import whole_gap
from sandbox.gap.report.shares import with_part


def test_without_its_effects_a_fit_is_the_one_before(small_answers):
    """Ordinary deviations that follow the missing effect by algebra stand where a fit of them alone
    ends: what is left on the recordings held out agrees within the tenth that replay and slopes
    differ by at 20 floors."""
    d = small_answers.diagnosis
    assert d.held_out
    part = with_part(d, d.after.effects)
    # an ordinary deviation again
    assert part.values["dead_time.time"] == pytest.approx(0.0, abs=4.0 * 0.2e-6)
    assert rms(normal(part, ()), d.held_out) == pytest.approx(d.size.before, rel=0.1)
    assert rms(normal(with_part(d, ()), ()), d.held_out) == pytest.approx(d.size.after, rel=1e-3)


def test_a_step_knows_nothing_of_the_recordings_held_out(small_answers):
    """What they say is replaced by nonsense in the fit's equations: the point stays."""
    d = small_answers.diagnosis
    n = d.after.normal
    spoilt = [
        dataclasses.replace(s, g=1e3 * s.g + 1.0) if s.recording in d.held_out else s
        for s in n.segments
    ]
    other = dataclasses.replace(
        d, after=dataclasses.replace(d.after, normal=dataclasses.replace(n, segments=tuple(spoilt)))
    )
    one, two = (with_part(x, x.after.effects).values for x in (d, other))
    assert np.array_equal([one[k] for k in one], [two[k] for k in one], equal_nan=True)


def test_one_effect_has_a_waterfall_on_page_and_trace(small_answers, tmp_path):
    """Before, with dead time, noise: the figures of `gap`, each bar under its name."""
    labels, levels = waterfall(small_answers)
    size = small_answers.diagnosis.size
    assert labels == ["before", "+ dead time", "noise"]
    assert levels == [size.before, size.after, 1.0]
    d = small_answers.diagnosis
    parts = {
        "before": decompose(d.before.point, shown(d.before.point)),
        "after": decompose(d.after.point, shown(d.after.point)),
    }
    drawn = dict(whole_gap(small_answers, parts))["waterfall"]
    assert list(drawn.lines) == ["1_before", "2_dead_time", "3_noise"]
    assert np.array(list(drawn.lines.values())) == pytest.approx(np.diag(levels))
    write_report(tmp_path / "r.html", small_answers)
    assert "as effects are added one after the other" in (tmp_path / "r.html").read_text(
        encoding="utf-8"
    )

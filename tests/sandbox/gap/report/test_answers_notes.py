"""Notes and remains in words: which findings are still true after the fit, and what is said of what
is left."""

from types import SimpleNamespace

import pytest

from sandbox.gap.evidence.gap_size import OfRecording
from sandbox.gap.posterior.estimates import Estimate
from sandbox.gap.report import answers, left
from sandbox.gap.words import quantity
from sandbox.recordings.checks.mistakes import Unanswered
from sandbox.recordings.findings import Finding


def diagnosis(findings, *after):
    """A diagnosis of two parts of one recording, with the residuals that the best hypothesis
    leaves."""
    names = [f"run[{k}].csv" for k in range(len(after))]
    return SimpleNamespace(
        campaign=SimpleNamespace(
            findings=findings, recordings=[SimpleNamespace(file=n, origin="run.csv") for n in names]
        ),
        size=SimpleNamespace(
            recordings=[OfRecording(n, 9.0, x, False) for n, x in zip(names, after, strict=True)]
        ),
    )


@pytest.mark.parametrize(("after", "kept"), [((1.0, 1.09), False), ((1.0, 1.11), True)])
def test_a_contradiction_that_is_explained_is_no_note(after, kept):
    """All parts of its recording have to be met; what is wrong with the data itself stays, with a
    full stop."""
    stale = Unanswered(
        "run.csv", "u_alpha", 7, "run.csv: row 7: 110 % of the commanded voltage is unexplained"
    )
    own = Finding("run.csv", "theta", 3, "row 3: samples seem lost")
    found = answers.findings_of(diagnosis([stale, own], *after))
    assert found == [f"{stale.text}."] * kept + ["run.csv: row 3: samples seem lost."]


def remaining(effects, evaluated=None):
    best = SimpleNamespace(
        effects=effects, evaluated=SimpleNamespace(effects=evaluated or effects), probability=1.0
    )
    d = SimpleNamespace(
        best=best,
        hypotheses=[best],
        remainder=SimpleNamespace(before=125.0**2 - 1.0, after=0.0),
        held_out=(),
    )
    return left.remains_text(SimpleNamespace(diagnosis=d, remains=None, ranking=None))


@pytest.mark.parametrize(
    ("effects", "judged", "said"),
    [
        (
            ("dead_time", "inertia"),
            None,
            "With these effects residuals are 1.00 times the noise floor over all ",
        ),
        (
            ("dead_time",),
            None,
            "With this effect residuals are 1.00 times the noise floor over all ",
        ),
        (
            ("unknown",),
            ("dead_time",),
            "With dead time residuals are 1.00 times the noise floor over all ",
        ),
    ],
)
def test_what_is_left_is_told_with_the_effects_that_leave_it(effects, judged, said):
    assert remaining(effects, judged).startswith(f"{said}recordings (125 before);")


def test_no_effect_leaves_what_was_there():
    assert remaining(()).startswith("Residuals are 125 times the noise floor over all recordings;")


def test_inverse_inductances_have_no_prefix():
    assert quantity(Estimate(0.2377, 0.2367, 0.2388, "1/H")).startswith("0.2377 1/H")

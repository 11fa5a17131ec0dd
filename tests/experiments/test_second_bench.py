"""Scores of the second bench's rows, by hand on a few made-up rows; the order of a run."""

import pytest

from experiments import second_bench as bench
from experiments import second_bench_scores as scores
from sandbox.withheld.scoring.limits import Figure


def row(
    kind,
    causes,
    *sets,
    outside=(),
    chances=None,
    unknown=0.0,
    parameters=None,
    before=2.0,
    after=1.0,
):
    """A row of a campaign: causes (name, size, true values), sets (effects, probability)."""
    made = [{"name": n, "form": "own", "size": s, "with_background": v} for n, s, v in causes]
    listed = [{"effects": list(e), "probability": p} for e, p in sets]
    found = {
        "sets": listed,
        "in_set": [s["effects"] for s in listed],
        "chances": chances or {},
        "unknown": unknown,
        "parameters": parameters or {},
        "before": before,
        "after": after,
    }
    truth = {"causes": made, "outside": [{"name": n} for n in outside]}
    return {"name": "x", "kind": kind, "code": "c", "cpu": 9.0, "found": found, "truth": truth}


NOTHING: dict = {"causes": [], "outside": []}
INERTIA = ("inertia", 1.0, {"inertia": 1.05})


def test_the_first_set_has_to_be_the_truth_with_unknown_in_it():
    assert scores.right(row("one", [INERTIA], (["inertia"], 0.9)))
    assert not scores.right(row("one", [INERTIA], (["inertia", "unknown"], 0.9)))
    assert scores.right(row("outside", [INERTIA], (["inertia", "unknown"], 0.9), outside=["fan"]))


def test_a_size_is_off_by_half_widths_of_its_interval():
    """1.05 in 1.00 with 0.95 to 1.10: half of the way up, 0.98 of 1.96 deviations."""
    found = row(
        "one", [INERTIA], (["inertia"], 0.9), parameters={"inertia.inertia": [1.0, 0.95, 1.1]}
    )
    assert scores.deviations(found) == [pytest.approx(0.98)]


def test_a_failed_diagnosis_is_wrong_for_sure():
    failed = {**row("one", [INERTIA]), "found": {"failed": "it"}}
    assert scores.first(failed)[1] == 1.0
    assert not scores.right(failed)
    assert scores.false_names(failed)
    assert scores.raised(failed)
    assert not scores.noticed(failed)


def test_brier_against_a_constant():
    """Right at 0.9 and wrong at 0.4: (0.01 + 0.16) / 2 less (0.25 + 0.25) / 2."""
    rows = [row("several", [INERTIA], (["inertia"], 0.9)), row("several", [INERTIA], ([], 0.4))]
    assert scores.brier(rows).value == pytest.approx(0.085 - 0.25)


def test_f1_counts_what_is_named():
    """One of two found, one false: 2 * 1 / (2 + 2)."""
    two = [INERTIA, ("dead_time", 1.0, {})]
    assert scores.f1(row("many", two, chances={"inertia": 0.9, "magnet_flux": 0.6})) == 0.5


def test_rivals_are_compared_on_the_same_campaigns():
    """One campaign right by both, three by the rival alone: two-sided, 2 / 2^3; a campaign of the
    rival's own counts nowhere."""
    made = [
        {**row("one", [INERTIA], (e, 0.9)), "name": str(k)}
        for k, e in enumerate((["inertia"], [], [], []))
    ]
    found = [
        {**row("one", [INERTIA], (["inertia"], 1.0)), "name": str(k), "method": "bic"}
        for k in range(5)
    ]
    # of no campaign of ours: no line
    found.append({**found[0], "name": "elsewhere", "method": "gp"})
    line = scores.against_rivals(made, found)[-1]
    assert line.startswith("| bic | 4 | 4 | 1 | 3 | 0 | 0.25 | 0.00 | ")


def test_the_page_has_every_goal_and_says_what_was_not_run():
    found = scores.page([row("none", [], ([], 0.9))], {"none": 2, "one": 1}, 7)
    assert "1 of 2 none, 0 of 1 one" in found
    assert sum(line.startswith("| ") for line in found.splitlines()) > sum(
        len(g) for _, g in scores.GOALS.values()
    )


@pytest.mark.parametrize(
    ("value", "low", "high", "verdict"),
    [
        (0.0, 0.0, 0.95, "○"),  # one campaign
        (0.0, 0.0, 0.009, "✓"),
        (0.05, 0.02, 0.1, "✗"),
        (0.02, None, None, "✗"),
        (None, None, None, "–"),
    ],
)
def test_a_verdict_needs_limits_that_allow_no_other(value, low, high, verdict):
    goal = scores.Goal("false alarms", None, 0.01, lambda rows: Figure(None, None, None, 0))
    assert goal.verdict(Figure(value, low, high, 1)) == verdict


def test_every_kind_is_run_in_turn():
    """A run that ends early has seen each kind in proportion, within one; all are there, those
    whose seal is open at the end."""
    found = bench.places()
    assert len(set(found)) == len(found) == sum(bench.GROUPS.values())
    opened = bench.OPENED * bench.AT_ONCE
    blind = found[: -opened * len(bench.GROUPS)]
    assert all(k >= bench.OPENED for _, k, _ in blind)
    for n in (10, 50, 120):
        for kind, count in bench.GROUPS.items():
            seen = sum(k == kind for k, _, _ in blind[:n])
            assert abs(seen - n * (count - opened) / len(blind)) <= 1.0


def test_a_campaign_that_cannot_be_read_is_a_row_that_counts_as_wrong(tmp_path):
    """In a process of its own, as `--jobs` has them; nothing is begun once the time is over."""
    gone = [bench.Asked(tmp_path / "gone", f"one-0-{k}", "one", NOTHING) for k in range(2)]
    file = tmp_path / "rows.jsonl"
    bench.run(iter(gone), file, hours=0.0, jobs=1)
    assert not file.exists()
    bench.run(iter(gone), file, hours=1.0, jobs=2)
    rows = bench.lines(file)
    assert sorted(r["name"] for r in rows) == ["one-0-0", "one-0-1"]
    assert all("gone" in r["found"]["failed"] for r in rows)

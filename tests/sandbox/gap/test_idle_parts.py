"""Parts that do nothing any more are taken out, those that the recordings show stay."""

import dataclasses
from types import SimpleNamespace

import pytest

from model.effects import library
from sandbox.gap.evidence.fit import fit
from sandbox.gap.evidence.holdout import weights_of
from sandbox.gap.evidence.normal import Point
from sandbox.gap.evidence.probes import Probe
from sandbox.gap.search.estimates import estimates
from sandbox.gap.search.forward import Search
from sandbox.gap.search.judged import judge
from sandbox.gap.search.parts import idle as parts_idle
from sandbox.gap.search.parts.idle import alike, idle, standing, without_idle, without_part
from sandbox.plant.sets import complete
from sandbox.replay.replay import prepare
from tests.sandbox.gap.conftest import CASES, DRIVE, FLUX, FURTHER, SIXTH, TURNING, small_campaign

KEY = ("flux_harmonics",)


def searched(planted, begun):
    """Return a search whose set was fitted from begun values, on a bench with planted ones; and the weights."""
    prepared = prepare(small_campaign(planted, (CASES[0], *TURNING)))
    weights, chosen = weights_of(len(prepared.recordings)), (Probe("flux_harmonics", {}),)
    start = Point(prepared, complete(DRIVE.motor, DRIVE.converter))
    there = fit(dataclasses.replace(start, values={**start.values, **begun}), KEY, weights)
    named = judge(there, chosen, 0.01, weights, 1)
    return Search(there, (named,), 0.0, frozenset({KEY}), chosen, 0.01), weights  # what it began from is not asked


def test_a_part_that_the_bench_does_not_have_is_taken_out():
    """Orders 6 and 18 are on the bench; orders 12 and 24, with which the fit began, are not.  The order that stays is
    the third part, and parts 2 and 4 are free again."""
    third = {name.replace(".2.", ".3."): x for name, x in FURTHER.items()}
    more = {f"flux_harmonics.{k}.{n}": x for k, order in ((2, 12.0), (4, 24.0)) for n, x in
            (("order", order), ("psi_d", 1e-4 * FLUX), ("psi_q", 1e-4 * FLUX))}  # fmt: skip
    found, weights = searched({**SIXTH, **FURTHER}, {**third, **more})
    assert idle(found.judged[0]) == (("flux_harmonics", 2), ("flux_harmonics", 4))
    new = without_idle(found, 5.0, weights)
    (best,) = new.judged
    told = estimates(best)
    assert {name for name in told if name.count(".") > 1} == {*third, "flux_harmonics.3.phase"}
    assert told["flux_harmonics.3.order"].value == 18.0
    assert new.further["flux_harmonics.2.psi_d"] == 0.0
    assert new.further["flux_harmonics.3.psi_d"] == best.fit.point.values["flux_harmonics.3.psi_d"] != 0.0
    assert best.log_evidence > found.judged[0].log_evidence
    assert new.simulations > 0.0


def test_parts_that_the_recordings_show_stay():
    found, weights = searched({**SIXTH, **FURTHER}, FURTHER)
    assert idle(found.judged[0]) == ()
    assert without_idle(found, 5.0, weights) == found


COGGING = library.load_effect("cogging_torque")
NAMES = ("amplitude", "phase", "order_mech")


def at_orders(*orders):
    """Return a point whose cogging has such orders, the first in the first place; amplitudes are their places."""
    point = Point(prepare(small_campaign({}, CASES[:1])), complete(DRIVE.motor, DRIVE.converter))
    parts = [dict(zip(NAMES, (1e-3 * k, 0.2, order), strict=True)) for k, order in enumerate(orders, 1)]
    own = {COGGING.public(k, n): x for k, part in enumerate(parts, 1) for n, x in part.items()}
    return dataclasses.replace(point, values={**point.values, **own})


def test_a_further_part_takes_the_place_of_a_first_one_that_does_nothing():
    """Of cogging, whose parts have the same parameters; a harmonic's first part is of the sixth order and stays."""
    assert alike(COGGING)
    assert not alike(library.load_effect("flux_harmonics"))
    new = without_part(at_orders(168.0, 108.0, 24.0), COGGING, 1)
    neutral = library.neutral(DRIVE.motor)
    assert [new.values[COGGING.public(1, n)] for n in NAMES] == [2e-3, 0.2, 108.0]
    assert [new.values[COGGING.public(2, n)] for n in NAMES] == [neutral[COGGING.public(2, n)] for n in NAMES]
    assert [new.values[COGGING.public(3, n)] for n in NAMES] == [3e-3, 0.2, 24.0]


def test_the_only_part_stays():
    alone = at_orders(168.0)
    assert without_part(alone, COGGING, 1) is alone


def test_probes_start_where_the_part_that_took_the_place_stands():
    chosen = (Probe("cogging_torque", {"cogging_torque.order_mech": 168.0}), Probe("inertia", {}))
    new = without_part(at_orders(168.0, 108.0), COGGING, 1)
    moved = standing(chosen, new, {("cogging_torque", 1)})
    assert [p.start for p in moved] == [{"cogging_torque.order_mech": 108.0}, {}]
    assert standing(chosen, new, {("cogging_torque", 2)}) == chosen


class Orders:
    """Sets of one effect, a letter a part: how probable each is, and which parts may be zero, is told."""

    def __init__(self, monkeypatch, told, does_nothing):
        """told: log posterior by the parts that are there; does_nothing: which of them may be zero."""
        self.told = told
        monkeypatch.setattr(parts_idle, "level", lambda j, t: told[j.parts])
        monkeypatch.setattr(parts_idle, "on", lambda j: tuple(("c", k) for k, _ in enumerate(j.parts, 1)))
        monkeypatch.setattr(
            parts_idle, "idle", lambda j: tuple(("c", k) for k, p in enumerate(j.parts, 1) if p in does_nothing)
        )
        monkeypatch.setattr(parts_idle, "_better", self.better)

    def better(self, j, gone, found, t, weights, workers):
        """Return the set without the parts in these places, where it is told and more probable."""
        rest = "".join(p for k, p in enumerate(j.parts, 1) if ("c", k) not in gone)
        return (SimpleNamespace(parts=rest) if self.told.get(rest, -9.0) > self.told[j.parts] else j), 1.0


@pytest.mark.parametrize(
    ("told", "does_nothing", "expected"),
    [
        ({"ab": 0.0, "a": 1.0, "b": 5.0}, "ab", "b"),  # each may be zero beside the other; the better one stays
        ({"abc": 0.0, "c": 2.0, "bc": 9.0}, "ab", "c"),  # both at once, where the set is more probable so
        ({"abc": 0.0, "c": -1.0, "bc": 3.0, "ac": 1.0}, "ab", "bc"),  # else one of them
        ({"abcd": 0.0, "cd": -1.0, "bcd": 3.0, "acd": 1.0}, "ab", "bcd"),  # the next, now in its place, is tried again
        ({"ab": 0.0, "b": -1.0}, "a", "ab"),
    ],
)
def test_which_parts_that_do_nothing_are_taken_out(monkeypatch, told, does_nothing, expected):
    Orders(monkeypatch, told, does_nothing)
    best = SimpleNamespace(parts=max(told, key=len))
    while True:
        new, gone, _ = parts_idle._fewer(best, None, 1.0, {}, 1)
        if new is best:
            break
        best = new
    assert best.parts == expected
    assert gone == ()

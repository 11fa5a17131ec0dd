"""Campaigns that the diagnosis' tests make; a sealed check without recordings."""

import hashlib
import json
from types import SimpleNamespace

import pytest

from sandbox.gap.posterior.candidates import Candidate
from sandbox.gap.posterior.sets import possible
from sandbox.withheld.baselines import stepwise
from sandbox.withheld.baselines.screening import Promise, staying
from sandbox.withheld.baselines.stepwise import Visited
from sandbox.withheld.scoring import running
from tests.sandbox.gap.conftest import quiet_folder  # noqa: F401 - a fixture
from tests.sandbox.withheld.known import truth_of
from tests.sandbox.withheld.places import NOWHERE, Place, nothing


@pytest.fixture
def check(tmp_path):
    """A sealed check of five campaigns without recordings; a fake diagnosis needs their names
    only."""
    truths = {
        "w000": truth_of(),
        "w001": truth_of((), "none", (), {}),
        "w002": truth_of(("unknown",), "outside", (1.0,), {}),
        "w003": truth_of(("dead_time", "inertia"), "several", (1.0, 1.0), {}),
        "w004": truth_of(sizes=(0.25,)),
    }
    data = json.dumps({"campaigns": truths}).encode()
    (tmp_path / "truth.sealed").write_bytes(data)
    (tmp_path / "SHA256").write_text(f"{hashlib.sha256(data).hexdigest()}  truth.sealed\n")
    for name in truths:
        (tmp_path / "campaigns" / name).mkdir(parents=True)
    return tmp_path


@pytest.fixture
def in_this_process(monkeypatch):
    """Diagnose in this process, where a test's own functions are."""
    monkeypatch.setattr(running, "spread", lambda task, work, workers, lost: map(task, work))


@pytest.fixture
def on_a_table(monkeypatch):
    """Return a function that lets stepwise selection walk over a table {set: criterion} in place of
    fits, and returns the set with none, and the sets fitted, in turn.  A set that no two effects of
    a library may form fails where it is asked for; what a set promises is what it reaches."""
    out, table = [], {}

    def told(effects):
        """Return a set as the table has it."""
        assert possible(effects)
        value = table[frozenset(effects)]
        one = SimpleNamespace(
            point=Place({}, NOWHERE),
            cost=value,
            normal=SimpleNamespace(coordinates=()),
            estimates=nothing,
        )
        return Visited(tuple(sorted(effects)), one, value)

    def fitted(effects):
        """Return a set that is fitted."""
        out.append(frozenset(effects))
        return told(effects)

    def promises(point, known, choices, effects):
        """Return what joining reaches, exactly."""
        found = [
            Promise(table[frozenset((*staying(effects, p.effect), p.effect))], p) for p in choices
        ]
        return sorted(found, key=lambda p: p.criterion)

    def choices(point, without, left):
        """Return the effects that may join."""
        every = sorted({e for own in table for e in own})
        return [Candidate(e, {}) for e in every if e not in without]

    for name, own in (
        ("candidates", choices),
        ("with_usual_sign", lambda values, motor: values),
        ("screened", promises),
        ("visited", lambda point, probe, beside=(): fitted((*beside, probe.effect))),
        ("reduced", lambda whole, rest: fitted(rest)),
    ):
        monkeypatch.setattr(stepwise, name, own)

    def over(criteria):
        table.update({frozenset(k): v for k, v in criteria.items()})
        return told(()), out

    return over

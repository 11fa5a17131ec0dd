"""The command line as a door: called in this process, up to where the physics begins."""

from __future__ import annotations

import contextlib
import importlib
import pkgutil
import random
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from unittest import mock

import sandbox
from model.errors import PhysicsError
from tests.fuzz.doors import Outcome, called, listing
from tests.fuzz.mutations import damaged_call
from tests.fuzz.whole import (
    make_campaign,
    make_check,
    make_effects,
    make_map,
    make_motor,
    make_result,
)

REACHED = "the physics begins here"
SHORT = (
    "[scenario]\nsettle = 0.05\n[[segment]]\nduration = 0.1\n[[segment]]\nduration = "
    "0.1\nload = 1.0\nramp = 0.05\n"
)
PHYSICS = (  # replaced where the command line is tried: what stands before them is
    "sandbox.evaluation.compare.compare",
    "sandbox.evaluation.compare.single",
    "model.saliency.audit",
    "sandbox.evaluation.maps.maps",
    "sandbox.evaluation.bench.bench",
    "sandbox.evaluation.protocol.run_unit",
    "sandbox.recordings.identify.identify",
    "sandbox.gap.report.answers.answer",
    "sandbox.withheld.making.make.make",
    "sandbox.replay.replay.prepare",
    "sandbox.gap.planning.bench_plan.plan",
    "sandbox.gap.planning.visible.visible",
    "sandbox.withheld.scoring.blind.score",
    "sandbox.evaluation.protocol.reversal_case",
    "sandbox.evaluation.sweep.store.begin",
    "sandbox.public.exports.estimator.exported",
    "sandbox.public.verifying._again",
)


def call(arguments) -> Outcome:
    """Call the command line up to where the physics begins; getting there is being let in."""
    everything_imported()
    patches = [mock.patch(name, _reached) for name in PHYSICS]
    try:
        for p in patches:
            p.start()
        outcome = called(arguments)
    finally:
        for p in patches:
            p.stop()
    if outcome.kind == "refused" and REACHED in outcome.why:
        return Outcome("accepted", "", outcome.seconds)
    return outcome


@cache
def everything_imported():
    """Import all modules once: one that is imported while a function is replaced would keep the
    replacement."""
    for module in pkgutil.walk_packages(sandbox.__path__, "sandbox."):
        with contextlib.suppress(ImportError):  # an extra that is not installed
            importlib.import_module(module.name)


def _reached(*_, **__):
    raise PhysicsError(REACHED)


def make_home(folder):
    """Write what the calls name."""
    for make in (make_motor, make_campaign, make_map("csv")):
        make(folder)
    make_effects(folder)
    (folder / "s.toml").write_text(SHORT)
    (folder / "sweep.toml").write_text(SHORT)
    make_result(folder / "result")
    (folder / "campaign").mkdir()
    (folder / "check").mkdir()
    make_campaign(folder / "campaign")
    make_check(folder / "check")


def left_behind(folder: Path, before: set[str], words: Sequence[str]) -> set[str]:
    """Return what a call has left in a folder beside what lay there; `check` writes its findings,
    whatever they are."""
    own = {"check.json", "columns.toml"} if words[:1] == ["check"] else set()
    left = [folder / name for name in listing(folder) - before]
    kept = {p for p in left if p.name in own} | {
        d for p in left if p.name in own for d in p.parents
    }
    return {p.relative_to(folder).as_posix() for p in left if p not in kept}


def call_number(number: int) -> list[str]:
    """Return the damaged call of a number."""
    return damaged_call(random.Random(f"cli {number}"))

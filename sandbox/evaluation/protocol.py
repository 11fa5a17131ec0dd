"""One protocol for every estimator, belief and motor: runs the tests, keeps what is finished,
judges.

A unit is one test of one estimator with one belief on one motor.  Finished units are kept, a line
each, in `.protocol-<key>.jsonl` beside the results until all are done, so that an interrupted
protocol goes on where it stopped (sandbox/engine/journal.py); the key changes with the code and
with the seed.  A unit's name holds a hash of the drive: one of a motor file that was changed
meanwhile counts as not run.
"""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, astuple, dataclass, fields, replace
from pathlib import Path
from typing import Any

from estimators.registry import MODULES, AnyEstimator, load_estimator
from model.drive_files import fetched, load_drive
from model.errors import BadInput, PhysicsError, unknown
from model.kernels.kept import digest
from model.parameters import Drive
from sandbox.engine.journal import Journal, state_of_code
from sandbox.engine.processes import Workers, spread
from sandbox.evaluation.choice import ANY, Limits
from sandbox.evaluation.compare import distinct
from sandbox.evaluation.protocol_modulation import modulation
from sandbox.evaluation.protocol_motion import (
    bandwidth,
    beats_peer,
    hand_over,
    reversal,
    reversal_case,
    with_peer,
)
from sandbox.evaluation.protocol_names import BELIEFS, ESTIMATORS, usual_motors
from sandbox.evaluation.protocol_tests import (
    EvaluatedSegment,
    Outcome,
    attraction,
    costs,
    creep,
    load_step,
    mission,
    robustness,
    starting,
    static_map,
)
from sandbox.output.files import plain

Test = Callable[[Drive, AnyEstimator, str, int], Outcome]
TESTS: dict[str, Test] = {
    "start": starting,
    "static_map": static_map,
    "load_step": load_step,
    "creep": creep,
    "hand_over": hand_over,
    "robustness": robustness,
    "attraction": attraction,
    "bandwidth": bandwidth,
    "mission": mission,
    "reversal": reversal,
    "modulation": modulation,
    "cost": costs,
}
TWO = Workers(2)
SHARED = ("start",)  # the same for every estimator: run with the first
ONE_MOTOR = {"mission": "ipm_exchanged"}
PEER = "motulator 2.2 kW"  # the motor of the reversal
# with all that they import; estimators are looked up by name
MADE_BY = ("sandbox/evaluation/protocol.py", "estimators/*.py")


@dataclass(frozen=True)
class Unit:
    """One test of one estimator with one belief on one motor."""

    motor: str
    test: str
    estimator: str
    belief: str


@dataclass(frozen=True, repr=False)
class Row:
    """A finished unit; failure: the sentence of a run that the physics ended."""

    unit: Unit
    outcome: Outcome
    cpu_seconds: float
    failure: str | None = None

    def __repr__(self) -> str:
        unit, outcome = self.unit, self.outcome
        said = (
            f"{outcome.said()}, {len(outcome.points)} points"
            if self.failure is None
            else self.failure
        )
        return f"<Row: {unit.test}, {unit.estimator} {unit.belief} on {unit.motor}: {said}>"

    def as_json(self) -> dict[str, Any]:
        """Return what `protocol.json` says of it."""
        return {
            **asdict(self.unit),
            "metrics": dict(self.outcome.metrics),
            "passed": self.outcome.passed,
            "cpu_seconds": self.cpu_seconds,
            "failure": self.failure,
            "why_lost": self.outcome.why_lost,
        }


@dataclass(frozen=True, repr=False)
class Protocol:
    """All rows, in the order of motors, estimators, beliefs, tests."""

    rows: tuple[Row, ...]
    seed: int
    # CPU seconds a second and error rms (degrees) of motulator's reversal
    peer: tuple[float, float] | None = None
    limits: Limits = ANY  # of what is recommended

    def __repr__(self) -> str:
        return f"<Protocol: {len(self.rows)} rows, seed {self.seed}>"

    def as_json(self) -> dict[str, Any]:
        """Return what `protocol.json` holds beyond its header."""
        cpu = sum(row.cpu_seconds for row in self.rows)
        peer = {"cpu_s_per_s": self.peer[0], "rms_deg": self.peer[1]} if self.peer else None
        tests = [row.as_json() for row in self.rows]
        limits = self.limits._asdict()
        return {
            "seed": self.seed,
            "cpu_seconds": cpu,
            "limits": limits,
            "peer": peer,
            "tests": tests,
        }

    def with_reversal_of(self, cpu: float, rms: float) -> Protocol:
        """Return the protocol with the peer's reversal beside ours: CPU seconds a second, error rms
        (degrees)."""
        rows = []
        for row in self.rows:
            if row.unit.test == "reversal" and not row.failure:
                ratios = with_peer(row.outcome.metrics, cpu, rms)
                metrics = dict(row.outcome.metrics) | ratios
                row = replace(
                    row, outcome=replace(row.outcome, metrics=metrics, passed=beats_peer(ratios))
                )
            rows.append(row)
        return replace(self, rows=tuple(rows), peer=(cpu, rms))


def units(motors: Iterable[str], estimators: Iterable[str], tests: Iterable[str]) -> list[Unit]:
    """Return the units of a protocol in order, estimators by name; BadInput where there is none of
    a kind."""
    motors, estimators, tests = (
        list(dict.fromkeys(names)) for names in (motors, estimators, tests)
    )
    for kind, names in (("motor", motors), ("estimator", estimators), ("test", tests)):
        if not names:
            raise BadInput(f"no {kind} for the protocol; name at least one")
    found = []
    for motor in motors:
        for number, estimator in enumerate(estimators):
            for belief in BELIEFS:
                for test in tests:
                    if test == "reversal":
                        continue
                    if (test in SHARED and number) or (
                        test in ONE_MOTOR and not _is_chosen(motor, test, motors)
                    ):
                        continue
                    found.append(Unit(motor, test, estimator, belief))
    if "reversal" in tests:
        found += [
            Unit(PEER, "reversal", estimator, belief)
            for estimator in estimators
            for belief in BELIEFS[:1]
        ]
    return found


def _is_chosen(motor: str, test: str, motors: list[str]) -> bool:
    """Tell whether a test meant for one motor runs on this one: its own, or the first where that is
    not asked for."""
    own = ONE_MOTOR[test]
    return motor == (own if own in motors else motors[0])


def run_unit(unit: Unit, drive: Drive, estimator: AnyEstimator, seed: int) -> Row:
    """Run one unit; a PhysicsError becomes its failure, a BadInput a refusal."""
    begun = time.thread_time()
    failure = None
    try:
        outcome = TESTS[unit.test](drive, estimator, unit.belief, seed)
    except PhysicsError as error:
        outcome, failure = Outcome((), {}, False), str(error)
    except BadInput as error:
        # this estimator on this drive, such as rotating injection in two samples a turn
        outcome, failure = Outcome((), {"refused": 1.0}, None), str(error)
    return Row(unit, outcome, time.thread_time() - begun, failure)


def protocol(
    estimators: Iterable[AnyEstimator] = ESTIMATORS,
    motors: Iterable[str | Path | Drive] | None = None,
    tests: Iterable[str] = tuple(TESTS),
    *,
    seed: int = 0,
    workers: Workers = TWO,
    keep: Path | None = None,
    progress: Callable[[float], None] | None = None,
) -> Protocol:
    """Run every unit on threads, or on a dask cluster where one is given (estimators by name or
    file); `keep` is a folder in which finished units wait for the rest.

    Estimators and motors are names, files or objects; units of objects and of estimators from files
    are not kept, as nobody knows whether they are still the same later.  Raises BadInput for what
    cannot be run (before anything runs, as far as names and files go).
    """
    tests = list(dict.fromkeys(tests))
    for test in tests:
        if test not in TESTS:
            raise unknown("test", test, TESTS)
    drives = _distinct_motors(usual_motors() if motors is None else motors)
    asked = list(estimators)
    own = distinct(asked)
    todo = units(drives, own, tests)
    loaded = {**_loaded(drives), PEER: reversal_case()[0]}
    kept = Kept(keep, seed, {name: digest(_values_of(drive)) for name, drive in loaded.items()})
    missing = [u for u in todo if u not in kept.rows or isinstance(drives.get(u.motor), Drive)]
    lock, done = threading.Lock(), len(todo) - len(missing)
    if progress:
        progress(done / max(len(todo), 1))

    def keep_row(row: Row) -> None:
        """Keep a finished row."""
        nonlocal done
        unit = row.unit
        with lock:
            kept.add(
                row,
                lasting=unit.estimator in MODULES and not isinstance(drives.get(unit.motor), Drive),
            )
            done += 1
            if progress:
                progress(done / len(todo))

    if workers.cluster is not None:
        places = {name: place_of(which) for which in asked if (name := load_estimator(which).name)}
        tasks = [(u, loaded[u.motor], places[u.estimator], seed) for u in missing]
        for row in spread(_run_task, tasks, workers):
            keep_row(row)
    else:
        with ThreadPoolExecutor(workers.jobs) as pool:
            list(
                pool.map(
                    lambda u: keep_row(run_unit(u, loaded[u.motor], own[u.estimator], seed)),
                    missing,
                )
            )
    return Protocol(tuple(kept.rows[u] for u in todo), seed)


def _distinct_motors(motors: Iterable[str | Path | Drive]) -> dict[str, str | Path | Drive]:
    """Return motors by name, each once; BadInput where two of them bear one name."""
    drives: dict[str, str | Path | Drive] = {}
    for motor in motors:
        name = motor.name if isinstance(motor, Drive) else str(motor)
        if drives.setdefault(name, motor) is not motor and isinstance(motor, Drive):
            raise BadInput(f"two motors are called '{name}'; give one of them another name")
    return drives


def _loaded(motors: Mapping[str, str | Path | Drive]) -> dict[str, Drive]:
    """Return the drives of motors; what is to be downloaded comes after all else is read."""
    files = (m for m in motors.values() if not isinstance(m, Drive))
    read = {str(m): load_drive(m) for m in sorted(files, key=lambda m: fetched(str(m)))}
    return {n: m if isinstance(m, Drive) else read[str(m)] for n, m in motors.items()}


def _values_of(drive: Drive) -> bytes:
    """Return all values of a drive; a flux map is told by its hash."""
    return repr((drive.motor, drive.converter, drive.injection, drive.provenance)).encode()


def _run_task(task: tuple[Unit, Drive, AnyEstimator, int]) -> Row:
    return run_unit(*task)


def place_of(which: AnyEstimator) -> str:
    """Return an estimator's name or full path; BadInput for an object, which other processes cannot
    be told of."""
    if not isinstance(which, (str, Path)):
        raise BadInput(
            "a cluster's workers are told estimators by name or file; keep yours in a file"
        )
    return str(which) if which in MODULES else str(Path(which).resolve())


class Kept:
    """Finished units, in memory and, where a folder is given, in a file that outlives an
    interruption."""

    def __init__(self, folder: Path | None, seed: int, drives: Mapping[str, str]) -> None:
        """drives: a hash of each motor's drive by its name."""
        code = state_of_code(*MADE_BY)
        self.journal = Journal(folder / f".protocol-{code}-{seed}.jsonl" if folder else None)
        self.drives = drives
        self.rows: dict[Unit, Row] = {}
        for name, content in self.journal.entries.items():
            self._read(name, content)

    def _name(self, unit: Unit) -> str:
        return json.dumps([*astuple(unit), self.drives.get(unit.motor)])

    def _read(self, name: str, found: Any) -> None:
        try:
            unit = Unit(**found["unit"])
            outcome = Outcome(
                tuple(EvaluatedSegment(**p) for p in found["points"]),
                found["metrics"],
                found["passed"],
            )
            row = Row(unit, outcome, found["cpu_seconds"], found["failure"])
        except (KeyError, TypeError):  # of somebody else
            return
        if name == self._name(unit):
            self.rows[unit] = row

    def add(self, row: Row, lasting: bool = True) -> None:
        """Remember a finished unit; lasting: in the file, too."""
        self.rows[row.unit] = row
        content = {
            "unit": asdict(row.unit),
            "points": [asdict(p) for p in row.outcome.points],
            "metrics": dict(row.outcome.metrics),
            "passed": row.outcome.passed,
            "cpu_seconds": row.cpu_seconds,
            "failure": row.failure,
        }
        self.journal.add(self._name(row.unit), plain(content), lasting)


def forget(folder: Path) -> None:
    """Remove what interrupted protocols left in a folder."""
    for path in folder.glob(".protocol-*.jsonl"):
        path.unlink(missing_ok=True)


def tidy(result: Protocol) -> list[dict[str, Any]]:
    """Return the tidy table: a row per evaluated segment, or per test that has none."""
    nothing: dict[str, Any] = dict.fromkeys(f.name for f in fields(EvaluatedSegment))
    rows = []
    for row in result.rows:
        head = asdict(row.unit) | {"passed": row.outcome.passed}
        rows += [head | asdict(p) for p in row.outcome.points] or [head | nothing]
    return rows


def with_motulator(result: Protocol, anchors: Path, python: str | None) -> Protocol:
    """Return the protocol with motulator's reversal beside ours, measured now; BadInput where it is
    not at hand.

    python: one that has motulator; None: this one, or one in an environment that is made for it.
    """
    if not any(row.unit.test == "reversal" for row in result.rows):
        return result
    from sandbox.evaluation.bench import peer
    from sandbox.evaluation.peer_python import peer_python

    return result.with_reversal_of(*peer(anchors, peer_python(python), "lin", 4.0))

"""Blocks of runs: what one task does, the schema of its table, how many runs a block has."""

from __future__ import annotations

import time
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from model.errors import BadInput
from sandbox.engine.journal import state_of_code
from sandbox.evaluation.sweep.keys import keys
from sandbox.evaluation.sweep.plan import Sweep, again, label

if TYPE_CHECKING:
    import pyarrow

MADE_BY = (
    "sandbox/evaluation/sweep/blocks.py",
    "estimators/*.py",
    "model/effects/*.py",
    "model/motors/**/*.toml",
    "sandbox/drive/scenarios/*.toml",
)  # the first with all that it imports; the others are looked up by name
SMALLEST, LARGEST, WANTED = 10, 1000, 100  # runs in a block; blocks in a sweep
MOST_TRACED = 4_000_000  # numbers in the traces of a block: 32 MB
RESULTS = {  # name: (type, unit, what it is)
    "status": (
        "string",
        "",
        "ok, refused (bad input), failed (physics), error (of one's own code), crashed",
    ),
    "sentence": ("string", "", "why a run has no result; null where it has one"),
    "mean_deg": (
        "double",
        "deg",
        "mean position error over all settled scored segments; null where lock was lost",
    ),
    "rms_deg": ("double", "deg", "its rms"),
    "p95_deg": ("double", "deg", "95th percentile of its size"),
    "max_deg": ("double", "deg", "largest size of it"),
    "worst_mean_deg": ("double", "deg", "mean error of the segment where its size is largest"),
    "rms_mean_deg": ("double", "deg", "rms over the segments of their mean errors"),
    "lost_lock": (
        "bool",
        "",
        "a pole slipped, or the error stayed beyond 45 degrees, in any scored segment",
    ),
    "speed_held": ("bool", "", "the speed asked for was reached in every scored segment"),
    "loss_w": (
        "double",
        "W",
        "copper and core loss that the injection adds, the largest of any scored segment; null "
        "where injection_cost is not asked for",
    ),
    "torque_ripple": ("double", "of rated torque", "its torque ripple, rms, likewise"),
    "sound_db": (
        "double",
        "dB",
        "proxy for its sound, likewise (see sandbox/evaluation/injection_cost.py)",
    ),
    "tone_db": ("double", "dB", "its loudest tone alone, likewise"),
}
ARROW = {str: "string", bool: "bool", int: "int64", float: "double"}


class Task(NamedTuple):
    """Runs start to stop (not included) of a sweep, and the state of the code that is to make
    them."""

    text: str
    code: str
    start: int
    stop: int


class Block(NamedTuple):
    """What a task made: table (one row a run), traces (runs, channels, samples; NaN after a run's
    end) or None."""

    start: int
    table: pyarrow.Table
    traces: NDArray[np.float64] | None
    cpu_seconds: float
    kernel_seconds: float


def schema_of(sweep: Sweep) -> list[dict[str, str]]:
    """Return the columns of a sweep's table: name, type, unit, what it is."""
    found = [
        {"name": "run", "type": "int64", "unit": "", "what": "number of the run"},
        {"name": "point", "type": "int64", "unit": "", "what": "point of the random design"},
    ]
    for name in sweep.varied:
        key = keys()[name]
        found.append({"name": name, "type": ARROW[key.kind], "unit": key.unit, "what": key.what})
    return found + [
        {"name": n, "type": t, "unit": u, "what": w} for n, (t, u, w) in RESULTS.items()
    ]


def arrow_schema(sweep: Sweep) -> pyarrow.Schema:
    """Return the same for pyarrow; a field's metadata holds its unit where it has one."""
    import pyarrow as pa

    kinds = {"string": pa.string(), "bool": pa.bool_(), "int64": pa.int64(), "double": pa.float64()}
    return pa.schema(
        [
            pa.field(
                c["name"], kinds[c["type"]], metadata={"unit": c["unit"]} if c["unit"] else None
            )
            for c in schema_of(sweep)
        ]
    )


def tasks_of(sweep: Sweep) -> list[Task]:
    """Return the blocks of a sweep; they depend on the sweep alone, not on who runs them."""
    size, code = block_size(sweep), state_of_code(*MADE_BY)
    return [
        Task(sweep.text, code, a, min(a + size, sweep.runs)) for a in range(0, sweep.runs, size)
    ]


def block_size(sweep: Sweep) -> int:
    """Return the runs of a block: a hundred blocks, as far as they are neither tiny nor hold too
    many traces."""
    size = min(max(-(-sweep.runs // WANTED), SMALLEST), LARGEST)
    return max(1, min(size, MOST_TRACED // max(1, trace_numbers(sweep))))


def trace_numbers(sweep: Sweep) -> int:
    """Return how many numbers the traces of one run hold; 0 where none are kept."""
    return 0 if sweep.traces is None else len(sweep.traces.channels) * samples_of(sweep)


@cache
def _longest(text: str) -> int:
    """Return the recorded samples of the longest run; runs that are refused have none."""
    from model.errors import PhysicsError
    from sandbox.evaluation.sweep.cases import EACH_TIME, made_ready

    sweep, longest = again(text), 0
    bases = (
        tuple((k, v) for k, v in sweep.case(r).items() if k.partition(".")[0] not in EACH_TIME)
        for r in range(sweep.cells)
    )
    for base in dict.fromkeys(bases):
        try:
            longest = max(longest, made_ready(text, base).setup.samples)
        except (BadInput, PhysicsError):
            continue
    return longest


def samples_of(sweep: Sweep) -> int:
    """Return the samples that are kept of a run's trace."""
    return -(-_longest(sweep.text) // (sweep.traces.stride if sweep.traces else 1))


def run_block(task: Task) -> Block:
    """Run a block; BadInput where this process has another state of the code than the one that
    asks."""
    if task.code != state_of_code(*MADE_BY):
        raise BadInput(
            "a worker has another state of the code, or of numpy, scipy or numba; "
            "install the same there"
        )
    from sandbox.evaluation.sweep.cases import run_case

    sweep, begun = again(task.text), time.process_time()
    room = _room(sweep, task)
    cases, rows, kernel = [], [], 0.0
    for place, number in enumerate(range(task.start, task.stop)):
        case = sweep.case(number)
        run = run_case(sweep, case)
        cases.append(case)
        rows.append(run.row)
        kernel += run.kernel_seconds
        if room is not None and run.traces is not None:
            kept = run.traces[:, : room.shape[2]]
            room[place, :, : kept.shape[1]] = kept
    return Block(
        task.start,
        table_of(sweep, task.start, cases, rows),
        room,
        time.process_time() - begun,
        kernel,
    )


def _room(sweep: Sweep, task: Task) -> NDArray[np.float64] | None:
    """Return room for the traces of a task's runs."""
    if sweep.traces is None:
        return None
    return np.full((task.stop - task.start, len(sweep.traces.channels), samples_of(sweep)), np.nan)


def table_of(sweep: Sweep, start: int, cases: list[Any], rows: list[Any]) -> pyarrow.Table:
    """Return runs as a table: their numbers, cases and rows."""
    import pyarrow as pa

    numbers = range(start, start + len(cases))
    columns: list[Any] = [list(numbers), [n // sweep.cells for n in numbers]]
    columns += [
        [label(name, case[name]) if name in case else None for case in cases]
        for name in sweep.varied
    ]
    columns += [list(values) for values in zip(*rows, strict=True)]
    schema = arrow_schema(sweep)
    arrays = [pa.array(values, field.type) for values, field in zip(columns, schema, strict=True)]
    return pa.Table.from_arrays(arrays, schema=schema)


def crashed(task: Task) -> Block:
    """Return the block of runs whose process died."""
    from sandbox.evaluation.sweep.cases import CRASHED, Row

    sweep = again(task.text)
    cases = [sweep.case(number) for number in range(task.start, task.stop)]
    rows = [
        Row(CRASHED, "the process that ran it died (out of memory, or a crash in compiled code)")
    ] * len(cases)
    return Block(task.start, table_of(sweep, task.start, cases, rows), _room(sweep, task), 0.0, 0.0)

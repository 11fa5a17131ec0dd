"""Running a sweep: blocks handed to the engine, kept as they finish, gone on with after an
interruption."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from model.errors import BadInput
from sandbox.engine.processes import ALONE, Workers, spread
from sandbox.evaluation.sweep import store
from sandbox.evaluation.sweep.blocks import Block, Task, crashed, run_block, tasks_of, trace_numbers
from sandbox.evaluation.sweep.plan import Sweep

MOST_RUNS = 200_000
MOST_BYTES = 2e9
Progress = Callable[[int, int], None]  # runs finished, runs in all


def run_sweep(
    sweep: Sweep,
    folder: Path,
    workers: Workers = ALONE,
    *,
    afresh: bool = False,
    yes: bool = False,
    progress: Progress | None = None,
) -> store.Kept:
    """Run what is not finished of a sweep; return what its folder holds.

    afresh: forget what an earlier call has finished; yes: run it however large it is.  Raises
    BadInput before anything is written for what cannot be run.
    """
    check_size(sweep, yes)
    store.check_traces(sweep)
    kept = store.open_folder(sweep, folder, afresh)
    store.begin(kept)
    tasks = [t for t in tasks_of(sweep) if t.start not in kept.blocks]
    if progress is not None:
        progress(kept.runs, sweep.runs)
    for _ in finished(tasks, workers, lambda block: store.add(kept, block)):
        if progress is not None:
            progress(kept.runs, sweep.runs)
    return kept


def rows_of(sweep: Sweep, workers: Workers = ALONE, progress: Progress | None = None) -> Any:
    """Return all runs of a small sweep as one pyarrow table, by number; nothing is kept on disk."""
    import pyarrow as pa

    blocks: list[Block] = []
    for _ in finished(tasks_of(sweep), workers, blocks.append):
        if progress is not None:
            progress(sum(b.table.num_rows for b in blocks), sweep.runs)
    return pa.concat_tables([b.table for b in sorted(blocks, key=lambda b: b.start)])


def finished(tasks: Sequence[Task], workers: Workers, keep: Callable[[Block], None]) -> Any:
    """Yield after each block that is finished and kept."""
    if tasks and workers.jobs > 1 and workers.cluster is None:
        _compile(tasks[0])
    for block in spread(run_block, tasks, workers, None if workers.alone else run_again):
        keep(block)
        yield


def run_again(task: Task) -> Block:
    """Return the block of a task whose process died: in halves, until what kills it stands
    alone."""
    if task.stop - task.start == 1:
        return crashed(task)
    middle = (task.start + task.stop) // 2
    halves = [task._replace(stop=middle), task._replace(start=middle)]
    one, other = sorted(spread(run_block, halves, ALONE, run_again), key=lambda b: b.start)
    return together(one, other)


def together(one: Block, other: Block) -> Block:
    """Return two blocks, the second behind the first, as one."""
    import pyarrow as pa

    traces = None
    if one.traces is not None and other.traces is not None:
        traces = np.concatenate([one.traces, other.traces])
    return Block(
        one.start,
        pa.concat_tables([one.table, other.table]).combine_chunks(),
        traces,
        one.cpu_seconds + other.cpu_seconds,
        one.kernel_seconds + other.kernel_seconds,
    )


def _compile(task: Task) -> None:
    """Run the first cases here, so that what all processes compile is compiled once."""
    from sandbox.evaluation.sweep.cases import run_case
    from sandbox.evaluation.sweep.plan import again

    sweep, seen = again(task.text), set()
    for number in range(task.start, min(task.stop, task.start + sweep.cells)):
        case = sweep.case(number)
        if case["estimator"] not in seen:
            seen.add(case["estimator"])
            run_case(sweep, case)


def check_size(sweep: Sweep, yes: bool) -> None:
    """Raise BadInput, with the number of runs and their size, for more than anybody starts by
    mistake."""
    if yes:
        return
    if sweep.runs > MOST_RUNS:  # the traces' length is asked for below: that takes a design
        raise BadInput(
            f"{sweep.runs} runs, about {sweep.runs * store.BYTES_A_RUN / 1e6:.0f} MB of "
            "table, are more than "
            f"{MOST_RUNS}; add --yes (yes=True) if they are meant, or take fewer points or values"
        )
    traced = 8.0 * sweep.runs * trace_numbers(sweep)
    if traced > MOST_BYTES:
        raise BadInput(
            f"the traces of {sweep.runs} runs take {traced / 1e9:.1f} GB, more than "
            f"{MOST_BYTES / 1e9:g}; raise "
            "[traces] stride, keep fewer channels, or add --yes (yes=True)"
        )

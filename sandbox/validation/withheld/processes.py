"""Many tasks on several processes, none of which may take the others down with it."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context, parent_process
from typing import Any

THREADS = "OPENBLAS_NUM_THREADS"


def spread(
    task: Callable[[Any], Any], work: Sequence[Any], jobs: int, lost: Callable[[Any], Any] | None = None
) -> Iterator[Any]:
    """Yield task(item) for all items, as they finish, on so many processes.

    lost: what to do with an item whose process died (out of memory, a crash in compiled code) twice, the second time
    alone; without it that raises.  Only `jobs` items are under way at once, so an interrupt leaves no queue behind.
    One job, or a single item, needs no other process unless one may be lost.
    """
    if lost is None and (jobs == 1 or len(work) < 2):
        for item in work:
            yield task(item)
        return
    left = list(reversed(work))
    while left:
        suspects = yield from _pooled(task, left, min(jobs, len(left)))
        for item in suspects:
            try:
                with _pool(1) as alone:
                    yield alone.submit(task, item).result()
            except BrokenProcessPool:
                if lost is None:
                    raise
                yield lost(item)


def _pooled(task: Callable[[Any], Any], left: list[Any], jobs: int) -> Generator[Any, None, list[Any]]:
    """Yield results until nothing is left or a process dies; return the items that were under way then."""
    with _pool(jobs) as pool:
        running: dict[Future[Any], Any] = {}
        while left or running:
            try:
                while left and len(running) < jobs:
                    running[pool.submit(task, left[-1])] = left[-1]
                    left.pop()
                done, _ = wait(running, return_when=FIRST_COMPLETED)
                for future in done:
                    result = future.result()
                    del running[future]
                    yield result
            except BrokenProcessPool:
                return list(running.values())
    return []


def _pool(jobs: int) -> ProcessPoolExecutor:
    os.environ.setdefault(THREADS, "1")  # the processes share the cores already
    return ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=_end_with_parent)


def _end_with_parent() -> None:
    """End this process as soon as the one that started it is gone: interrupted, it leaves without a word."""
    threading.Thread(target=_watch, daemon=True).start()


def _watch() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)

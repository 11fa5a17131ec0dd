"""Many tasks on several processes or on a dask cluster, none of which may take the others down with
it.

The same engine runs sweeps, `withheld make` and `score`, and on a cluster the protocol.  A task is
an importable function of one item that can be pickled: paths and numbers, so that nothing large
travels.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process, util
from typing import Any, NamedTuple

from model.errors import BadInput

THREADS = "OPENBLAS_NUM_THREADS"
AHEAD = 2  # tasks that a thread of a cluster has at hand: one to work on, one to go on with
PATIENCE = 30.0  # s to wait for a scheduler and its first worker
_ENDING = threading.Event()  # set once: no process is started any more

Task = Callable[[Any], Any]
# a dask scheduler's address such as "tcp://10.0.0.1:8786", or a dask.distributed.Client
Cluster = Any


class Workers(NamedTuple):
    """Who works on many tasks: so many processes, or a cluster where one is given."""

    jobs: int = 1
    cluster: Cluster | None = None

    @classmethod
    def asked(cls, jobs: int | None, cluster: Cluster | None = None) -> Workers:
        """Return those asked for; without a number all cores."""
        return cls(jobs or os.cpu_count() or 1, cluster)

    @property
    def alone(self) -> bool:
        """Whether this process does all of it."""
        return self.jobs == 1 and self.cluster is None


ALONE = Workers()


def spread(
    task: Task, work: Sequence[Any], workers: Workers = ALONE, lost: Task | None = None
) -> Iterator[Any]:
    """Yield task(item) for all items, as they finish.

    lost: what to do with an item whose process died (out of memory, a crash in compiled code)
    twice, the second time alone, or on a cluster as often as its scheduler tries; without it that
    raises.  Only as many items are under way as there are hands, so an interrupt leaves no queue
    behind.  One job, or a single item, needs no other process unless one may be lost.
    """
    if workers.cluster is not None:
        yield from _on_cluster(task, work, lost, workers.cluster)
        return
    if lost is None and (workers.jobs == 1 or len(work) < 2):
        for item in work:
            yield task(item)
        return
    left = list(reversed(work))
    while left:
        suspects = yield from _pooled(task, left, min(workers.jobs, len(left)))
        for item in suspects:
            try:
                with _pool(1) as alone:
                    yield alone.submit(task, item).result()
            except BrokenProcessPool:
                if lost is None:
                    raise
                yield lost(item)


def _pooled(task: Task, left: list[Any], jobs: int) -> Generator[Any, None, list[Any]]:
    """Yield results until nothing is left or a process dies; return the items that were under way
    then."""
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


def end_processes() -> None:
    """Kill all processes started here and give their semaphores back, right before this one leaves
    by `os._exit`.

    That skips what multiprocessing does on the way out, and its resource tracker would complain of
    leaks.
    """
    _ENDING.set()
    for child in active_children():
        child.kill()
    util._run_finalizers(0)  # type: ignore[attr-defined]  # semaphores', not what waits for a queue's thread


def _pool(jobs: int) -> ProcessPoolExecutor:
    if _ENDING.is_set():  # what finds its process killed must not start another
        raise SystemExit
    os.environ.setdefault(THREADS, "1")  # the processes share the cores already
    return ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), initializer=_begin)


def _begin() -> None:
    """Leave Ctrl-C to the process that started this one, and end as soon as that one is gone,
    without a word."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_watch, daemon=True).start()


def _watch() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _on_cluster(
    task: Task, work: Sequence[Any], lost: Task | None, cluster: Cluster
) -> Iterator[Any]:
    """Yield results as a cluster finishes them; a worker that dies costs nothing but time."""
    with client_of(cluster) as client:
        from distributed import KilledWorker, as_completed

        left, items = list(reversed(work)), {}
        running = as_completed()

        def hand_out() -> None:
            """Give the cluster one more item."""
            if left:
                item = left.pop()
                future = client.submit(task, item, pure=False)
                items[future] = item
                running.add(future)

        for _ in range(AHEAD * max(1, sum(client.nthreads().values()))):
            hand_out()
        try:
            for future in running:
                item = items.pop(future)
                hand_out()
                if future.status == "finished":
                    yield future.result()
                    continue
                error = future.exception() if future.status == "error" else None
                if isinstance(error, KilledWorker) and lost is not None:
                    yield lost(item)
                elif error is not None and not isinstance(error, KilledWorker):
                    raise error
                else:
                    why = (
                        "a task killed its workers" if error is not None else "the cluster is gone"
                    )
                    raise BadInput(
                        f"dask: {why}; start it again and run the same command, which goes on"
                    )
        finally:
            client.cancel(list(items))  # interrupted: what nobody waits for


@contextmanager
def client_of(cluster: Cluster) -> Iterator[Any]:
    """Give the client of a scheduler's address, closed afterwards, or the client handed over;
    BadInput without one."""
    try:
        from distributed import Client
    except ImportError:
        raise BadInput(
            "a dask cluster needs dask.distributed; `pip install 'sensorless-sandbox[dask]'`"
        ) from None
    if not isinstance(cluster, (str, Client)):
        raise BadInput(
            f"{cluster!r:.60} is no cluster; give a scheduler's address, tcp://..., or a "
            "dask Client"
        )
    try:
        client = Client(cluster, timeout=PATIENCE) if isinstance(cluster, str) else cluster
    except (OSError, ValueError, TimeoutError) as error:
        raise BadInput(
            f"no dask scheduler answers at '{cluster}' ({error}); give its address, tcp://..."
        ) from None
    try:
        _wait_for_workers(client)
        yield client
    finally:
        if client is not cluster:
            client.close()


def _wait_for_workers(client: Any) -> None:
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        raise BadInput(
            f"the dask cluster has no worker after {PATIENCE:g} s; start some and run again"
        ) from None

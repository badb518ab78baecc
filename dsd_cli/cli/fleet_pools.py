"""Where the tasks of a fleet run: processes of this machine, or a Dask cluster; the same tasks either way.

A worker that dies takes its tasks with it. They are tried again one by one, so that the one that kills is known.
"""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from concurrent.futures.process import BrokenProcessPool, ProcessPoolExecutor
from multiprocessing import active_children, get_context
from typing import Any, Protocol

from dsd_cli.cli.fleet_tasks import Row, Task, failed, run_task
from dsd_cli.errors import DataError, UsageError, how_to_install

#: Tasks handed out per worker: one in work, one that waits for it.
AHEAD = 2


class Pool(Protocol):
    """Workers. `lost` : what a future raises when the worker that had it is gone."""

    lost: tuple[type[BaseException], ...]

    @property
    def workers(self) -> int: ...

    def submit(self, task: Task) -> Future[Row]: ...

    def renew(self) -> None:
        """Workers again, after some are gone."""

    def close(self) -> None: ...


def run_all(pool: Pool, tasks: Iterable[Task], retries: int, say: Callable[[str], None]) -> Iterator[Row]:
    """The rows of all tasks as they come; only a few tasks are out at any time."""
    waiting = iter(tasks)
    running: dict[Future[Row], Task] = {}
    while True:
        while len(running) < AHEAD * pool.workers and (task := next(waiting, None)) is not None:
            running[pool.submit(task)] = task
        if not running:
            return
        gone: list[Task] = []
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            yield from _result(pool, future, running.pop(future), gone)
        if gone:
            for future in wait(running).done:
                yield from _result(pool, future, running.pop(future), gone)
            say(f"a worker died; {len(gone)} log(s) that were handed out are tried again, one by one")
            pool.renew()
            yield from _one_by_one(pool, gone, retries)


def _result(pool: Pool, future: Future[Row], task: Task, gone: list[Task]) -> Iterator[Row]:
    try:
        yield future.result()
    except pool.lost:
        gone.append(task)


def _one_by_one(pool: Pool, tasks: list[Task], retries: int) -> Iterator[Row]:
    left = deque((task, 1) for task in tasks)
    while left:
        task, attempt = left.popleft()
        try:
            row = pool.submit(task).result()
        except pool.lost:
            pool.renew()
            if attempt < retries:
                left.append((task, attempt + 1))
                continue
            row = failed(task, f"the worker died {attempt} time(s) with this log alone: too little memory, or a crash")
        yield row


class ProcessPool:
    """Processes of this machine."""

    lost: tuple[type[BaseException], ...] = (BrokenProcessPool,)

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self._executor = self._started()

    def _started(self) -> Executor:
        # spawned, not forked: the libraries' threads do not survive a fork
        return ProcessPoolExecutor(self.workers, mp_context=get_context("spawn"), initializer=start_worker)

    def submit(self, task: Task) -> Future[Row]:
        try:
            return self._executor.submit(run_task, task)
        except BrokenProcessPool as error:  # it died idle
            broken: Future[Row] = Future()
            broken.set_exception(error)
            return broken

    def renew(self) -> None:
        self.close()
        self._executor = self._started()

    def close(self) -> None:
        """Nothing of what is still in work is wanted."""
        for worker in active_children():
            worker.terminate()
        self._executor.shutdown(wait=True, cancel_futures=True)


def start_worker() -> None:
    """A worker uses one core, leaves Ctrl-C to its parent, and does not outlive it."""
    import signal
    import warnings
    from multiprocessing import connection, parent_process

    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):  # the first is Arrow's as well
        os.environ[name] = "1"
    for name in ("SIGINT", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    warnings.simplefilter("ignore")
    parent = parent_process()

    def watch(sentinel: int) -> None:
        connection.wait([sentinel])
        os._exit(1)

    if parent is not None:
        threading.Thread(target=watch, args=(parent.sentinel,), daemon=True).start()


class DaskPool:
    """A Dask cluster: `local:N` starts one here, anything else is the address of a scheduler."""

    def __init__(self, where: str, timeout: float = 20.0) -> None:
        from importlib.util import find_spec

        if find_spec("distributed") is None:
            raise UsageError(f"--cluster {where}: distributed is not installed", how_to_install("cluster"))
        from distributed import Client
        from distributed.scheduler import KilledWorker

        self.lost: tuple[type[BaseException], ...] = (KilledWorker,)
        self._where, self._cluster = where, _local(where)
        try:
            self._client = Client(self._cluster or where, timeout=timeout, set_as_default=False)
        except (OSError, ValueError) as error:
            said = (str(error).splitlines() or [""])[0]
            raise DataError(
                f"--cluster {where}: no scheduler can be reached ({said})", "is its address right?"
            ) from None
        self._executor: Any = self._client.get_executor(pure=False, retries=0)

    @property
    def workers(self) -> int:
        """Threads of all workers; they may come and go."""
        return max(1, sum(self._client.nthreads().values()))

    def submit(self, task: Task) -> Future[Row]:
        future: Future[Row] = self._executor.submit(run_task, task)
        return future

    def renew(self) -> None:
        """The cluster starts its own workers again."""

    def close(self) -> None:
        self._client.close()
        if self._cluster is not None:
            self._cluster.close()


def _local(where: str) -> Any:
    if not where.startswith("local:"):
        return None
    from distributed import LocalCluster

    count = where.removeprefix("local:")
    if not count.isdecimal() or int(count) < 1:
        raise UsageError(f"--cluster {where}", "write local:N with N workers from 1, or the address of a scheduler")
    return LocalCluster(
        n_workers=int(count), threads_per_worker=1, processes=True, dashboard_address=None, silence_logs="CRITICAL"
    )

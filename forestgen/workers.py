"""Run jobs in worker processes, in a fixed order of results, with progress and a clean stop."""

from __future__ import annotations

import multiprocessing
import signal
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.queues import SimpleQueue
from typing import Any, TypeVar

from forestgen.errors import StageError

Job = TypeVar("Job")
Result = TypeVar("Result")

OnProgress = Callable[[int, str, int, int], None]
"""Called as (job's index, stage, done, total); stage '' means that the job has ended."""

Work = Callable[[Job, Callable[[str, int, int], None]], Result]

_messages: SimpleQueue[Any] | None = None  # in a worker: where progress goes


def run_parallel(
    work: Work[Job, Result], jobs: Sequence[Job], n_workers: int, on_progress: OnProgress | None = None
) -> list[Result]:
    """Results of `work(job, on_stage)` in the order of the jobs, whatever the number of workers.

    The first exception of a job ends all others and is raised.
    """
    report = on_progress or _silent
    if n_workers <= 1 or len(jobs) <= 1:
        results = []
        for index, job in enumerate(jobs):
            results.append(work(job, lambda stage, done, total, index=index: report(index, stage, done, total)))
            report(index, "", 1, 1)
        return results
    context = multiprocessing.get_context("spawn")
    messages: SimpleQueue[Any] = context.SimpleQueue()
    listener = threading.Thread(target=_listen, args=(messages, report), daemon=True)
    listener.start()
    strangers = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(min(n_workers, len(jobs)), context, _start_worker, (messages,))
    try:
        futures: list[Future[Result]] = [pool.submit(_run, work, index, job) for index, job in enumerate(jobs)]
        done = [future.result() for future in futures]
        pool.shutdown()
        return done
    except BrokenProcessPool as error:
        raise StageError("a worker process died, most likely for want of memory; try again with --jobs 1") from error
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in set(multiprocessing.active_children()) - strangers:
            child.terminate()
        messages.put(None)
        listener.join()


def _silent(index: int, stage: str, done: int, total: int) -> None:
    """Report nothing."""


def _listen(messages: SimpleQueue[Any], report: OnProgress) -> None:
    while (message := messages.get()) is not None:
        report(*message)


def _start_worker(messages: SimpleQueue[Any]) -> None:
    global _messages
    _messages = messages
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends its workers itself


def _run(work: Work[Job, Result], index: int, job: Job) -> Result:
    queue = _messages
    if queue is None:
        raise ValueError("_run belongs in a worker started by run_parallel")
    result = work(job, lambda stage, done, total: queue.put((index, stage, done, total)))
    queue.put((index, "", 1, 1))
    return result

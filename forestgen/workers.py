"""Run jobs in worker processes, in a fixed order of results, with progress and a clean stop.

Workers are fresh interpreters at the other end of a pipe. They never import the caller's main module,
so a script needs no `if __name__ == "__main__"`, and they end with their parent, however that ends.
"""

from __future__ import annotations

import logging
import pickle
import signal
import subprocess
import sys
import traceback
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, Pipe, wait
from typing import Any, TypeVar

from forestgen.blas import on_one_thread
from forestgen.errors import StageError
from forestgen.interrupts import uninterrupted

Job = TypeVar("Job")
Result = TypeVar("Result")

OnStage = Callable[[str, int, int], None]
"""Called inside a job as (stage, done, total)."""

OnProgress = Callable[[int, str, int, int], None]
"""Called as (job's index, stage, done, total); stage '' means that the job has ended."""

Work = Callable[[Job, OnStage], Result]

SERVE = "import sys; sys.path[:] = {path!r}; from forestgen.workers import serve; serve({handle}, {level})"


def run_parallel(
    work: Work[Job, Result], jobs: Sequence[Job], n_workers: int, on_progress: OnProgress | None = None
) -> list[Result | StageError]:
    """Results of `work(job, on_stage)` in the order of the jobs, whatever the number of workers.

    A StageError of a job takes its result's place, and so does the death of its worker: the other jobs
    go on. Any other exception ends all jobs and is raised. With one worker, or one job, all happens here.
    """
    report = on_progress or _silent
    if n_workers <= 1 or len(jobs) <= 1:
        return [_run_here(work, index, job, report) for index, job in enumerate(jobs)]
    waiting = deque(range(len(jobs)))
    results: dict[int, Result | StageError] = {}
    crew: dict[Connection, _Worker] = {}
    try:
        while len(results) < len(jobs):
            while waiting and len(crew) < n_workers:
                worker = _Worker()
                crew[worker.connection] = worker
                worker.start(work, waiting[0], jobs[waiting[0]])
                waiting.popleft()
            for connection in wait(list(crew)):
                worker = crew[connection]  # type: ignore[index]
                index, message = worker.index, worker.receive()
                if message[0] == "stage":
                    report(index, *message[1:])
                    continue
                if message[0] == "error" and not isinstance(message[1], StageError):
                    raise message[1]
                results[index] = message[1]
                report(index, "", 1, 1)
                if message[0] == "death" or not waiting:
                    crew.pop(worker.connection).end()
                else:
                    worker.start(work, waiting[0], jobs[waiting[0]])
                    waiting.popleft()
    finally:
        with uninterrupted():
            for worker in crew.values():
                worker.end()
    return [results[index] for index in range(len(jobs))]


def _silent(index: int, stage: str, done: int, total: int) -> None:
    """Report nothing."""


def _run_here(work: Work[Job, Result], index: int, job: Job, report: OnProgress) -> Result | StageError:
    try:
        result: Result | StageError = work(job, lambda stage, done, total: report(index, stage, done, total))
    except StageError as error:
        result = error
    report(index, "", 1, 1)
    return result


class _Worker:
    """A worker process, seen from its parent."""

    def __init__(self) -> None:
        self.connection, theirs = Pipe()
        self.index = -1  # of the job that it is at
        handle, level = theirs.fileno(), logging.getLogger("forestgen").getEffectiveLevel()
        code = SERVE.format(path=sys.path, handle=handle, level=level)
        kept = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # inherited: the parent alone hears Ctrl-C
        try:
            self.process = subprocess.Popen(
                [sys.executable, "-c", code],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                pass_fds=(handle,),
            )
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, kept)
            theirs.close()

    def start(self, work: Work[Job, Result], index: int, job: Job) -> None:
        """Give the worker its next job."""
        content = pickle.dumps((work, job))
        self.index = index
        with suppress(OSError):  # it has died already: that it does not answer says so
            self.connection.send_bytes(content)

    def receive(self) -> tuple[Any, ...]:
        """Take the worker's next message: its stage, its result, its error, or that it has died."""
        try:
            message: tuple[Any, ...] = self.connection.recv()
        except (EOFError, OSError):
            how = self.process.wait()
            return "death", StageError(
                f"its worker process died ({_cause(how)}), most likely for want of memory: use fewer --jobs"
            )
        return message

    def end(self) -> None:
        """End the process, whatever it is doing, and wait until it is gone."""
        self.process.kill()
        self.process.wait()
        self.connection.close()


def _cause(code: int) -> str:
    return f"exit code {code}" if code >= 0 else signal.Signals(-code).name


def serve(handle: int, level: int) -> None:
    """Do jobs as they come through the pipe, until its other end is closed. A worker's whole life."""
    on_one_thread()
    logging.basicConfig(format="%(name)s: %(message)s")
    logging.getLogger("forestgen").setLevel(level)
    connection = Connection(handle)
    while True:
        try:
            content = connection.recv_bytes()
        except EOFError:
            return
        try:
            work, job = pickle.loads(content)
            answer = pickle.dumps(
                ("result", work(job, lambda stage, done, total: connection.send(("stage", stage, done, total))))
            )
        except BrokenPipeError:
            return  # the parent is gone
        except Exception as error:
            answer = _pickled_error(error)
        connection.send_bytes(answer)


def _pickled_error(error: Exception) -> bytes:
    """An error that can travel, with the worker's traceback as a note; RuntimeError where its class cannot."""
    note = "in a worker process:\n" + "".join(traceback.format_exception(error))
    try:
        content = pickle.dumps(("error", error))
        pickle.loads(content)
    except Exception:
        error = RuntimeError(f"{type(error).__name__}: {error}")
    error.add_note(note)
    return pickle.dumps(("error", error))

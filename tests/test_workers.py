"""Workers: results in order, errors across the border, deaths told, nothing left running."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import psutil
import pytest

from forestgen.errors import InputError, RenderError, StageError
from forestgen.workers import run_parallel

ROOT = Path(__file__).parents[1]


def square(job: int, on_stage) -> int:
    on_stage("think", 1, 2)
    time.sleep(0.05 * (5 - job))  # the first jobs end last
    return job * job


def fail(job: Exception | int, on_stage) -> int:
    if isinstance(job, Exception):
        raise job
    return job


def die(job: int, on_stage) -> int:
    if job == 1:
        os._exit(7)
    if job == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return job


def own_pid(job: float, on_stage) -> int:
    on_stage("here", 0, 0)
    time.sleep(job)
    return os.getpid()


def chatter(job: int, on_stage) -> int:
    sys.stdout.write("chatter\n")
    sys.stdout.flush()
    os.write(1, b"more chatter")
    return job


class UnsendableError(Exception):
    def __init__(self, first, second):
        super().__init__(f"{first} and {second}")


def raise_unsendable(job: int, on_stage) -> None:
    raise UnsendableError(1, 2)


def unsendable_result(job: int, on_stage):
    return threading.Lock()


def children() -> list[psutil.Process]:
    return psutil.Process().children(recursive=True)


@pytest.mark.parametrize("n_workers", [1, 2, 3, 9])
def test_results_come_in_the_order_of_the_jobs(n_workers):
    assert run_parallel(square, range(5), n_workers) == [0, 1, 4, 9, 16]
    assert run_parallel(square, [], n_workers) == []
    assert not children()


@pytest.mark.parametrize("n_workers", [1, 2])
def test_progress_of_each_job_arrives_in_order_and_ends(n_workers):
    heard: dict[int, list] = {0: [], 1: [], 2: []}
    run_parallel(square, range(3), n_workers, lambda index, *what: heard[index].append(what))
    assert heard == {index: [("think", 1, 2), ("", 1, 1)] for index in range(3)}


@pytest.mark.parametrize("n_workers", [1, 2])
def test_a_stage_error_takes_the_place_of_its_result(n_workers):
    first, second, third = run_parallel(fail, [4, StageError("too dark"), 6], n_workers)
    assert (first, third) == (4, 6)
    assert isinstance(second, StageError)
    assert str(second) == "too dark"


@pytest.mark.parametrize("n_workers", [1, 2])
@pytest.mark.parametrize(
    "error", [InputError("a.json: wrong"), RenderError("no GL"), OSError(28, "No space left on device", "x.usdc")]
)
def test_other_errors_cross_the_border_with_their_class(n_workers, error):
    with pytest.raises(type(error)) as caught:
        run_parallel(fail, [1, error, 2, 3], n_workers)
    assert str(caught.value) == str(error)
    assert getattr(caught.value, "errno", None) == getattr(error, "errno", None)
    assert not children()


def test_errors_that_cannot_travel_are_told_in_words():
    with pytest.raises(RuntimeError, match="UnsendableError: 1 and 2") as caught:
        run_parallel(raise_unsendable, [1, 2], 2)
    assert "raise_unsendable" in caught.value.__notes__[0]  # the worker's traceback
    with pytest.raises(TypeError, match="pickle"):
        run_parallel(unsendable_result, [1, 2], 2)


def test_a_worker_that_dies_is_told_and_the_other_jobs_go_on():
    results = run_parallel(die, range(5), 2)
    assert [results[k] for k in (0, 3, 4)] == [0, 3, 4]
    assert isinstance(results[1], StageError)
    assert "exit code 7" in str(results[1])
    assert "SIGKILL" in str(results[2])
    assert "memory" in str(results[2])


def test_workers_are_reused_and_gone_at_the_end():
    pids = run_parallel(own_pid, [0.0] * 6, 2)
    assert len(set(pids)) <= 2
    assert os.getpid() not in pids
    assert not any(psutil.pid_exists(pid) for pid in pids)


def test_children_of_the_host_program_are_left_alone():
    stranger = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    try:
        with pytest.raises(InputError):
            run_parallel(fail, [InputError("x"), 1], 2)
        assert stranger.poll() is None
    finally:
        stranger.kill()
        stranger.wait()


def test_an_error_in_the_caller_ends_the_workers():
    def on_progress(*_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_parallel(own_pid, [60.0, 60.0], 2, on_progress)
    assert not children()


def test_workers_print_nothing(capfd):
    assert run_parallel(chatter, [1, 2], 2) == [1, 2]
    assert capfd.readouterr() == ("", "")


def test_a_script_needs_no_main_guard(tmp_path):
    script = tmp_path / "script.py"
    script.write_text("from tests.test_workers import *\nprint(run_parallel(square, range(3), 2))\n")
    done = subprocess.run(
        [sys.executable, script], capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(ROOT)}
    )
    assert (done.stdout, done.stderr) == ("[0, 1, 4]\n", "")


def test_workers_end_with_their_parent():
    """After kill -9 nobody tidies up: busy workers must notice by themselves, at their next word."""
    code = textwrap.dedent("""
        from tests.test_workers import *
        print("parent", flush=True)
        def tell(index, *_):
            print(*(child.pid for child in children()), flush=True)
        run_parallel(own_pid, [0.5] * 99, 2, tell)
    """)
    parent = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, cwd=ROOT)
    assert parent.stdout is not None
    with parent.stdout:
        parent.stdout.readline()
        workers = [psutil.Process(int(pid)) for pid in parent.stdout.readline().split()]
        parent.kill()
        parent.wait()
    assert workers
    _, alive = psutil.wait_procs(workers, timeout=10)
    assert not alive


def blas_threads(job: int, on_stage) -> str | None:
    return os.environ.get("OPENBLAS_NUM_THREADS")


def test_workers_keep_blas_on_one_thread_unless_the_user_says_otherwise(monkeypatch):
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    assert run_parallel(blas_threads, [1, 2], 2) == ["1", "1"]
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    assert run_parallel(blas_threads, [1, 2], 2) == ["2", "2"]

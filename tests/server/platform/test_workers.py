"""Worker processes: order, bounds, errors, and how they end."""

import itertools
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from server import errors
from server.errors import DomainError, InvalidField, InvalidLandmarks, NotFound, TooLarge, WorkerLost
from server.platform.process_pool import PoolTask, ProcessPool
from tests.server.platform import job_helpers
from tests.server.platform.job_helpers import gone, until

ROOT = Path(__file__).parents[3]
HANGING: PoolTask[str, str, None] = PoolTask(job_helpers.hang, str, job_helpers.hang)


@pytest.fixture
def pool() -> Iterator[ProcessPool]:
    """Two processes beside this one, that were waited for."""
    with ProcessPool(3, warm_up=job_helpers.load, patience=0.0) as workers:
        job_helpers.start(workers)
        yield workers


def slow_numbers() -> Iterator[int]:
    while True:
        time.sleep(0.01)
        yield 1


def test_results_come_in_order_from_all_processes(pool: ProcessPool) -> None:
    results = list(pool.map(job_helpers.SQUARES, iter(range(50))))
    assert [square for square, _ in results] == [number * number for number in range(50)]
    assert set(pool.pids) <= {pid for _, pid in results} <= {*pool.pids, os.getpid()}
    assert os.getpid() not in pool.pids and len(pool.pids) == 2


def test_what_is_short_starts_no_process() -> None:
    with ProcessPool(3, warm_up=job_helpers.load) as workers:
        results = list(workers.map(job_helpers.SQUARES, range(1, 100)))
        assert {pid for _, pid in results} == {os.getpid()}
        assert workers.pids == []


def test_one_process_is_this_one() -> None:
    with ProcessPool(1, warm_up=job_helpers.load, patience=0.0) as workers:
        assert {pid for _, pid in workers.map(job_helpers.SQUARES, range(1, 9))} == {os.getpid()}
        assert workers.pids == []


def test_work_goes_on_here_until_the_processes_are_there() -> None:
    with ProcessPool(3, warm_up=job_helpers.load, patience=0.0) as workers:
        places = []
        for square, pid in workers.map(job_helpers.SQUARES, itertools.count(1)):
            places.append(pid)
            assert square == len(places) ** 2
            if len(set(places)) == 3:
                break
        assert places[0] == os.getpid()
        assert places[-1] != os.getpid()


def test_no_more_is_taken_than_a_few_ahead(pool: ProcessPool) -> None:
    taken = 0

    def numbers() -> Iterator[int]:
        nonlocal taken
        for number in range(40):
            taken += 1
            yield number

    for done, _ in enumerate(pool.map(job_helpers.SQUARES, numbers())):
        assert taken - done <= 6


def test_large_tasks_and_results_do_not_block_each_other(pool: ProcessPool) -> None:
    results = list(pool.map(job_helpers.LARGE, range(12)))
    assert [(len(result), result[0]) for result in results] == [(6_000_000, number) for number in range(12)]


def test_an_error_arrives_as_it_was_and_the_pool_goes_on(pool: ProcessPool) -> None:
    results = pool.map(job_helpers.REFUSALS, range(9))
    assert [next(results) for _ in range(3)] == [0, 1, 2]
    with pytest.raises(TooLarge, match=r"The limit landmarks is 3, and 3 were sent\. Take fewer\."):
        next(results)
    refusals: list[TooLarge] = []

    def refused_by_a_worker() -> bool:
        """While the workers still have what was given up, this process does the work itself."""
        with pytest.raises(TooLarge, match=r"The limit landmarks is 3, and 3 were sent\. Take fewer\.") as caught:
            list(pool.map(job_helpers.REFUSALS, [3]))
        refusals.append(caught.value)
        return hasattr(caught.value, "__notes__")

    until(refused_by_a_worker)
    assert {(error.limit, error.allowed, error.got) for error in refusals} == {("landmarks", 3, 3)}
    assert "in a worker process" in refusals[-1].__notes__[0] and "job_helpers.py" in refusals[-1].__notes__[0]
    with pytest.raises(RuntimeError, match="Unsendable: five is odd"):
        list(pool.map(job_helpers.REFUSALS, [5]))
    with pytest.raises(ZeroDivisionError):
        list(pool.map(PoolTask(job_helpers.square, lambda number: 1 // number, job_helpers.square), [0]))
    assert list(pool.map(job_helpers.REFUSALS, [6, 7, 8])) == [6, 7, 8]


def test_a_source_that_fails_does_so_after_what_it_gave(pool: ProcessPool) -> None:
    def numbers() -> Iterator[int]:
        yield from range(3)
        raise ValueError("no more of them")

    results = pool.map(job_helpers.SQUARES, numbers())
    assert [next(results)[0] for _ in range(3)] == [0, 1, 4]
    with pytest.raises(ValueError, match="no more of them"):
        next(results)


def test_what_was_given_up_is_not_taken_for_the_next(pool: ProcessPool) -> None:
    for _ in range(3):
        results = pool.map(job_helpers.SQUARES, iter(range(100, 200)))
        assert next(results)[0] == 10_000
        results.close()
        after = list(pool.map(job_helpers.SQUARES, range(1, 20)))
        assert [square for square, _ in after] == [number * number for number in range(1, 20)]
    until(lambda: {pid for _, pid in pool.map(job_helpers.SQUARES, [1, 1, 1, 1])} == set(pool.pids))


def test_while_one_thread_has_the_processes_another_works_here(pool: ProcessPool) -> None:
    results = pool.map(job_helpers.SQUARES, iter(range(1, 100)))
    next(results)
    places: set[int] = set()
    other = threading.Thread(
        target=lambda: places.update(pid for _, pid in pool.map(job_helpers.SQUARES, [1, 2, 3])), daemon=True
    )
    other.start()
    other.join(30.0)
    assert places == {os.getpid()}
    assert len(list(results)) == 98


def test_a_process_that_dies_is_an_error_and_not_a_wait(pool: ProcessPool, tmp_path: Path) -> None:
    note = tmp_path / "pid"
    results = pool.map(HANGING, [str(note)])

    def kill() -> None:
        until(lambda: note.exists() and note.read_text() != "")
        os.kill(int(note.read_text()), signal.SIGKILL)

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    with pytest.raises(WorkerLost, match=r"worker-\d of 3 was ended by signal 9"):
        next(results)
    killer.join(30.0)
    assert pool.pids == []
    assert [square for square, _ in pool.map(job_helpers.SQUARES, range(1, 9))] == [n * n for n in range(1, 9)]


def test_a_process_that_cannot_begin_is_an_error() -> None:
    with (
        ProcessPool(3, warm_up=job_helpers.fail_to_load, patience=0.0) as workers,
        pytest.raises(WorkerLost, match="ended with exit code 7"),
    ):
        list(workers.map(job_helpers.SQUARES, slow_numbers()))


def test_a_result_that_cannot_be_sent_is_an_error_and_not_a_wait(pool: ProcessPool) -> None:
    with pytest.raises(WorkerLost, match="ended with exit code 1"):
        list(pool.map(job_helpers.UNSENDABLE, [1]))


def test_closing_ends_the_processes_and_what_they_are_at(pool: ProcessPool, tmp_path: Path) -> None:
    pids = pool.pids
    thread = threading.Thread(target=pool.close, daemon=True)
    thread.start()
    thread.join(30.0)
    assert not thread.is_alive()
    assert all(map(gone, pids))


SCRIPT = """
import sys
from tests.server.platform import job_helpers
from server.platform.process_pool import PoolTask, ProcessPool
if __name__ == "__main__":
    workers = ProcessPool(3, warm_up=job_helpers.load, patience=0.0)
    job_helpers.start(workers)
    print(*workers.pids, flush=True)
    list(workers.map(PoolTask(job_helpers.hang, str, job_helpers.hang), [sys.argv[1], sys.argv[2]]))
"""


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_processes_end_with_the_one_that_started_them(tmp_path: Path, how: signal.Signals) -> None:
    script, notes = tmp_path / "script.py", [tmp_path / "a", tmp_path / "b"]
    script.write_text(SCRIPT)
    with subprocess.Popen(
        [sys.executable, script, *notes],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        # Who runs in the background of a shell has it ignored, and children inherit that.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as parent:
        assert parent.stdout is not None
        pids = [int(pid) for pid in parent.stdout.readline().split()]
        until(lambda: all(note.exists() for note in notes))
        assert len(pids) == 2 and not any(map(gone, pids))
        parent.send_signal(how)
        until(lambda: parent.poll() is not None)
        until(lambda: all(map(gone, pids)))


@pytest.mark.parametrize(
    "error",
    [
        NotFound("collection", "plots"),
        TooLarge("landmarks", 3, None, "Take fewer."),
        InvalidField("is wrong", code="c", pointer="/xy"),
        InvalidLandmarks("/xy", "line", "all on one line", [1, 2]),
        errors.PreconditionFailed("no", "etag"),
        errors.NotReady("index", "catching up"),
        errors.StorageBusy("wait"),
    ],
)
def test_errors_are_the_same_in_another_process(error: DomainError) -> None:
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again), vars(again)) == (type(error), str(error), vars(error))

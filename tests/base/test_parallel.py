import os
import threading
import time
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from ccfem.base import parallel
from ccfem.base.arrays import is_shared, read_only, shared_rows
from ccfem.base.errors import InputError
from ccfem.base.parallel import (
    beside,
    done_elsewhere,
    in_processes,
    in_threads,
    one_blas_thread,
    processors,
    repeating,
)


@pytest.fixture
def two(monkeypatch):
    monkeypatch.setenv("CCFEM_THREADS", "2")


def test_results_come_in_the_order_of_the_items_and_several_are_done_at_a_time(two):
    both = threading.Barrier(2, timeout=10.0)

    def work(number, name):
        both.wait()  # breaks where one has to be done before the other starts
        return f"{name}{number}"

    assert in_threads(work, [0, 1, 2, 3], ["a", "b", "c", "d"]) == ["a0", "b1", "c2", "d3"]
    assert in_threads(work, [], []) == []


@pytest.mark.parametrize("side_by_side", [in_threads, in_processes])
def test_the_first_error_in_the_order_of_the_items_is_raised(two, side_by_side):
    def work(number):
        if number:
            raise ValueError(f"item {number}")

    with pytest.raises(ValueError, match="item 1"):
        list(side_by_side(work, [0, 1, 2]))


def test_processes_give_results_in_order_and_change_nothing_here(two):
    seen = []

    def work(number, name):
        seen.append(number)
        return f"{name}{number}", os.getpid()

    results = list(in_processes(work, range(5), "abcde"))
    assert [name for name, _ in results] == ["a0", "b1", "c2", "d3", "e4"]
    pids = {pid for _, pid in results}
    assert 1 <= len(pids) <= 2
    assert os.getpid() not in pids
    assert seen == []
    assert list(in_processes(work, [], [])) == []


def test_rows_that_are_one_in_memory_come_back_as_one(two):
    for up in in_processes(lambda count: shared_rows(np.tile([0.0, 1.0], (count, 1))), [4, 5]):
        assert is_shared(up)
        assert up.tolist() == len(up) * [[0.0, 1.0]]
        assert not up.flags.writeable


@dataclass(frozen=True)
class Result:
    part: object
    values: np.ndarray
    notes: MappingProxyType


def test_results_refer_to_the_same_objects_and_stay_read_only(two):
    class Part:  # of no module, and with something that cannot be sent
        def __init__(self):
            self.mesh = np.zeros((3, 3))
            self.solve = lambda: None

    part = Part()

    def work(number, about):
        notes = MappingProxyType({"mesh": about.mesh})
        return Result(about, read_only([number, np.nan]), notes)

    for known in (
        list(in_processes(work, [0, 1], [part, part])),
        list(in_processes(lambda number: work(number, part), [0, 1], shared=[part])),
    ):
        for number, result in enumerate(known):
            assert result.part is part
            assert result.notes["mesh"] is part.mesh
            np.testing.assert_array_equal(result.values, [number, np.nan])
            assert result.values.dtype == float
            with pytest.raises(ValueError, match="read-only"):
                result.values[0] = 1.0
            with pytest.raises(TypeError):
                result.notes["mesh"] = None


def test_results_that_cannot_be_sent_are_made_here(two):
    def work(number):
        return lambda: (number, os.getpid())

    assert [result() for result in in_processes(work, [4, 5])] == [
        (4, os.getpid()),
        (5, os.getpid()),
    ]


def test_an_error_in_a_process_says_where_it_was(two):
    def work(number):
        raise InputError(f"got {number}")

    with pytest.raises(InputError, match=r"^got 3") as caught:
        list(in_processes(work, [3, 4]))
    assert "in work" in caught.value.__notes__[0]


def test_a_process_that_is_killed_is_named(two):
    def work(number):
        if number == 1:
            os.kill(os.getpid(), 9)
        return number

    with pytest.raises(InputError, match="a process ended before its work"):
        list(in_processes(work, [0, 1, 2]))


def test_processes_are_not_started_within_one(two):
    def inner(number):
        return os.getpid()

    def outer(number):
        return set(in_processes(inner, [0, 1])) == {os.getpid()}

    assert list(in_processes(outer, [0, 1])) == [True, True]


def test_work_is_done_beside_other_work_on_the_processor_that_is_left(two, tmp_path, monkeypatch):
    monkeypatch.setattr(parallel, "_granted", lambda: 3)
    go = tmp_path / "go"

    def work():
        deadline = time.monotonic() + 10.0
        while not go.exists() and time.monotonic() < deadline:
            time.sleep(0.001)
        return os.getpid()

    with beside(work) as result:
        # The second processor is taken, and nothing else is started on it.
        assert list(in_processes(lambda _: os.getpid(), [0, 1])) == 2 * [os.getpid()]
        with beside(os.getpid) as here:
            assert here() == os.getpid()
        go.touch()
        assert result() != os.getpid()
        assert os.getpid() not in in_processes(lambda _: os.getpid(), [0, 1])


def test_work_beside_gives_way_where_other_work_may_use_all_processors(two, monkeypatch):
    monkeypatch.setattr(parallel, "_granted", lambda: 2)
    with beside(lambda: os.nice(0)) as result:
        assert os.getpid() not in in_processes(lambda _: os.getpid(), [0, 1])
        assert list(in_processes(lambda _: os.nice(0), [0, 1])) == 2 * [os.nice(0)]
        assert result() == min(os.nice(0) + 5, 19)


def test_nothing_is_done_beside_work_that_is_shared_out(two):
    with done_elsewhere(lambda work, arguments: None), beside(os.getpid) as here:
        assert here() == os.getpid()


def test_an_error_beside_other_work_is_raised_where_its_result_is_asked_for(two):
    with beside(lambda: 1 / 0) as result, pytest.raises(ZeroDivisionError):
        result()


def test_alone_work_beside_is_done_when_its_result_is_asked_for(monkeypatch):
    monkeypatch.setenv("CCFEM_THREADS", "1")
    done = []
    with beside(lambda: done.append(1)) as result:
        assert done == []
        result()
    assert done == [1]


def test_threads_start_no_processes(two):
    seen = []

    def work(number):
        return os.getpid()

    thread = threading.Thread(target=lambda: seen.extend(in_processes(work, [0, 1])))
    thread.start()
    thread.join()
    assert seen == 2 * [os.getpid()]


@pytest.mark.parametrize("wanted", ["0", "two", "-1", "1.5"])
def test_the_number_of_processors_is_a_whole_number(monkeypatch, wanted):
    monkeypatch.setenv("CCFEM_THREADS", wanted)
    with pytest.raises(InputError, match=rf"whole number, 1 or more; got '{wanted}'"):
        processors()
    monkeypatch.setenv("CCFEM_THREADS", "")
    assert processors() == len(os.sched_getaffinity(0))


def test_what_repeats_is_made_once_and_comes_in_order(two):
    def made(number):
        return f"{number} by {os.getpid()}"

    results = list(repeating(made, "abacbda", lambda result, number: (result, number)))
    first = {word: results["abacbda".index(word)] for word in "abcd"}
    assert [first[word].split()[0] for word in "abcd"] == ["0", "1", "3", "5"]
    for number, word in enumerate("abacbda"):
        again = number != "abacbda".index(word)
        assert results[number] == ((first[word], number) if again else first[word])


def test_threads_of_blas_are_off_within_and_back_after():
    def threads():
        return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}

    with threadpool_limits(2, user_api="blas"):
        assert one_blas_thread(threads)() == {1}
        assert threads() == {2}


def test_processes_share_the_processors_that_their_threads_use(monkeypatch):
    monkeypatch.setenv("CCFEM_THREADS", "4")
    left = parallel._left
    assert list(in_processes(lambda _: left(), range(2))) == [2, 2]
    assert list(in_processes(lambda _: left(), range(4))) == [1, 1, 1, 1]
    with beside(left) as alone:
        assert alone() == 4

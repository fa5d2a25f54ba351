import threading

import numpy as np
import pandas as pd
import pytest

import ccfem
from ccfem.base.arrays import read_only
from ccfem.base.cluster import on_cluster
from ccfem.base.errors import InputError
from ccfem.base.parallel import in_processes


def test_workers_do_what_processes_do_in_order_and_keep_arrays_read_only(cluster):
    factor, here = read_only(np.arange(3.0)), threading.current_thread().name

    def work(number):
        return threading.current_thread().name, read_only(number * factor)

    with on_cluster(cluster):
        results = list(in_processes(work, range(4)))
    assert here not in {name for name, _ in results}
    assert [array.tolist() for _, array in results] == [[0.0, k, 2.0 * k] for k in range(4)]
    assert not any(array.flags.writeable for _, array in results)


@pytest.mark.parametrize(
    ("sent", "options"), [(threading.Lock(), {}), (None, {"writes": True})], ids=["lock", "files"]
)
def test_what_cannot_or_must_not_be_sent_is_done_here(cluster, monkeypatch, sent, options):
    monkeypatch.setenv("CCFEM_THREADS", "1")

    def work(number):
        return number, sent, threading.current_thread() is threading.main_thread()

    with on_cluster(cluster):
        results = list(in_processes(work, range(2), **options))
    assert results == [(0, sent, True), (1, sent, True)]


def test_the_first_error_comes_back_as_it_is(cluster):
    def work(number):
        raise InputError(f"item {number}: no such thing")

    with on_cluster(cluster), pytest.raises(InputError, match="item 0: no such thing"):
        list(in_processes(work, range(2)))


def test_a_comparison_on_a_cluster_is_the_same_to_the_last_bit(cluster):
    case = ccfem.cases.create_case("bar", element_size=12.5)
    strategies = [ccfem.strategies.Zigzag(3.0), ccfem.strategies.Isocurve()]
    here = ccfem.compare(case, strategies, layers=3)
    with on_cluster(cluster):
        there = ccfem.compare(case, strategies, layers=3)
    pd.testing.assert_frame_equal(there.frame, here.frame, check_exact=True)
    for one, other in zip(there.runs, here.runs, strict=True):
        assert one.toolpaths.points.tobytes() == other.toolpaths.points.tobytes()


def test_a_cluster_that_does_not_answer_is_one_line():
    with pytest.raises(InputError, match="no Dask scheduler answers"), on_cluster("nowhere://1"):
        pass

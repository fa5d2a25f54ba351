import threading

import pytest

from ccfem.base.threads import in_threads


def test_results_come_in_the_order_of_the_items_and_several_are_done_at_a_time(monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    both = threading.Barrier(2, timeout=10.0)

    def work(number, name):
        both.wait()  # breaks where one has to be done before the other starts
        return f"{name}{number}"

    assert in_threads(work, [0, 1, 2, 3], ["a", "b", "c", "d"]) == ["a0", "b1", "c2", "d3"]
    assert in_threads(work, [], []) == []


def test_the_first_error_in_the_order_of_the_items_is_raised():
    def work(number):
        if number:
            raise ValueError(f"item {number}")

    with pytest.raises(ValueError, match="item 1"):
        in_threads(work, [0, 1, 2])

"""Orders of clusters beside all that there are."""

from itertools import pairwise, permutations, product

import numpy as np
import pytest

from ccfem.errors import InputError
from ccfem.linking.exchanges import improved_order
from ccfem.linking.ordering import costs_between_ends, order_clusters, strand_visits


def distances(seed: int, count: int) -> np.ndarray:
    points = np.random.default_rng(seed).uniform(0.0, 100.0, (count, 2))
    return np.linalg.norm(points[:, None] - points, axis=2)


def cost(way: np.ndarray, links: np.ndarray, visit: np.ndarray) -> float:
    return float(links[way[:-1, 1], way[1:, 0]].sum() + visit[way[:, 0], way[:, 1]].sum())


def all_ways(offsets):
    """Every order of the clusters with every choice of terminals."""
    terminals = [range(a, b) for a, b in pairwise(offsets)]
    for order in permutations(terminals):
        for choice in product(*[product(own, own) for own in order]):
            yield np.array(choice)


def least(links, visit, offsets, first=None, last=None):
    return min(
        cost(way, links, visit)
        for way in all_ways(offsets)
        if (first is None or way[0, 0] == first) and (last is None or way[-1, 1] == last)
    )


def clusters(seed: int):
    """Three clusters of 3, 2 and 2 terminals; one visit cannot be made."""
    random = np.random.default_rng(seed)
    offsets = np.array([0, 3, 5, 7])
    links, visit = random.uniform(0.0, 10.0, (2, 7, 7))
    visit[0, 1] = np.inf
    return links, visit, offsets


@pytest.mark.parametrize("exact", [12, 0])
@pytest.mark.parametrize("seed", range(6))
def test_strands_are_ordered_as_well_as_can_be(seed, exact) -> None:
    links, visit, offsets = distances(seed, 10), strand_visits(5), 2 * np.arange(6)
    way = order_clusters(links, visit, offsets, exact=exact)
    assert sorted(way.ravel()) == list(range(10))
    orders = (
        np.array([[2 * k + turn, 2 * k + 1 - turn] for k, turn in zip(order, turns, strict=True)])
        for order in permutations(range(5))
        for turns in product((0, 1), repeat=5)
    )
    assert cost(way, links, visit) == pytest.approx(min(cost(w, links, visit) for w in orders))


@pytest.mark.parametrize("exact", [12, 0])
@pytest.mark.parametrize(("first", "last"), [(None, None), (2, None), (None, 4), (6, 1)])
@pytest.mark.parametrize("seed", range(3))
def test_clusters_are_ordered_as_well_as_can_be(seed, first, last, exact) -> None:
    links, visit, offsets = clusters(seed)
    way = order_clusters(links, visit, offsets, first, last, exact)
    assert first is None or way[0, 0] == first
    assert last is None or way[-1, 1] == last
    expected = least(links, visit, offsets, first, last)
    assert cost(way, links, visit) == pytest.approx(expected, rel=1e-12)


def test_costs_between_ends_are_those_of_the_best_orders() -> None:
    links, visit, offsets = distances(7, 8), strand_visits(4), 2 * np.arange(5)
    table = costs_between_ends(links)
    np.testing.assert_allclose(table, table.T)
    for a, b in product(range(8), repeat=2):
        if a // 2 == b // 2:
            assert table[a, b] == np.inf
        else:
            expected = cost(order_clusters(links, visit, offsets, a, b), links, visit)
            assert table[a, b] == pytest.approx(expected)
    assert table.min() == pytest.approx(cost(order_clusters(links, visit, offsets), links, visit))


def test_one_strand_is_laid_from_either_end() -> None:
    np.testing.assert_array_equal(
        costs_between_ends(np.zeros((2, 2))), [[np.inf, 0.0], [0.0, np.inf]]
    )


def test_search_comes_close_to_the_best_order() -> None:
    visit, offsets = strand_visits(11), 2 * np.arange(12)
    ratio = []
    for seed in range(8):
        links = distances(seed, 22)
        found, best = (
            cost(order_clusters(links, visit, offsets, exact=exact), links, visit)
            for exact in (0, 11)
        )
        ratio.append(found / best)
    assert min(ratio) > 1.0 - 1e-12
    assert max(ratio) < 1.03


def test_a_given_order_is_only_changed_for_the_better() -> None:
    visit, offsets = strand_visits(9), 2 * np.arange(10)
    for seed in range(5):
        links = distances(seed, 18)
        best = order_clusters(links, visit, offsets)
        kept = improved_order(best[:, 0] // 2, links, visit, offsets, 0, 1.0)
        assert cost(kept, links, visit) == pytest.approx(cost(best, links, visit), rel=1e-12)
        start = np.arange(9)
        better = improved_order(start, links, visit, offsets, 0, 1.0)
        np.testing.assert_array_equal(start, np.arange(9))
        straight = np.stack([2 * start, 2 * start + 1], axis=1)
        assert cost(better, links, visit) < cost(straight, links, visit)


def test_many_strands_in_a_row_are_laid_one_after_the_other() -> None:
    """Parallel strands one apart: the best order is known, and costs one for each link."""
    count = 30
    x = np.random.default_rng(0).permutation(count).astype(float)
    ends = np.stack([np.stack([x, 0.0 * x], 1), np.stack([x, 50.0 + 0.0 * x], 1)], 1)
    points = ends.reshape(-1, 2)
    links = np.linalg.norm(points[:, None] - points, axis=2)
    visit, offsets = strand_visits(count), 2 * np.arange(count + 1)
    way = order_clusters(links, visit, offsets)
    assert cost(way, links, visit) == pytest.approx(count - 1.0)
    again = order_clusters(links, visit, offsets)
    np.testing.assert_array_equal(again, way)
    table = costs_between_ends(links)
    assert table.min() == pytest.approx(count - 1.0)
    assert np.isfinite(table).sum() >= 4


def test_nothing_and_one() -> None:
    assert len(order_clusters(np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(1))) == 0
    one = order_clusters(np.zeros((3, 3)), np.arange(9.0).reshape(3, 3), np.array([0, 3]), 1)
    np.testing.assert_array_equal(one, [[1, 0]])


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(InputError, match="no way"):
        order_clusters(np.zeros((2, 2)), np.full((2, 2), np.inf), np.array([0, 2]))
    with pytest.raises(InputError, match="no way"):
        order_clusters(np.zeros((2, 2)), np.full((2, 2), np.inf), np.array([0, 2]), exact=0)
    with pytest.raises(InputError, match="shape"):
        order_clusters(np.zeros((2, 3)), np.zeros((2, 2)), np.array([0, 2]))

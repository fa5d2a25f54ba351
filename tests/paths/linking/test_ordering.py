"""Orders of clusters beside all that there are."""

from itertools import pairwise, permutations, product

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.paths.linking.ordering import (
    Clusters,
    costs_between_ends,
    improved_order,
    order_clusters,
    strands,
)


def distances(seed: int, count: int) -> np.ndarray:
    points = np.random.default_rng(seed).uniform(0.0, 100.0, (count, 2))
    return np.linalg.norm(points[:, None] - points, axis=2)


def cost(way: np.ndarray, given: Clusters) -> float:
    links = given.links[way[:-1, 1], way[1:, 0]]
    return float(links.sum() + given.visit[way[:, 0], way[:, 1]].sum())


def all_ways(offsets):
    """Every order of the clusters with every choice of terminals."""
    terminals = [range(a, b) for a, b in pairwise(offsets)]
    for order in permutations(terminals):
        for choice in product(*[product(own, own) for own in order]):
            yield np.array(choice)


def least(given: Clusters) -> float:
    return min(
        cost(way, given)
        for way in all_ways(given.offsets)
        if given.first in (-1, way[0, 0]) and given.last in (-1, way[-1, 1])
    )


def clusters(seed: int):
    """Three clusters of 3, 2 and 2 terminals; one visit cannot be made."""
    random = np.random.default_rng(seed)
    offsets = np.array([0, 3, 5, 7])
    links, visit = random.uniform(0.0, 10.0, (2, 7, 7))
    visit[0, 1] = np.inf
    return Clusters(links, visit, offsets)


@pytest.mark.parametrize("exact", [12, 0])
@pytest.mark.parametrize("seed", range(6))
def test_strands_are_ordered_as_well_as_can_be(seed, exact) -> None:
    given = strands(distances(seed, 10))
    way = order_clusters(given, exact=exact)
    assert sorted(way.ravel()) == list(range(10))
    orders = (
        np.array([[2 * k + turn, 2 * k + 1 - turn] for k, turn in zip(order, turns, strict=True)])
        for order in permutations(range(5))
        for turns in product((0, 1), repeat=5)
    )
    assert cost(way, given) == pytest.approx(min(cost(w, given) for w in orders))


@pytest.mark.parametrize("exact", [12, 0])
@pytest.mark.parametrize(("first", "last"), [(-1, -1), (2, -1), (-1, 4), (6, 1)])
@pytest.mark.parametrize("seed", range(3))
def test_clusters_are_ordered_as_well_as_can_be(seed, first, last, exact) -> None:
    given = clusters(seed)._replace(first=first, last=last)
    way = order_clusters(given, exact)
    assert first < 0 or way[0, 0] == first
    assert last < 0 or way[-1, 1] == last
    assert cost(way, given) == pytest.approx(least(given), rel=1e-12)


def test_costs_between_ends_are_those_of_the_best_orders() -> None:
    links = distances(7, 8)
    table = costs_between_ends(links)
    np.testing.assert_allclose(table, table.T)
    for a, b in product(range(8), repeat=2):
        if a // 2 == b // 2:
            assert table[a, b] == np.inf
        else:
            given = strands(links, a, b)
            assert table[a, b] == pytest.approx(cost(order_clusters(given), given))
    given = strands(links)
    assert table.min() == pytest.approx(cost(order_clusters(given), given))


def test_one_strand_is_laid_from_either_end() -> None:
    np.testing.assert_array_equal(
        costs_between_ends(np.zeros((2, 2))), [[np.inf, 0.0], [0.0, np.inf]]
    )


def test_search_comes_close_to_the_best_order() -> None:
    ratio = []
    for seed in range(8):
        given = strands(distances(seed, 22))
        found, best = (cost(order_clusters(given, exact), given) for exact in (0, 11))
        ratio.append(found / best)
    assert min(ratio) > 1.0 - 1e-12
    assert max(ratio) < 1.03


def test_a_given_order_is_only_changed_for_the_better() -> None:
    for seed in range(5):
        given = strands(distances(seed, 18))
        best = order_clusters(given)
        kept = improved_order(best[:, 0] // 2, given, 0)
        assert cost(kept, given) == pytest.approx(cost(best, given), rel=1e-12)
        start = np.arange(9)
        better = improved_order(start, given, 0)
        np.testing.assert_array_equal(start, np.arange(9))
        straight = np.stack([2 * start, 2 * start + 1], axis=1)
        assert cost(better, given) < cost(straight, given)


def test_many_strands_in_a_row_are_laid_one_after_the_other() -> None:
    """Parallel strands one apart: the best order is known, and costs one for each link."""
    count = 30
    x = np.random.default_rng(0).permutation(count).astype(float)
    ends = np.stack([np.stack([x, 0.0 * x], 1), np.stack([x, 50.0 + 0.0 * x], 1)], 1)
    points = ends.reshape(-1, 2)
    links = np.linalg.norm(points[:, None] - points, axis=2)
    way = order_clusters(strands(links))
    assert cost(way, strands(links)) == pytest.approx(count - 1.0)
    np.testing.assert_array_equal(order_clusters(strands(links)), way)
    table = costs_between_ends(links)
    assert table.min() == pytest.approx(count - 1.0)
    assert np.isfinite(table).sum() >= 4


def test_nothing_and_one() -> None:
    assert len(order_clusters(Clusters(np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(1)))) == 0
    visit = np.arange(9.0).reshape(3, 3)
    one = order_clusters(Clusters(np.zeros((3, 3)), visit, np.array([0, 3]), first=1))
    np.testing.assert_array_equal(one, [[1, 0]])


def test_what_cannot_be_is_refused() -> None:
    closed = Clusters(np.zeros((2, 2)), np.full((2, 2), np.inf), np.array([0, 2]))
    for exact in (12, 0):
        with pytest.raises(InputError, match="no way"):
            order_clusters(closed, exact)
    with pytest.raises(InputError, match="shape"):
        order_clusters(closed._replace(links=np.zeros((2, 3))))

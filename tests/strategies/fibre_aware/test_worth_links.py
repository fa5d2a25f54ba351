"""Links worth most, against all choices there are and against the shortest ones."""

from itertools import combinations

import numpy as np
import shapely

from ccfem.geometry.polylines import line_length
from ccfem.paths.linking.finishing import long_enough
from ccfem.paths.linking.joining import link_ends
from ccfem.strategies.fibre_aware.path_profile import Profile
from ccfem.strategies.fibre_aware.worth_links import link_by_worth

PLATE = shapely.box(-100.0, -100.0, 100.0, 100.0)
ENOUGH, LIMIT, WIDTH, RADIUS = 42.0, 5.0, 1.0, 0.0  # no link is smooth, and none folds


def even(lines):
    """Profiles of lines on which every mm is worth the same."""
    counts = [max(int(np.ceil(line_length(line))), 1) for line in lines]
    return [
        Profile(k, np.ones(count), line_length(line) / count, 0.0)
        for k, (line, count) in enumerate(zip(lines, counts, strict=True))
    ]


def along_x(y: float, start: float, end: float) -> np.ndarray:
    x = np.linspace(start, end, 30)
    return np.column_stack([x, np.full(30, y)])


def by_worth(lines, worth=even, cheapest=0.0):
    joined = link_by_worth(lines, PLATE, LIMIT, WIDTH, RADIUS, ENOUGH, worth, cheapest)
    return long_enough(joined, ENOUGH)


def by_length(lines):
    return long_enough(link_ends(lines, PLATE, LIMIT, WIDTH, radius=RADIUS, enough=ENOUGH), ENOUGH)


def laid(joined) -> float:
    return sum(map(line_length, joined.lines))


def cheap(count: int):
    """Profiles as `even`, of which a last strand far away is worth nothing: the price is low."""

    def worth(lines):
        found = even(lines)
        found[count] = Profile(count, np.zeros(5), 1.0, 0.0)
        return found

    return worth


FAR = along_x(90.0, 0.0, 5.0)


def test_the_shortest_link_may_be_the_wrong_one():
    # The two in the middle are nearest, but then those outside stay alone: too short, both.
    lines = [along_x(y, 0.0, 22.0) for y in (0.0, 2.0, 3.2, 5.2)]
    assert len(by_length(lines).lines) == 1
    found = by_worth([*lines, FAR], cheap(4))
    assert laid(found) > 88.0
    assert all(line_length(line) >= ENOUGH for line in found.lines)


def test_links_are_marked_and_join_only_what_is_too_short():
    short = [along_x(y, 0.0, 22.0) for y in (0.0, 2.0)]
    (link,) = by_worth([*short, FAR], cheap(2)).link
    assert link.sum() == 1
    long = [along_x(y, 0.0, 50.0) for y in (0.0, 2.0)]
    found = by_worth([*long, FAR], cheap(2))
    assert len(found.lines) == 2
    assert not any(link.any() for link in found.link)


def test_no_lines_and_lines_far_from_each_other_stay():
    assert by_worth([]).lines == []
    assert len(by_worth([along_x(0.0, 0.0, 50.0), along_x(50.0, 0.0, 50.0)]).lines) == 2


def most_of_all_pairings(lines: list[np.ndarray]) -> float:
    """Fibre in the best of all sets of links, one an end, of collinear-ended parallel strands.

    Straight links between ends on one side; each may pass no end in between.
    """
    ends = [(k, side) for k in range(len(lines)) for side in (0, 1)]
    place = {end: lines[end[0]][-end[1]] for end in ends}
    links = []
    for a, b in combinations(ends, 2):
        path = shapely.linestrings([place[a], place[b]])
        others = [k for k in range(len(lines)) if k not in (a[0], b[0])]
        clear = all(shapely.distance(path, shapely.linestrings(lines[k])) > 0.9 for k in others)
        if a[0] != b[0] and np.linalg.norm(place[a] - place[b]) <= LIMIT and clear:
            links.append((a, b, path))
    best = 0.0
    for size in range(len(links) + 1):
        for some in combinations(links, size):
            used = [end for a, b, _ in some for end in (a, b)]
            apart = all(shapely.distance(x[2], y[2]) > 0.9 for x, y in combinations(some, 2))
            if len(set(used)) < len(used) or not apart:
                continue
            group = list(range(len(lines)))
            closed = False
            for a, b, _ in some:
                closed |= group[a[0]] == group[b[0]]
                group = [group[a[0]] if g == group[b[0]] else g for g in group]
            if closed:
                continue
            total = 0.0
            for g in set(group):
                length = sum(line_length(lines[k]) for k in range(len(lines)) if group[k] == g)
                length += sum(x.length for a, _, x in some if group[a[0]] == g)
                total += length if length >= ENOUGH else 0.0
            best = max(best, total)
    return best


def test_little_is_lost_to_the_best_of_all_choices():
    shares = []
    for seed in range(12):
        random = np.random.default_rng(seed)
        heights = np.cumsum(random.uniform(1.2, 2.2, 6))
        lengths = random.uniform(9, 40, 6)
        lines = [along_x(y, 0.0, end) for y, end in zip(heights, lengths, strict=True)]
        best = most_of_all_pairings(lines)
        found = laid(by_worth([*lines, FAR], cheap(6)))
        shares.append((found / best, laid(by_length(lines)) / best))
    worth, length = np.array(shares).T
    assert worth.max() <= 1.0 + 1e-9
    assert worth.min() > 0.8
    assert worth.mean() > 0.95  # the shortest links first: 0.78
    assert length.mean() < 0.8

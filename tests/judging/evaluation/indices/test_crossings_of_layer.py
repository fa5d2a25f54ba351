"""Crossings between paths and of paths with themselves."""

from ccfem.judging.evaluation.indices.crossings import crossing_indices, sample_crossings


def indices(paths):
    values = crossing_indices(sample_crossings(paths))
    return values["crossings"], values["self_crossings"]


def test_two_crossing_lines(pulled):
    assert indices(pulled.plane([[10, 10], [20, 20]], [[10, 20], [20, 10]])) == (1.0, 0.0)
    # The same with a common point at the crossing.
    bent = [[10, 10], [15, 15], [20, 20]], [[10, 20], [15, 15], [20, 10]]
    assert indices(pulled.plane(*bent)) == (1.0, 0.0)


def test_a_line_that_crosses_itself_and_another(pulled):
    loop = [[10, 10], [20, 10], [20, 20], [15, 5]]
    assert indices(pulled.plane(loop)) == (0.0, 1.0)
    assert indices(pulled.plane(loop, [[5, 15], [40, 15]])) == (2.0, 1.0)


def test_touching_paths_do_not_cross(pulled):
    ring = [[10, 10], [20, 10], [20, 20], [10, 20], [10, 10]]
    assert indices(pulled.plane(ring, [[15, 10], [15, 5]], [[20, 10], [20, 20]])) == (0.0, 0.0)


def test_no_path_and_one_segment(pulled):
    assert indices(pulled.plane()) == (0.0, 0.0)
    assert indices(pulled.plane([[1, 1], [2, 2]])) == (0.0, 0.0)

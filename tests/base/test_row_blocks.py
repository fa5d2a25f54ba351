import io
import pickle

import numpy as np
import pytest

from ccfem.base import row_blocks
from ccfem.base.arrays import is_shared, read_only, shared_rows
from ccfem.base.parallel import ReadOnlyPickler
from ccfem.base.row_blocks import RowBlocks
from ccfem.comparison.studies.fingerprint import fingerprint


def blocks_of(*blocks):
    """Rows of three columns as blocks, and joined by NumPy."""
    rows = RowBlocks(float, 3)
    for block in blocks:
        rows.append(block)
    return rows, np.concatenate(blocks)


@pytest.fixture
def stacked(monkeypatch):
    """Three layers of the same lines, 0.25 mm apart, and one of numbers that nothing rounds."""
    monkeypatch.setattr(row_blocks, "SMALL", 0)
    rng = np.random.default_rng(1)
    flat = np.column_stack([rng.uniform(0.0, 400.0, (500, 2)).round(3), np.zeros(500)])
    heights = [np.array([0.0, 0.0, z]) for z in (0.25, 0.5, 0.75)]
    rows, joined = blocks_of(*(flat + height for height in heights), rng.normal(size=(300, 3)))
    return rows.rows(), joined


def test_blocks_are_read_as_the_array_that_they_stand_for(stacked):
    rows, joined = stacked
    assert isinstance(rows, RowBlocks)
    assert rows.shape == joined.shape
    assert rows.nbytes == joined.nbytes
    local, far = np.array([502, 499, 700]), np.array([1799, 0, 0, 1000])
    for key in (3, -1, slice(None), slice(490, 1010), slice(None, None, 7), local, far, -far[:1]):
        np.testing.assert_array_equal(rows[key], joined[key])
    for key in ((slice(400, 600), 2), (far, slice(0, 2)), (5, 1), joined[:, 0] > 1.0, far[:0]):
        np.testing.assert_array_equal(rows[key], joined[key])
    for key in ((..., slice(2)), None, [], [3, 1], (far, np.array([0, 2, 1, 1])), joined > 1.0):
        np.testing.assert_array_equal(rows[key], joined[key])
    for key in (slice(5, 5), slice(5, 3), slice(0, 0), np.zeros(len(joined), dtype=bool)):
        np.testing.assert_array_equal(rows[key], joined[key])
    for wrong in (np.ones(len(rows) + 1, dtype=bool), np.array([len(rows)]), len(rows)):
        with pytest.raises(IndexError):
            rows[wrong]
    with pytest.raises(ValueError, match="read-only"):
        rows += 1.0
    assert fingerprint(rows) == fingerprint(joined)
    np.testing.assert_array_equal(rows + 1.0 < 2.0, joined + 1.0 < 2.0)
    np.testing.assert_array_equal(np.diff(rows, axis=0), np.diff(joined, axis=0))
    assert rows.sum() == joined.sum()
    assert (rows.T == joined.T).all()
    np.testing.assert_array_equal(list(rows), list(joined))
    assert read_only(rows) is rows
    assert shared_rows(rows) is rows
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(rows)), joined)


def test_equal_layers_at_other_heights_are_kept_once(stacked):
    # Of three layers X and Y in four bytes, once; the last block as it is.
    file = io.BytesIO()
    ReadOnlyPickler(file).dump(stacked[0])
    assert file.tell() < 500 * 2 * 4 + 300 * 3 * 8 + 2000


@pytest.mark.parametrize("value", [-0.0, 1.0 / 3.0, 1e9, 0.1 + 0.2, np.nan])
def test_what_thousandths_do_not_tell_is_kept_to_the_last_bit(value):
    rows, joined = blocks_of(np.array([[1.0, value, 0.001], [0.0, 2.5, value]]))
    assert rows.rows().tobytes() == joined.tobytes()


def test_few_values_are_kept_by_their_places(monkeypatch):
    monkeypatch.setattr(row_blocks, "SMALL", 0)
    values = np.tile([1.0 / 3.0, -0.0, np.pi, 0.0], 1000)
    rows = RowBlocks(float)
    rows.append(values)
    assert len(pickle.dumps(rows.rows())) < 4000 * 2 + 1000
    assert np.asarray(rows).tobytes() == values.tobytes()


def test_rows_are_inserted_at_once(stacked):
    rows, joined = stacked
    places, given = [0, 4, 4, 500, 1800], np.arange(15.0).reshape(5, 3)
    rows.insert(places, given)
    np.testing.assert_array_equal(rows, np.insert(joined, places, given, axis=0))


def test_small_rows_are_an_array_and_rows_that_are_one_share_it():
    rows, joined = blocks_of(np.ones((3, 3)), np.zeros((0, 3)), np.full((1, 3), 2.0))
    assert type(rows.rows()) is np.ndarray
    np.testing.assert_array_equal(rows.rows(), joined)
    rows, _ = blocks_of(np.ones((3, 3)), np.ones((1, 3)))
    rows.insert([2], np.ones((1, 3)))
    assert is_shared(rows.rows())
    assert len(rows.rows()) == 5
    assert blocks_of(np.zeros((0, 3)))[0].rows().shape == (0, 3)

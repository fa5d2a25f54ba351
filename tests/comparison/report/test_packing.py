"""Numbers in a page: what comes out is what went in, to the step that was asked for."""

import base64
import gzip

import numpy as np

from ccfem.comparison.report.packing import Rounded, as_bytes, pack, unpack


def test_a_tree_comes_back():
    tree = {
        "words": ["</script>", "a & b", None, True, 1.5, float("nan")],
        "bytes": np.array([0, 7, 255], dtype=np.uint8),
        "small": np.array([0, 65535]),
        "large": np.array([0, 2**32 - 1]),
        "floats": np.array([1.0, -2.5e-7, np.pi]),
        "none": Rounded(np.zeros((0, 2)), 0.01),
    }
    found = unpack(pack(tree))
    assert found["words"] == ["</script>", "a & b", None, True, 1.5, None]
    for name in ("bytes", "small", "large"):
        np.testing.assert_array_equal(found[name], tree[name])
    np.testing.assert_array_equal(found["floats"], tree["floats"].astype(np.float32))
    assert found["none"].shape == (0, 2)


def test_coordinates_are_rounded_to_the_step():
    points = np.random.default_rng(0).uniform(-80.0, 140.0, (1000, 3))
    found = unpack(pack({"points": Rounded(points, 0.01)}))["points"]
    np.testing.assert_allclose(found, points, atol=0.005 + 1e-9)
    far = unpack(pack(Rounded(1e4 * points, 0.01)))  # more than 65,535 steps
    np.testing.assert_allclose(far, 1e4 * points, atol=0.5 * 2.2e6 / 65535 + 1e-6)


def test_bytes_span_the_scale_and_know_what_is_missing():
    found = as_bytes(np.array([0.0, 5.0, 10.0, 12.0, np.nan, -1.0]), 10.0)
    np.testing.assert_array_equal(found, [0, 127, 254, 254, 255, 0])


def test_what_is_packed_is_gzip_that_any_program_reads():
    data = gzip.decompress(base64.b64decode(pack({"a": np.arange(3, dtype=np.uint8)})))
    assert data.endswith(b"\x00\x01\x02")
    assert pack({"a": 1}) == pack({"a": 1})

"""Products of blocks and vectors, beside scipy."""

import numpy as np
import pytest
import scipy.sparse as sp

from ccfem.fem.elasticity import block_product
from ccfem.fem.elasticity.block_product import times


@pytest.mark.parametrize(("size", "threads"), [(3, 1), (3, 2), (2, 1)])
def test_a_product_is_that_of_scipy_to_the_last_bit(size, threads, monkeypatch):
    monkeypatch.setattr(block_product, "_MANY_BLOCKS", 0)
    monkeypatch.setenv("CCFEM_THREADS", str(threads))
    random = np.random.default_rng(0)
    sparse = sp.random_array((40, 30), density=0.2, rng=random, format="csr")
    matrix = sp.bsr_array(sp.kron(sparse, random.normal(size=(size, size))), blocksize=(size, size))
    # Every other entry of a vector, and one that cannot be written to.
    x = random.normal(size=2 * matrix.shape[1])
    x.flags.writeable = False
    np.testing.assert_array_equal(times(matrix, x[::2]), matrix @ x[::2])
    np.testing.assert_array_equal(times(matrix.tocsr(), x[::2]), matrix.tocsr() @ x[::2])

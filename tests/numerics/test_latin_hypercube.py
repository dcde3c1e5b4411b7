"""Latin hypercubes: the numbers that SciPy gives."""

import numpy as np
import pytest
from scipy.stats import qmc

from galileo_jax.numerics.latin_hypercube import latin_hypercube


@pytest.mark.parametrize(("points", "axes", "seed"), [(24, 7, 0), (5, 1, 3)])
def test_the_numbers_are_scipys(points, axes, seed):
    expected = qmc.LatinHypercube(axes, rng=np.random.default_rng(seed)).random(points)
    found = latin_hypercube(points, axes, np.random.default_rng(seed))
    np.testing.assert_array_equal(found, expected)

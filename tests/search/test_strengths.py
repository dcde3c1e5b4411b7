"""The best of all strengths is found where a little more changes everything."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from galileo_jax.model.parameters import Normal, Parameter
from galileo_jax.search.starts import best_strengths

HELD = 1e6  # chi2 / 2 of a body that never sets off


class Cliff:
    """Cost falls up to an edge, past which the body is held for ever."""

    def __init__(self, edge: float):
        parameters = [Parameter(name, "1", Normal(0.0, 1.0), 0.0) for name in ("k1", "strength")]
        self.edge, self.trials = edge, SimpleNamespace(model_parameters=parameters)

    def search_costs(self, z: np.ndarray, free: np.ndarray) -> np.ndarray:
        assert len(free) == len(z)
        before = self.edge - z[:, 1]
        return np.where(before < 0, HELD, 1e4 * before)


@given(st.floats(-2.0, 2.0))
def test_the_edge_is_approached_from_below(edge: float):
    fitter: Any = Cliff(edge)
    start = np.array([[0.3, 2.5], [0.7, -1.0]])
    found = best_strengths(fitter, start, np.ones((2, 2), bool), [np.array([1])] * 2)
    assert np.all(found[:, 1] <= edge)
    assert found[:, 1] == pytest.approx(edge, abs=2e-3)
    np.testing.assert_array_equal(found[:, 0], start[:, 0])

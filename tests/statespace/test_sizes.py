"""Which sizes are more than usual."""

import numpy as np
import pytest

from galileo_jax.statespace.sizes import Sizes


@pytest.mark.parametrize(
    ("draws", "expected"),
    [
        ([[2.1, 0.0], [2.2, 0.0], [0.0, 0.0]], ["a"]),
        ([[2.1, 0.0], [0.0, 0.0], [0.0, 1.9], [0.0, 0.0]], []),
        ([[2.1, 0.0], [0.0, 2.1], [2.1, 0.0], [0.0, 0.0]], ["a"]),
        ([[2.1, 0.0], [0.0, 2.1], [2.1, 2.1], [0.0, 0.0]], ["a", "b"]),
    ],
)
def test_half_of_what_is_possible_decides(draws, expected):
    """One that is large where the other is not counts for both; two standard deviations."""
    rows = np.column_stack([np.array(draws), np.full(len(draws), 9.0)])  # and the noise's
    assert Sizes(("a", "b"), np.zeros(2), rows, 0.0).unusual == expected

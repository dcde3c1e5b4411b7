"""Batches of any size through programs of a few sizes: nothing lost, nothing mixed up."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from galileo_jax.runtime.batching import in_chunks


@given(st.integers(1, 300), st.sampled_from([(16,), (4, 16), (16, 64)]))
def test_rows_come_back_in_their_order(count: int, sizes: tuple[int, ...]):
    seen: list[int] = []

    def doubled(rows: np.ndarray) -> np.ndarray:
        seen.append(len(rows))
        return 2 * rows

    rows = np.arange(3 * count).reshape(count, 3)
    np.testing.assert_array_equal(in_chunks(sizes, doubled, rows), 2 * rows)
    assert set(seen) <= set(sizes)


@given(st.integers(1, 300))
def test_little_is_computed_for_nothing(count: int):
    seen: list[int] = []

    def kept(rows: np.ndarray) -> np.ndarray:
        seen.append(len(rows))
        return rows

    in_chunks((16, 64), kept, np.zeros(count))
    assert sum(seen) - count < 16

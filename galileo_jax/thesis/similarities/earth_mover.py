"""The thesis's earth mover's distance between profiles, by dynamic programming."""

from typing import ClassVar

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from galileo_jax.thesis.similarity import AbstractSimilarity, register


@register
class EarthMover(AbstractSimilarity):
    """Minus the least work, m/s, that aligns the profiles in time; 0 is the best.

    What is computed, for each object and axis on its own and then summed: over the
    measured frames only, the least sum of |x_i - y_j| along a path from (first, first) to
    (last, last) whose steps go on by one frame in x, in y or in both,

        D[i, j] = |x_i - y_j| + min(D[i - 1, j], D[i, j - 1], D[i - 1, j - 1]).

    Every value is moved onto one or more values of the other profile without changing the
    order in time: dynamic time warping with the L1 cost. It is not the Wasserstein distance
    of two histograms, which would forget the order. Being blind to delays, it tells little
    about when a collision happens. A score.

    Source: the recursion is of Sakoe and Chiba, Dynamic programming algorithm optimization
    for spoken word recognition (1978), 10.1109/TASSP.1978.1163055.
    """

    name: ClassVar[str] = "earth_mover"

    def _of_measured(self, predicted, observed, mask) -> jax.Array:
        num_frames = predicted.shape[-1]
        work = jax.vmap(least_work)(
            predicted.reshape(-1, num_frames),
            observed.reshape(-1, num_frames),
            mask.reshape(-1, num_frames),
        )
        return -jnp.sum(work)


def least_work(x: ArrayLike, y: ArrayLike, mask: ArrayLike) -> jax.Array:
    """D at the last measured frames, 0 where nothing was measured; all arguments `[frame]`.

    One scan over the rows i. Within a row the recursion over j is resolved at once: with
    S_j the running sum of the row's costs and a_j = min(D[i - 1, j], D[i - 1, j - 1]),
    D[i, j] = S_j + min over k <= j of (a_k - S_{k - 1}). A masked frame's row repeats the
    one before, and a masked column costs nothing and cannot be stepped into from above.
    """
    x, y, mask = jnp.asarray(x), jnp.asarray(y), jnp.asarray(mask)
    far = jnp.asarray(jnp.inf, x.dtype)
    # Before the first row only the corner is reached, moved right past masked columns.
    corner = jnp.where(jnp.cumsum(mask) == 0, jnp.zeros((), x.dtype), far)
    before_first = jnp.concatenate([jnp.zeros(1, x.dtype), corner])

    def row(above, row_value_and_mask):
        value, is_measured = row_value_and_mask
        cost = jnp.where(mask, jnp.abs(value - y), 0.0)
        run = jnp.cumsum(cost)
        entry = jnp.where(mask, jnp.minimum(above[1:], above[:-1]), far)
        reached = run + jax.lax.cummin(entry - (run - cost))
        here = jnp.concatenate([far[None], reached])
        return jnp.where(is_measured, here, above), None

    last, _ = jax.lax.scan(row, before_first, (x, mask))
    return last[-1]

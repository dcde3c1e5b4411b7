"""The similarities of velocity profiles that `--preset thesis` can maximise; higher is more alike.

A score maps predicted and observed velocities, m/s, and whether each was measured, all
`[object, axis, frame - 1]`, to `[]`; what is masked counts for nothing.
"""

from collections.abc import Callable, Mapping

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

VARIANCE_M2_S2 = 0.05  # the thesis does not state its unit


def similarity(
    name: str, predicted_m_s: ArrayLike, observed_m_s: ArrayLike, mask: ArrayLike
) -> jax.Array:
    """How alike two velocity profiles `[object, 2, frame - 1]` are, `[]`.

    `name`: in `SCORES`. `mask`: `[object, frame - 1]`, True where a velocity was measured (both its
    frames were). What is masked may be anything, NaN too, and counts for nothing, in the derivative
    neither.
    """
    both = jnp.broadcast_to(jnp.asarray(mask)[:, None, :], jnp.shape(predicted_m_s))
    # Masked values are replaced before the arithmetic: a NaN times zero stays a NaN.
    return SCORES[name](
        jnp.where(both, predicted_m_s, 0.0), jnp.where(both, observed_m_s, 0.0), both
    )


def thesis_gaussian(predicted: jax.Array, observed: jax.Array, mask: jax.Array) -> jax.Array:
    """Sum over measured velocities of log N(observed; predicted, variance).

    Normalized, but of a noise that velocities from tracked positions do not have: theirs is
    correlated between neighbours, and far smaller than sqrt(0.05) = 0.22 m/s. For an honest
    posterior use `Whitening.log_density`. The thesis's own acceptance and selection only rank, so
    that its answer is the same for every variance.
    """
    squares = (observed - predicted) ** 2 / VARIANCE_M2_S2
    constant = jnp.log(2 * jnp.pi * VARIANCE_M2_S2)
    return -0.5 * jnp.sum(jnp.where(mask, squares + constant, 0.0))


def root_mean(predicted: jax.Array, observed: jax.Array, mask: jax.Array) -> jax.Array:
    """Root mean square over the measured velocities of s = 1 - |x - y| / (|x| + |y|).

    1 where the profiles are the same; 0 where every pair differs in sign or one of it is
    zero. Two zeros are alike (s = 1). A score. It is relative: the noise of an object at
    rest (x = 0, y = noise) counts as complete difference.

    Source: Cassisi, Montalto, Aliotta, Cannata, Pulvirenti, Similarity measures and
    dimensionality reduction techniques for time series data mining (2012), 10.5772/49941.
    """
    size = jnp.abs(predicted) + jnp.abs(observed)
    is_zero = size == 0
    alike = 1.0 - jnp.abs(predicted - observed) / jnp.where(is_zero, 1.0, size)
    total = jnp.sum(jnp.where(mask & ~is_zero, alike**2, 0.0)) + jnp.sum(mask & is_zero)
    mean = total / jnp.maximum(jnp.sum(mask), 1)
    # The root has no derivative at 0.
    return jnp.where(mean > 0, jnp.sqrt(jnp.where(mean > 0, mean, 1.0)), 0.0)


def earth_mover(predicted: jax.Array, observed: jax.Array, mask: jax.Array) -> jax.Array:
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
    rows = (values.reshape(-1, values.shape[-1]) for values in (predicted, observed, mask))
    return -jnp.sum(jax.vmap(least_work)(*rows))


Score = Callable[[jax.Array, jax.Array, jax.Array], jax.Array]
SCORES: Mapping[str, Score] = {
    one.__name__: one for one in (earth_mover, root_mean, thesis_gaussian)
}


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

"""Draws out of weighed ones, each as often as it weighs, the same ones where weights change little.

    times_i = floor(n w_i)  or one more, n in all: of the rests r_i = n w_i - floor(n w_i) those
    with the least  u_i (1 - r_i) / ((1 - u_i) r_i)  have one more,    u_i uniform, from the seed

Weights that differ in the tenth digit change no draw, or one. Systematic resampling, whose evenly
spaced places fall through the sum of all weights before, would choose quite other draws: the ends
of an interval then differed by .05 standard deviations between two processors.

Draws that hardly anything proposed weigh so much that one may have most of all weight. They are
cut, as draws by importance may be: w_i <= mean(w) sqrt(n), which tends to no cut at all.

Sources: E. L. Ionides, Truncated importance sampling, J. Comput. Graph. Stat. 17 (2008), 295 (the
cut); B. Rosén, On sampling with probability proportional to size, J. Stat. Plan. Inference 62
(1997), 159 (Pareto sampling, permanent random numbers).
"""

import numpy as np
from jaxtyping import Float, Int

GOLDEN = (5**0.5 - 1) / 2


def truncated(log_weights: Float[np.ndarray, " draw"]) -> Float[np.ndarray, " draw"]:
    """The same log weights, at most log(mean(w) sqrt(n))."""
    most = float(np.logaddexp.reduce(log_weights)) - 0.5 * np.log(len(log_weights))
    return np.minimum(log_weights, most)


def worth(log_weights: Float[np.ndarray, " draw"]) -> float:
    """How many draws of the distribution itself weighed ones are worth: (sum w)^2 / sum w^2."""
    one, two = (float(np.logaddexp.reduce(power * log_weights)) for power in (1, 2))
    return float(np.exp(2 * one - two))


def resampled(
    log_weights: Float[np.ndarray, " draw"], count: int, generator: np.random.Generator
) -> Int[np.ndarray, " chosen"]:
    """Indices of `count` draws in random order: the first few are a sample, too.

    `log_weights`: up to a constant. `count`: n. `generator`: of u and of the order, two numbers for
    each draw.
    """
    u, place = generator.random((2, len(log_weights)))
    weights = np.exp(log_weights - np.max(log_weights))
    expected = count * weights / weights.sum()
    times = np.floor(expected).astype(int)
    rest = expected - times
    with np.errstate(divide="ignore"):  # of no rest: last
        odds = np.log(u / (1 - u)) - np.log(rest) + np.log1p(-rest)
    rank = np.argsort(odds, kind="stable")
    times[rank[: count - times.sum()]] += 1
    which = np.repeat(np.arange(len(times)), times)
    copy = np.arange(count) - np.repeat(np.cumsum(times) - times, times)
    return which[np.argsort((place[which] + GOLDEN * copy) % 1.0, kind="stable")]

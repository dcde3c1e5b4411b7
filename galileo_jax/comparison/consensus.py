"""What several groups that measured the same find together, and who of them lies outside.

The random-effects model of meta-analysis: group i finds y_i = mu + u_i + e_i, where e_i has the
standard deviation s_i that the group itself states, and u_i the scatter tau between groups: of
surfaces, of ramps, of what nobody stated. The estimates are

    sum_i w_i (y_i - mu)^2 = n - 1,    w_i = 1 / (s_i^2 + tau^2),    mu = sum w_i y_i / sum w_i

(tau = 0 where no tau >= 0 solves it). A group lies outside where t_i = (y_i - mu') / sqrt(s_i^2 +
tau'^2 + 1 / sum w'), with everything dashed from the others alone, is larger than Student's t with
n' - 1 degrees of freedom is for one of n groups by chance in `LEVEL` of all classes (simulated, in
5 to 8 % of them where tau is much larger than s, in fewer where it is not).

The others are those that do not lie outside themselves, or several that are wrong would hide each
other. They are found from a start that up to half of the groups cannot spoil: the weighted
median, and the tau with which half of the groups are within 0.674 standard deviations of it.

Sources: R. C. Paule, J. Mandel, Consensus values and weighting factors, J. Res. NBS 87 (1982) 377,
doi 10.6028/jres.087.022. J. P. T. Higgins, S. G. Thompson, D. J. Spiegelhalter, A re-evaluation of
random-effects meta-analysis, J. R. Stat. Soc. A 172 (2009) 137,
doi 10.1111/j.1467-985X.2008.00552.x (the t of a further group). P. J. Rousseeuw, A. M. Leroy,
Robust Regression and Outlier Detection (1987), doi 10.1002/0471725382 (the start, then the rest).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import bisect
from scipy.stats import norm, t

LEVEL = 0.05  # of classes in which nobody is wrong, some group is marked all the same
CUT = 2.5  # robust standard deviations from the start: Rousseeuw and Leroy's
FEWEST = 3  # groups: of two that differ nobody can say which is wrong


@dataclass(frozen=True)
class Consensus:
    """A value that a class found."""

    mean: float  # mu, of the groups that do not lie outside
    sd: float  # its standard deviation
    scatter: float  # tau, standard deviation between groups beyond what they state
    t: np.ndarray  # `[group]`, how far each is from what the others find
    others: np.ndarray  # `[group]`, what the others find
    is_outside: np.ndarray  # `[group]`


def consensus(values: np.ndarray, sds: np.ndarray) -> Consensus:
    """The consensus of groups, at least `FEWEST`, that measured one quantity."""
    is_member = _start(values, sds)
    seen: set[bytes] = set()
    while True:
        distance, others, is_outside = _distances(values, sds, is_member)
        seen.add(is_member.tobytes())
        if (~is_outside).tobytes() in seen or np.sum(~is_outside) < FEWEST:
            break
        is_member = ~is_outside
    mean, sd, scatter = _pooled(values[~is_outside], sds[~is_outside])
    return Consensus(mean, sd, scatter, distance, others, is_outside)


def _distances(
    values: np.ndarray, sds: np.ndarray, is_member: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distances t and mu' of each group against the other members, and whether it is outside."""
    count = len(values)
    distance, others, is_outside = np.zeros(count), np.zeros(count), np.zeros(count, bool)
    for i in range(count):
        rest = is_member & (np.arange(count) != i)
        others[i], sd, scatter = _pooled(values[rest], sds[rest])
        distance[i] = (values[i] - others[i]) / np.sqrt(sds[i] ** 2 + scatter**2 + sd**2)
        # Bonferroni: n groups are looked at.
        is_outside[i] = abs(distance[i]) > t.isf(LEVEL / 2 / count, rest.sum() - 1)
    return distance, others, is_outside


def _pooled(values: np.ndarray, sds: np.ndarray) -> tuple[float, float, float]:
    """Mu, its standard deviation and tau (Paule and Mandel)."""

    def weights(scatter: float) -> np.ndarray:
        return 1 / (sds**2 + scatter**2)

    def excess(scatter: float) -> float:
        w = weights(scatter)
        return np.sum(w * (values - np.average(values, weights=w)) ** 2) - (len(values) - 1)

    scatter = _scatter(excess, values)
    w = weights(scatter)
    return float(np.average(values, weights=w)), float(w.sum() ** -0.5), scatter


def _start(values: np.ndarray, sds: np.ndarray) -> np.ndarray:
    """`[group]`, who is near the weighted median; at least `FEWEST`."""

    def distances(scatter: float) -> np.ndarray:
        spread = np.sqrt(sds**2 + scatter**2)
        order = np.argsort(values)
        share = np.cumsum(1 / spread[order])
        median = values[order][np.searchsorted(share, share[-1] / 2)]
        return np.abs(values - median) / spread

    scatter = _scatter(lambda tau: np.median(distances(tau)) - norm.isf(0.25), values)
    far = distances(scatter)
    return far <= max(CUT, np.sort(far)[FEWEST - 1])


def _scatter(excess: Callable[[float], float], values: np.ndarray) -> float:
    """Where an excess that falls with tau is 0; 0 where it is never positive.

    With tau twice the range of the values the mean square of what it compares is at most 1/4.
    """
    most = 2 * float(np.ptp(values))
    return float(bisect(excess, 0.0, most)) if excess(0.0) > 0 else 0.0  # pyright: ignore

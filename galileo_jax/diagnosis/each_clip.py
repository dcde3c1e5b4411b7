"""Where clips together do not fit: each of them against the model of all, and by itself.

Against the model of all, a clip's acceleration differs by a_j in each of NUM_PARTS equal parts of
the way that object 1 goes in it; its start (the instant of the release) is its own:

    observed - predicted = sum_j a_j d_j(t) + tau v(t),    d_j'' = 1 in part j, 0 elsewhere

by least squares in the whitened residuals.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from scipy import stats

from galileo_jax.comparison.compare import ADEQUATE_P, NOISE_SCALE_RANGE, Comparison, compare
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.trials import Trials

NUM_PARTS = 4  # quarters, as they are called
ALIKE_P = 0.01
FINE = 20  # steps from frame to frame in which accelerations are summed up

Kind = Literal["shared", "some", "alike", "different"]


@dataclass(frozen=True)
class EachClip:
    """One clip of several.

    Attributes:
      clip: its name.
      chi2_together, chi2_alone: per number measured, under the model of all clips and refitted
        by itself.
      p_alone: of the model being adequate for it by itself.
      way_m: `[part + 1]`, how far object 1 has gone at the edges of the parts.
      extra_m_s2, sd_m_s2: `[part]`, how much more it accelerates than the model of all clips.
    """

    clip: str
    chi2_together: float
    chi2_alone: float
    p_alone: float
    way_m: np.ndarray
    extra_m_s2: np.ndarray
    sd_m_s2: np.ndarray


def each_clip(
    trials: Trials, fit: GradientFit, comparison: Comparison, seed: int
) -> tuple[EachClip, ...]:
    """Every clip against the model of all and by itself.

    Args:
      trials: several clips.
      fit: of all together, without effects.
      comparison: of that fit with the data.
      seed: of the replicates.
    """
    return tuple(_one(trials, fit, comparison, clip, seed) for clip in range(len(trials.problems)))


def kind_of(found: tuple[EachClip, ...]) -> Kind:
    """What the clips have in common.

    "shared": each fits by itself, so that what they share differs; "some": some fit by
    themselves; none does, and what is missing is "alike" in all parts of the way or "different".
    """
    fits = [one.p_alone >= ADEQUATE_P for one in found]
    if all(fits):
        return "shared"
    if any(fits):
        return "some"
    extra = np.stack([one.extra_m_s2 for one in found])
    weight = 1.0 / np.stack([one.sd_m_s2 for one in found]) ** 2
    mean = (weight * extra).sum(axis=0) / weight.sum(axis=0)
    apart = float((weight * (extra - mean) ** 2).sum())
    is_alike = stats.chi2.sf(apart, extra.size - mean.size) >= ALIKE_P
    return "alike" if is_alike else "different"


def _one(
    trials: Trials, fit: GradientFit, comparison: Comparison, clip: int, seed: int
) -> EachClip:
    alone, columns = trials.alone(clip), trials.columns[clip]
    start, free = fit.z[columns], fit.free[columns]
    found = GradientFitter(alone).fit_from(start[None], free[None], np.zeros(1, int))[0]
    compared = compare(alone, found, seed)
    way, extra, sd = _parts(trials, fit, comparison.white[clip], clip)
    return EachClip(
        clip=trials.problems[clip].name,
        chi2_together=_chi2(trials, comparison.white[clip], clip),
        chi2_alone=_chi2(trials, compared.white[0], clip),
        p_alone=compared.p_value,
        way_m=way,
        extra_m_s2=extra,
        sd_m_s2=sd,
    )


def _chi2(trials: Trials, white: np.ndarray, clip: int) -> float:
    return float(np.sum(white**2) / trials.problems[clip].data.num_values)


def _parts(
    trials: Trials, fit: GradientFit, white: np.ndarray, clip: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Edges of the parts, extra accelerations and their standard deviations."""
    problem = trials.problems[clip]
    shared = trials.theta(fit.z, fit.free)
    theta = trials.of_clip(shared, clip)
    predicted = problem.simulate(theta)
    seen = np.flatnonzero(problem.observation.mask[0])
    times_s = problem.observation.times_s[seen[0] : seen[-1] + 1]
    path = predicted[0][:, seen[0] : seen[-1] + 1]
    gone = np.append(0.0, np.cumsum(np.hypot(*np.diff(path))))
    edges = np.linspace(0.0, gone[-1], NUM_PARTS + 1)
    fine_s = np.linspace(times_s[0], times_s[-1], FINE * len(times_s))
    fine = np.interp(fine_s, times_s, gone)
    step_s = fine_s[1] - fine_s[0]
    velocity = np.stack([np.gradient(row, times_s) for row in path])
    way = velocity / np.maximum(np.hypot(*velocity), np.finfo(float).tiny)
    shapes = [velocity]
    for low, high in pairwise(edges):
        inside = (fine > low) & (fine <= high)
        far = np.cumsum(np.cumsum(inside)) * step_s**2
        shapes.append(way * np.interp(times_s, fine_s, far))
    changed = np.tile(predicted, (len(shapes), 1, 1, 1))
    for one, shape in zip(changed, shapes, strict=True):
        one[0][:, seen[0] : seen[-1] + 1] -= shape
    # As the comparison judges residuals.
    scale = float(np.clip(trials.noise_scale(shared, clip), *NOISE_SCALE_RANGE))
    design = problem.whiten(changed, scale) - problem.whiten(predicted, scale)
    left = white.reshape(-1)
    inverse = np.linalg.pinv(design @ design.T)
    found = inverse @ (design @ left)
    rest = np.sum((left - found @ design) ** 2) / max(problem.data.num_values - len(found), 1)
    sd = np.sqrt(np.diagonal(inverse) * max(1.0, float(rest)))
    return edges, found[1:], sd[1:]

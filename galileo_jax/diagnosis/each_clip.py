"""Each of several clips: against the model of all, by itself, and as the others predict it.

Against the model of all, a clip's acceleration differs by a_j in each of NUM_PARTS equal parts of
the way that object 1 goes in it; its start (the instant of the release) is its own:

    observed - predicted = sum_j a_j d_j(t) + tau v(t),    d_j'' = 1 in part j, 0 elsewhere

The coefficients come from least squares with the tracker's errors alone, so effects that a camera
tilt could absorb remain visible. Remaining residuals are smooth, so the standard deviations are
multiplied by the residuals' size (if it is more than one) and by sqrt((1 + r) / (1 - r)), where r
is the correlation of neighbours.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import jax.numpy as jnp
import numpy as np
from scipy.special import chdtrc

from galileo_jax.comparison.compare import ADEQUATE_P, JUDGED_SCALE_RANGE, Comparison
from galileo_jax.diagnosis.thresholds import ALIKE_P
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.result import velocity_error
from galileo_jax.model.parameters import Parameter
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.similarity.gaussian_likelihood import whitening_in

NUM_PARTS = 4  # quarters, as they are called
MOST_ALIKE = 0.99  # of neighbours
FINE = 20  # steps from frame to frame in which accelerations are summed up

Kind = Literal["shared", "some", "alike", "different"]


@dataclass(frozen=True)
class EachClip:
    """One clip of several."""

    clip: str  # its name
    # per degree of freedom at the stated noise, under the model of all clips and refitted by itself
    chi2_together: float
    chi2_alone: float
    # of a chi2 as large as that by itself, at the noise that it asks for (replicates say little
    # here: what several clips determine, one alone may not)
    p_alone: float
    way_m: np.ndarray  # `[part + 1]`, how far object 1 has gone at the edges of the parts
    # `[part]`, how much more it accelerates than the model of all clips
    extra_m_s2: np.ndarray
    sd_m_s2: np.ndarray


def each_clip(
    trials: JointProblem, fit: GradientFit, comparison: Comparison
) -> tuple[EachClip, ...]:
    """Every clip against the model of all and by itself."""
    return tuple(_one(trials, fit, comparison, clip) for clip in range(len(trials.problems)))


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
    is_alike = chdtrc(extra.size - mean.size, apart) >= ALIKE_P
    return "alike" if is_alike else "different"


def _one(trials: JointProblem, fit: GradientFit, comparison: Comparison, clip: int) -> EachClip:
    alone, columns = trials.alone(clip), trials.columns[clip]
    start, free = fit.z[columns], fit.free[columns]
    found = GradientFitter(alone).fit_from(start[None], free[None], np.zeros(1, int))[0]
    theta = alone.theta(found.z, found.free)
    problem = trials.problems[clip]
    predicted = problem.simulate(alone.of_clip(theta, 0))
    scale = float(np.clip(alone.noise_scale(theta, 0), *JUDGED_SCALE_RANGE))

    def degrees(scale: float) -> float:
        return max(float(problem.data.degrees(scale)) - found.num_used, 1.0)

    left = float(np.sum(problem.tracking_errors(predicted, scale) ** 2))
    stated = float(np.sum(problem.tracking_errors(predicted) ** 2))
    together = float(np.sum(comparison.white[clip] ** 2))
    way, extra, sd = _parts(trials, fit, clip)
    return EachClip(
        clip=problem.name,
        chi2_together=together / degrees(1.0),
        chi2_alone=stated / degrees(1.0),
        p_alone=float(chdtrc(degrees(scale), left)),
        way_m=way,
        extra_m_s2=extra,
        sd_m_s2=sd,
    )


def _parts(
    trials: JointProblem, fit: GradientFit, clip: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Edges of the parts, extra accelerations and their standard deviations."""
    problem = trials.problems[clip]
    theta = trials.of_clip(trials.theta(fit.z, fit.free), clip)
    predicted = problem.simulate(theta)
    seen = np.flatnonzero(problem.observation.mask[0])
    times_s = problem.observation.times_s[seen[0] : seen[-1] + 1]
    path = predicted[0][:, seen[0] : seen[-1] + 1]
    gone = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path), axis=0)))
    edges = np.linspace(0.0, gone[-1], NUM_PARTS + 1)
    fine_s = np.linspace(times_s[0], times_s[-1], FINE * len(times_s))
    fine = np.interp(fine_s, times_s, gone)
    step_s = fine_s[1] - fine_s[0]
    velocity = np.stack([np.gradient(row, times_s) for row in path])
    way = velocity / np.maximum(np.linalg.norm(velocity, axis=0), np.finfo(float).tiny)
    shapes = [velocity]
    for low, high in pairwise(edges):
        inside = (fine > low) & (fine <= high)
        far = np.cumsum(np.cumsum(inside)) * step_s**2
        shapes.append(way * np.interp(times_s, fine_s, far))
    moved = np.zeros((len(shapes), *predicted.shape))
    moved[:, 0, :, seen[0] : seen[-1] + 1] = shapes
    scene = problem.model.scene.surroundings
    data = whitening_in(problem.observation, scene, "tracker")
    left = data.whiten_batch(data.observed_m - predicted, 1.0)
    design = data.whiten_batch(moved, 1.0)
    inverse = np.linalg.pinv(design @ design.T)
    found = inverse @ (design @ left)
    left = np.asarray(left - found @ design).reshape(predicted.shape)[0][:, seen]
    rest = np.sum(left**2) / max(data.num_values - len(found), 1)
    alike = np.clip(np.sum(left[:, 1:] * left[:, :-1]) / np.sum(left**2), 0.0, MOST_ALIKE)
    widened = max(1.0, float(rest)) * (1 + alike) / (1 - alike)
    return edges, found[1:], np.sqrt(np.diagonal(inverse) * widened)[1:]


def leave_one_out_rmse(trials: JointProblem, hypothesis: Hypothesis) -> tuple[float, ...]:
    """Per clip, the rmse (m/s) of its velocities as the other clips predict them.

    A hypothesis that only follows the noise fits every clip and predicts none. The parameters of
    the objects are those that the others gave; what is the clip's own (its release, its start)
    stays at its prior's middle.
    """
    own = hypothesis.of(trials)
    return tuple(_left_out(own, hypothesis, clip) for clip in range(len(own.problems)))


def _left_out(trials: JointProblem, hypothesis: Hypothesis, clip: int) -> float:
    problem = trials.problems[clip]
    others = JointProblem(tuple(p for i, p in enumerate(trials.problems) if i != clip))
    kept = [i for i in range(len(trials.problems)) if i != clip]
    # Names count clips, so that they change where one is left out: places do not.
    start = np.zeros(len(others.model_parameters))
    for new, old in enumerate(kept):
        start[others.columns[new]] = hypothesis.fit.z[trials.columns[old]]
    free = others.free(hypothesis.effects)[: len(start)]
    fit = GradientFitter(others).fit_from(start[None], free[None], np.zeros(1, int))[0]
    shared = dict(zip(others.names, others.theta(fit.z, fit.free), strict=True))
    theta = np.array([_value(p, shared, hypothesis.effects) for p in problem.parameters])
    predicted = problem.simulate(theta)
    return velocity_error([problem], [predicted])["rmse"]


def _value(parameter: Parameter, shared: dict[str, float], effects: tuple[str, ...]) -> float:
    """What the others say; else the prior's middle of an effect that is there; else nothing."""
    is_own = parameter.role == "nuisance" or parameter.per_clip
    if not is_own and parameter.name in shared:
        return float(shared[parameter.name])
    if parameter.per_clip and parameter.name in effects:
        return float(parameter.prior.forward(jnp.asarray(0.0)))
    return parameter.absent

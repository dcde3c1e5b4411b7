"""Score tests: how much of the misfit the slope to an effect explains, before the effect is fitted.

Along the derivative with respect to the effect's strength at zero, after removing what the other
parameters can absorb. It needs one rollout per effect; of an effect with a shape (a position, a
time, a wavelength) one for each shape that is tried: a matched filter.
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import ndtri

from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.parameters import in_units
from galileo_jax.numerics.latin_hypercube import latin_hypercube

# Of a strength's prior: small enough to be a slope, large enough to be seen.
PROBE_Z = 0.1
SMALL_QUANTILE_Z = -2.0
NUM_SHAPES = 96  # tried per candidate whose effect has a shape
SHOWS = 1e-9  # a slope below does not
# Standard deviations by which a probe may change the track and still be a slope: a nuisance that
# is bent far to take an effect's place follows its slope, but not a large effect.
SMALL_CHANGE = 3.0


def score_tests(
    trials: JointProblem, base: GradientFit, candidates: Sequence[tuple[str, ...]]
) -> np.ndarray:
    """How many standard deviations each candidate's slope stands out, at zero strength.

        z = d.r / |d|,   d = the slope of the whitened residuals r, made orthogonal to those of
                             the parameters that are there already

    `[candidate]`, of the last effect of each, without a refit; signed strengths by size.
    """
    here = trials.theta(base.z, base.free)
    strengths = [strength_of(trials, effects[-1]) for effects in candidates]
    probes = np.tile(here, (len(candidates), 1))
    for probe, (where, size) in zip(probes, strengths, strict=True):
        probe[where] = size
    residual, change = _changes(trials, base, probes)
    # As it is, for effects that only act above some strength; and so small that it is a slope.
    share = np.minimum(SMALL_CHANGE / np.maximum(np.linalg.norm(change, axis=1), SHOWS), 1.0)
    smaller = probes.copy()
    for row, own, (where, _) in zip(smaller, share, strengths, strict=True):
        row[where] = here[where] + own * (row[where] - here[where])
    both = np.concatenate([change, _changes(trials, base, smaller)[1]])
    return np.sqrt(explained(*_along(base, residual, both)).reshape(2, -1).max(axis=0))


def strength_of(trials: JointProblem, effect: str) -> tuple[np.ndarray, float]:
    """Where an effect's strengths stand (one per clip, or one), and a small one."""
    where = trials.brought_by(effect)
    first = trials.model_parameters[where[0]]
    own = [i for i in where if trials.model_parameters[i].prior == first.prior]
    is_signed = in_units(first.prior, -1.0) < first.absent
    at = PROBE_Z if is_signed else SMALL_QUANTILE_Z
    return np.array(own if first.per_clip else own[:1]), float(in_units(first.prior, at))


def shapes_beside(
    trials: JointProblem, base: GradientFit, effects: Sequence[str], seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Shapes of the last effect beside a fit: `[shape, z]`, and in units at a probe's size."""
    count = len(trials.model_parameters)
    where, size = strength_of(trials, effects[-1])
    new = np.flatnonzero(trials.free(effects)[:count] & ~base.free[:count])
    shape = np.setdiff1d(new, where)
    number = NUM_SHAPES if len(shape) else 1
    generator = np.random.default_rng([seed, 43])
    z = np.tile(base.z, (number, 1))
    z[:, shape] = ndtri(np.clip(latin_hypercube(number, len(shape), generator), 0.02, 0.98))
    probes = np.array(trials.theta(z, trials.free(effects)))
    probes[:, where] = size
    return z, probes


def slopes_along(
    trials: JointProblem, base: GradientFit, probes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The slopes to each of `probes` along the base fit's residuals, and their squares."""
    return _along(base, *_changes(trials, base, probes))


def misfit(trials: JointProblem, base: GradientFit) -> float:
    """The squared residuals of a fit, whitened, and its pulls: what slopes explain a part of."""
    theta, free = trials.theta(base.z, base.free), base.free[: len(trials.model_parameters)]
    white = trials.whitened(theta[None], theta[len(free) :])
    return float(sum(np.sum(one**2) for one in white) + np.sum(base.z[: len(free)][free] ** 2))


def explained(along: np.ndarray, power: np.ndarray) -> np.ndarray:
    """How much of the squared residuals each slope explains; none where it does not show."""
    return np.where(power > SHOWS, along**2 / np.maximum(power, SHOWS), 0.0)


def _changes(
    trials: JointProblem, base: GradientFit, probes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The base fit's whitened residuals, and how they change to each of `probes`."""
    here = trials.theta(base.z, base.free)
    scale = here[len(trials.model_parameters) :]
    white = np.concatenate(trials.whitened(np.vstack([here, probes]), scale), axis=1)
    return white[0], white[1:] - white[:1]


def _along(
    base: GradientFit, residual: np.ndarray, change: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The slopes along the base fit's residuals, and their squares, as `_changes` finds them.

    Both without what the parameters that are there can take up. The priors' residuals count
    among them: a nuisance that is bent is a misfit, too.
    """
    free = base.free[: base.jacobian.shape[1]]
    basis, _ = np.linalg.qr(np.vstack([base.jacobian[:, free], np.eye(int(free.sum()))]))
    whole = np.append(residual, base.z[: len(free)][free])
    padded = np.pad(change, [(0, 0), (0, int(free.sum()))])
    slopes = padded - (padded @ basis) @ basis.T
    return slopes @ (whole - basis @ (basis.T @ whole)), np.sum(slopes**2, axis=1)

"""What a clip could not have shown: of each effect the smallest strength that it would have.

An effect of strength s bends the whitened residuals by d(s), as far as the free parameters, with
their priors, cannot take it up. It would raise the log odds of the effect over the model without it
to about

    n / 2 log(1 + |d(s)|^2 / n) - z^2 / 2 + log sd_z + log prior

The first term is the gain, where the model without the effect takes d for larger noise in its n
residuals; the next two are what the evidence charges for a strength that has z in its prior and is
known to sd_z. The smallest s at which this is what the verdict asks for (`CONVINCING`, beside
imperfections `DECISIVE`) is the answer. It is an estimate without a fit: from slopes, taken again
at the strength that they gave. Chance adds or takes away some nats in every single clip. Of effects
that were hidden with just this strength, seven clips each, the log odds were on average 6.4
(air_drag) and 7.0 (viscous_drag) on a board, 2.2 +- 2.3 (air_drag) on a ramp with a table, where 7
are asked for.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.special import logsumexp

from galileo_jax.diagnosis.thresholds import CONVINCING, DECISIVE
from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.per_mass import force_constants, is_any_weighed
from galileo_jax.model.parameters import Prior, in_units
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.search.score_tests import (
    SHOWS,
    explained,
    shapes_beside,
    slopes_along,
    strength_of,
)

ROUNDS = 3  # of slopes: each at the strength that the one before gave
RATE_Z = 1e-3  # of a strength's prior: a difference over it is a derivative
PRIOR_Z = np.linspace(-6.0, 4.0, 401)  # strengths that are looked at, in their prior


def could_not_see(
    trials: JointProblem, last: Hypothesis, log_priors: Mapping[str, float], seed: int
) -> dict[str, dict[str, Any]]:
    """The smallest strength of each effect that the clips would have shown, beside a model.

    `last` must describe the clips: else nobody knows their noise. `log_priors` are those of the
    effects of the library, over that of the model without effects.

    Returns:
      effect to `strength` and `unit`, as diagnosis.json has them, the most probable beforehand
      first; strength None where not even the largest that anybody expects would show. Of effects
      that are not in the model; empty where it has parameters of its own, as that of a law.
    """
    own = last.of(trials)  # with imperfections, perhaps
    if own.names != trials.names:
        return {}
    asked = sorted(set(log_priors) - set(last.effects), key=lambda name: (-log_priors[name], name))
    return {name: _entry(own, last, name, log_priors[name], seed) for name in asked}


def shown(
    trials: JointProblem, last: Hypothesis, log_priors: Mapping[str, float], seed: int
) -> list[str]:
    """The effects that may be missing beside a model that describes the clips: worth a fit.

    What a free size of imperfections takes up may yet be an effect. From the slopes to it, for each
    of its shapes, its log odds would be

        -n / 2 log(1 - along^2 / (n |d|^2)) - z^2 / 2 + log sd_z + log prior

    at its best strength, and it is worth a fit where their mean is what the verdict asks for.

    `last`, `log_priors`: as of `could_not_see`.
    """
    own = last.of(trials)
    if own.names != trials.names:
        return []
    needed, asked = _needed_beside(last.fit), sorted(set(log_priors) - set(last.effects))
    return [n for n in asked if _log_odds(own, last, n, seed) + log_priors[n] >= needed]


def _needed_beside(fit: GradientFit) -> float:
    """The log odds that an effect needs beside a fit that describes the clips."""
    return CONVINCING if fit.sizes is None else DECISIVE


def _num_left(fit: GradientFit) -> float:
    """How many residuals tell the noise."""
    return max(fit.num_values - fit.num_used, 1.0)


def _log_odds(trials: JointProblem, last: Hypothesis, effect: str, seed: int) -> float:
    """Of an effect, its log prior left out, by slopes at no strength: the mean over its shapes."""
    where, size = strength_of(trials, effect)
    own = trials.model_parameters[where[0]]
    _, probes = shapes_beside(trials, last.fit, (*last.effects, effect), seed)
    along, power = slopes_along(trials, last.fit, probes)
    step = size - own.absent
    best = own.absent - step * along / np.maximum(power, SHOWS)
    z = np.asarray(own.prior.inverse(best))
    is_one = np.isfinite(z) & (power > SHOWS)  # not of the other sign, or where nothing shows
    z = np.where(is_one, z, 0.0)
    wide = (in_units(own.prior, z + RATE_Z) - in_units(own.prior, z - RATE_Z)) / (2 * RATE_Z)
    num_left = _num_left(last.fit)
    gain = -0.5 * num_left * np.log1p(-np.minimum(explained(along, power) / num_left, 1 - 1e-9))
    odds = gain - 0.5 * z**2 - 0.5 * np.log1p(power * (wide / step) ** 2)
    return float(logsumexp(np.where(is_one, odds, -np.inf)) - np.log(len(odds)))


def smallest_shown(
    power: float, num_left: float, prior: Prior, absent: float, log_prior: float, needed: float
) -> float:
    """The smallest strength whose expected log odds convince; infinite where none does.

    Args:
      power: squared length of the slope to a strength of 1, in units of the noise.
      num_left: how many residuals tell the noise.
      prior: of the strength.
      absent: at which the effect is not there.
      log_prior: of the effect, over that of the model without it.
      needed: log odds that the verdict asks for.
    """
    strength = in_units(prior, PRIOR_Z)
    wide = np.gradient(strength, PRIOR_Z)  # d strength / dz
    sd_z = 1 / np.sqrt(1 + power * wide**2)
    gain = 0.5 * num_left * np.log1p(power * (strength - absent) ** 2 / num_left)
    odds = gain - 0.5 * PRIOR_Z**2 + np.log(sd_z) + log_prior
    return float(np.min(np.abs(strength - absent)[odds >= needed], initial=np.inf))


def _entry(
    trials: JointProblem, last: Hypothesis, effect: str, log_prior: float, seed: int
) -> dict[str, Any]:
    """Of one effect; of one with a place or a length the median of those that are tried."""
    where, _ = strength_of(trials, effect)
    own = trials.model_parameters[where[0]]
    effects = (*last.effects, effect)
    _, probes = shapes_beside(trials, last.fit, effects, seed)
    found = _smallest(trials, last.fit, probes, where, log_prior)
    shown, unit = float(np.median(found)), own.unit
    constants: Mapping[str, str] = force_constants(trials)
    if effect in constants and "m1" in trials.names and not is_any_weighed(trials):
        theta = trials.theta(last.fit.z, last.fit.free)
        shown, unit = shown / float(theta[trials.names.index("m1")]), constants[effect]
    return {"strength": float(f"{shown:.3g}") if np.isfinite(shown) else None, "unit": unit}


def _smallest(
    trials: JointProblem, fit: GradientFit, probes: np.ndarray, where: np.ndarray, log_prior: float
) -> np.ndarray:
    """Of each probe (a shape of the effect), by slopes that are taken nearer and nearer to it."""
    own = trials.model_parameters[where[0]]
    probes = probes.copy()
    num_left, needed = _num_left(fit), _needed_beside(fit)
    found = np.full(len(probes), np.inf)
    for _ in range(ROUNDS):
        _, power = slopes_along(trials, fit, probes)
        size = probes[:, where[0]] - own.absent
        # Where an effect is tried at no strength it shows by none.
        shown = np.divide(power, size**2, out=np.zeros_like(power), where=size != 0)
        for i, squared in enumerate(shown):
            tried = float(squared), num_left, own.prior, own.absent, log_prior, needed
            found[i] = smallest_shown(*tried)
            if np.isfinite(found[i]):
                probes[i, where] = own.absent + found[i]
    return found

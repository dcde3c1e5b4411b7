"""What a clip could not have shown: of each effect the smallest strength that it would have.

And which effects may be missing although a model describes the clip.

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

What a free size of imperfections takes up may yet be an effect. By the slopes d to it, the log odds
of each of its shapes would be, at its best strength,

    -n / 2 log(1 - along^2 / (r^2 |d|^2)) - z^2 / 2 + log sd_z + log prior

with r the residuals, of which noise alone would leave r^2 = n, and `along` their product with d; it
is in question where the mean over its shapes is what the verdict asks for. A size that is fitted
without the effect is too large beside it, and may hide it: so an effect is in question, too, if by
its slopes it is so much more probable in an exact world than none is in this one, and no other
effect is far ahead of it there.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Self

import numpy as np
from scipy.special import logsumexp

from galileo_jax.diagnosis.changed_numbers import changed_numbers
from galileo_jax.diagnosis.thresholds import CONVINCING, DECISIVE
from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.per_mass import force_constants, is_any_weighed
from galileo_jax.model.parameters import Parameter, Prior, in_units
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.search.score_tests import (
    SHOWS,
    explained,
    misfit,
    shapes_beside,
    slopes_along,
    strength_of,
)

ROUNDS = 3  # of slopes: each at the strength that the one before gave
RATE_Z = 1e-3  # of a strength's prior: a difference over it is a derivative
USUAL_Z = 1.0  # as large as effects usually are, in a strength's prior
PRIOR_Z = np.linspace(-6.0, 4.0, 401)  # strengths that are looked at, in their prior


@dataclass(frozen=True)
class Unseen:
    """What a model that describes the clips leaves open of the effects that it does not have.

    Attributes:
      could_not_see: effect to `strength`, `usual`, `unit` and `changes`, as diagnosis.json has
        them, the most probable beforehand first: the smallest strength that the clips would have
        shown, None where not even the largest that anybody expects would; how strong it usually is;
        and the numbers of the fit that this strength (of None, the usual one) would change by more
        than their standard deviations.
      in_question: effects that may be missing although the model describes the clips: from the
        slopes to them they are worth what a verdict asks for, and a free size of imperfections
        takes them up.
    """

    could_not_see: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    in_question: tuple[str, ...] = ()


def unseen(
    trials: JointProblem,
    last: Hypothesis,
    log_priors: Mapping[str, float],
    seed: int,
    exact: Hypothesis | None = None,
) -> Unseen:
    """Of every effect beside a model: the smallest strength to show, and whether it may be there.

    Nothing is said where the model has parameters of its own, as that of a law.

    `trials`: with all effects. `last`: describes the clips: else nobody knows their noise.
    `log_priors`: of the effects of the library, over that of the model without effects. `seed`: of
    the shapes that are tried. `exact`: the same effects in an exact world, where it is
    imperfections that describe the clips.
    """
    own = last.of(trials)  # with imperfections, perhaps
    if own.names != trials.names:
        return Unseen()
    asked = sorted(set(log_priors) - set(last.effects), key=lambda name: (-log_priors[name], name))
    beside = {name: _Beside.of(own, last, name, log_priors[name], seed) for name in asked}
    needed = _needed_beside(last.fit)
    in_question = {name for name, one in beside.items() if one.log_odds() >= needed}
    if exact is not None and last.fit.sizes is not None:
        behind = last.fit.log_evidence - exact.fit.log_evidence
        alone = (_Beside.of(exact.of(trials), exact, n, log_priors[n], seed) for n in asked)
        odds = {one.effect: one.log_odds() - behind for one in alone}
        least = max(needed, max(odds.values(), default=0.0) - DECISIVE)
        in_question |= {name for name, own in odds.items() if own >= least}
    each = [one.entry() for one in beside.values()]
    changes = changed_numbers(own, last.fit, np.array([p for _, p in each])) if each else []
    entries = {
        name: entry | {"changes": changed}
        for name, (entry, _), changed in zip(beside, each, changes, strict=True)
    }
    return Unseen(entries, tuple(sorted(in_question)))


def _needed_beside(fit: GradientFit) -> float:
    """The log odds that an effect needs beside a fit that describes the clips."""
    return CONVINCING if fit.sizes is None else DECISIVE


def _num_left(fit: GradientFit) -> float:
    """How many residuals tell the noise."""
    return max(fit.num_values - fit.num_used, 1.0)


def smallest_shown(
    power: float, num_left: float, prior: Prior, absent: float, log_prior: float, needed: float
) -> float:
    """The smallest strength whose expected log odds are as `needed`; infinite where none has.

    `power`: squared length of the slope to a strength of 1, in units of the noise, which `num_left`
    residuals tell. `prior`: of the strength, which is `absent` without the effect. `log_prior`: of
    the effect, over that of the model without it.
    """
    strength = in_units(prior, PRIOR_Z)
    wide = np.gradient(strength, PRIOR_Z)  # d strength / dz
    sd_z = 1 / np.sqrt(1 + power * wide**2)
    gain = 0.5 * num_left * np.log1p(power * (strength - absent) ** 2 / num_left)
    odds = gain - 0.5 * PRIOR_Z**2 + np.log(sd_z) + log_prior
    return float(np.min(np.abs(strength - absent)[odds >= needed], initial=np.inf))


@dataclass(frozen=True, eq=False)
class _Beside:
    """One effect beside a fit: its shapes as `probes`, `[shape, parameter]`, in units."""

    trials: JointProblem
    fit: GradientFit
    effect: str
    log_prior: float
    probes: np.ndarray
    along: np.ndarray  # [shape], of the slopes at the probes along the residuals
    power: np.ndarray  # [shape], their squares

    @classmethod
    def of(
        cls, trials: JointProblem, last: Hypothesis, effect: str, log_prior: float, seed: int
    ) -> Self:
        _, probes = shapes_beside(trials, last.fit, (*last.effects, effect), seed)
        slopes = slopes_along(trials, last.fit, probes)
        return cls(trials, last.fit, effect, log_prior, probes, *slopes)

    @cached_property
    def _where(self) -> np.ndarray:
        """Which parameters are its strength."""
        return strength_of(self.trials, self.effect)[0]

    @property
    def _strength(self) -> Parameter:
        return self.trials.model_parameters[self._where[0]]

    def log_odds(self) -> float:
        """At its best strength, by the slopes: the mean over its shapes."""
        own = self._strength
        step = self.probes[:, self._where[0]] - own.absent
        best = own.absent - step * self.along / np.maximum(self.power, SHOWS)
        z = np.asarray(own.prior.inverse(best))
        is_one = np.isfinite(z) & (self.power > SHOWS)  # not of the other sign, or none that shows
        z = np.where(is_one, z, 0.0)
        wide = (in_units(own.prior, z + RATE_Z) - in_units(own.prior, z - RATE_Z)) / (2 * RATE_Z)
        num_left = _num_left(self.fit)
        left = max(num_left, misfit(self.trials, self.fit))
        share = np.minimum(explained(self.along, self.power) / left, 1 - 1e-9)
        odds = -0.5 * num_left * np.log1p(-share) - 0.5 * z**2
        odds -= 0.5 * np.log1p(self.power * (wide / step) ** 2)
        mean = float(logsumexp(np.where(is_one, odds, -np.inf)) - np.log(len(odds)))
        return mean + self.log_prior

    def entry(self) -> tuple[dict[str, Any], np.ndarray]:
        """Its smallest strength, the usual one and their unit; and the parameters with it.

        Of one with a place or a length, the median of its shapes.
        """
        smallest, own = self._smallest(), self._strength
        median = np.argsort(smallest)[(len(smallest) - 1) // 2]
        shown, unit, per = float(smallest[median]), own.unit, 1.0
        usual = abs(float(in_units(own.prior, USUAL_Z)) - own.absent)
        probe = self.probes[median].copy()
        probe[self._where] = own.absent + (shown if np.isfinite(shown) else usual)
        constants: Mapping[str, str] = force_constants(self.trials)
        is_per_mass = self.effect in constants and "m1" in self.trials.names
        if is_per_mass and not is_any_weighed(self.trials):
            theta = self.trials.theta(self.fit.z, self.fit.free)
            per, unit = float(theta[self.trials.names.index("m1")]), constants[self.effect]
        strength = float(f"{shown / per:.3g}") if np.isfinite(shown) else None
        return {"strength": strength, "usual": float(f"{usual / per:.3g}"), "unit": unit}, probe

    def _smallest(self) -> np.ndarray:
        """Of each shape, by slopes that are taken nearer and nearer to it."""
        own, probes, power = self._strength, self.probes.copy(), self.power
        num_left, needed = _num_left(self.fit), _needed_beside(self.fit)
        found = np.full(len(probes), np.inf)
        for again in range(ROUNDS):
            if again:
                _, power = slopes_along(self.trials, self.fit, probes)
            size = probes[:, self._where[0]] - own.absent
            # Where an effect is tried at no strength it shows by none.
            shown = np.divide(power, size**2, out=np.zeros_like(power), where=size != 0)
            for i, squared in enumerate(shown):
                tried = float(squared), num_left, own.prior, own.absent, self.log_prior, needed
                found[i] = smallest_shown(*tried)
                if np.isfinite(found[i]):
                    probes[i, self._where] = own.absent + found[i]
        return found

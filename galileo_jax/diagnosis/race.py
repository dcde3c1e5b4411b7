"""The table of the hypotheses fitted so far, to which every race of candidates adds."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from galileo_jax.diagnosis.candidates import Hypothesis, fit_candidates
from galileo_jax.diagnosis.diagnosis import Candidate
from galileo_jax.diagnosis.mended_evidence import mended
from galileo_jax.diagnosis.score_tests import score_tests
from galileo_jax.diagnosis.verdict import (
    decisive_margin,
    is_close_call,
    log_prior,
    may_decide,
    num_expected,
    ranked,
)
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.result import error_of
from galileo_jax.model.effects.effect import Effect
from galileo_jax.model.effects.forms import FORM_NAMES


class Race:
    """Fits candidates, and makes a table of what was fitted so far.

    Attributes:
      fitter: of trials whose models have the whole library.
      base: the fit without effects, from which evidence counts.
      is_adequate: whether that will do.
      seed: of the starts.
      on_candidate: called with each candidate as soon as it is fitted.
    """

    def __init__(
        self,
        fitter: GradientFitter,
        base: Hypothesis,
        is_adequate: bool,
        seed: int,
        on_candidate: Callable[[Candidate], None],
    ):
        self.fitter, self.base, self.is_adequate, self.seed = fitter, base, is_adequate, seed
        self.on_candidate = on_candidate
        self._made: dict[tuple[str, ...], Candidate] = {}

    def __call__(
        self,
        bases: Sequence[Hypothesis],
        sets: Sequence[tuple[str, ...]],
        starts: Sequence[np.ndarray] | None = None,
    ) -> list[Candidate]:
        """Fits sets of effects, each from the fit of all but its last; not ranked yet.

        Args:
          bases: of each the fit of all but its last.
          sets: names of the effects of each.
          starts: of each `[start, model parameter]`, z; None: scattered and matched ones.
        """
        best = max((c.log_odds for c in self._made.values()), default=-np.inf)
        decisive = decisive_margin(self.is_adequate)

        def matters(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
            known = [*(made.hypothesis for made in self._made.values()), *hypotheses]
            if not any(self.fitter.is_explained(one.fit) for one in known):
                return np.ones(len(hypotheses), bool)  # any fit may yet be the one that does
            log_odds = np.array([self.log_odds(one) for one in hypotheses])
            is_form = np.array(
                [any(name in FORM_NAMES for name in one.effects) for one in hypotheses]
            )
            return may_decide(log_odds, is_form, best, decisive, self.is_adequate)

        def needs_mending(hypotheses: Sequence[Hypothesis]) -> np.ndarray:
            log_odds = np.array([self.log_odds(one) for one in hypotheses])
            close = is_close_call(log_odds, best, decisive, self.is_adequate)
            if close.any() and self.base.weighed is None:
                _, found = mended(self.fitter, [self.base.fit], self.seed, None)
                self.base = replace(self.base, weighed=found)
            return close & (self.base.weighed is not None)

        trials = self.fitter.trials
        scores = dict.fromkeys(sets, 0.0)
        for base in {id(base): base for base in bases}.values():
            own = [e for e, other in zip(sets, bases, strict=True) if other is base]
            scores |= dict(zip(own, score_tests(trials, base.fit, own).tolist(), strict=True))

        def make(hypothesis: Hypothesis) -> Candidate:
            made = self._candidate(hypothesis, scores[hypothesis.effects])
            self._made[made.effects] = made
            return made

        def on_fit(hypothesis: Hypothesis) -> None:
            made = make(hypothesis)
            table = ranked(self._made.values())
            self.on_candidate(next(c for c in table if c.effects == made.effects))

        found = fit_candidates(
            self.fitter, bases, sets, self.seed, matters, on_fit, needs_mending, starts
        )
        return [
            made if (made := self._made[one.effects]).hypothesis.is_same(one) else make(one)
            for one in found
        ]

    def log_odds(self, hypothesis: Hypothesis) -> float:
        """Over the model without effects, nats."""
        return self._log_evidence(hypothesis) + self._log_prior(hypothesis)

    def _log_evidence(self, hypothesis: Hypothesis) -> float:
        return hypothesis.evidence_over(self.base)

    def _log_prior(self, hypothesis: Hypothesis) -> float:
        trials = self.fitter.trials
        library = [name for name in trials.all_effects if name not in FORM_NAMES]
        return log_prior(_odds(trials, hypothesis), len(library))

    def _candidate(self, hypothesis: Hypothesis, score_z: float) -> Candidate:
        trials, fit = self.fitter.trials, hypothesis.fit
        return Candidate(
            effects=hypothesis.effects,
            hypothesis=hypothesis,
            error=error_of(trials, trials.theta(fit.z, fit.free), fit.num_fitted, fit.pull),
            score_z=score_z,
            log_evidence=self._log_evidence(hypothesis),
            log_prior=self._log_prior(hypothesis),
            probability=0.0,
            p_value=None,
            confounded_with=(),
            num_constants=_num_constants(trials, hypothesis),
            num_expected=num_expected(_odds(trials, hypothesis)),
        )


def _odds(trials: JointProblem, hypothesis: Hypothesis) -> list[float]:
    """Of each effect of a hypothesis, as far as the clip leads to expect it."""
    problem = trials.problems[0]
    theta = trials.of_clip(trials.theta(hypothesis.fit.z, hypothesis.fit.free), 0)
    named = dict(zip(problem.model.names, theta, strict=True))
    scene = problem.model.scene.surroundings
    return [effect.odds(named, scene) for effect in _effects(trials, hypothesis)]


def _num_constants(trials: JointProblem, hypothesis: Hypothesis) -> int:
    """Parameters of its effects, in one clip."""
    scene = trials.problems[0].model.scene.surroundings
    return sum(len(effect.parameters(scene)) for effect in _effects(trials, hypothesis))


def _effects(trials: JointProblem, hypothesis: Hypothesis) -> list[Effect]:
    effects = trials.problems[0].model.effects
    return [effect for effect in effects if effect.name in hypothesis.effects]

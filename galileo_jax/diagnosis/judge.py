"""Verdicts of tables of candidates, as far as these need comparisons with the data and new fits."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

from galileo_jax.comparison.compare import Comparison, compare
from galileo_jax.diagnosis.diagnosis import Candidate, Verdict
from galileo_jax.diagnosis.law_verdict import (
    contested_by_law,
    law_contested,
    law_verdict,
    other_formulas,
)
from galileo_jax.diagnosis.reasons import because
from galileo_jax.diagnosis.thresholds import PAIR_P
from galileo_jax.diagnosis.verdict import (
    looked_at_again,
    pair_ahead_of_all,
    ranked,
    rivals,
    to_compare,
    verdict_of,
    within_luck,
)
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.search.fit import refit
from galileo_jax.search.hypothesis import Hypothesis


@dataclass(frozen=True)
class Judge:
    """Judges the candidates of one world."""

    trials: JointProblem  # what was diagnosed
    decisive: float  # difference in log odds, nats, at which one hypothesis rules out another
    seed: int  # of the comparisons' replicates
    on_stage: Callable[[str], None] = lambda _: None  # told what is being done
    # made so far, with the fits that were compared, by effects
    comparisons: dict[tuple[str, ...], tuple[GradientFit, Comparison]] = field(default_factory=dict)

    def comparison(self, hypothesis: Hypothesis) -> Comparison:
        """A hypothesis compared with the data, once."""
        known = self._known(hypothesis)
        if known is None:
            known = compare(hypothesis.of(self.trials), hypothesis.fit, self.seed)
            self.comparisons[hypothesis.effects] = hypothesis.fit, known
        return known

    def _known(self, hypothesis: Hypothesis) -> Comparison | None:
        """The comparison, if this fit was compared."""
        fit, made = self.comparisons.get(hypothesis.effects, (None, None))
        return made if fit is hypothesis.fit else None

    def compared(self, candidates: Iterable[Candidate]) -> tuple[Candidate, ...]:
        """The candidates, ranked; the best with p-values and with what they are confounded with."""
        table = ranked(candidates)
        for c in to_compare(table, self.decisive):
            self.comparison(c.hypothesis)
        known = [self._known(c.hypothesis) for c in table]
        p_values = [None if made is None else made.p_value for made in known]
        done = [replace(c, p_value=p) for c, p in zip(table, p_values, strict=True)]
        return tuple(replace(c, confounded_with=rivals(c, done)) for c in done)

    def verdict(self, candidates: Sequence[Candidate]) -> Verdict:
        """On a table without laws; what is named was looked at again."""
        found = verdict_of(candidates, self.decisive)
        return found if found.status != "named" else self._looked_at_again(found, candidates)

    def or_pair(self, verdict: Verdict, candidates: Sequence[Candidate]) -> Verdict:
        """A pair in place of unknown, where it is ahead of all that was tried, formulas too."""
        unknown = verdict.status == "unknown"
        pair = pair_ahead_of_all(candidates, self.decisive) if unknown else None
        if pair is None:
            return verdict
        why = because("explains", pair), because("pair_ahead", pair, least_p_value=PAIR_P)
        named = Verdict("named", pair.effects, reasons=why)
        return self._looked_at_again(named, candidates)

    def or_law(self, before: Verdict, candidates: Sequence[Candidate]) -> Verdict:
        """The verdict law where a formula does what a named effect must; else as before.

        What a formula explains as well is contested.
        """
        law = law_verdict(candidates, self.decisive)
        if law is None:
            said = law_contested(candidates, self.decisive)
            after = contested_by_law(before, candidates, self.decisive)
            return replace(after, reasons=(*before.reasons, *said))
        best = next(c for c in candidates if c.effects == law.effects)
        again = self._looked_at_again(law, other_formulas(best, candidates))
        if again.status == "law":
            return again
        unknown = replace(before, status="unknown", effects=())
        return replace(unknown, reasons=(*before.reasons, *again.reasons))

    def _looked_at_again(self, verdict: Verdict, candidates: Sequence[Candidate]) -> Verdict:
        """A verdict for one hypothesis, if a clip like this one tells it from its confusables."""
        self.on_stage("looking at what could be confused with it")
        named = next(c for c in candidates if c.effects == verdict.effects)
        alike = within_luck(named, candidates, self.decisive)
        leads = expected_leads(self.trials, named, alike)
        expected = list(zip(alike, leads, strict=True))
        return looked_at_again(verdict, named, expected, self.decisive)


def expected_leads(
    trials: JointProblem, candidate: Candidate, rivals: Sequence[Candidate]
) -> list[float]:
    """For each rival, by how many nats it is behind on average if the candidate is true.

    How far a rival is behind in the clip is partly luck: its noise. The clip is therefore made
    once more from the hypothesis' fit with its errors turned round, predicted - (measured -
    predicted), which are as likely as those measured. All are fitted again. What luck gave to one
    side it now gives to the other (exactly, where predictions are linear in the parameters), and
    the mean is free of it:

        expected = (log odds in the clip + log odds in the clip turned round) / 2
    """
    if not rivals:
        return []
    turned = turned_round(candidate.hypothesis.of(trials), candidate.hypothesis.fit)
    fitter = GradientFitter(turned)
    own = refit(fitter, candidate.hypothesis.fit).log_evidence
    fitters = {id(candidate.hypothesis.of(trials)): fitter}
    found = []
    for rival in rivals:
        its = rival.hypothesis.of(trials)
        if id(its) not in fitters:
            pairs = zip(its.problems, turned.problems, strict=True)
            same = tuple(replace(a, observation=b.observation) for a, b in pairs)
            fitters[id(its)] = GradientFitter(JointProblem(same))
        lead = own - refit(fitters[id(its)], rival.hypothesis.fit).log_evidence
        lead += candidate.log_prior - rival.log_prior
        found.append(0.5 * (lead + candidate.log_odds - rival.log_odds))
    return found


def turned_round(trials: JointProblem, fit: GradientFit) -> JointProblem:
    """The trials as they would be with errors of the opposite sign, if the fit were the truth."""
    predicted, problems = trials.simulate(trials.theta(fit.z, fit.free)), []
    for problem, own in zip(trials.problems, predicted, strict=True):
        seen = problem.observation
        turned = replace(seen, position_m=2 * own - seen.position_m)
        problems.append(replace(problem, observation=turned))
    return JointProblem(tuple(problems))

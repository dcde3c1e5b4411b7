"""By how much a clip like this one would tell a hypothesis from its rivals.

How far a rival is behind in the clip is partly luck: its noise. The clip is therefore made once
more from the hypothesis' fit with its errors turned round, predicted - (measured - predicted),
which are as likely as those measured. All are fitted again. What luck gave to one side it now gives
to the other (exactly, where predictions are linear in the parameters), and the mean is free of it:

    expected = (log odds in the clip + log odds in the clip turned round) / 2
"""

from collections.abc import Sequence
from dataclasses import replace

from galileo_jax.diagnosis.diagnosis import Candidate
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.search.fit import refit


def expected_leads(
    trials: JointProblem, candidate: Candidate, rivals: Sequence[Candidate]
) -> list[float]:
    """For each rival, by how many nats it is behind on average if the candidate is true."""
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
            fitters[id(its)] = GradientFitter(_with_observations_of(its, turned))
        lead = own - refit(fitters[id(its)], rival.hypothesis.fit).log_evidence
        lead += candidate.log_prior - rival.log_prior
        found.append(0.5 * (lead + candidate.log_odds - rival.log_odds))
    return found


def _with_observations_of(trials: JointProblem, seen: JointProblem) -> JointProblem:
    """The trials, with other measurements of the same clips."""
    pairs = zip(trials.problems, seen.problems, strict=True)
    return JointProblem(tuple(replace(a, observation=b.observation) for a, b in pairs))


def turned_round(trials: JointProblem, fit: GradientFit) -> JointProblem:
    """The trials as they would be with errors of the opposite sign, if the fit were the truth."""
    theta = trials.theta(fit.z, fit.free)
    problems = []
    for clip, problem in enumerate(trials.problems):
        seen = problem.observation
        predicted = problem.simulate(trials.of_clip(theta, clip))
        turned = replace(seen, position_m=2 * predicted - seen.position_m)
        problems.append(replace(problem, observation=turned))
    return JointProblem(tuple(problems))

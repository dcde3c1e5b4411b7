"""What an ambiguous verdict advises: the setting that is expected to tell most."""

from dataclasses import replace

from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.diagnosis.diagnosis import Diagnosis
from galileo_jax.experiment.belief import beliefs_of
from galileo_jax.experiment.choose import LITTLE, best_first, default_can, expect, sentence_of
from galileo_jax.experiment.settings import grid, parse_can
from galileo_jax.inference.joint_problem import JointProblem

MOST_SETTINGS = 9  # in passing; `galileo next` looks at more


def with_next(found: Diagnosis, clip: Clip, trials: JointProblem, seed: int) -> Diagnosis:
    """The diagnosis whose advice begins with what to measure next, where that helps.

    Clips as long as the first are rehearsed, so that nothing is compiled anew.
    """
    if found.verdict.status != "ambiguous" or not SCENARIOS[clip.scenario].has_ramp:
        return found
    settings = grid(parse_can(default_can(clip, trials)), seed, MOST_SETTINGS)
    seconds = float(trials.problems[0].observation.times_s[-1])
    beliefs = beliefs_of(found)
    best = best_first(expect(clip, trials, beliefs, settings, None, seed, seconds))[0]
    if best.gain_nats < LITTLE:
        return found
    advice = (f"measure next: {sentence_of(best)}", *found.verdict.advice)
    return replace(found, verdict=replace(found.verdict, advice=advice))

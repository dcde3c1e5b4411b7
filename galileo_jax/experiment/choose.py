"""Every setting that a lab allows, and what is expected of an experiment there."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.diagnosis.diagnosis import Diagnosis
from galileo_jax.experiment.gain import about_hypotheses, about_parameter
from galileo_jax.experiment.hypothesis_probabilities import Beliefs, beliefs_of
from galileo_jax.experiment.predicted_experiment import PredictedExperiment, predict_experiment
from galileo_jax.experiment.proposal import height_m, propose
from galileo_jax.experiment.settings import grid, parse_can, text_of
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.per_mass import is_any_weighed
from galileo_jax.runtime import progress
from galileo_jax.runtime.errors import InputError

RATIO = "mass_ratio"
LITTLE = 0.05  # nats; less is not worth an experiment
MOST_SETTINGS = 9  # that a diagnosis looks at in passing; `galileo next` looks at more


@dataclass(frozen=True)
class Expected:
    """One setting, and what is expected of an experiment there."""

    setting: Mapping[str, Any]  # name to value, as the lab calls them
    gain_nats: float  # about which hypothesis holds, or about the parameter asked for
    named: float  # how probable it is that the true hypothesis is then far ahead of all others
    lead_nats: float  # how far it is then ahead on average, log odds
    # How probable it is that object 1 hits another object; None where there is none.
    hit: float | None


def expect(
    clip: Clip,
    trials: JointProblem,
    beliefs: Beliefs,
    settings: Sequence[Mapping[str, Any]],
    about: str | None = None,
    seed: int = 0,
    seconds: float | None = None,
) -> list[Expected]:
    """What is expected of every setting, in their order.

    About the parameter `about` (or mass_ratio), or which hypothesis holds, from a clip of so many
    `seconds` (None: long enough for most).

    Raises:
      InputError: a setting has no place in the scene, or no hypothesis has the parameter.
    """
    if about is not None:
        _check_about(trials, beliefs, about)
    best = beliefs.of[0]
    scale = trials.noise_scale(trials.theta(best.z, best.free), 0)
    log_odds = np.array([one.log_odds for one in beliefs.of])
    has_others = len(trials.problems[0].observation.names) > 1
    found = []
    for i, setting in enumerate(settings):
        progress.report("simulating possible experiments", i / len(settings))
        proposal = propose(clip, trials, scale, setting, seconds)
        predicted = predict_experiment(proposal, trials, beliefs.of, seed)
        gain = about_hypotheses(predicted, log_odds, beliefs.margin, seed)
        nats = gain.nats if about is None else _about(trials, beliefs, predicted, about)
        hits = float(beliefs.probability @ [one.hits for one in predicted])
        found.append(Expected(setting, nats, gain.named, gain.lead, hits if has_others else None))
    return found


def best_first(expected: Sequence[Expected]) -> tuple[Expected, ...]:
    """By gain; of those whose gain is the same, which tell all there is to know, by the lead."""
    return tuple(sorted(expected, key=lambda one: (-round(one.gain_nats, 2), -one.lead_nats)))


def default_can(clip: Clip, trials: JointProblem) -> dict[str, Any]:
    """What nearly every lab allows: lower and higher; flatter and steeper; more frames.

    Not lower and higher where the foot of a board is not known.
    """
    can: dict[str, Any] = {"fps": [clip.fps, 2 * clip.fps, 4 * clip.fps]}
    if not SCENARIOS[clip.scenario].is_sloped and clip.scenario != "fall":
        return can
    height = height_m(clip, trials.problems[0])
    low, high = round(0.4 * height, 3), round(2.0 * height, 3)
    if 0 < low < high:
        can = {"height": (low, high)}
    if clip.ramp_angle_deg is not None:
        flat, steep = max(5.0, clip.ramp_angle_deg - 8), min(45.0, clip.ramp_angle_deg + 8)
        can["angle"] = (round(flat, 1), round(steep, 1))
    return can


def sentence_of(best: Expected, about: str | None = None) -> str:
    """What to do next, in one sentence."""
    where = text_of(best.setting)
    if about is not None:
        narrower = math.exp(best.gain_nats)
        return f"{where}: the interval of {about} becomes {narrower:.1f} times narrower"
    if math.isinf(best.lead_nats):
        return (
            "only one hypothesis is left of those that can be simulated (a law cannot): ask "
            "about a parameter (--about)"
        )
    if best.gain_nats < LITTLE:
        return f"no setting is expected to help: at best {best.gain_nats:.2f} nats, with {where}"
    return (
        f"{where}: named with probability {best.named:.2f} "
        f"({best.gain_nats:.2f} nats expected about which hypothesis holds)"
    )


def _about(
    trials: JointProblem, beliefs: Beliefs, predicted: Sequence[PredictedExperiment], about: str
) -> float:
    """The gain about a parameter, over the hypotheses that have it."""
    weights = _weights(trials, about)
    has = np.array([belief.free[weights != 0].all() for belief in beliefs.of])
    share = beliefs.probability * has
    gains = [
        about_parameter(one, weights) if is_there else 0.0
        for one, is_there in zip(predicted, has, strict=True)
    ]
    return float(share @ gains / share.sum())


def _weights(trials: JointProblem, about: str) -> np.ndarray:
    """The combination of the parameters' z that the name stands for (masses are log-normal)."""
    weights = np.zeros(len(trials.names))
    if about == RATIO:
        for name, sign in (("m1", 1.0), ("m2", -1.0)):
            at = trials.names.index(name)
            weights[at] = sign * trials.parameters[at].prior.sd  # pyright: ignore
    else:
        weights[trials.names.index(about)] = 1.0
    return weights


def _check_about(trials: JointProblem, beliefs: Beliefs, about: str) -> None:
    shared = [
        p.name
        for i, p in enumerate(trials.model_parameters)
        if p.role != "nuisance" and not p.per_clip and any(one.free[i] for one in beliefs.of)
    ]
    ratio = [RATIO] if {"m1", "m2"} <= set(shared) else []
    if about not in (*shared, *ratio):
        known = ", ".join([*shared, *ratio])
        raise InputError(
            f"--about: {about!r} is not a parameter of a likely hypothesis; known: {known}"
        )
    if re.fullmatch(r"m\d+", about) and not is_any_weighed(trials):
        raise InputError(
            f"--about: {about}: a motion shows only the ratio of the masses; {RATIO} expected"
        )


def with_next(found: Diagnosis, clip: Clip, trials: JointProblem, seed: int) -> Diagnosis:
    """The diagnosis whose advice begins with what to measure next, where that helps.

    Clips as long as the first are predicted, so that nothing is compiled anew.
    """
    if found.verdict.status != "ambiguous" or not SCENARIOS[clip.scenario].is_sloped:
        return found
    settings = grid(parse_can(default_can(clip, trials)), seed, MOST_SETTINGS)
    seconds = float(trials.problems[0].observation.times_s[-1])
    beliefs = beliefs_of(found)
    best = best_first(expect(clip, trials, beliefs, settings, None, seed, seconds))[0]
    if best.gain_nats < LITTLE:
        return found
    advice = (f"measure next: {sentence_of(best)}", *found.verdict.advice)
    return replace(found, verdict=replace(found.verdict, advice=advice))

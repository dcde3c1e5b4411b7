"""Comparisons and diagnoses put together by hand, of the closed-form ramp: nothing is fitted."""

from dataclasses import replace
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from galileo_jax.assembly.build_problem import make_problem
from galileo_jax.comparison.compare import Comparison, Place, Pull
from galileo_jax.comparison.phases import PHASES
from galileo_jax.diagnosis import reasons
from galileo_jax.diagnosis.diagnosis import Candidate, Diagnosis, Law, MissingForce, Round, Verdict
from galileo_jax.diagnosis.verdict import ranked
from galileo_jax.inference.fits.gradient import Code, GradientFit
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.model.parameters import inverse
from galileo_jax.search.hypothesis import Hypothesis
from tests.oracle_run import HIT, make_run

LIBRARY = ("air_drag", "release_delay", "viscous_drag")
SD_Z = 0.01
TRUTH = {"m1": 0.5, "m2": 0.3, "k1": 0.1, "k2": 0.2, "air_drag": 0.1, "viscous_drag": 0.1}
LAW = Law("a = 0.99 sin(2π t/1.05 + 0), object 1", "wave_t", "", {})
ERROR = {"rmse": 0.02, "noise": 0.01, "l1": 0.015, "l2": 0.3, "chi2_per_dof": 4.0}


def make_trials(folder: Path) -> JointProblem:
    """One clip; its model has three effects."""
    run = make_run(folder, HIT, 1.6)
    effects = make_effects(LIBRARY)
    return JointProblem((make_problem(run.clip, run.problem.observation, "rigid", effects),))


def fit_of(trials: JointProblem, effects: tuple[str, ...]) -> GradientFit:
    """The truth as if it had been fitted."""
    free = trials.free(effects)
    theta = np.array([TRUTH.get(p.name, p.absent) for p in trials.parameters])
    z = np.clip(np.asarray(inverse(trials.parameters, jnp.asarray(theta))), -2.0, 2.0)
    count = len(trials.model_parameters)
    return GradientFit(
        z=np.where(free, z, 0.0),
        free=free,
        covariance=np.diag(np.where(free, SD_Z**2, 0.0)),
        chi2=100.0,
        log_evidence=-50.0,
        num_values=trials.num_values,
        steps=np.full(count, 0.01),
        jacobian=np.arange(trials.num_values * 1.0)[:, None] * free[:count],
        code=Code.CONVERGED,
        stats={},
        pull=1.0,
        num_pulled=0.5,
    )


def comparison_of(trials: JointProblem, p_value: float) -> Comparison:
    """White residuals with a bump on the ramp, as large as `p_value` is small."""
    observation = trials.problems[0].observation
    count, frames = len(observation.names), len(observation.times_s)
    white = np.random.default_rng(2).standard_normal((count, 2, frames))
    white[0, 0, 10:15] += -np.log10(p_value)
    label = np.full((count, frames), PHASES.index("table"))
    label[0, :20] = PHASES.index("ramp")
    name = trials.problems[0].name
    places = (
        Place(name, "object1", "x", "ramp", 0.03, 0.01, 3 - np.log10(p_value), 0.7),
        Place(name, "object2", "y", "whole", 0.01, 0.01, 0.3, 0.0),
    )
    pulls = (
        Pull("release_instant", -0.05, "s", -4.9),
        Pull("foot_transition", 1.01, "1", 0.2),
    )
    return Comparison(p_value, places, pulls, ERROR, (label,), (white,), (1.0,), False)


def candidate_of(trials: JointProblem, name: str, probability: float, rivals: tuple[str, ...] = ()):
    """One effect in the race."""
    return Candidate(
        effects=(name,),
        hypothesis=Hypothesis((name,), fit_of(trials, (name,))),
        error=ERROR | {"chi2_per_dof": 1.0},
        score_z=5.0,
        log_evidence=np.log(probability) + 40.0,
        log_prior=-2.8,
        probability=probability,
        p_value=0.4 if probability > 0.01 else None,
        confounded_with=rivals,
    )


def diagnosis_of(trials: JointProblem, status: str) -> Diagnosis:
    """A diagnosis of each kind."""
    first = Round(
        Hypothesis((), fit_of(trials, ())), comparison_of(trials, 0.5 if status == "none" else 1e-9)
    )
    rivals = ("viscous_drag",) if status == "ambiguous" else ()
    last = candidate_of(trials, "release_delay", 0.01)
    if status == "unknown":  # a formula that does not explain the data
        last = replace(last, law=LAW, p_value=3e-4)
    candidates = ranked(
        [
            candidate_of(trials, "air_drag", 0.9, rivals),
            candidate_of(trials, "viscous_drag", 0.09),
            last,
        ]
    )
    rounds = (first,)
    if status in ("named", "ambiguous"):
        rounds = (first, Round(candidates[0].hypothesis, comparison_of(trials, 0.4)))
    effects = {"named": ("air_drag",), "ambiguous": ("air_drag", "viscous_drag")}.get(status, ())
    return Diagnosis(
        rounds=rounds,
        candidates=candidates,
        verdict=Verdict(
            status,  # pyright: ignore
            effects,
            advice=("film <it> again",) if effects else (),
            reasons=reasons.without_effects(first.comparison),
        ),
        missing=_missing() if status == "unknown" else None,
    )


def _missing() -> MissingForce:
    times = np.linspace(0, 1.5, 20)
    wave = np.stack([np.sin(6 * times), np.nan * times])  # object 2 rests
    wave[0, :3] = np.nan
    return MissingForce(
        time_s=times,
        acceleration_m_s2=wave,
        sd_m_s2=0.1 + 0 * wave,
        path_m=np.stack([times - 0.5, 0 * times]),
        speed_m_s=np.stack([times, 0 * times]),
    )

"""Noisy tracks of closed-form experiments as trials: nothing of the package made the data."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.problem import Problem, with_shared_parameters
from galileo_jax.model.effects.effect import Effect
from galileo_jax.observation.observation import Observation
from galileo_jax.rollout.engine_path import EnginePath
from tests.ramp_model import make_model
from tests.reference_ramp import Experiment, solve

NOISE_M, FPS, CLIP_S = 2e-4, 30.0, 1.6


def observe(experiment: Experiment, seed: int, noise_m: float = NOISE_M) -> Observation:
    """The experiment, filmed with white noise that is declared as it is."""
    times = np.arange(round(CLIP_S * FPS)) / FPS
    centres = solve(experiment, times).position_m
    count, _, frames = centres.shape
    noise = np.random.default_rng([seed, 7]).standard_normal(centres.shape)
    return Observation(
        names=("object1", "object2")[:count],
        times_s=times,
        position_m=centres + noise_m * noise,
        covariance_m2=np.tile(noise_m**2 * np.eye(2)[None, ..., None], (count, 1, 1, frames)),
        mask=np.ones((count, frames), bool),
    )


def make_trials(
    experiments: Sequence[Experiment], seed: int = 0, effects: tuple[Effect, ...] = ()
) -> JointProblem:
    """One clip of each experiment, with the same effects in all models."""
    problems = []
    for clip, experiment in enumerate(experiments):
        model = replace(make_model(experiment, CLIP_S), effects=effects)
        seen = observe(experiment, seed + 1000 * clip)
        problems.append(Problem(seen, model, EnginePath(model), f"clip{clip + 1}"))
    return JointProblem(with_shared_parameters(problems))

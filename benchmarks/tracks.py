"""Tracks of ramps with known truth, without a video: what inference alone is judged on."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.clip.schema import Clip, ClipObject
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.problem import Problem
from galileo_jax.observation.observation import Observation
from galileo_jax.simulation.motion import roll_out
from galileo_jax.simulation.truth import Truth, draw_truth

# The oracle shares nothing with the package and lives beside the tests that it serves.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from tests.reference_ramp import Experiment, solve

FPS, NUM_FRAMES, RAMP_ANGLE_DEG = 30.0, 61, 20.0


@dataclass(frozen=True)
class Case:
    """A truth and one noisy measurement of it."""

    truth: Truth  # what it was made with
    trials: JointProblem  # the observation alone, with the base model, ready for inference

    @property
    def problem(self) -> Problem:
        """The trials' only one."""
        return self.trials.problems[0]

    @property
    def values(self) -> dict[str, float]:
        """m1, k1, m2, k2."""
        (m1, m2), (k1, k2) = self.truth.mass_kg, self.truth.friction
        return {"m1": m1, "k1": k1, "m2": m2, "k2": k2}


def make_case(seed: int, source: Literal["exact", "engine"], noise_m: float) -> Case:
    """A random experiment in which object 2 is hit, seen for two seconds at 30 fps.

    Args:
      seed: same seed, same case.
      source: "exact": closed form; "engine": the project's own rollouts.
      noise_m: standard deviation of each coordinate in each frame, declared as it is.
    """
    rng = np.random.default_rng([seed, 2])
    truth = draw_truth(rng, RAMP_ANGLE_DEG, {})
    times = np.arange(NUM_FRAMES) / FPS
    motion = _solve_exactly(truth, times) if source == "exact" else roll_out(truth).at(times)
    centres = motion.position_m
    seen = observed(centres + noise_m * rng.standard_normal(centres.shape), FPS, noise_m)
    clip = declared(truth.objects, RAMP_ANGLE_DEG, FPS, NUM_FRAMES)
    return Case(truth, make_joint_problem([clip], [seen]))


def observed(position_m: np.ndarray, fps: float, noise_m: float) -> Observation:
    """Positions `[object, 2, frame]`, m, all seen, with that standard deviation of a coordinate."""
    count, _, frames = position_m.shape
    covariance = np.broadcast_to(noise_m**2 * np.eye(2)[None, ..., None], (count, 2, 2, frames))
    return Observation(
        names=tuple(f"object{i + 1}" for i in range(count)),
        times_s=np.arange(frames) / fps,
        position_m=position_m,
        covariance_m2=covariance.copy(),
        mask=np.ones((count, frames), bool),
    )


def declared(objects: Sequence[ClipObject], angle_deg: float, fps: float, frames: int) -> Clip:
    """The clip that declares a ramp experiment and has a track."""
    return Clip(
        path=Path("made.yaml"),
        track=Path("made.csv"),
        scenario="ramp",
        fps=fps,
        ramp_angle_deg=angle_deg,
        objects=tuple(objects),
        frame_count=frames,
    )


def _solve_exactly(truth: Truth, times_s: np.ndarray):
    where = truth.surroundings
    sizes = zip(where.half_length_m, where.half_height_m, strict=True)
    experiment = Experiment(
        mass_kg=(truth.mass_kg[0], truth.mass_kg[1]),
        friction=(truth.friction[0], truth.friction[1]),
        angle_rad=truth.angle_rad,
        size_m=tuple((2 * length, 2 * height) for length, height in sizes),  # pyright: ignore
        release_m=truth.release_m,
        object2_x_m=truth.stand_x_m[0],
        gravity=truth.gravity,
    )
    return solve(experiment, times_s)

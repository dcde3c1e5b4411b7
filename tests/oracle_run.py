"""A finished run of the closed-form ramp, without the cost of a fit: draws round the truth."""

from math import radians
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import yaml

from galileo_jax.assembly.build_problem import make_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import write_observation_csv
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.posterior import Posterior, Status
from galileo_jax.inference.result import make_result
from galileo_jax.model.parameters import inverse
from galileo_jax.observation.observation import Observation
from galileo_jax.results.run import BEST, Run, save_run
from tests.reference_ramp import Experiment, solve

SIZES = ((0.06, 0.05), (0.07, 0.06))
HIT = Experiment((0.5, 0.3), (0.1, 0.2), radians(20), SIZES, 0.5, 0.25)
PARTS = Experiment((0.3, 0.6), (0.25, 0.1), radians(20), SIZES, 0.5, 0.25)
MISS = Experiment((0.5, 0.3), (0.33, 0.2), radians(20), SIZES, 0.5, 0.25)
STILL = Experiment((0.5, 0.3), (0.5, 0.2), radians(20), SIZES, 0.5, 0.25)

NOISE_M = 2e-4
NUM_DRAWS = 300
# Widths of the draws in the search space; the masses are wide, too, but together.
SD_Z = {
    "foot_transition": 0.05,
    "k1": 0.005,
    "k2": 0.02,
    "m1": 0.02,
    "m2": 0.02,
    "noise_scale": 0.3,
    "release_instant": 0.1,
}


def make_run(folder: Path, experiment: Experiment, clip_s: float) -> Run:
    """Writes the clip's files and a run to `folder`, as `fit` would, and returns the run."""
    rng = np.random.default_rng(1)
    times = np.arange(round(clip_s * 30) + 1) / 30
    centres = solve(experiment, times).position_m
    covariance = np.broadcast_to(NOISE_M**2 * np.eye(2)[None, ..., None], (2, 2, 2, len(times)))
    observation = Observation(
        ("object1", "object2"),
        times,
        centres + NOISE_M * rng.standard_normal(centres.shape),
        covariance,
        np.ones((2, len(times)), bool),
    )
    folder.mkdir(parents=True, exist_ok=True)
    write_observation_csv(folder / "oracle.csv", observation)
    objects = [
        {"name": name, "shape": "box", "size_m": [length, 0.06, height]}
        for name, (length, height) in zip(observation.names, SIZES, strict=True)
    ]
    declared = {"track": "oracle.csv", "scenario": "ramp", "fps": 30.0, "ramp_angle_deg": 20.0}
    (folder / "oracle.yaml").write_text(yaml.safe_dump({**declared, "objects": objects}))
    clip = load_clip(folder / "oracle.yaml")
    problem = make_problem(clip, observation, "rigid")
    trials = JointProblem((problem,))
    truth = {"m1": experiment.mass_kg[0], "m2": experiment.mass_kg[1]}
    truth |= {"k1": experiment.friction[0], "k2": experiment.friction[1]}
    best = np.array([truth.get(p.name, p.absent) for p in trials.parameters])
    z = np.clip(np.asarray(inverse(trials.parameters, jnp.asarray(best))), -2.0, 2.0)
    widths = np.array([SD_Z.get(name, 0.3) for name in trials.names])
    draws = z + widths * rng.standard_normal((NUM_DRAWS, len(z)))
    draws[:, [name in ("m1", "m2") for name in trials.names]] += rng.standard_normal((NUM_DRAWS, 1))
    posterior = Posterior(
        names=trials.names,
        draws=trials.theta(draws).reshape(2, NUM_DRAWS // 2, -1),
        log_density=-0.5 * np.sum(draws**2, axis=-1).reshape(2, -1),
        status=Status.CONVERGED,
        provenance={BEST: np.median(draws, axis=0).tolist()},
    )
    result = make_result(
        trials,
        posterior,
        z,
        clips=["oracle.csv"],
        method="mh",
        seed=3,
        timings_s={"track": 0.0, "compile": 1.0, "fit": 2.0},
        notes={"engine": "rigid"},
    )
    save_run(folder / "run", clip, observation, posterior, result)
    return Run(folder / "run", clip, problem, posterior, result)

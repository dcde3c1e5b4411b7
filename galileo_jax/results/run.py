"""A run: what `fit` leaves in its folder, and what later commands read from it.

DIR/result.json       numbers; its keys: docs/reference/result_files.md
DIR/observation.csv   the track in metres with its covariance
DIR/errors.npz        errors that its frames share, where there are any
DIR/clip.yaml         the clip as fitted, overrides included
DIR/posterior.nc      draws of all parameters (ArviZ InferenceData)
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from galileo_jax.assembly.build_problem import make_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip, ClipFile
from galileo_jax.clip.track_csv import read_observation_csv, write_observation_csv
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.posterior import Posterior
from galileo_jax.inference.problem import Problem
from galileo_jax.measurement.shared_errors import ERRORS, with_errors, write_errors
from galileo_jax.model.effects.nuisances.trial_friction import TrialFriction
from galileo_jax.model.effects.registry import load_file, make_effects
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.atomic_write import write_json, write_text
from galileo_jax.runtime.errors import InputError

RESULT, OBSERVATION = "result.json", "observation.csv"
CLIP, POSTERIOR = "clip.yaml", "posterior.nc"
CHECKPOINT = "chains.checkpoint.npz"
BEST = "z_best"  # in the posterior's provenance: the best fit, in the search space


@dataclass(frozen=True)
class Run:
    """A finished fit."""

    folder: Path  # where it is
    clip: Clip  # as fitted
    problem: Problem  # observation, model and engine, as fitted
    posterior: Posterior  # draws in the parameters' units, names as `trials.names`
    result: dict[str, Any]  # result.json

    @property
    def trials(self) -> JointProblem:
        """The problem alone."""
        return JointProblem((self.problem,))

    @property
    def best(self) -> np.ndarray:
        """`[parameter]`, the best fit in the parameters' units; raises as `best_z`."""
        return self.trials.theta(best_z(self.posterior, self.folder))


def best_z(posterior: Posterior, folder: Path | None) -> np.ndarray:
    """`[parameter]`, the best fit in the search space; refuses a run that has none."""
    if BEST not in posterior.provenance:
        raise InputError(f"{folder}: an earlier version wrote this run; fit the clip anew")
    return np.array(posterior.provenance[BEST])


def save_run(
    folder: Path, clip: Clip, observation: Observation, posterior: Posterior, result: dict[str, Any]
) -> None:
    """Writes a run; result.json last, so that a folder with it is complete."""
    keys = clip.model_dump(mode="json", include=set(ClipFile.model_fields))
    if SCENARIOS[clip.scenario].angle_deg is not None:
        keys["ramp_angle_deg"] = None  # the scenario's own
    for key in ("video", "track"):
        if (file := getattr(clip, key)) is not None:
            keys[key] = str(Path(file).resolve())
    write_text(folder / CLIP, yaml.safe_dump(keys, sort_keys=False))
    write_observation_csv(folder / OBSERVATION, observation)
    write_errors(folder / ERRORS, observation)
    posterior.to_netcdf(folder / POSTERIOR)
    write_json(folder / RESULT, result)


def read_result(folder: Path) -> dict[str, Any]:
    """result.json of a run, of one clip or several."""
    if not (folder / RESULT).is_file():
        raise InputError(f"{folder}: no {RESULT}; a folder written by `galileo fit` expected")
    try:
        return json.loads((folder / RESULT).read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(f"{folder / RESULT}: not JSON ({error})") from error


def load_run(folder: Path, engine: str = "auto") -> Run:
    """Reads a run; refuses a folder that `fit` has not finished, naming what is missing."""
    folder = Path(folder)
    result = read_result(folder)
    clip = load_clip(folder / CLIP)
    observation = with_errors(folder / ERRORS, read_observation_csv(folder / OBSERVATION))
    posterior = Posterior.from_netcdf(folder / POSTERIOR)
    for path in result.get("effects_from", []):
        load_file(path)
    problem = make_problem(
        clip,
        observation,
        engine,
        make_effects(result["effects"]),
        motion=result.get("motion", "planar"),
        free=result.get("free", []),
        trials_differ=TrialFriction.spread in posterior.names,
    )
    if (found := result.get("imperfections")) is not None:
        sizes = {name: entry["z"] for name, entry in found.items() if "z" in entry}
        problem = problem.with_sizes(sizes)
    return Run(folder, clip, problem, posterior, result)

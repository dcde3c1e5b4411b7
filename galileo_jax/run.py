"""A run: what `fit` leaves in its folder, and what later commands read from it.

DIR/result.json       numbers, by contract (DESIGN.md 2.3)
DIR/observation.csv   the track in metres with its covariance
DIR/clip.yaml         the clip as fitted, overrides included
DIR/posterior.nc      draws of all parameters (ArviZ InferenceData)
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from galileo_jax.clip.load import load_clip
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip, ClipFile
from galileo_jax.clip.track_csv import read_observation_csv, write_observation_csv
from galileo_jax.effects.effect import Effect, Surroundings
from galileo_jax.effects.registry import load_file, load_library, make_effects
from galileo_jax.errors import InputError
from galileo_jax.files import write_json, write_text
from galileo_jax.inference.posterior import Posterior
from galileo_jax.inference.problem import Problem, with_shared_parameters
from galileo_jax.inference.trials import Trials
from galileo_jax.observation import Observation
from galileo_jax.rollout.engines import make_engine
from galileo_jax.rollout.model import Model
from galileo_jax.scene.scene import build_scene
from galileo_jax.similarity.gaussian_likelihood import NoiseModel

RESULT, OBSERVATION = "result.json", "observation.csv"
LONGER = 1.15
CLIP, POSTERIOR = "clip.yaml", "posterior.nc"


@dataclass(frozen=True)
class Run:
    """A finished fit.

    Attributes:
      folder: where it is.
      clip: as fitted.
      problem: observation, model and engine, as fitted.
      posterior: draws in the parameters' units, names as `trials.names`.
      result: result.json.
    """

    folder: Path
    clip: Clip
    problem: Problem
    posterior: Posterior
    result: dict[str, Any]

    @property
    def trials(self) -> Trials:
        """The problem alone."""
        return Trials((self.problem,))


def noise_of(clip: Clip, scene: Surroundings) -> NoiseModel:
    """Which imperfections a clip's observation has.

    Positions on a ramp in metres, without any scale in pixels, were measured by no camera that
    anybody knows of. Those of a fall were read off a picture, whoever told them.
    """
    has_pixels = clip.video is not None or clip.pixels_per_metre is not None
    is_measured = scene.has_surface and scene.is_scale_known and not has_pixels
    return "bodies" if is_measured else "camera"


def make_problem(
    clip: Clip,
    observation: Observation,
    engine: str = "auto",
    effects: tuple[Effect, ...] = (),
    noise: NoiseModel | None = None,
    motion: str = "planar",
) -> Problem:
    """A clip with a model of it: the base model, or one with effects; `noise`: its own."""
    for effect in effects:
        if effect.name in SCENARIOS[clip.scenario].without:
            raise InputError(
                f"{clip.path}: effects: {effect.name} has no place in scenario {clip.scenario}, "
                "whose own laws do the same"
            )
    scene = build_scene(clip, observation)
    # An effect may run the clock faster: the frame rate's does.
    margin = LONGER if effects else 1.0
    model = Model(scene, margin * float(observation.times_s[-1]), effects, motion=motion)
    noise = noise or noise_of(clip, scene.surroundings)
    return Problem(observation, model, make_engine(engine, model), clip.path.stem, noise)


def make_trials(
    clips: Sequence[Clip],
    observations: Sequence[Observation],
    engine: str = "auto",
    effects: tuple[Effect, ...] = (),
    noise: NoiseModel | None = None,
    motion: str = "planar",
) -> Trials:
    """Clips of the same objects with the same model."""
    problems = [
        make_problem(clip, observation, engine, effects, noise, motion)
        for clip, observation in zip(clips, observations, strict=True)
    ]
    return Trials(with_shared_parameters(problems))


def save_run(
    folder: Path, clip: Clip, observation: Observation, posterior: Posterior, result: dict[str, Any]
) -> None:
    """Writes a run; result.json last, so that a folder with it is complete."""
    keys = clip.model_dump(mode="json", include=set(ClipFile.model_fields))
    for key in ("video", "track"):
        if (file := getattr(clip, key)) is not None:
            keys[key] = str(Path(file).resolve())
    write_text(folder / CLIP, yaml.safe_dump(keys, sort_keys=False))
    write_observation_csv(folder / OBSERVATION, observation)
    posterior.to_netcdf(folder / POSTERIOR)
    write_json(folder / RESULT, result)


def load_run(folder: Path, engine: str = "auto") -> Run:
    """Reads a run.

    Raises:
      InputError: not a folder that `fit` has finished; names the file that is missing.
    """
    folder = Path(folder)
    if not (folder / RESULT).is_file():
        raise InputError(f"{folder}: no {RESULT}; a folder written by `galileo fit` expected")
    try:
        result = json.loads((folder / RESULT).read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(f"{folder / RESULT}: not JSON ({error})") from error
    clip = load_clip(folder / CLIP)
    observation = read_observation_csv(folder / OBSERVATION)
    posterior = Posterior.from_netcdf(folder / POSTERIOR)
    load_library()
    for path in result.get("effects_from", []):
        load_file(path)
    effects = make_effects(result["effects"])
    motion = result.get("motion", "planar")
    problem = make_problem(clip, observation, engine, effects, motion=motion)
    return Run(folder, clip, problem, posterior, result)

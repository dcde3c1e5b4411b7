"""Tracks of pucks seen from above: drawn, and then written."""

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.clip.track_csv import write_observation_csv
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.errors import InputError
from galileo_jax.simulation.clip_files import WriteClip, write_yaml_and_truth
from galileo_jax.simulation.free import hide_free
from galileo_jax.simulation.hidden import Hidden
from galileo_jax.simulation.level import SCENARIO, LevelTruth, draw_level, solve_level
from galileo_jax.simulation.settings import Settings


def level_clips(settings: Settings, hidden: Sequence[Hidden]) -> list[WriteClip]:
    """Draws the clip; returns what writes it into the file that it is given.

    Raises:
      InputError: a video is asked for, or the scenario has no such parameter, floor or effect.
    """
    if not settings.track_only:
        raise InputError(f"--scenario {SCENARIO}: tracks only; add --track-only")
    if settings.floor:
        raise InputError(f"--floor: there is none in scenario {SCENARIO}")
    things, secrets, looks = np.random.default_rng(settings.seed).spawn(3)
    truth = draw_level(things, settings.values)
    for each in hidden:
        truth = hide_free(truth, each, secrets)
    return [partial(_write, settings, truth, looks)]


def _write(settings: Settings, truth: LevelTruth, looks: np.random.Generator, out: Path) -> None:
    """Writes the track, its yaml and its truth into the folder of `out`."""
    motion, hits = solve_level(truth)
    clock = 1.0 + truth.values.get("frame_rate", 0.0)
    true_fps = settings.fps / clock
    seconds = settings.seconds or float(motion.times_s[-1])
    taken = np.arange(max(2, math.floor(seconds * true_fps) + 1)) / true_fps
    frames = motion.at(taken)
    content: dict[str, Any] = {
        "track": out.name,
        "scenario": truth.scenario,
        "fps": settings.fps,
        "gravity": truth.gravity,
        "objects": [
            {"name": item.name, "shape": item.shape, "size_m": list(item.size_m or ())}
            for item in truth.things
        ],
    }
    scene = truth.surroundings
    names = [parameter.name for e in truth.effects for parameter in e.parameters(scene)]
    record = {
        "name": out.stem,
        "engine": "galileo_jax",
        "scenario": truth.scenario,
        "effect": "+".join(effect.name for effect in truth.effects) or "none",
        "effect_parameters": {name: truth.values[name] for name in names},
        "parameters": dict(truth.values),
        "gravity": truth.gravity,
        "events_s": {"hits": [round(hit, 4) for hit in hits]},
        "frames": len(taken),
        "fps_declared": settings.fps,
        "seed": settings.seed,
    }
    radii = np.array(scene.half_length_m)
    places = np.concatenate([frames.position_m, frames.pitch_rad[:, None]], axis=1)
    # Rims are followed as well as centres.
    sd = np.stack([np.full(len(radii), settings.track_noise)] * 2 + [settings.track_noise / radii])
    noisy = places + sd.T[:, :, None] * looks.standard_normal(places.shape)
    covariance = np.einsum("ao,ab->oab", sd**2, np.eye(3))[..., None] * np.ones(len(taken))
    seen = np.ones((len(radii), len(taken)), bool)
    track = Observation(
        tuple(item.name for item in truth.things),
        taken / clock,
        noisy,
        covariance,
        seen,
        is_turning=True,
    )
    write_observation_csv(out, track)
    write_yaml_and_truth(out, content, record)

"""Clips of what slides on nothing (falls, flights, springs, liquids): drawn, and then written."""

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.clip.track_csv import write_observation_csv
from galileo_jax.model.effects.laws.liquid import Liquid
from galileo_jax.observation.observation import Observation
from galileo_jax.simulation import clip_files
from galileo_jax.simulation.clip_files import WriteClip, write_yaml_and_truth
from galileo_jax.simulation.filming import declared_picture, film, plane_camera, plane_filming
from galileo_jax.simulation.free import WATER_KG_M3, FreeTruth, draw_free, hide_free, solve_free
from galileo_jax.simulation.hidden import Hidden
from galileo_jax.simulation.motion import Motion
from galileo_jax.simulation.record import plane_record
from galileo_jax.simulation.settings import Settings
from galileo_jax.video import synthetic


def free_clips(settings: Settings, hidden: Sequence[Hidden]) -> list[WriteClip]:
    """Draws the clip; returns what writes it into the file that it is given.

    Raises:
      InputError: the scenario has no such parameter, floor or effect.
    """
    things, secrets, looks = np.random.default_rng(settings.seed).spawn(3)
    truth = draw_free(things, settings.scenario, settings.values, settings.floor)
    for each in hidden:
        truth = hide_free(truth, each, secrets)
    return [partial(_write, settings, truth, looks)]


def _write(settings: Settings, truth: FreeTruth, looks: np.random.Generator, out: Path) -> None:
    """Writes the clip, its yaml and its truth into the folder of `out`."""
    motion, bounces = solve_free(truth)
    frames = sampled_motion(truth, motion, settings.fps, settings.seconds or truth.seconds)
    content = declared_content(truth, settings.fps)
    record = plane_record(out.stem, settings, truth, frames) | {
        "events_s": {"bounces": [round(t + _start_s(truth), 4) for t in bounces]},
        "trajectory": {
            "t": np.round(frames.times_s, 6).tolist(),
            "x": np.round(frames.position_m[0, 0], 6).tolist(),
            "y": np.round(frames.position_m[0, 1], 6).tolist(),
        },
    }
    if settings.track_only:
        write_observation_csv(out, noisy_track(truth, frames, settings.track_noise, looks))
        content = {"track": out.name, **content}
    else:
        camera = plane_camera(settings, motion)
        magnified = 1.0 + truth.values.get("scale_error", 0.0)
        first = camera.project(frames.position_m[:, :, 0])[0]
        content["objects"][0]["point_px"] = np.round(first, 1).tolist()
        picture = declared_picture(camera, magnified)
        if not _has_origin(camera):
            del picture["origin_px"]
        content = {"video": out.name, **picture, **content}
        record["pixels_per_metre_true"] = camera.pixels_per_metre
        path = synthetic.Motion(frames.times_s, frames.position_m, frames.pitch_rad)
        bodies = (synthetic.Body(truth.thing.shape, truth.thing.size_m or ()),)
        filming = plane_filming(settings, 1.0 + truth.values.get("frame_rate", 0.0))
        film(out, path, bodies, camera, None, filming, len(frames.times_s), settings.seed)
    write_yaml_and_truth(out, content, record)


def _has_origin(camera: synthetic.Camera) -> bool:
    """Whether `load` allows where heights count from; a swing is filmed from very near."""
    axes = zip(camera.origin_px, camera.size_px, strict=True)
    return all(-size <= at < 2 * size for at, size in axes)


def _start_s(truth: FreeTruth) -> float:
    """When the object is let go, or first looked at, on the true clock after the first frame."""
    return truth.release_s + truth.values.get("release_delay", 0.0)


def sampled_motion(truth: FreeTruth, motion: Motion, fps: float, seconds: float) -> Motion:
    """The motion in the frames' true instants; at the start before it is let go."""
    true_fps = fps / (1.0 + truth.values.get("frame_rate", 0.0))
    taken = np.arange(max(2, math.floor(seconds * true_fps) + 1)) / true_fps
    frames = motion.at(taken - _start_s(truth))
    return Motion(taken, frames.position_m, frames.velocity_m_s, frames.pitch_rad)


def noisy_track(
    truth: FreeTruth, frames: Motion, noise_m: float, rng: np.random.Generator
) -> Observation:
    """The track that a camera of the declared scale and clock would give."""
    start = np.asarray(truth.start_m)[:, None]
    magnified = 1.0 + truth.values.get("scale_error", 0.0)
    clock = 1.0 + truth.values.get("frame_rate", 0.0)
    shown = start + magnified * (frames.position_m - start)
    sd = np.full(shown.shape[:2], noise_m)
    return clip_files.noisy_track((truth.thing.name,), frames.times_s / clock, shown, sd, rng)


def declared_content(truth: FreeTruth, fps: float) -> dict[str, Any]:
    """What a user would declare: the mass and the size, that there is a floor, the liquid."""
    thing = truth.thing
    content: dict[str, Any] = {"scenario": truth.scenario, "fps": fps, "gravity": truth.gravity}
    if "floor_restitution" in truth.values:
        content["floor"] = True
    if Liquid.name in truth.surroundings.laws:
        content["liquid_density"] = WATER_KG_M3
    content["objects"] = [
        {
            "name": thing.name,
            "shape": thing.shape,
            "size_m": list(thing.size_m or ()),
            "mass_kg": float(f"{thing.mass_kg:.4g}"),
        }
    ]
    return content

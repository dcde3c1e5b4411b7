"""Clips of what is on no ramp (falls, flights, springs, liquids, pendulums, pucks): drawn, written.

A track is what a camera of the declared scale and clock would give.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.track_csv import write_observation_csv
from galileo_jax.model.effects.laws.liquid import Liquid
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.errors import InputError
from galileo_jax.simulation import clip_files
from galileo_jax.simulation.clip_files import WriteClip, declared_objects, write_yaml_and_truth
from galileo_jax.simulation.filming import (
    MARGIN_M,
    declared_picture,
    filming_of,
    plane_camera,
    reported,
)
from galileo_jax.simulation.free import WATER_KG_M3, draw_free, solve_free
from galileo_jax.simulation.hidden import Hidden
from galileo_jax.simulation.level import draw_level, solve_level
from galileo_jax.simulation.motion import Motion
from galileo_jax.simulation.plane import PlaneTruth, hide_in_plane
from galileo_jax.simulation.record import plane_record
from galileo_jax.simulation.settings import Settings
from galileo_jax.simulation.truth import Declared
from galileo_jax.video import synthetic

RUN_UP_S = 0.2  # no exposure is longer
PUCKS_MARGIN_M = 0.05  # of the picture round the centres: pucks are small, and no wider than that


def plane_clips(settings: Settings, hidden: Sequence[Hidden]) -> list[WriteClip]:
    """Draws the clip; returns what writes it into the file that it is given.

    Raises:
      InputError: the scenario has no such parameter, floor or effect.
    """
    things, secrets, looks = np.random.default_rng(settings.seed).spawn(3)
    scenario = SCENARIOS[settings.scenario]
    if settings.floor and "floor" not in scenario.keys:
        raise InputError(f"--floor: there is none in scenario {settings.scenario}")
    if scenario.is_level:
        truth = draw_level(things, settings.values, settings.walls)
    else:
        truth = draw_free(things, settings.scenario, settings.values, settings.floor)
    for each in hidden:
        truth = hide_in_plane(truth, each, secrets)
    if settings.seconds is not None:
        truth = replace(truth, seconds=max(truth.seconds, settings.seconds))
    return [partial(_write, settings, truth, looks)]


def _write(settings: Settings, truth: PlaneTruth, looks: np.random.Generator, out: Path) -> None:
    """Writes the clip, its yaml and its truth into the folder of `out`."""
    scene = truth.surroundings
    motion, events_s = (solve_level if scene.is_level else solve_free)(truth)
    seconds = settings.seconds or min(truth.seconds, float(motion.times_s[-1]))
    declared = truth.declared(settings.fps)
    frames = sampled_motion(declared, motion, seconds)
    content = declared_content(truth, settings.fps)
    events = "hits" if scene.is_level else "bounces"
    record = plane_record(out.stem, settings, truth, frames) | {
        "events_s": {events: [round(t + declared.release_s, 4) for t in events_s]}
    }
    if not scene.is_level:
        rows = (frames.times_s, *frames.position_m[0])
        rounded = [np.round(row, 6).tolist() for row in rows]
        record["trajectory"] = dict(zip("txy", rounded, strict=True))
    if settings.track_only:
        write_observation_csv(
            out, noisy_track(truth, declared, frames, settings.track_noise, looks)
        )
        content = {"track": out.name, **content}
    else:
        margin = PUCKS_MARGIN_M if scene.is_level else MARGIN_M
        camera = plane_camera(settings, motion, margin)
        points = camera.project(frames.position_m[:, :, 0])
        for entry, point in zip(content["objects"], points, strict=True):
            entry["point_px"] = np.round(point, 1).tolist()
        picture = declared_picture(camera, declared.scale)
        if not _has_origin(camera):
            del picture["origin_px"]
        content = {"video": out.name, **picture, **content}
        record["pixels_per_metre_true"] = camera.pixels_per_metre
        path = synthetic.Motion(frames.times_s, frames.position_m, frames.pitch_rad)
        if scene.is_level:
            path = _with_run_up(motion)
        # From above a puck is a disc, and all else is a ball.
        bodies = tuple(synthetic.Body((2 * r, 2 * r), is_round=True) for r in scene.half_length_m)
        count, seed = len(frames.times_s), settings.seed
        filming = filming_of(settings, declared, count, looks)
        film = synthetic.render_frames(path, bodies, camera, None, filming, count, seed=seed)
        synthetic.write_clip(out, film, camera, filming, reported(count))
    write_yaml_and_truth(out, content, record)


def _has_origin(camera: synthetic.Camera) -> bool:
    """Whether `load` allows where heights count from; a swing is filmed from very near."""
    axes = zip(camera.origin_px, camera.size_px, strict=True)
    return all(-size <= at < 2 * size for at, size in axes)


def _with_run_up(motion: Motion) -> synthetic.Motion:
    """As it is filmed: half of the first exposure is before the start, and pucks move then, too."""
    place, turned = motion.position_m, motion.pitch_rad
    spin = (turned[:, 1] - turned[:, 0]) / (motion.times_s[1] - motion.times_s[0])
    before = place[..., 0] - RUN_UP_S * motion.velocity_m_s[..., 0]
    return synthetic.Motion(
        np.append(-RUN_UP_S, motion.times_s),
        np.concatenate([before[..., None], place], axis=-1),
        np.concatenate([(turned[:, 0] - RUN_UP_S * spin)[:, None], turned], axis=-1),
    )


def sampled_motion(declared: Declared, motion: Motion, seconds: float) -> Motion:
    """The motion in the frames' true instants; at the start before it is let go."""
    true_fps = declared.true_fps
    taken = np.arange(max(2, math.floor(seconds * true_fps) + 1)) / true_fps
    frames = motion.at(taken - declared.release_s)
    return Motion(taken, frames.position_m, frames.velocity_m_s, frames.pitch_rad)


def noisy_track(
    truth: PlaneTruth,
    declared: Declared,
    frames: Motion,
    noise_m: float,
    rng: np.random.Generator,
) -> Observation:
    """The track: of centres, and from above of turning, since rims are followed as well."""
    scene = truth.surroundings
    if scene.is_level:
        shown = np.concatenate([frames.position_m, frames.pitch_rad[:, None]], axis=1)
        sd = noise_m / np.array([(1.0, 1.0, radius) for radius in scene.half_length_m])
    else:
        start = np.asarray(truth.start_m)[..., None]
        shown = start + declared.scale * (frames.position_m - start)
        sd = np.full(shown.shape[:2], noise_m)
    times = np.arange(len(frames.times_s)) / declared.fps
    return clip_files.noisy_track(scene.names, times, shown, sd, rng, is_turning=scene.is_level)


def declared_content(truth: PlaneTruth, fps: float) -> dict[str, Any]:
    """What a user would declare: sizes, a mass that is known, floor, liquid and walls."""
    content: dict[str, Any] = {"scenario": truth.scenario, "fps": fps, "gravity": truth.gravity}
    if "floor_restitution" in truth.values:
        content["floor"] = True
    if Liquid.name in truth.surroundings.laws:
        content["liquid_density"] = WATER_KG_M3
    content["objects"] = declared_objects(truth.things)
    if truth.walls_m:
        content["walls"] = [
            {"from_m": list(one), "to_m": list(other)} for one, other in truth.walls_m
        ]
    return content

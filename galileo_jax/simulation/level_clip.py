"""Clips of pucks seen from above: drawn, and then written."""

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.clip.track_csv import write_observation_csv
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.errors import InputError
from galileo_jax.simulation.clip_files import WriteClip, noisy_track, write_yaml_and_truth
from galileo_jax.simulation.filming import declared_picture, film, plane_camera, plane_filming
from galileo_jax.simulation.free import hide_free
from galileo_jax.simulation.hidden import Hidden
from galileo_jax.simulation.level import SCENARIO, LevelTruth, draw_level, solve_level
from galileo_jax.simulation.motion import Motion
from galileo_jax.simulation.record import plane_record
from galileo_jax.simulation.settings import Settings
from galileo_jax.video import synthetic

RUN_UP_S = 0.2  # no exposure is longer
MARGIN_M = 0.05  # of the picture round the centres: pucks are small, and no wider than that


def level_clips(settings: Settings, hidden: Sequence[Hidden]) -> list[WriteClip]:
    """Draws the clip; returns what writes it into the file that it is given.

    Raises:
      InputError: the scenario has no such parameter, floor or effect.
    """
    if settings.floor:
        raise InputError(f"--floor: there is none in scenario {SCENARIO}")
    things, secrets, looks = np.random.default_rng(settings.seed).spawn(3)
    truth = draw_level(things, settings.values, settings.walls)
    for each in hidden:
        truth = hide_free(truth, each, secrets)
    return [partial(_write, settings, truth, looks)]


def _write(settings: Settings, truth: LevelTruth, looks: np.random.Generator, out: Path) -> None:
    """Writes the clip, its yaml and its truth into the folder of `out`."""
    motion, hits = solve_level(truth)
    clock = 1.0 + truth.values.get("frame_rate", 0.0)
    true_fps = settings.fps / clock
    seconds = settings.seconds or float(motion.times_s[-1])
    taken = np.arange(max(2, math.floor(seconds * true_fps) + 1)) / true_fps
    frames = motion.at(taken)
    content: dict[str, Any] = {
        "track" if settings.track_only else "video": out.name,
        "scenario": truth.scenario,
        "fps": settings.fps,
        "gravity": truth.gravity,
        "objects": [
            {"name": item.name, "shape": item.shape, "size_m": list(item.size_m or ())}
            for item in truth.things
        ],
    }
    if truth.walls_m:
        content["walls"] = [
            {"from_m": list(one), "to_m": list(other)} for one, other in truth.walls_m
        ]
    scene = truth.surroundings
    hits_s = [round(hit, 4) for hit in hits]
    record = plane_record(out.stem, settings, truth, frames) | {"events_s": {"hits": hits_s}}
    if settings.track_only:
        write_observation_csv(out, _track(settings, truth, frames, taken / clock, looks))
    else:
        camera = plane_camera(settings, motion, MARGIN_M)
        for entry, point in zip(
            content["objects"], camera.project(frames.position_m[:, :, 0]), strict=True
        ):
            entry["point_px"] = np.round(point, 1).tolist()
        content |= declared_picture(camera)
        record["pixels_per_metre_true"] = camera.pixels_per_metre
        path = _with_run_up(motion)
        # From above a puck is a disc.
        bodies = tuple(synthetic.Body("sphere", (radius,)) for radius in scene.half_length_m)
        filming = plane_filming(settings, clock)
        film(out, path, bodies, camera, None, filming, len(taken), settings.seed)
    write_yaml_and_truth(out, content, record)


def _with_run_up(motion: Motion) -> synthetic.Motion:
    """As it is filmed: half of the first exposure is before the start, and pucks move then, too."""
    place, turned = motion.position_m, motion.pitch_rad
    spin = (turned[:, 1] - turned[:, 0]) / (motion.times_s[1] - motion.times_s[0])
    return synthetic.Motion(
        np.append(-RUN_UP_S, motion.times_s),
        np.concatenate(
            [(place[..., 0] - RUN_UP_S * motion.velocity_m_s[..., 0])[..., None], place], axis=-1
        ),
        np.concatenate([(turned[:, 0] - RUN_UP_S * spin)[:, None], turned], axis=-1),
    )


def _track(
    settings: Settings,
    truth: LevelTruth,
    frames: Motion,
    times_s: np.ndarray,
    looks: np.random.Generator,
) -> Observation:
    """The track of centres and of turning: rims are followed as well."""
    scene = truth.surroundings
    places = np.concatenate([frames.position_m, frames.pitch_rad[:, None]], axis=1)
    sd = settings.track_noise / np.array([(1.0, 1.0, radius) for radius in scene.half_length_m])
    return noisy_track(scene.names, times_s, places, sd, looks, is_turning=True)

"""What `galileo simulate` writes where nothing slides: falls, flights, springs, liquids."""

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.clip.load import check_clip
from galileo_jax.clip.track_csv import write_observation_csv
from galileo_jax.clip.yaml_edit import dump
from galileo_jax.commands import command
from galileo_jax.files.atomic_write import write_json, write_text
from galileo_jax.model.effects.laws.liquid import Liquid
from galileo_jax.observation.observation import Observation
from galileo_jax.simulation.free import WATER_KG_M3, FreeTruth, draw_free, hide_free, solve_free
from galileo_jax.simulation.hidden import Hidden
from galileo_jax.simulation.motion import Motion
from galileo_jax.video import synthetic

FREE_SCENARIOS = ("fall", "flight", "spring", "liquid")
MARGIN_M = 0.10  # round the motion, to the picture's edge


def write_free_clip(out: Path, call: argparse.Namespace, hidden: Sequence[Hidden]) -> None:
    """Writes the clip (a track or a video by the suffix), its yaml and its truth."""
    things, secrets, looks = np.random.default_rng(call.seed).spawn(3)
    truth = draw_free(things, call.scenario, dict(call.set), call.floor)
    for each in hidden:
        truth = hide_free(truth, each, secrets)
    motion, bounces = solve_free(truth)
    seconds = call.seconds or truth.seconds
    frames = seen_motion(truth, motion, call.fps, seconds)
    content = clip_content(truth, call.fps)
    scene = truth.surroundings
    names = [parameter.name for e in truth.effects for parameter in e.parameters(scene)]
    record: dict[str, Any] = {
        "name": out.stem,
        "engine": "galileo_jax",
        "scenario": truth.scenario,
        "effect": "+".join(effect.name for effect in truth.effects) or "none",
        "effect_parameters": {name: truth.values[name] for name in names},
        "parameters": dict(truth.values),
        "gravity": truth.gravity,
        "events_s": {"bounces": [round(t + start_s(truth), 4) for t in bounces]},
        "trajectory": {
            "t": np.round(frames.times_s, 6).tolist(),
            "x": np.round(frames.position_m[0, 0], 6).tolist(),
            "y": np.round(frames.position_m[0, 1], 6).tolist(),
        },
        "frames": len(frames.times_s),
        "fps_declared": call.fps,
        "seed": call.seed,
    }
    if call.track_only:
        write_observation_csv(out, noisy(truth, frames, call.track_noise, looks))
        content = {"track": out.name, **content}
    else:
        camera = _camera(call, motion)
        magnified = 1.0 + truth.values.get("scale_error", 0.0)
        first = camera.project(frames.position_m[:, :, 0])[0]
        content["objects"][0]["point_px"] = np.round(first, 1).tolist()
        content = {
            "video": out.name,
            "direction": call.direction,
            "pixels_per_metre": round(camera.pixels_per_metre / magnified, 2),
            "origin_px": list(camera.origin_px),
            **content,
        }
        record["pixels_per_metre_true"] = camera.pixels_per_metre
        _film(out, truth, frames, camera, call)
    check_clip(out.with_suffix(".yaml"), content)
    write_json(out.with_suffix(".truth.json"), record)
    write_text(out.with_suffix(".yaml"), dump(content))


def start_s(truth: FreeTruth) -> float:
    """When the object is let go, or first looked at, on the true clock after the first frame."""
    return truth.release_s + truth.values.get("release_delay", 0.0)


def seen_motion(truth: FreeTruth, motion: Motion, fps: float, seconds: float) -> Motion:
    """The motion in the frames' true instants; at the start before it is let go."""
    true_fps = fps / (1.0 + truth.values.get("frame_rate", 0.0))
    taken = np.arange(max(2, math.floor(seconds * true_fps) + 1)) / true_fps
    frames = motion.at(taken - start_s(truth))
    return Motion(taken, frames.position_m, frames.velocity_m_s, frames.pitch_rad)


def noisy(
    truth: FreeTruth, frames: Motion, noise_m: float, rng: np.random.Generator
) -> Observation:
    """The track that a camera of the declared scale and clock would give."""
    start = np.asarray(truth.start_m)[:, None]
    magnified = 1.0 + truth.values.get("scale_error", 0.0)
    clock = 1.0 + truth.values.get("frame_rate", 0.0)
    shown = start + magnified * (frames.position_m - start)
    count = len(frames.times_s)
    return Observation(
        names=(truth.thing.name,),
        times_s=frames.times_s / clock,
        position_m=shown + noise_m * rng.standard_normal(shown.shape),
        covariance_m2=np.broadcast_to(noise_m**2 * np.eye(2)[None, :, :, None], (1, 2, 2, count)),
        mask=np.ones((1, count), bool),
    )


def clip_content(truth: FreeTruth, fps: float) -> dict[str, Any]:
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


def _camera(call: argparse.Namespace, motion: Motion) -> synthetic.Camera:
    """A camera that has the whole motion in the picture, the floor (y = 0) just in it."""
    width, height = call.size
    low, high = motion.position_m[0].min(axis=1), motion.position_m[0].max(axis=1)
    span = np.maximum(high - low, 0.2) + 2 * MARGIN_M
    scale = float(math.floor(min(width / span[0], height / span[1])))
    middle = (low + high) / 2
    sign = 1.0 if call.direction == "right" else -1.0
    origin = (width / 2 - sign * scale * middle[0], height / 2 + scale * middle[1])
    return synthetic.Camera(
        pixels_per_metre=scale,
        origin_px=(round(float(origin[0]), 1), round(float(origin[1]), 1)),
        size_px=(width, height),
        direction=call.direction,
    )


def _film(
    out: Path, truth: FreeTruth, frames: Motion, camera: synthetic.Camera, call: argparse.Namespace
) -> None:
    clock = 1.0 + truth.values.get("frame_rate", 0.0)
    filming = synthetic.Filming(
        fps=call.fps / clock,
        written_fps=call.fps,
        exposure_s=min(call.exposure, clock / call.fps),
        noise_grey_levels=call.noise,
        defocus_px=call.defocus,
    )
    path = synthetic.Motion(frames.times_s, frames.position_m, frames.pitch_rad)
    bodies = (synthetic.Body(truth.thing.shape, truth.thing.size_m or ()),)
    count = len(frames.times_s)
    with command.progress() as bar:
        task = bar.add_task("rendering", total=count)
        synthetic.render_clip(
            out,
            path,
            bodies,
            camera,
            None,
            filming,
            count,
            seed=call.seed,
            on_frame=lambda: bar.advance(task),
        )

"""How a synthetic clip is filmed: where the camera stands, what goes wrong, the video itself."""

import itertools
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.clip.schema import ClipObject
from galileo_jax.clip.sizes import extents
from galileo_jax.runtime import progress
from galileo_jax.simulation.motion import Motion
from galileo_jax.simulation.settings import Settings
from galileo_jax.simulation.truth import Declared, Truth
from galileo_jax.video import synthetic

MARGIN_M = 0.10  # round the motion, to the picture's edge
WIDEST_M = 2.5
SMALLEST_SPAN_M = 0.2  # of a motion without a ramp
TABLE_AT = 0.80  # of the picture's height
KEYSTONE_PER_M = 0.01
ROLL_RAD = math.radians(0.5)
SWAY_RAD = math.radians(0.2)  # sd of how far a camera in a hand turns
RAMP_ABOVE_M = 0.12  # how far the ramp goes on above object 1


def ramp_camera(
    settings: Settings, truth: Truth, frames: Motion, rng: np.random.Generator
) -> synthetic.Camera:
    """A camera that has the ramp and the whole motion in the picture."""
    width, height = settings.size
    behind = truth.release_m * math.cos(truth.angle_rad) + MARGIN_M
    ahead = float(frames.position_m[:, 0].max()) + MARGIN_M
    span = min(behind + ahead, WIDEST_M)
    top = float(frames.position_m[0, 1].max()) + MARGIN_M
    scale = math.floor(min(width / span, TABLE_AT * height / top))
    spare = max(0.0, width / scale - behind - ahead)
    left = (behind + spare / 2) * scale
    foot = left if settings.direction == "right" else width - left
    shift = rng.uniform(-0.01, 0.01, 2) * (width, height)
    origin = (round(float(foot + shift[0]), 1), round(float(TABLE_AT * height + shift[1]), 1))
    is_askew, is_rolled = (fault in settings.camera_fault for fault in ("keystone", "roll"))
    keystone = rng.uniform(-KEYSTONE_PER_M, KEYSTONE_PER_M, 2) if is_askew else (0.0, 0.0)
    return synthetic.Camera(
        pixels_per_metre=float(scale),
        origin_px=origin,
        size_px=(width, height),
        direction=settings.direction,
        keystone_per_m=(float(keystone[0]), float(keystone[1])),
        roll_rad=float(rng.uniform(-ROLL_RAD, ROLL_RAD)) if is_rolled else 0.0,
    )


def plane_camera(
    settings: Settings, motion: Motion, margin_m: float = MARGIN_M
) -> synthetic.Camera:
    """A camera that has the motion of all objects in the picture, the floor (y = 0) just in it."""
    width, height = settings.size
    low, high = motion.position_m.min(axis=(0, 2)), motion.position_m.max(axis=(0, 2))
    span = np.maximum(high - low, SMALLEST_SPAN_M) + 2 * margin_m
    scale = float(math.floor(min(width / span[0], height / span[1])))
    middle = (low + high) / 2
    sign = 1.0 if settings.direction == "right" else -1.0
    origin = (width / 2 - sign * scale * middle[0], height / 2 + scale * middle[1])
    return synthetic.Camera(
        pixels_per_metre=scale,
        origin_px=(round(float(origin[0]), 1), round(float(origin[1]), 1)),
        size_px=(width, height),
        direction=settings.direction,
    )


def declared_picture(camera: synthetic.Camera, magnified: float = 1.0) -> dict[str, Any]:
    """What the yaml says of a picture in which lengths are `magnified` times as large."""
    return {
        "direction": camera.direction,
        "pixels_per_metre": round(camera.pixels_per_metre / magnified, 2),
        "pixels_per_metre_sd": 0.0,
        "origin_px": list(camera.origin_px),
    }


def filming_of(
    settings: Settings, declared: Declared, num_frames: int, rng: np.random.Generator
) -> synthetic.Filming:
    """Frame rate, exposure and faults; the hand and the missed frames are drawn."""
    hand = None
    if settings.hand:
        hand = synthetic.Hand(
            leave_s=max(0.0, declared.release_s) + float(rng.uniform(1, 4)) / settings.fps,
            speed_m_s=float(rng.uniform(1.2, 1.9)),
            offset_m=(float(rng.uniform(-0.028, -0.008)), float(rng.uniform(0.010, 0.026))),
        )
    inner = np.arange(1, num_frames)
    missed = rng.choice(inner, min(settings.missed_frames, len(inner)), replace=False)
    return synthetic.Filming(
        fps=declared.true_fps,
        written_fps=declared.fps,
        exposure_s=min(settings.exposure, 1 / declared.true_fps),
        noise_grey_levels=settings.noise,
        defocus_px=settings.defocus,
        repeated_frames=tuple(sorted(map(int, missed))),
        hand=hand,
        sway_rad=SWAY_RAD if "hand_held" in settings.camera_fault else 0.0,
    )


def film_ramp(
    out: Path,
    truth: Truth,
    declared: Declared,
    motion: Motion,
    camera: synthetic.Camera,
    filming: synthetic.Filming,
    num_frames: int,
    seed: int,
) -> dict[str, Any]:
    """Renders the video; returns what of the filming belongs into the truth."""
    path = synthetic.Motion(
        motion.times_s + declared.release_s, motion.position_m, motion.pitch_rad
    )
    bodies = tuple(_body(each) for each in truth.objects)
    ramp = synthetic.Ramp(truth.angle_rad, truth.release_m + RAMP_ABOVE_M)
    film = synthetic.render_frames(path, bodies, camera, ramp, filming, num_frames, seed=seed)
    covered = synthetic.write_clip(out, film, camera, filming, reported(num_frames))
    hand = filming.hand
    with_hand = np.flatnonzero(covered.max(axis=0))
    return {
        "noise_grey_levels": filming.noise_grey_levels,
        "flicker": filming.flicker,
        "exposure_s": filming.exposure_s,
        "defocus_px": filming.defocus_px,
        "repeated_frames": list(filming.repeated_frames),
        "hand": hand
        and {
            "leave": math.ceil(hand.leave_s * filming.fps),
            "gone": int(with_hand[-1]) + 1 if with_hand.size else 0,
            "speed": hand.speed_m_s,
            "off": list(hand.offset_m),
        },
        "covered": {
            each.name: [round(float(share), 3) for share in row]
            for each, row in zip(truth.objects, covered, strict=True)
        },
    }


def reported(num_frames: int) -> Callable[[], None]:
    """What reports the progress when it is called after each frame."""
    drawn = itertools.count(1)
    return lambda: progress.report("rendering", next(drawn) / num_frames)


def _body(declared: ClipObject) -> synthetic.Body:
    """What rolls is a disc from the side."""
    half_length, half_height = extents(declared)
    is_round = declared.roll_inertia is not None or declared.shape in ("sphere", "torus")
    return synthetic.Body((2 * half_length, 2 * half_height), is_round)

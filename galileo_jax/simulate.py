"""`galileo simulate`: make a clip with known truth (video or track, yaml, truth)."""

import argparse
import math
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax import command
from galileo_jax.clip.load import check_clip
from galileo_jax.clip.track_csv import write_observation_csv
from galileo_jax.clip.yaml_edit import dump
from galileo_jax.errors import InputError
from galileo_jax.files import write_json, write_text
from galileo_jax.observation import Observation
from galileo_jax.truth import LONGEST_S, Motion, Truth, draw_truth, roll_out
from galileo_jax.video import synthetic

MARGIN_M = 0.10  # round the motion, to the picture's edge
WIDEST_M = 2.5
TABLE_AT = 0.80  # of the picture's height
KEYSTONE_PER_M = 0.01
TRACK_SUFFIX, VIDEO_SUFFIX = ".csv", ".mp4"


def main(argv: Sequence[str]) -> int | None:
    """Writes NAME.mp4 (or NAME.csv), NAME.yaml and NAME.truth.json."""
    call = _parser().parse_args(argv)
    out: Path = call.out
    suffix = TRACK_SUFFIX if call.track_only else VIDEO_SUFFIX
    if out.suffix != suffix:
        raise InputError(f"--out: {out.name} does not end in {suffix}")
    looks, things, faults = np.random.default_rng(call.seed).spawn(3)
    given = {key: getattr(call, key) for key in ("m1", "k1", "m2", "k2")}
    truth = draw_truth(things, call.angle, {k: v for k, v in given.items() if v is not None})
    motion = roll_out(truth)
    seconds = call.seconds or min(LONGEST_S, max(1.5, motion.rest_s + 0.4))
    num_frames = max(2, round(seconds * call.fps))
    frames = motion.at(np.arange(num_frames) / call.fps)
    camera = _camera(call, truth, frames, faults)
    declared = _clip_content(call, truth, camera, frames)
    record = _truth_record(call, truth, motion, frames, camera)
    try:
        with _all_or_nothing(out.parent) as folder:
            if call.track_only:
                _write_track(folder / out.name, truth, frames, call.track_noise, looks)
            else:
                filming = _filming(call, num_frames, faults)
                video = folder / out.name
                record |= _film(video, truth, motion, camera, filming, num_frames, call.seed)
            check_clip(folder / f"{out.stem}.yaml", declared)
            write_json(folder / f"{out.stem}.truth.json", record)
            write_text(folder / f"{out.stem}.yaml", dump(declared))
    except OSError as error:
        raise InputError(f"--out: {out}: {error.strerror or error}") from error
    for name in (out, out.with_suffix(".yaml"), out.with_suffix(".truth.json")):
        print(name)
    return None


@contextmanager
def _all_or_nothing(folder: Path) -> Iterator[Path]:
    """Yields an empty folder whose files are moved to `folder` on success only."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".simulate.", dir=folder) as temporary:
        yield Path(temporary)
        for path in Path(temporary).iterdir():
            path.replace(folder / path.name)


def _film(
    out: Path,
    truth: Truth,
    motion: Motion,
    camera: synthetic.Camera,
    filming: synthetic.Filming,
    num_frames: int,
    seed: int,
) -> dict[str, Any]:
    """Renders the video; returns what of the filming belongs into the truth."""
    bodies = tuple(
        synthetic.Body(declared.shape, declared.size_m or ()) for declared in truth.objects
    )
    ramp = synthetic.Ramp(truth.angle_rad, truth.release_m + 0.12)
    path = synthetic.Motion(motion.times_s, motion.position_m, motion.pitch_rad)
    with command.progress() as bar:
        task = bar.add_task("rendering", total=num_frames)
        covered = synthetic.render_clip(
            out,
            path,
            bodies,
            camera,
            ramp,
            filming,
            num_frames,
            seed=seed,
            on_frame=lambda: bar.advance(task),
        )
    hand = filming.hand
    seen = np.flatnonzero(covered.max(axis=0))
    return {
        "noise_grey_levels": filming.noise_grey_levels,
        "flicker": filming.flicker,
        "exposure_s": filming.exposure_s,
        "defocus_px": filming.defocus_px,
        "repeated_frames": list(filming.repeated_frames),
        "hand": hand
        and {
            "leave": math.ceil(hand.leave_s * filming.fps),
            "gone": int(seen[-1]) + 1 if seen.size else 0,
            "speed": hand.speed_m_s,
            "off": list(hand.offset_m),
        },
        "covered": {
            declared.name: [round(float(share), 3) for share in row]
            for declared, row in zip(truth.objects, covered, strict=True)
        },
    }


def _write_track(
    out: Path, truth: Truth, frames: Motion, noise_m: float, rng: np.random.Generator
) -> None:
    """Writes the centres with independent normal errors as a csv track."""
    position = frames.position_m + noise_m * rng.standard_normal(frames.position_m.shape)
    count, _, length = position.shape
    covariance = np.broadcast_to(noise_m**2 * np.eye(2)[None, :, :, None], (count, 2, 2, length))
    names = tuple(declared.name for declared in truth.objects)
    seen = np.ones((count, length), bool)
    write_observation_csv(out, Observation(names, frames.times_s, position, covariance, seen))


def _camera(
    call: argparse.Namespace, truth: Truth, frames: Motion, rng: np.random.Generator
) -> synthetic.Camera:
    """A camera that has the ramp and the whole motion in the picture."""
    width, height = call.size
    behind = truth.release_m * math.cos(truth.angle_rad) + MARGIN_M
    ahead = float(frames.position_m[:, 0].max()) + MARGIN_M
    span = min(behind + ahead, WIDEST_M)
    top = float(frames.position_m[0, 1].max()) + MARGIN_M
    scale = math.floor(min(width / span, TABLE_AT * height / top))
    spare = max(0.0, width / scale - behind - ahead)
    left = (behind + spare / 2) * scale
    foot = left if call.direction == "right" else width - left
    shift = rng.uniform(-0.01, 0.01, 2) * (width, height)
    origin = (round(float(foot + shift[0]), 1), round(float(TABLE_AT * height + shift[1]), 1))
    keystone = rng.uniform(-KEYSTONE_PER_M, KEYSTONE_PER_M, 2) if call.keystone else (0.0, 0.0)
    return synthetic.Camera(
        pixels_per_metre=float(scale),
        origin_px=origin,
        size_px=(width, height),
        direction=call.direction,
        keystone_per_m=(float(keystone[0]), float(keystone[1])),
    )


def _filming(
    call: argparse.Namespace, num_frames: int, rng: np.random.Generator
) -> synthetic.Filming:
    hand = None
    if call.hand:
        hand = synthetic.Hand(
            leave_s=float(rng.uniform(1, 4)) / call.fps,
            speed_m_s=float(rng.uniform(1.2, 1.9)),
            offset_m=(float(rng.uniform(-0.028, -0.008)), float(rng.uniform(0.010, 0.026))),
        )
    inner = np.arange(1, num_frames)
    missed = rng.choice(inner, min(call.missed_frames, len(inner)), replace=False)
    return synthetic.Filming(
        fps=call.fps,
        exposure_s=min(call.exposure, 1 / call.fps),
        noise_grey_levels=call.noise,
        defocus_px=call.defocus,
        repeated_frames=tuple(sorted(map(int, missed))),
        hand=hand,
    )


def _clip_content(
    call: argparse.Namespace, truth: Truth, camera: synthetic.Camera, frames: Motion
) -> dict[str, Any]:
    """What is declared about the clip (DESIGN.md 2.1)."""
    objects: list[dict[str, Any]] = [
        {"name": declared.name, "shape": declared.shape, "size_m": list(declared.size_m or ())}
        for declared in truth.objects
    ]
    seen: dict[str, Any] = {}
    if not call.track_only:
        seen = {
            "direction": call.direction,
            "pixels_per_metre": camera.pixels_per_metre,
            "origin_px": list(camera.origin_px),
        }
        if not call.no_points:
            points = camera.project(frames.position_m[:, :, 0])
            for entry, point in zip(objects, points, strict=True):
                entry["point_px"] = np.round(point, 1).tolist()
    return {
        "track" if call.track_only else "video": call.out.name,
        "scenario": call.scenario,
        "fps": call.fps,
        "ramp_angle_deg": truth.ramp_angle_deg,
        **seen,
        "gravity": truth.gravity,
        "objects": objects,
    }


def _truth_record(
    call: argparse.Namespace,
    truth: Truth,
    motion: Motion,
    frames: Motion,
    camera: synthetic.Camera,
) -> dict[str, Any]:
    """Everything the clip was made with; y along the travel and z up, as in shared clips."""
    (m1, m2), (k1, k2) = truth.mass_kg, truth.friction
    return {
        "name": call.out.stem,
        "engine": "galileo_jax",
        "effect": "none",
        "effect_parameters": {},
        "m1": m1,
        "k1": k1,
        "m2": m2,
        "k2": k2,
        "gravity": truth.gravity,
        "ramp_angle_deg_true": truth.ramp_angle_deg,
        "ramp_angle_deg_declared": truth.ramp_angle_deg,
        "release_m": truth.release_m,
        "object2_y_m": truth.object2_x_m,
        "size1_m": truth.objects[0].size_m,
        "size2_m": truth.objects[1].size_m,
        "events_s": motion.events_s(truth),
        "trajectory": {"t": _rounded(frames.times_s)}
        | {declared.name: _trajectory(frames, i) for i, declared in enumerate(truth.objects)},
        "frames": len(frames.times_s),
        "fps_true": call.fps,
        "fps_declared": call.fps,
        "pixels_per_metre_true": camera.pixels_per_metre,
        "pixels_per_metre_declared": camera.pixels_per_metre,
        "world_to_image": camera.world_to_image.tolist(),
        "image_px": list(camera.size_px),
        "seed": call.seed,
    }


def _trajectory(frames: Motion, index: int) -> Mapping[str, list[float]]:
    return {
        "y": _rounded(frames.position_m[index, 0]),
        "z": _rounded(frames.position_m[index, 1]),
        "pitch": _rounded(frames.pitch_rad[index]),
        "vy": _rounded(frames.velocity_m_s[index, 0]),
        "vz": _rounded(frames.velocity_m_s[index, 1]),
    }


def _rounded(values: np.ndarray) -> list[float]:
    return np.round(values, 6).tolist()


def _parser() -> command.Parser:
    parser = command.Parser(
        prog="galileo simulate",
        description="Make a clip with known truth: NAME.mp4, NAME.yaml and NAME.truth.json. "
        "What is not given is drawn at random; the same seed makes the same clip.",
    )
    add = parser.add_argument
    add("--out", type=Path, required=True, metavar="DIR/NAME.mp4", help="NAME.csv for a track")
    add("--scenario", choices=["ramp"], default="ramp")
    add("--seed", type=_number(int, 0), default=0)
    add("--angle", type=_number(float, 1, 60), default=20.0, metavar="DEG", help="of the ramp")
    add("--seconds", type=_number(float, 0.1, LONGEST_S), help="default: until all is at rest")
    add("--fps", type=_number(float, 5, 1000), default=30.0)
    for index in (1, 2):
        add(f"--m{index}", type=_number(float, 0.01, 100), metavar="KG")
        add(f"--k{index}", type=_number(float, 0, 2), metavar="FRICTION")
    add("--track-only", action="store_true", help="a csv track in place of the video")
    add(
        "--track-noise",
        type=_number(float, 1e-6, 0.1),
        default=0.0002,
        metavar="M",
        help="standard deviation of a track's coordinates, m (default 0.0002)",
    )
    film = parser.add_argument_group("filming")
    film.add_argument("--size", type=_size, default=(640, 360), metavar="WIDTHxHEIGHT")
    film.add_argument("--direction", choices=["right", "left"], default="right")
    film.add_argument("--no-points", action="store_true", help="do not tell where objects are")
    film.add_argument("--hand", action="store_true", help="a hand lets object 1 go")
    film.add_argument("--keystone", action="store_true", help="the camera is held askew")
    film.add_argument("--noise", type=_number(float, 0, 60), default=4.0, help="grey levels")
    film.add_argument("--exposure", type=_number(float, 0, 0.2), default=0.008, metavar="S")
    film.add_argument("--defocus", type=_number(float, 0, 20), default=0.0, metavar="PX")
    film.add_argument(
        "--missed-frames",
        type=_number(int, 0, 1000),
        default=0,
        metavar="N",
        help="so many frames show the one before once more",
    )
    return parser


def _number(kind: type, low: float, high: float = math.inf) -> Any:
    """A parser of numbers in [low, high]; argparse makes its complaint one line."""

    def parse(text: str) -> float | int:
        try:
            value = kind(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            limit = f"at least {low:g}" if high == math.inf else f"in [{low:g}, {high:g}]"
            noun = "whole number" if kind is int else "number"
            raise argparse.ArgumentTypeError(f"{text!r} is no {noun} {limit}")
        return value

    return parse


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    if width.isdecimal() and height.isdecimal():
        size = int(width), int(height)
        if all(64 <= side <= 8192 and side % 2 == 0 for side in size):
            return size
    raise argparse.ArgumentTypeError(f"{text!r} is no size; even numbers such as 640x360 expected")


if __name__ == "__main__":
    raise SystemExit(command.run(main))

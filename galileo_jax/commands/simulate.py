"""`galileo simulate`: make a clip with known truth (video or track, yaml, truth)."""

import argparse
import math
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, get_args

import numpy as np

from galileo_jax.clip.load import check_clip
from galileo_jax.clip.schema import MAX_ACROSS_M, ClipObject, Shape
from galileo_jax.clip.track_csv import write_observation_csv
from galileo_jax.clip.yaml_edit import dump
from galileo_jax.commands import command
from galileo_jax.commands.simulate_free import FREE_SCENARIOS, write_free_clip
from galileo_jax.files.atomic_write import write_json, write_text
from galileo_jax.model.scene.scene import extents
from galileo_jax.observation.observation import Observation
from galileo_jax.rollout.engine_names import MOTIONS
from galileo_jax.runtime.errors import InputError
from galileo_jax.simulation import (
    LONGEST_S,
    SOLVERS,
    Declared,
    Hidden,
    Motion,
    Truth,
    draw_series,
    truth_record,
)
from galileo_jax.video import synthetic

MARGIN_M = 0.10  # round the motion, to the picture's edge
WIDEST_M = 2.5
BEYOND_TABLE_M = 2.5  # x, where a clip ends; a board alone ends at 0
TABLE_AT = 0.80  # of the picture's height
KEYSTONE_PER_M = 0.01
ROLL_RAD = math.radians(0.5)
OFF_PX = (1.0, 4.0)  # how far a point set by hand is off, where the fault is asked for
CAMERA_FAULTS = ("keystone", "roll", "origin", "points")
SHAPES: dict[str, tuple[Shape, ...]] = {
    "ramp": ("box", "box"),
    "multi": ("box", "box", "box"),
    "incline": ("box",),
}
RAMP_OPTIONS = (
    *("--angle", "--shapes", "--m1", "--k1", "--m2", "--k2", "--series", "--solver"),
    *("--faults", "--hand", "--camera-fault", "--no-points", "--missed-frames"),
)
FILM_OPTIONS = (
    *("--camera-fault", "--size", "--direction", "--no-points", "--hand"),
    *("--noise", "--exposure", "--defocus", "--missed-frames"),
)
TRACK_SUFFIX, VIDEO_SUFFIX = ".csv", ".mp4"


def main(argv: Sequence[str]) -> int | None:
    """Writes NAME.mp4 (or NAME.csv), NAME.yaml and NAME.truth.json, for a series NAME_1 and on."""
    call = _parser().parse_args(argv)
    out: Path = call.out
    suffix = TRACK_SUFFIX if call.track_only else VIDEO_SUFFIX
    if out.suffix != suffix:
        raise InputError(f"--out: {out.name} does not end in {suffix}")
    _refuse_ignored(call, argv)
    if call.motion == "free":
        _refuse_planar_only(call)
    elif call.z2 is not None:
        raise InputError("--z2: of --motion free only")
    hidden = _hidden(call)
    if call.scenario not in SHAPES:
        path = out.parent / out.name
        try:
            with _all_or_nothing(out.parent) as folder:
                write_free_clip(folder / out.name, call, hidden)
        except OSError as error:
            raise InputError(f"--out: {out}: {error.strerror or error}") from error
        for end in (suffix, ".yaml", ".truth.json"):
            print(path.with_suffix(end))
        return None
    shapes = _shapes(call)
    looks, things, faults, secrets = np.random.default_rng(call.seed).spawn(4)
    given = {key: getattr(call, key) for key in ("m1", "k1", "m2", "k2", "z2")}
    given |= _masses_and_frictions(call.set, len(shapes))
    trials = draw_series(
        call.angle,
        {key: value for key, value in given.items() if value is not None},
        hidden,
        call.series or 1,
        solver="free" if call.motion == "free" else call.solver,
        things=things,
        secrets=secrets,
        frame_s=1 / call.fps if call.faults else None,
        scenario=call.scenario,
        shapes=shapes,
    )
    names = [f"{out.stem}_{i + 1}" if call.series else out.stem for i in range(len(trials))]
    try:
        with _all_or_nothing(out.parent) as folder:
            for i, (name, (truth, motion)) in enumerate(zip(names, trials, strict=True)):
                path = folder / f"{name}{suffix}"
                _write_clip(path, call, truth, motion, looks, faults, call.seed + i)
    except OSError as error:
        raise InputError(f"--out: {out}: {error.strerror or error}") from error
    for name in names:
        for end in (suffix, ".yaml", ".truth.json"):
            print(out.with_name(name + end))
    return None


def _shapes(call: argparse.Namespace) -> list[Shape]:
    """The objects' shapes, as many as the scenario has."""
    shapes = call.shapes.split(",") if call.shapes else list(SHAPES[call.scenario])
    for shape in shapes:
        if shape not in get_args(Shape):
            raise InputError(f"--shapes: unknown shape {shape!r}; known: box, cylinder, ...")
    most = 9 if call.scenario == "multi" else len(SHAPES[call.scenario])
    if not (2 if call.scenario == "multi" else most) <= len(shapes) <= most:
        raise InputError(
            f"--shapes: {len(shapes)} given; {call.scenario} has {most} (multi: 2 to 9)"
        )
    return shapes


def _masses_and_frictions(given: Sequence[tuple[str, float]], count: int) -> dict[str, float]:
    """`--set` of a ramp: m1, k1 and so on."""
    names = [f"{key}{i + 1}" for i in range(count) for key in "mk"]
    for name, _ in given:
        if name not in names:
            raise InputError(f"--set: no parameter {name!r}; known: {', '.join(names)}")
    return dict(given)


def _refuse_ignored(call: argparse.Namespace, argv: Sequence[str]) -> None:
    """Options that have no part in the clip asked for."""
    if call.scenario not in SHAPES:
        where = f"of a ramp only, not of scenario {call.scenario}"
        command.refuse_ignored(argv, RAMP_OPTIONS, where)
    else:
        command.refuse_ignored(argv, ["--floor"], "not of a ramp")
    if call.scenario == "incline":
        command.refuse_ignored(argv, ["--m2", "--k2"], "an incline has one object")
    if call.track_only:
        command.refuse_ignored(argv, FILM_OPTIONS, "a track (--track-only) has no camera")
    else:
        command.refuse_ignored(argv, ["--track-noise"], "of a track only (--track-only)")
    if not call.effect:
        command.refuse_ignored(argv, ["--strength"], "of what? name an effect with --effect NAME")
        command.refuse_ignored(argv, ["--effects-from"], "nothing of it is used without --effect")


def _refuse_planar_only(call: argparse.Namespace) -> None:
    """What bodies that turn out of the plane cannot be."""
    if call.scenario not in ("ramp", "multi"):
        raise InputError(f"--motion free: of ramp and multi, not of scenario {call.scenario}")
    if not call.track_only:
        raise InputError("--motion free: pictures show motion in a plane only; add --track-only")
    if call.solver != "rigid":
        raise InputError(f"--solver {call.solver}: of --motion planar only")


def _hidden(call: argparse.Namespace) -> list[Hidden]:
    """The effects asked for, each with the values given."""
    from galileo_jax.model.effects.registry import load_file, make_effects

    for path in call.effects_from:
        load_file(path)
    values = dict(call.effect)
    if len(values) < len(call.effect):
        raise InputError("--effect: an effect is named twice")
    effects = make_effects(list(values))
    return [Hidden(effect, values[effect.name], call.strength) for effect in effects]


def _write_clip(
    out: Path,
    call: argparse.Namespace,
    truth: Truth,
    motion: Motion,
    looks: np.random.Generator,
    faults: np.random.Generator,
    seed: int,
) -> None:
    """Writes one clip, its yaml and its truth into the folder of `out`."""
    declared = Declared.of(truth, call.fps)
    ends = motion.leaves_s(BEYOND_TABLE_M if truth.surroundings.has_table else 0.0)
    longest = min(LONGEST_S, ends + declared.release_s)
    seconds = call.seconds or min(longest, max(1.5, motion.rest_s + declared.release_s + 0.4))
    num_frames = max(2, round(seconds * declared.true_fps))
    frames = motion.at(declared.taken_s(num_frames))
    camera = _camera(call, truth, frames, faults)
    content = _clip_content(call, out.name, truth, declared, camera, frames, faults)
    record = {
        "name": out.stem,
        "series": call.out.stem if call.series else None,
        **truth_record(truth, declared, motion, frames),
        "pixels_per_metre_true": camera.pixels_per_metre,
        "pixels_per_metre_declared": content.get("pixels_per_metre", camera.pixels_per_metre),
        "world_to_image": camera.world_to_image.tolist(),
        "image_px": list(camera.size_px),
        "camera_faults": sorted(call.camera_fault),
        "seed": seed,
    }
    if call.track_only:
        _write_track(out, truth, declared, frames, call.track_noise, looks)
    else:
        filming = _filming(call, declared, num_frames, faults)
        record |= _film(out, truth, declared, motion, camera, filming, num_frames, seed)
    check_clip(out.with_suffix(".yaml"), content)
    write_json(out.with_suffix(".truth.json"), record)
    write_text(out.with_suffix(".yaml"), dump(content))


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
    declared: Declared,
    motion: Motion,
    camera: synthetic.Camera,
    filming: synthetic.Filming,
    num_frames: int,
    seed: int,
) -> dict[str, Any]:
    """Renders the video; returns what of the filming belongs into the truth."""
    bodies = tuple(_body(each) for each in truth.objects)
    ramp = synthetic.Ramp(truth.angle_rad, truth.release_m + 0.12)
    path = synthetic.Motion(
        motion.times_s + declared.release_s, motion.position_m, motion.pitch_rad
    )
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
            each.name: [round(float(share), 3) for share in row]
            for each, row in zip(truth.objects, covered, strict=True)
        },
    }


def _body(declared: ClipObject) -> synthetic.Body:
    """What rolls is a disc from the side."""
    if declared.roll_inertia is not None:
        return synthetic.Body("sphere", extents(declared)[:1])
    return synthetic.Body(declared.shape, declared.size_m or ())


def _write_track(
    out: Path,
    truth: Truth,
    declared: Declared,
    frames: Motion,
    noise_m: float,
    rng: np.random.Generator,
) -> None:
    """Writes the centres, as the declared scale and clock show them, with normal errors."""
    error = noise_m * rng.standard_normal(frames.position_m.shape)
    position = declared.scale * frames.position_m + error
    count, _, length = position.shape
    covariance = np.broadcast_to(noise_m**2 * np.eye(2)[None, :, :, None], (count, 2, 2, length))
    names = tuple(each.name for each in truth.objects)
    times = np.arange(length) / declared.fps
    seen = np.ones((count, length), bool)
    write_observation_csv(out, Observation(names, times, position, covariance, seen))


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
    is_askew, is_rolled = (fault in call.camera_fault for fault in ("keystone", "roll"))
    keystone = rng.uniform(-KEYSTONE_PER_M, KEYSTONE_PER_M, 2) if is_askew else (0.0, 0.0)
    return synthetic.Camera(
        pixels_per_metre=float(scale),
        origin_px=origin,
        size_px=(width, height),
        direction=call.direction,
        keystone_per_m=(float(keystone[0]), float(keystone[1])),
        roll_rad=float(rng.uniform(-ROLL_RAD, ROLL_RAD)) if is_rolled else 0.0,
    )


def _filming(
    call: argparse.Namespace, declared: Declared, num_frames: int, rng: np.random.Generator
) -> synthetic.Filming:
    hand = None
    if call.hand:
        hand = synthetic.Hand(
            leave_s=max(0.0, declared.release_s) + float(rng.uniform(1, 4)) / call.fps,
            speed_m_s=float(rng.uniform(1.2, 1.9)),
            offset_m=(float(rng.uniform(-0.028, -0.008)), float(rng.uniform(0.010, 0.026))),
        )
    inner = np.arange(1, num_frames)
    missed = rng.choice(inner, min(call.missed_frames, len(inner)), replace=False)
    return synthetic.Filming(
        fps=declared.true_fps,
        written_fps=declared.fps,
        exposure_s=min(call.exposure, 1 / declared.true_fps),
        noise_grey_levels=call.noise,
        defocus_px=call.defocus,
        repeated_frames=tuple(sorted(map(int, missed))),
        hand=hand,
    )


def _clip_content(
    call: argparse.Namespace,
    name: str,
    truth: Truth,
    declared: Declared,
    camera: synthetic.Camera,
    frames: Motion,
    rng: np.random.Generator,
) -> dict[str, Any]:
    """What is declared about the clip (DESIGN.md 2.1)."""
    objects: list[dict[str, Any]] = [
        {"name": each.name, "shape": each.shape, "size_m": list(each.size_m or ())}
        | ({} if each.rolls is None else {"rolls": each.rolls})
        | ({"z_m": each.z_m} if each.z_m else {})
        for each in truth.objects
    ]
    seen: dict[str, Any] = {}
    if not call.track_only:
        off = {
            fault: _off_px(rng, count) if fault in call.camera_fault else np.zeros((count, 2))
            for fault, count in (("origin", 1), ("points", len(objects)))
        }
        seen = {
            "direction": call.direction,
            "pixels_per_metre": round(camera.pixels_per_metre / declared.scale, 2),
            "origin_px": np.round(camera.origin_px + off["origin"][0], 1).tolist(),
        }
        if not call.no_points:
            points = camera.project(frames.position_m[:, :, 0]) + off["points"]
            for entry, point in zip(objects, points, strict=True):
                entry["point_px"] = np.round(point, 1).tolist()
    return {
        "track" if call.track_only else "video": name,
        "scenario": call.scenario,
        "fps": declared.fps,
        "ramp_angle_deg": declared.ramp_angle_deg,
        **seen,
        "gravity": truth.gravity,
        "objects": objects,
    }


def _off_px(rng: np.random.Generator, count: int) -> np.ndarray:
    """Errors of points set by hand, `[count, 2]`, in any direction."""
    size, way = rng.uniform(*OFF_PX, count), rng.uniform(0, 2 * np.pi, count)
    return size[:, None] * np.stack([np.cos(way), np.sin(way)], axis=1)


def _parser() -> command.Parser:
    parser = command.Parser(
        prog="galileo simulate",
        description="Make a clip with known truth: NAME.mp4, NAME.yaml and NAME.truth.json. "
        "What is not given is drawn at random; the same seed makes the same clip.",
    )
    add = parser.add_argument
    add("--out", type=Path, required=True, metavar="DIR/NAME.mp4", help="NAME.csv for a track")
    add("--scenario", choices=[*SHAPES, *FREE_SCENARIOS], default="ramp")
    add(
        "--shapes",
        metavar="SHAPE,...",
        help="of the objects on a ramp, in the order of the travel; round ones roll; so many has a "
        "multi (default 3 boxes)",
    )
    add("--seed", type=_number(int, 0), default=0)
    add("--angle", type=_number(float, 1, 60), default=20.0, metavar="DEG", help="of the ramp")
    add("--seconds", type=_number(float, 0.1, LONGEST_S), help="default: until all is at rest")
    add("--fps", type=_number(float, 5, 1000), default=30.0)
    for index in (1, 2):
        add(f"--m{index}", type=_number(float, 0.01, 100), metavar="KG")
        add(f"--k{index}", type=_number(float, 0, 2), metavar="FRICTION")
    add(
        "--motion",
        choices=MOTIONS,
        default="planar",
        help="free: from the first hit on objects turn and tip (MuJoCo's C engine; tracks only)",
    )
    add(
        "--z2",
        type=_number(float, -MAX_ACROSS_M, MAX_ACROSS_M),
        metavar="M",
        help="how far object 2 stands off the plane, towards the camera (--motion free; default 0)",
    )
    add("--solver", choices=SOLVERS, default="rigid", help="fine: not the engine that fits")
    add(
        "--set",
        type=_value,
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="a parameter of the scenario, such as k3=0.2 or floor_restitution=0.7",
    )
    add("--floor", action="store_true", help="of a fall or a flight: it bounces")
    add("--series", type=_number(int, 1, 99), metavar="N", help="N trials: NAME_1, NAME_2, ...")
    add("--track-only", action="store_true", help="a csv track in place of the video")
    add(
        "--track-noise",
        type=_number(float, 1e-6, 0.1),
        default=0.0002,
        metavar="M",
        help="standard deviation of a track's coordinates, m (default 0.0002)",
    )
    hide = parser.add_argument_group("what is hidden", "in the truth, and not in the yaml")
    hide.add_argument(
        "--effect",
        type=_effect,
        action="append",
        default=[],
        metavar="NAME[:PARAMETER=VALUE,...]",
        help="an effect, in SI units; what is left out is drawn (may be given several times)",
    )
    hide.add_argument("--strength", type=_number(float, 0, 1), help="0: weak, 1: strong")
    hide.add_argument("--effects-from", type=Path, action="append", default=[], metavar="FILE.py")
    hide.add_argument(
        "--faults",
        action="store_true",
        help="small faults of real clips: release between frames, foot and impact not ideal",
    )
    film = parser.add_argument_group("filming")
    film.add_argument("--size", type=_size, default=(640, 360), metavar="WIDTHxHEIGHT")
    film.add_argument("--direction", choices=["right", "left"], default="right")
    film.add_argument("--no-points", action="store_true", help="do not tell where objects are")
    film.add_argument("--hand", action="store_true", help="a hand lets object 1 go")
    film.add_argument(
        "--camera-fault",
        choices=CAMERA_FAULTS,
        action="append",
        default=[],
        help="held askew or rolled, or points of the yaml off by a few px",
    )
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


def _effect(text: str) -> tuple[str, dict[str, float]]:
    """`NAME[:PARAMETER=VALUE,...]`."""
    name, _, rest = text.partition(":")
    values = {}
    for part in rest.split(",") if rest else []:
        key, _, value = part.partition("=")
        try:
            values[key.strip()] = float(value)
        except ValueError:
            values[key.strip()] = math.nan
        if not math.isfinite(values[key.strip()]):
            raise argparse.ArgumentTypeError(f"{part!r} is not PARAMETER=NUMBER")
    return name.strip(), values


def _value(text: str) -> tuple[str, float]:
    """`NAME=VALUE`."""
    name, values = _effect(f":{text}")
    if name or len(values) != 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not NAME=NUMBER")
    return next(iter(values.items()))


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    if width.isdecimal() and height.isdecimal():
        size = int(width), int(height)
        if all(64 <= side <= 8192 and side % 2 == 0 for side in size):
            return size
    raise argparse.ArgumentTypeError(f"{text!r} is no size; even numbers such as 640x360 expected")

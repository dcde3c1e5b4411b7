"""`galileo label`: write what is known about a clip into the yaml beside it."""

import copy
import math
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from galileo_jax.clip.load import (
    YAML_SUFFIXES,
    check_belongs,
    check_clip,
    find_yaml,
    has_yaml,
    with_unused,
)
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.track_files.read import is_track
from galileo_jax.clip.yaml_edit import Key, dump, edited
from galileo_jax.clip.yaml_file import read_mapping
from galileo_jax.commands import command
from galileo_jax.files.atomic_write import write_text
from galileo_jax.physics101 import place as physics101
from galileo_jax.physics101.source import check_place
from galileo_jax.runtime.errors import InputError
from galileo_jax.video.decode import probe

SCALARS = (
    "scenario",
    "fps",
    "ramp_angle_deg",
    "direction",
    "pixels_per_metre",
    "gravity",
    "track_units",
    "track_y",
)

LEVELS = ("scenario", "setup", "object", "trial")
"""Folders of Physics 101, of which something can be told."""

KEY_ORDER = (
    "video",
    "track",
    "track_units",
    "track_y",
    "track_origin",
    "scenario",
    "fps",
    "ramp_angle_deg",
    "direction",
    "pixels_per_metre",
    "origin_px",
    "gravity",
    "objects",
)


def main(argv: Sequence[str]) -> int | None:
    """Creates or updates the yaml beside a clip; writes nothing unless the result is valid."""
    arguments = _parser().parse_args(argv)
    clip_path: Path = arguments.clip
    if (place := physics101.place_of(clip_path)) and not has_yaml(clip_path):
        return _label_place(place, arguments)
    command.refuse_ignored(argv, ["--level"], f"{clip_path} is not in folders of Physics 101")
    yaml_path = _yaml_path(clip_path)
    is_new = not yaml_path.exists()
    old = {} if is_new else read_mapping(yaml_path)
    defaults = _defaults(clip_path, arguments) if is_new else {}
    changes = _changes(arguments, yaml_path, old)
    if not changes:
        raise InputError(f"{clip_path}: nothing to write; see galileo label --help")

    content = _applied(old, changes | defaults)
    clip = with_unused(check_clip(yaml_path, content))
    check_belongs(clip, clip_path)
    old_text = "" if is_new else yaml_path.read_text(encoding="utf-8-sig")
    if is_new:
        text, is_kept = dump({key: content[key] for key in KEY_ORDER if key in content}), True
    else:
        text, is_kept = edited(old_text, changes, content)
    write_text(yaml_path, text)

    for warning in clip.warnings:
        _say(f"warning: {warning}")
    if not is_kept and "#" in old_text:
        _say(f"note: {yaml_path} was written afresh; its comments are lost")
    print(yaml_path)
    return None


def _label_place(place: physics101.Place, arguments: Namespace) -> int | None:
    """Writes into the labels of Physics 101: sizes by object, all else for one of the folders."""
    if arguments.scenario is not None:
        raise InputError(f"--scenario: the folders of {place.video} say {place.scenario}")
    old = physics101.read_labels(place.labels)
    things, clips = copy.deepcopy(old.things), copy.deepcopy(old.clips)
    level = place.level(arguments.level)
    changes = _changes(arguments, place.labels, {})
    here = {key[0]: value for key, value in changes.items() if key[0] != "objects"}
    by_trial: dict[str, dict[str, Any]] = {}
    for thing in (value for key, value in changes.items() if key[0] == "objects"):
        name = thing.pop("name")
        if name != place.object:
            here["target"] = name
        for key in physics101.BY_OBJECT:
            if key in thing:
                by_trial.setdefault(key, {})[name] = thing.pop(key)
        if name not in things or any(name == shape[0] for shape in arguments.shape):
            things.setdefault(name, {})["shape"] = thing["shape"]
        things[name] |= {key: value for key, value in thing.items() if key != "shape"}
    if not changes:
        raise InputError(f"{place.video}: nothing to write; see galileo label --help")
    if here:
        clips[level] = (clips.get(level) or {}) | here
    trial = clips.setdefault(place.levels[-1], {}) if by_trial else {}
    for key, values in by_trial.items():
        trial[key] = (trial.get(key) or {}) | values
    clip = check_place(place, physics101.Labels(things, clips))
    if place.labels.is_file() and "#" in place.labels.read_text(encoding="utf-8-sig"):
        _say(f"note: {place.labels} was written afresh; its comments are lost")
    tables = {"objects": things, "clips": clips}
    write_text(place.labels, dump({key: table for key, table in tables.items() if table}))
    for warning in clip.warnings:
        _say(f"warning: {warning}")
    print(place.labels)
    return None


def _say(line: str) -> None:
    command.console().print(line, soft_wrap=True, markup=False)


def _parser() -> command.Parser:
    parser = command.Parser(
        prog="galileo label",
        description="Write what is known about a clip into the yaml beside it. Pixels: x right, "
        "y down, as any image viewer shows them.",
    )
    parser.add_argument("clip", type=Path, metavar="CLIP", help="video, track file or yaml")
    parser.add_argument("--scenario", help=f"one of {', '.join(SCENARIOS)}")
    parser.add_argument("--fps", type=float, help="true frames per second; default: the video's")
    objects = parser.add_argument_group("objects (repeat for each; a new NAME adds an object)")
    objects.add_argument(
        "--point",
        nargs=3,
        action="append",
        default=[],
        metavar=("NAME", "X", "Y"),
        help="its centre in its first frame, pixels",
    )
    objects.add_argument(
        "--size",
        nargs="+",
        action="append",
        default=[],
        metavar=("NAME", "METRES"),
        help="box: length depth height; cylinder: radius length; torus: radii; sphere: radius",
    )
    objects.add_argument(
        "--shape",
        nargs=2,
        action="append",
        default=[],
        metavar=("NAME", "SHAPE"),
        help="box (default), cylinder, torus or sphere",
    )
    objects.add_argument(
        "--first-frame",
        nargs=2,
        action="append",
        default=[],
        metavar=("NAME", "FRAME"),
        help="first frame in which it moves by itself, from 0; null: to be found",
    )
    scale = parser.add_mutually_exclusive_group()
    scale.add_argument("--pixels-per-metre", type=float)
    scale.add_argument(
        "--scale",
        nargs=5,
        type=float,
        metavar=("X1", "Y1", "X2", "Y2", "METRES"),
        help="two pixels and the distance between them",
    )
    ramp = parser.add_mutually_exclusive_group()
    ramp.add_argument("--ramp-angle", type=float, metavar="DEG", dest="ramp_angle_deg")
    ramp.add_argument(
        "--ramp",
        nargs=4,
        type=float,
        metavar=("X1", "Y1", "X2", "Y2"),
        help="two pixels on the ramp: its angle and direction",
    )
    parser.add_argument("--track-units", help="of a track file: m, cm, mm, in, ft or px")
    parser.add_argument("--track-y", help="of a track file: y points up or down")
    parser.add_argument(
        "--track-origin",
        nargs=2,
        type=float,
        metavar=("X", "Y"),
        help="of a track file: the foot of the ramp, in its unit and along its axes",
    )
    parser.add_argument("--direction", help="which way the objects travel: right or left")
    parser.add_argument(
        "--origin", nargs=2, type=float, metavar=("X", "Y"), help="foot of the ramp, pixels"
    )
    parser.add_argument("--gravity", type=float, help="m/s^2")
    parser.add_argument(
        "--level",
        choices=LEVELS,
        default=LEVELS[-1],
        help="Physics 101: of what in the folder tree it is told (default trial); points are "
        "always of the trial, sizes of the object",
    )
    return parser


def _yaml_path(clip_path: Path) -> Path:
    """The clip's yaml: the one that is there, or the one to create."""
    is_source = clip_path.is_file() and clip_path.suffix.lower() not in YAML_SUFFIXES
    is_new = is_source and not has_yaml(clip_path)
    return clip_path.with_suffix(".yaml") if is_new else find_yaml(clip_path)


def _defaults(clip_path: Path, arguments: Namespace) -> dict[Key, Any]:
    """What a new yaml takes from the file beside it."""
    if is_track(clip_path):
        return {("track",): clip_path.name}
    defaults: dict[Key, Any] = {("video",): clip_path.name}
    if arguments.fps is None:
        fps = round(probe(clip_path).fps, 4)
        _say(f"note: fps: {fps:g} taken from the container; slow-motion clips often lie about it")
        defaults["fps",] = fps
    return defaults


def _changes(arguments: Namespace, yaml_path: Path, old: dict[str, Any]) -> dict[Key, Any]:
    """The values to write, by their place in the yaml."""
    changes: dict[Key, Any] = {}
    if arguments.ramp is not None:
        x1, y1, x2, y2 = arguments.ramp
        (high_x, high_y), (low_x, low_y) = sorted([(x1, y1), (x2, y2)], key=lambda point: point[1])
        changes["ramp_angle_deg",] = _ramp_angle_deg(low_x - high_x, low_y - high_y)
        changes["direction",] = "right" if low_x > high_x else "left"
    if arguments.scale is not None:
        changes["pixels_per_metre",] = _pixels_per_metre(*arguments.scale)
    if arguments.origin is not None:
        changes["origin_px",] = arguments.origin
    if arguments.track_origin is not None:
        changes["track_origin",] = arguments.track_origin
    for key in SCALARS:
        value = getattr(arguments, key)
        if value is not None:
            changes[key,] = value
    return changes | _object_changes(arguments, yaml_path, old)


def _object_changes(arguments: Namespace, yaml_path: Path, old: dict[str, Any]) -> dict[Key, Any]:
    given: dict[str, dict[str, Any]] = {}
    for name, shape in arguments.shape:
        given.setdefault(name, {})["shape"] = shape
    for name, *size in arguments.size:
        given.setdefault(name, {})["size_m"] = _numbers("--size", name, size)
    for name, *point in arguments.point:
        given.setdefault(name, {})["point_px"] = _numbers("--point", name, point)
    for name, frame in arguments.first_frame:
        if not (frame.isdecimal() or frame == "null"):
            raise InputError(
                f"--first-frame {name}: {frame!r} is not a frame number from 0, or null"
            )
        given.setdefault(name, {})["first_frame"] = None if frame == "null" else int(frame)

    listed = old.get("objects") or []
    if given and not isinstance(listed, list):
        raise InputError(f"{yaml_path}: objects: a list with one entry per object expected")
    names = [item.get("name") if isinstance(item, dict) else None for item in listed]
    changes: dict[Key, Any] = {}
    for name, values in given.items():
        if name in names:
            index = names.index(name)
            changes |= {("objects", index, key): value for key, value in values.items()}
        else:
            changes["objects", len(names)] = {"name": name, "shape": "box"} | values
            names.append(name)
    return changes


def _applied(old: dict[str, Any], changes: dict[Key, Any]) -> dict[str, Any]:
    content = copy.deepcopy(old)
    for key, value in changes.items():
        if key[0] == "objects" and content.get("objects") is None:
            content["objects"] = []
        match key:
            case ("objects", int(index)):
                content["objects"].insert(index, value)
            case ("objects", int(index), str(field)):
                content["objects"][index][field] = value
            case (str(field),):
                content[field] = value
    return content


def _numbers(option: str, name: str, texts: Sequence[str]) -> list[float]:
    numbers = []
    for text in texts:
        try:
            numbers.append(float(text))
        except ValueError:
            raise InputError(f"{option} {name}: {text!r} is not a number") from None
    return numbers


def _ramp_angle_deg(dx: float, dy: float) -> float:
    if not (math.isfinite(dx) and math.isfinite(dy)) or dx == 0 or dy == 0:
        raise InputError(
            f"--ramp: the two pixels differ by {dx:g} and {dy:g}; a sloping line expected"
        )
    return round(math.degrees(math.atan2(abs(dy), abs(dx))), 3)


def _pixels_per_metre(x1: float, y1: float, x2: float, y2: float, metres: float) -> float:
    distance = math.hypot(x2 - x1, y2 - y1)
    if not (math.isfinite(distance) and distance > 0):
        raise InputError("--scale: the two pixels are the same or not finite")
    if not (math.isfinite(metres) and metres > 0):
        raise InputError(f"--scale: {metres:g} is not a distance; metres above 0 expected")
    return round(distance / metres, 3)

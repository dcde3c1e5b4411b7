"""Loading a clip: every problem is one line that names the file, the key and the remedy."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from galileo_jax.clip import placement
from galileo_jax.clip.declaration import Declaration
from galileo_jax.clip.picture_plane import scale_of_rectangle
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import (
    MAX_SCALE_SD_SHARE,
    SIZE_MEANING,
    Clip,
    ClipFile,
    ClipObject,
    short,
)
from galileo_jax.clip.sources import source_of
from galileo_jax.clip.track_files.read import FileTrack, is_track, read_track
from galileo_jax.clip.yaml_file import read_mapping
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.known_names import check_known, did_you_mean

YAML_SUFFIXES = (".yaml", ".yml")

EXAMPLES: dict[str, str] = {
    "scenario": "scenario: ramp",
    "fps": "fps: 30.0",
    "objects": "objects: with one entry per object",
    "name": "name: object1",
    "shape": "shape: box",
    "corners_px": "corners_px: [[20, 400], [600, 400], [600, 50], [20, 50]]",
    "sides_m": "sides_m: [1.0, 0.6]",
    "k1": "k1: -0.05",
}
"""What to write for the keys that have no default."""


def load_clip(path: str | Path, **overrides: Any) -> Clip:
    """Loads and checks a clip.

    Args:
      path: the video or the csv track (the yaml beside it, same name), or the yaml; or what
        one of `SOURCES` recognises.
      **overrides: values for yaml keys that win over the file (`pixels_per_metre=490.0`,
        `fps=240.0`, ...); None leaves the file's value.

    Returns:
      the checked clip; doubts are in `Clip.warnings`.

    Raises:
      InputError: one line, for whatever is wrong with the yaml, the video or the csv track.

    The video is decoded once from end to end (under 1 ms per frame of 640 x 360), because a
    header's frame count and rate cannot be trusted.
    """
    source, path = str(path), Path(path)
    given = {key: value for key, value in overrides.items() if value is not None}
    if not has_yaml(path) and (other := source_of(path)):
        clip = other.load(path, given)
        return clip.model_copy(update={"source": source})
    yaml_path = find_yaml(path)
    content = read_mapping(yaml_path)
    is_shared = content.get("video") is not None and is_track(path)
    if is_track(path):
        content = {key: value for key, value in content.items() if key != "video"}
        content.setdefault("track", path.name)
    clip = check_clip(yaml_path, content | given, overridden=frozenset(given))
    check_belongs(clip, path)
    # Beside a video the same yaml needs what the track does not.
    clip = clip if is_shared else with_unused(clip)
    return clip.model_copy(update={"source": source})


def with_unused(clip: Clip) -> Clip:
    """The clip with a warning for every key that means nothing beside its track."""
    if clip.track is None:
        return clip
    unused = {
        f"objects[{index}].point_px": "the track says where it is"
        for index, item in enumerate(clip.objects)
        if item.point_px is not None
    }
    unused |= {
        f"objects[{index}].corrections": "a track is not tracked again"
        for index, item in enumerate(clip.objects)
        if item.corrections
    }
    if clip.origin_px is not None and clip.track_units != "px":
        unused["origin_px"] = "the track is in units of length" + (
            ", from the foot of the ramp on" if clip.is_own_track else "; track_origin is the foot"
        )
    if clip.track_origin is not None and clip.track_units == "px":
        unused["track_origin"] = "the track is in pixels; origin_px is the foot"
    doubts = tuple(f"{clip.path}: {key}: not used; {why}" for key, why in unused.items())
    return clip.model_copy(update={"warnings": clip.warnings + doubts})


def with_corrections(clip: Clip, correct: Mapping[str, Sequence[Sequence[float]]]) -> Clip:
    """The clip with objects put right in further frames, or no more in some.

    Raises:
      InputError: no such object, or no such frame or place.
    """
    if not correct:
        return clip
    for name in correct:
        check_known("--correct", "object", name, tuple(one.name for one in clip.objects))
    given = Declaration(correct=correct)
    objects = [
        item.model_dump() | {"corrections": given.corrections(item.name, item.corrections)}
        for item in clip.objects
    ]

    def fail(key: str, problem: str) -> NoReturn:
        raise InputError(f"{clip.path}: {key} (given in the call): {problem}")

    try:
        found = Clip.model_validate({**dict(clip), "objects": objects})
    except ValidationError as error:
        fail(*_first_problem(error))
    for index, item in enumerate(found.objects):
        _check_frames(f"objects[{index}]", item, found, fail)
    return found


def has_yaml(path: Path) -> bool:
    """Whether a video or track has a yaml beside it."""
    return any(path.with_suffix(suffix).is_file() for suffix in YAML_SUFFIXES)


def check_belongs(clip: Clip, path: Path) -> None:
    """Raises `InputError` if the yaml beside the video or track `path` names another one."""
    source = clip.video or clip.track
    if source is not None and path != clip.path and not source.samefile(path):
        key = "video" if clip.video else "track"
        raise InputError(
            f"{clip.path}: {key}: {source.name} is not {path.name}, beside which it lies; "
            f"write {key}: {path.name}"
        )


def find_yaml(path: Path) -> Path:
    """The yaml that belongs to a video, csv track or yaml. Raises `InputError` if none is there."""
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if path.is_dir():
        raise InputError(f"{path}: a folder; a video, a yaml or a csv track expected")
    if path.suffix.lower() in YAML_SUFFIXES:
        return path
    for suffix in YAML_SUFFIXES:
        if path.with_suffix(suffix).is_file():
            return path.with_suffix(suffix)
    raise InputError(
        f"{path}: no {path.with_suffix('.yaml').name} beside it; "
        f"write one: galileo label {path} --help"
    )


def check_clip(
    path: Path, content: Mapping[str, Any], overridden: frozenset[str] = frozenset()
) -> Clip:
    """Checks the content of a clip yaml and the video or csv track that it names.

    Args:
      path: the yaml; files are looked for beside it, and it is named in errors. It need not
        exist.
      content: its keys and values.
      overridden: the keys whose value does not stand in the file.
    """
    path = Path(path)

    def fail(key: str, problem: str) -> NoReturn:
        note = " (given in the call)" if key.split(".")[0].split("[")[0] in overridden else ""
        raise InputError(f"{path}: {key}{note}: {problem}")

    content = dict(content)
    if (content.get("video") is None) == (content.get("track") is None):
        _fail_for_unknown_key(content, fail)
        problem = "both given" if content.get("video") is not None else "missing"
        fail("video, track", f"{problem}; one of them expected, such as video: {path.stem}.mp4")

    is_timed = content.get("track") is not None and "fps" not in content
    if is_timed:
        content["fps"] = 1.0  # holds the place until the track's own times are read
    try:
        file = ClipFile.model_validate(content)
    except ValidationError as error:
        fail(*_first_problem(error))
    _check_objects(file, fail)
    read = None
    if file.track is not None:
        read = read_track(path, path.parent / file.track, file, None if is_timed else file.fps)
        if is_timed:
            file = file.model_copy(update={"fps": read.fps})
    found = _observed(path, file, read) if read else _filmed(path, file)
    _check_camera(file, fail)
    clip = Clip.model_validate({**dict(file), "path": path, **found})
    if clip.rectangle is not None:
        clip = clip.model_copy(update={"pixels_per_metre": scale_of_rectangle(clip)})
    _check_against_source(clip, read.observation if read else None, fail)
    return clip


def _fail_for_unknown_key(content: Mapping[str, Any], fail: Any) -> None:
    for key in content:
        if key not in ClipFile.model_fields:
            fail(short(key).strip("'"), _unknown_key(key, ClipFile))


def _first_problem(error: ValidationError) -> tuple[str, str]:
    """(key, problem) of the most telling of pydantic's errors.

    An unknown key comes first: it is often the misspelt form of one that is 'missing'.
    """
    errors = error.errors(include_url=False)
    first = next((e for e in errors if e["type"] in ("extra_forbidden", "invalid_key")), errors[0])
    return _key(first["loc"]), _problem(first)


def _key(loc: tuple[int | str, ...]) -> str:
    """('objects', 0, 'size_m', 2) -> 'objects[0].size_m[2]'."""
    first, *rest = loc or ("(top level)",)
    text = str(first)
    text += "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in rest)
    return " ".join(text.split())[:80]


def _problem(error: ErrorDetails) -> str:
    loc, value = error["loc"], error["input"]
    found = short(value)
    model = ClipObject if loc and loc[0] == "objects" else ClipFile
    match error["type"]:
        case "clip":
            return error["msg"]
        case "extra_forbidden" | "invalid_key":
            return _unknown_key(loc[-1], model)
        case "missing":
            example = EXAMPLES.get(str(loc[-1]))
            is_in_pair = isinstance(loc[-1], int)
            return "missing; [x, y] expected" if is_in_pair else f"missing; write {example}"
        case "too_long":
            return f"{found} has too many values; [x, y] expected"
        case "tuple_type":
            return f"{found} is not a list; {_expected_list(loc)} expected"
        case "model_type" | "dict_type" | "model_attributes_type":
            return f"{found} is not a mapping; name, shape, size_m, point_px expected"
        case "string_type":
            return f"{found} is not text"
        case "int_type" | "int_from_float":
            return f"{found} is not a whole number"
        case "greater_than_equal":
            return f"{found} is negative; 0 or more expected"
        case "finite_number":
            return f"{found} is not finite; a number expected"
        case "float_type":
            return f"{found} is not a number{_number_hint(value)}"
        case _:
            return f"{found}: {error['msg']}"


def _expected_list(loc: tuple[int | str, ...]) -> str:
    match loc[-1]:
        case "objects":
            return "a list with one entry per object"
        case "size_m":
            return "a list of metres, such as [0.06, 0.06, 0.06], or null"
        case _:
            return "[x, y] in pixels"


def _number_hint(value: Any) -> str:
    """How to write what is text to yaml, but looks like a number."""
    if not isinstance(value, str):
        return ""
    try:
        float(value)
    except ValueError:
        return ""
    return "; yaml takes 1.0e+3 for a number, not 1e3" if "e" in value else "; leave out the quotes"


def _unknown_key(key: Any, model: type[BaseModel]) -> str:
    known = list(model.model_fields)
    return "unknown key" + (did_you_mean(str(key), known) or f"; known: {', '.join(known)}")


def _check_objects(file: ClipFile, fail: Any) -> None:
    """What takes several values of the yaml to judge."""
    scenario = SCENARIOS[file.scenario]
    if scenario.has_ramp and "ramp_angle_deg" not in file.model_fields_set:
        fail(
            "ramp_angle_deg",
            f"missing; scenario {file.scenario} needs it, in degrees, or null where it is to be "
            "found from the path",
        )
    is_alone = scenario.num_objects[1] == 1  # several objects may slide beside a ramp
    if is_alone and not scenario.has_ramp and file.ramp_angle_deg is not None:
        fail(
            "ramp_angle_deg",
            f"{file.ramp_angle_deg:g} given; scenario {file.scenario} ({scenario.meaning}) has no "
            "ramp; leave it out",
        )
    for key in (key for other in SCENARIOS.values() for key in other.keys):
        is_given = getattr(file, key) != ClipFile.model_fields[key].default
        if is_given and key not in scenario.keys:
            where = ", ".join(name for name, other in SCENARIOS.items() if key in other.keys)
            fail(key, f"means nothing in scenario {file.scenario}, only in {where}; leave it out")
    fewest, most = scenario.num_objects
    count = len(file.objects)
    if count < fewest:
        fail("objects", "empty; at least one object expected")
    if most is not None and count > most:
        fail(
            "objects",
            f"{count} objects; scenario {file.scenario} ({scenario.meaning}) "
            f"has at most {most}; did you mean scenario: multi?",
        )
    names: dict[str, int] = {}
    for index, item in enumerate(file.objects):
        if item.name in names:
            fail(
                f"objects[{index}].name",
                f"{item.name!r} is also the name of objects[{names[item.name]}]; names must differ",
            )
        names[item.name] = index
        if item.rolls is not None:
            _check_rolls(f"objects[{index}].rolls", item, file.scenario, fail)
        if scenario.is_level and item.shape != "cylinder":
            fail(f"objects[{index}].shape", f"{item.shape}; a puck is a cylinder, seen from above")
        if item.size_m is None:
            continue
        meaning = SIZE_MEANING[item.shape]
        if len(item.size_m) != meaning.count(",") + 1:
            fail(
                f"objects[{index}].size_m",
                f"{list(item.size_m)} has {len(item.size_m)} values; "
                f"a {item.shape} has {meaning}, in metres",
            )
        if item.shape == "torus" and item.size_m[1] >= item.size_m[0]:
            fail(
                f"objects[{index}].size_m",
                f"{list(item.size_m)}: the tube is thicker than the ring; {meaning} expected",
            )


def _check_rolls(key: str, item: ClipObject, scenario: str, fail: Any) -> None:
    given = short(item.rolls)
    if not SCENARIOS[scenario].has_ramp:
        fail(key, f"{given} means nothing in scenario {scenario}, where nothing is touched")
    if item.shape == "box" and item.rolls:
        fail(key, f"{given}, but a box slides; leave it out, or mend shape")
    if item.shape == "sphere" and item.rolls is False:
        fail(key, "false, but a sphere rolls as far as friction lets it; leave it out")


def _filmed(path: Path, file: ClipFile) -> dict[str, Any]:
    assert file.video is not None
    video = path.parent / file.video
    if not video.exists():
        raise InputError(f"{path}: video: {video}: no such file")
    from galileo_jax.video import decode  # and OpenCV, which a csv track does not need

    info = decode.probe(video, file.fps)
    return {
        "video": video,
        "frame_count": info.frame_count,
        "frame_size_px": info.size_px,
        "container_fps": info.container_fps or None,
        "warnings": info.warnings,
    }


def _observed(path: Path, file: ClipFile, read: FileTrack) -> dict[str, Any]:
    assert file.track is not None
    track = path.parent / file.track
    warnings = read.warnings
    if abs(file.fps / read.fps - 1) > 0.01:
        warnings += (
            f"{path}: fps: {file.fps:g} declared, the times in {track.name} say {read.fps:.4g}; "
            "the times are used",
        )
    in_pixels = {"pixels_per_metre": read.pixels_per_metre, "origin_px": read.origin_px}
    return {
        "track": track,
        "track_units": read.unit,
        "is_own_track": read.is_own,
        **(in_pixels if read.unit == "px" else {}),
        "frame_count": len(read.observation.times_s),
        "warnings": warnings,
    }


def _check_against_source(clip: Clip, observation: Observation | None, fail: Any) -> None:
    """What takes the video or the csv track to judge."""
    _check_uncertainties(clip, fail)
    for index, item in enumerate(clip.objects):
        key = f"objects[{index}]"
        if (item.first_frame or 0) >= clip.frame_count:
            fail(
                f"{key}.first_frame",
                f"{item.first_frame} is beyond the end; the clip has "
                f"{clip.frame_count} frames (0 to {clip.frame_count - 1})",
            )
        _check_frames(key, item, clip, fail)
        if item.point_px is not None and clip.frame_size_px is not None:
            _check_in_frame(f"{key}.point_px", item.point_px, clip.frame_size_px, 0, fail)
    if clip.origin_px is not None and clip.frame_size_px is not None:
        # The foot may lie outside the picture, but not by more than its own size.
        _check_in_frame("origin_px", clip.origin_px, clip.frame_size_px, 1, fail)
    centres_m = (
        _first_positions(observation) if observation else placement.centres_from_pixels(clip)
    )
    for problem in (placement.find_odd_size(clip), placement.find_misplacement(clip, centres_m)):
        if problem:
            fail(*problem)


def _check_camera(file: ClipFile, fail: Any) -> None:
    """Refuses two scales, and a camera's geometry where there is no picture."""
    if file.rectangle is not None and file.pixels_per_metre is not None:
        fail("rectangle", "given together with pixels_per_metre; leave one of them out")
    for key in ("rectangle", "lens"):
        if getattr(file, key) is not None and file.video is None:
            fail(key, "means nothing beside a track, only beside a video; leave it out")


def _check_frames(key: str, item: ClipObject, clip: Clip, fail: Any) -> None:
    """Refuses a last frame or corrections outside of the frames in which the object is used."""
    first, end = item.first_frame or 0, clip.frame_count - 1
    last = end if item.last_frame is None else item.last_frame
    if not first < last <= end:
        fail(
            f"{key}.last_frame",
            f"{last} is not after first_frame ({first}) and within the clip (to {end})",
        )
    for n, (frame, x, y) in enumerate(item.corrections):
        if not first < frame <= last:
            fail(
                f"{key}.corrections[{n}]",
                f"frame {frame} is not after the first that is used ({first}) and up to the last "
                f"({last})",
            )
        if clip.frame_size_px is not None:
            _check_in_frame(f"{key}.corrections[{n}]", (x, y), clip.frame_size_px, 0, fail)


def _check_uncertainties(clip: Clip, fail: Any) -> None:
    """Refuses the uncertainty of what nobody declared, and of a scale that is a guess."""
    for key, of in (
        ("ramp_angle_sd_deg", "ramp_angle_deg"),
        ("pixels_per_metre_sd", "pixels_per_metre"),
        ("origin_sd_px", "origin_px"),
    ):
        if getattr(clip, key) and getattr(clip, of) is None:
            fail(key, f"{getattr(clip, key):g} given without {of}; give both, or leave it out")
    scale, sd = clip.pixels_per_metre, clip.pixels_per_metre_sd
    if scale is not None and sd > MAX_SCALE_SD_SHARE * scale:
        fail(
            "pixels_per_metre_sd",
            f"{sd:g} is more than {MAX_SCALE_SD_SHARE:.0%} of pixels_per_metre ({scale:g}); "
            "one standard deviation in pixels per metre expected",
        )


def _check_in_frame(
    key: str, point: tuple[float, float], size_px: tuple[int, int], margin: int, fail: Any
) -> None:
    width, height = size_px
    x, y = point
    is_inside = (
        -margin * width <= x < (1 + margin) * width
        and -margin * height <= y < (1 + margin) * height
    )
    if not is_inside:
        far = "far " if margin else ""
        fail(key, f"{list(point)} is {far}outside the frame of {width} x {height} pixels")


def _first_positions(observation: Observation) -> dict[str, np.ndarray]:
    first = observation.mask.argmax(axis=1)
    return {
        name: observation.position_m[index, :, first[index]]
        for index, name in enumerate(observation.names)
    }

"""Loading a clip: every problem is one line that names the file, the key and the remedy."""

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from pydantic import ValidationError

from galileo_jax.clip.checks import check_against_source, check_camera, check_frames, check_objects
from galileo_jax.clip.declaration import Declaration
from galileo_jax.clip.fields import short
from galileo_jax.clip.file_kinds import YAML_SUFFIXES, is_track, is_yaml
from galileo_jax.clip.picture_plane import scale_of_rectangle
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip, ClipFile
from galileo_jax.clip.schema_errors import first_problem, unknown_key
from galileo_jax.clip.sources import source_of
from galileo_jax.clip.track_file import FileTrack, read_track
from galileo_jax.clip.yaml_file import read_mapping
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.known_names import check_known


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
    elif path != yaml_path and content.get("track") is None:
        content.setdefault("video", path.name)
    clip = check_clip(yaml_path, content | given, overridden=frozenset(given))
    check_belongs(clip, path)
    # Beside a video the same yaml needs what the track does not.
    clip = clip if is_shared else with_unused(clip)
    return clip.model_copy(update={"source": source})


def with_unused(clip: Clip) -> Clip:
    """The clip with a warning for every key that means nothing beside its track."""
    if clip.track is None:
        return clip
    unused = {}
    for index, item in enumerate(clip.objects):
        if item.point_px is not None:
            unused[f"objects[{index}].point_px"] = "the track says where it is"
        if item.corrections:
            unused[f"objects[{index}].corrections"] = "a track is not tracked again"
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

    fail = _failing(clip.path, frozenset({"objects"}))
    try:
        found = Clip.model_validate({**dict(clip), "objects": objects})
    except ValidationError as error:
        fail(*first_problem(error))
    for index, item in enumerate(found.objects):
        check_frames(f"objects[{index}]", item, found, fail)
    return found


def _failing(path: Path, overridden: frozenset[str]) -> Callable[[str, str], NoReturn]:
    """What refuses the value of a key; of those that do not stand in the file it says so."""

    def fail(key: str, problem: str) -> NoReturn:
        note = " (given in the call)" if re.split(r"[.\[]", key)[0] in overridden else ""
        raise InputError(f"{path}: {key}{note}: {problem}")

    return fail


def yaml_of(path: Path) -> Path:
    """The yaml beside a video or track, which need not be there; of a yaml the yaml itself."""
    if is_yaml(path):
        return path
    names = [path.with_suffix(suffix) for suffix in YAML_SUFFIXES]
    return next((name for name in names if name.is_file()), names[0])


def has_yaml(path: Path) -> bool:
    """Whether a video or track has a yaml beside it."""
    return yaml_of(path).is_file()


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
    if (found := yaml_of(path)).is_file():
        return found
    raise InputError(
        f"{path}: no {path.with_suffix('.yaml').name} beside it; "
        "describe the scene with galileo label (see galileo label --help) or galileo studio"
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

    fail = _failing(path, overridden)
    content = dict(content)
    if (content.get("video") is None) == (content.get("track") is None):
        for key in content:
            if key not in ClipFile.model_fields:
                fail(short(key).strip("'"), unknown_key(key, ClipFile))
        problem = "both given" if content.get("video") is not None else "missing"
        fail("video, track", f"{problem}; one of them expected, such as video: {path.stem}.mp4")

    is_timed = content.get("track") is not None and "fps" not in content
    if is_timed:
        content["fps"] = 1.0  # holds the place until the track's own times are read
    try:
        file = ClipFile.model_validate(content)
    except ValidationError as error:
        fail(*first_problem(error))
    check_objects(file, fail)
    read = None
    if file.track is not None:
        read = read_track(path, path.parent / file.track, file, None if is_timed else file.fps)
        if is_timed:
            file = file.model_copy(update={"fps": read.fps})
        if not read.is_own:
            file = _let_go_whenever(file)
    found = _observed(path, file, read) if read else _filmed(path, file)
    check_camera(file, fail)
    clip = Clip.model_validate({**dict(file), "path": path, **found})
    if (angle_deg := SCENARIOS[clip.scenario].angle_deg) is not None:
        clip = clip.model_copy(update={"ramp_angle_deg": angle_deg})
    if clip.rectangle is not None:
        clip = clip.model_copy(update={"pixels_per_metre": scale_of_rectangle(clip)})
    check_against_source(clip, read.observation if read else None, fail)
    return clip


def _let_go_whenever(file: ClipFile) -> ClipFile:
    """A table that others made begins anywhere: its first row is no release unless it is said."""
    objects = tuple(
        item
        if "first_frame" in item.model_fields_set
        else item.model_copy(update={"first_frame": None})
        for item in file.objects
    )
    return file.model_copy(update={"objects": objects})


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
        "frame_times_s": info.times_s,
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
        "direction": read.direction,
        **(in_pixels if read.unit == "px" else {}),
        "frame_count": len(read.observation.times_s),
        "warnings": warnings,
    }

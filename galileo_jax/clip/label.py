"""Writing what is known about a clip into the yaml beside it, if the result is valid."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.clip.declaration import CLICK_SD_PX, LEVELS, Declaration
from galileo_jax.clip.file_kinds import is_track, is_yaml
from galileo_jax.clip.load import check_belongs, check_clip, find_yaml, has_yaml, with_unused
from galileo_jax.clip.picture_plane import PicturePlane, nearby_planes, picture_plane
from galileo_jax.clip.schema import UNCERTAINTY_OF, Clip, ClipFile
from galileo_jax.clip.sources import source_of
from galileo_jax.clip.yaml_file import read_mapping, yaml_text
from galileo_jax.clip.yaml_update import updated_text
from galileo_jax.runtime.atomic_write import write_text
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.known_names import check_known
from galileo_jax.video.decode import probe

KEY_ORDER = tuple(ClipFile.model_fields)

REPLACES = {"rectangle": "pixels_per_metre", "pixels_per_metre": "rectangle"}
"""What says the same in another way, and goes."""


@dataclass(frozen=True)
class LabelledClip:
    """What `label` wrote."""

    path: Path  # of the yaml
    clip: Clip  # as it is declared now
    notes: tuple[str, ...] = ()  # what to know about the writing, one line each

    def __repr__(self) -> str:
        """In one line."""
        return f"<LabelledClip {self.path}>"


def label_clip(path: Path, declared: Declaration) -> LabelledClip:
    """Creates or updates the yaml beside a clip; comments and order of an old one stay.

    Raises:
      InputError: nothing is declared, or the clip would be wrong; nothing is written then.
    """
    if not has_yaml(path) and (source := source_of(path)):
        check_known("--level", "level", declared.level, LEVELS)
        return source.label(path, declared)
    if declared.level != LEVELS[-1]:
        raise InputError(f"--level: {path} is not in folders of Physics 101")
    yaml_path = _yaml_path(path)
    is_new = not yaml_path.exists()
    content, notes = _defaults(path, declared) if is_new else (read_mapping(yaml_path), ())
    values, objects = declared.clip_values(), declared.object_values()
    for name in declared.correct:
        listed = content.get("objects")
        items = (one for one in listed if isinstance(one, dict)) if isinstance(listed, list) else ()
        was = next((item for item in items if item.get("name") == name), None)
        if was is None:
            raise InputError(f"{yaml_path}: objects: there is no {name!r} to correct")
        objects[name]["corrections"] = declared.corrections(name, was.get("corrections"))
    if not values and not objects:
        raise InputError(f"{path}: nothing to write; see galileo label --help")
    content |= values
    for key, other in REPLACES.items():
        if key in values and content.get(other):
            content[other] = None
    for key, sd in UNCERTAINTY_OF.items():
        # A new value is not known as well as the old one was, unless somebody says so.
        if key in values and sd not in values and sd in content:
            content[sd] = ClipFile.model_fields[sd].default
    if objects:
        content["objects"] = _with_objects(yaml_path, content.get("objects"), objects)
    clip = check_clip(yaml_path, content)
    if declared.ramp is not None and not clip.is_camera_plain:
        given = {} if declared.ramp_angle_sd is None else {"ramp_angle_sd_deg"}
        found = _ramp_in_plane(clip, declared.ramp)
        content |= {key: value for key, value in found.items() if key not in given}
        clip = check_clip(yaml_path, content)
    clip = with_unused(clip)
    check_belongs(clip, path)
    if is_new:
        text = yaml_text({key: content[key] for key in KEY_ORDER if key in content})
    else:
        text, lost = updated_file(yaml_path, content)
        notes += lost
    write_text(yaml_path, text)
    return LabelledClip(yaml_path, clip, notes)


def updated_file(path: Path, content: Mapping[str, Any]) -> tuple[str, tuple[str, ...]]:
    """A yaml file's text with new values, and a note where its comments are lost."""
    old_text = path.read_text(encoding="utf-8-sig")
    text, has_comments = updated_text(old_text, content, KEY_ORDER)
    is_lost = not has_comments and "#" in old_text
    return text, (f"{path} was written anew; its comments are lost",) if is_lost else ()


def _yaml_path(clip_path: Path) -> Path:
    """The clip's yaml: the one that is there, or the one to create."""
    is_source = clip_path.is_file() and not is_yaml(clip_path)
    is_new = is_source and not has_yaml(clip_path)
    return clip_path.with_suffix(".yaml") if is_new else find_yaml(clip_path)


def _defaults(clip_path: Path, declared: Declaration) -> tuple[dict[str, Any], tuple[str, ...]]:
    """What a new yaml takes from the file beside it, and a note about it."""
    if is_track(clip_path):
        return {"track": clip_path.name}, ()
    if declared.fps is not None:
        return {"video": clip_path.name}, ()
    fps = round(probe(clip_path).fps, 4)
    note = f"fps: {fps:g} taken from the video file; slow-motion files often state a wrong rate"
    return {"video": clip_path.name, "fps": fps}, (note,)


def _with_objects(
    yaml_path: Path, listed: Any, objects: Mapping[str, Mapping[str, Any]]
) -> list[Any]:
    """The list of objects with new values; a name that is not there is added, as a box."""
    listed = listed or []
    if not isinstance(listed, list):
        raise InputError(f"{yaml_path}: objects: a list with one entry per object expected")
    names = [item.get("name") if isinstance(item, dict) else None for item in listed]
    for name, values in objects.items():
        if name in names:
            listed[names.index(name)] |= values
        else:
            listed.append({"name": name, "shape": "box"} | dict(values))
            names.append(name)
    return listed


def _ramp_in_plane(clip: Clip, line: Sequence[float]) -> dict[str, Any]:
    """`ramp_angle_deg` and its standard deviation, by the declared rectangle or lens.

    Args:
      clip: with one of these.
      line: (x1, y1, x2, y2), px, on the ramp. Half a pixel of each of its coordinates and of the
        rectangle's, and what is open of the lens, make up the standard deviation.
    """
    ends = np.array(line, float).reshape(2, 2)
    plane, steps = picture_plane(clip, ends[0]), CLICK_SD_PX * np.eye(4).reshape(4, 2, 2)
    apart = [_angle_deg(plane, ends + step) - _angle_deg(plane, ends - step) for step in steps]
    for more, less in nearby_planes(clip, ends[0]):
        apart.append(_angle_deg(more, ends) - _angle_deg(less, ends))
    angle, read_off = _angle_deg(plane, ends), math.hypot(*apart) / 2
    return {"ramp_angle_deg": round(angle, 3), "ramp_angle_sd_deg": float(f"{read_off:.3g}")}


def _angle_deg(plane: PicturePlane, ends: np.ndarray) -> float:
    x, y = np.diff(plane.to_metres(ends), axis=0)[0]
    return math.degrees(math.atan2(abs(y), abs(x)))

"""Checks of a clip that take several keys of its yaml, or its video or track, to judge.

Each calls `fail(key, problem)`, which raises, for the first thing that is wrong.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from galileo_jax.clip import placement
from galileo_jax.clip.fields import MAX_SCALE_SD_SHARE, SIZE_MEANING, short
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import UNCERTAINTY_OF, Clip, ClipFile, ClipObject
from galileo_jax.numerics.line_segments import distance_to_segment
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.errors import InputError

INTO_WALL = 0.25
"""Of a radius: as deep a puck may seem to reach into a wall, by errors of marking and of size."""


def check_objects(file: ClipFile, fail: Any) -> None:
    """What takes several values of the yaml to judge."""
    scenario = SCENARIOS[file.scenario]
    this = f"scenario {file.scenario} ({scenario.meaning})"
    fewest, most = scenario.num_objects
    if scenario.is_sloped and "ramp_angle_deg" not in file.model_fields_set:
        fail(
            "ramp_angle_deg",
            f"missing; scenario {file.scenario} needs it, in degrees, or null where it is to be "
            "found from the path",
        )
    # Several objects may slide beside a ramp.
    if most == 1 and not scenario.is_sloped and (angle := file.ramp_angle_deg) is not None:
        fail("ramp_angle_deg", f"{angle:g} given; {this} has no ramp; leave it out")
    for key in (key for other in SCENARIOS.values() for key in other.keys):
        is_given = getattr(file, key) != ClipFile.model_fields[key].default
        if is_given and key not in scenario.keys:
            where = ", ".join(name for name, other in SCENARIOS.items() if key in other.keys)
            fail(key, f"means nothing in scenario {file.scenario}, only in {where}; leave it out")
    count = len(file.objects)
    if count < fewest:
        fail("objects", "empty; at least one object expected")
    if most is not None and count > most:
        multi = "did you mean scenario: multi?"
        fail("objects", f"{count} objects; {this} has at most {most}; {multi}")
    names: dict[str, int] = {}
    for index, item in enumerate(file.objects):
        key = f"objects[{index}]"
        if item.name in names:
            first = f"objects[{names[item.name]}]"
            fail(f"{key}.name", f"{item.name!r} is also the name of {first}; names must differ")
        names[item.name] = index
        if item.rolls is not None:
            _check_rolls(f"{key}.rolls", item, file.scenario, fail)
        if scenario.is_level and item.shape != "cylinder":
            fail(f"{key}.shape", f"{item.shape}; a puck is a cylinder, seen from above")
        if item.size_m is None:
            continue
        size, meaning = list(item.size_m), SIZE_MEANING[item.shape]
        if len(size) != meaning.count(",") + 1:
            has = f"has {len(size)} values; a {item.shape} has {meaning}, in metres"
            fail(f"{key}.size_m", f"{size} {has}")
        if item.shape == "torus" and size[1] >= size[0]:
            wrong = f"the tube is thicker than the ring; {meaning} expected"
            fail(f"{key}.size_m", f"{size}: {wrong}")


def _check_rolls(key: str, item: ClipObject, scenario: str, fail: Any) -> None:
    given = short(item.rolls)
    if not SCENARIOS[scenario].has_ramp:
        fail(key, f"{given} means nothing in scenario {scenario}, where nothing is touched")
    if item.shape == "box" and item.rolls:
        fail(key, f"{given}, but a box slides; leave it out, or correct shape")
    if item.shape == "sphere" and item.rolls is False:
        fail(key, "false, but a sphere rolls as far as friction lets it; leave it out")


def check_against_source(clip: Clip, observation: Observation | None, fail: Any) -> None:
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
        check_frames(key, item, clip, fail)
        _check_in_frame(f"{key}.point_px", item.point_px, clip, fail)
    # The foot may lie outside the picture, but not by more than its own size.
    _check_in_frame("origin_px", clip.origin_px, clip, fail, margin=1)
    check_walls(clip, observation, fail)
    places = _first_positions(observation) if observation else placement.centres_from_pixels(clip)
    for problem in (placement.find_odd_size(clip), placement.find_misplacement(clip, places)):
        if problem:
            fail(*problem)


def check_camera(file: ClipFile, fail: Any) -> None:
    """Refuses two scales, and a camera's geometry where there is no picture."""
    if file.rectangle is not None and file.pixels_per_metre is not None:
        fail("rectangle", "given together with pixels_per_metre; leave one of them out")
    for key in ("rectangle", "lens", "turning"):
        if getattr(file, key) not in (None, False) and file.video is None:
            fail(key, "means nothing beside a track, only beside a video; leave it out")


def check_walls(clip: Clip, observation: Observation | None, fail: Any) -> None:
    """Refuses walls in units that the clip does not have, outside its frame, or inside a puck."""
    if clip.walls and len(clip.objects) == 1 and clip.objects[0].size_m is None:
        fail("objects[0].size_m", "null, but a puck bounces off a wall one radius before it")
    for index, wall in enumerate(clip.walls):
        key = f"walls[{index}]"
        if wall.is_in_pixels and clip.frame_size_px is None:
            fail(key, "in pixels, but the clip is a track in metres; from_m and to_m expected")
        if not wall.is_in_pixels and not clip.is_scale_known:
            fail(
                key,
                "in metres, but pixels_per_metre is null; from_px and to_px expected, or the scale",
            )
        if wall.is_in_pixels:
            for end in ("from_px", "to_px"):
                # A wall may go on beside the picture, but not by more than the picture's own size.
                _check_in_frame(f"{key}.{end}", getattr(wall, end), clip, fail, margin=1)
            continue
        places = _first_positions(observation) if observation else {}
        for item in clip.objects:
            if item.size_m is None or item.name not in places:
                continue
            apart = float(distance_to_segment(places[item.name][:2], wall.ends_m))
            if apart < (1 - INTO_WALL) * item.size_m[0]:
                fail(
                    key,
                    f"{item.name} reaches into it by {1000 * (item.size_m[0] - apart):.0f} mm at "
                    "the start; the line that rims touch, in metres from the origin, expected",
                )


def check_frames(key: str, item: ClipObject, clip: Clip, fail: Any) -> None:
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
        _check_in_frame(f"{key}.corrections[{n}]", (x, y), clip, fail)


def _check_uncertainties(clip: Clip, fail: Any) -> None:
    """Refuses the uncertainty of what nobody declared, and of a scale that is a guess."""
    for of, key in UNCERTAINTY_OF.items():
        if getattr(clip, key) and getattr(clip, of) is None:
            fail(key, f"{getattr(clip, key):g} given without {of}; give both, or leave it out")
    scale, sd = clip.pixels_per_metre, clip.pixels_per_metre_sd
    if scale is not None and (sd or 0.0) > MAX_SCALE_SD_SHARE * scale:
        fail(
            "pixels_per_metre_sd",
            f"{sd:g} is more than {MAX_SCALE_SD_SHARE:.0%} of pixels_per_metre ({scale:g}); "
            "one standard deviation in pixels per metre expected",
        )


def _check_in_frame(
    key: str, point: tuple[float, float] | None, clip: Clip, fail: Any, margin: int = 0
) -> None:
    """Refuses a marked point that is further outside than so many times the picture's size."""
    if point is None or clip.frame_size_px is None:
        return
    width, height = clip.frame_size_px
    sides = zip(point, clip.frame_size_px, strict=True)
    if not all(-margin * size <= at < (1 + margin) * size for at, size in sides):
        far = "far " if margin else ""
        fail(key, f"{list(point)} is {far}outside the frame of {width} x {height} pixels")


def _first_positions(observation: Observation) -> dict[str, np.ndarray]:
    first = observation.mask.argmax(axis=1)
    return {
        name: observation.position_m[index, :, first[index]]
        for index, name in enumerate(observation.names)
    }


def check_scale(clip: Clip) -> None:
    """Raises `InputError` where a model needs lengths in metres and the clip has none."""
    if SCENARIOS[clip.scenario].has_table and not clip.is_scale_known:
        raise InputError(
            f"{clip.path}: pixels_per_metre: null; the scale of a ramp clip cannot be determined "
            "from its motion; set it with `galileo label --scale X1 Y1 X2 Y2 METRES` or "
            "--pixels-per-metre"
        )


def check_same_objects(clips: Sequence[Clip]) -> None:
    """Checks that clips are trials of the same objects.

    Raises:
      InputError: two clips have the same name, or another scenario, number of objects or mass.
    """
    first = clips[0]
    for i, clip in enumerate(clips[1:], 1):
        if clip.path.stem in (other.path.stem for other in clips[:i]):
            raise InputError(f"{clip.path}: two clips are named {clip.path.stem}")
        if clip.scenario != first.scenario or len(clip.objects) != len(first.objects):
            raise InputError(
                f"{clip.path}: {clip.scenario} with {len(clip.objects)} objects, but {first.path}: "
                f"{first.scenario} with {len(first.objects)}; clips given together are trials of "
                "the same objects"
            )
        for one, other in zip(first.objects, clip.objects, strict=True):
            if one.mass_kg != other.mass_kg:
                raise InputError(
                    f"{clip.path}: {other.name}.mass_kg: {other.mass_kg}, but {first.path}: "
                    f"{one.mass_kg}; clips given together are trials of the same objects"
                )

"""The clip that a file, its yaml and a person's answers make together, and its yaml."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from galileo_jax.api.questions import assumed, check_answered
from galileo_jax.api.understand import USUAL_FPS, Understood
from galileo_jax.clip.load import check_clip, with_unused
from galileo_jax.clip.look import SWINGS, proposed_yaml, usual_shape
from galileo_jax.clip.scenarios import Scenario
from galileo_jax.clip.schema import Clip, ClipFile
from galileo_jax.clip.yaml_file import yaml_text
from galileo_jax.runtime.atomic_write import write_text
from galileo_jax.runtime.errors import InputError, one_line_of

FOOT_SD_PX = 3.0  # of a foot that was found, not marked


def clip_of(known: Understood, source: str | None = None) -> Clip:
    """The checked clip; what a person said goes before what the yaml declares.

    `source`: what it is called in results; None: its file. Raises `InputError`, one line with all
    that only a person can know and is missing, or with what was said and is wrong.
    """
    _check_slides(known)
    check_answered(known)
    said = {key: value for key, value in known.answers.items() if key != "points"}
    content = _completed(known) | said if known.declared else yaml.safe_load(yaml_of(known))
    if known.has_objects and "points" in known.answers:
        objects = placed(known.declared["objects"], known.answers["points"], known.yaml_path)
        content["objects"] = objects
    clip = with_unused(check_clip(known.yaml_path, content, overridden=frozenset(said)))
    return clip.model_copy(update={"source": source or str(known.source)})


def placed(
    objects: Any, points: Sequence[tuple[float, float]], yaml_path: Path
) -> list[dict[str, Any]]:
    """Objects as a yaml declares them, where points, px, say that they are.

    Raises `InputError` where there are not as many.
    """
    known = [one for one in objects if isinstance(one, dict)] if isinstance(objects, list) else []
    if len(known) != len(points):
        raise InputError(
            f"{yaml_path}: objects: {len(known)} declared, but {len(points)} points in the call; "
            f"delete {yaml_path.name} to be asked anew, or place one: galileo label "
            f"{yaml_path} --point NAME X Y"
        )
    return [{**one, "point_px": list(at)} for one, at in zip(known, points, strict=True)]


def _check_slides(known: Understood) -> None:
    """Refuses a motion that is said to be a slide, and goes to and fro."""
    scenario = known.scenario
    if scenario is None or known.has_objects or scenario.line not in ("slope", "level"):
        return
    likely = known.likely
    if likely is None or likely.swings < SWINGS:
        return
    what, which = "its path", ""
    if known.is_film:
        what, which = "what moves", ", or which thing is meant (--point X Y)"
    raise InputError(
        f"{known.source}: scenario: {scenario.name}, but {what} {likely.why}, over more than half "
        f"of its way: nothing slides so; cut one slide out, or say what it is (such as --scenario "
        f"{likely.scenario}){which}"
    )


def yaml_of(known: Understood) -> str:
    """The yaml to be written beside the file, where there is none."""
    scenario = known.scenario
    if scenario is None:
        raise InputError(f"{known.source}: scenario: missing")
    if known.is_film:
        return yaml_text(_of_film(known, scenario))
    table = known.look.table
    assert table is not None  # of a table
    motion, floor = table.motion(1), _has_floor(known, scenario)
    text = proposed_yaml(known.source, motion, scenario.name, None, len(table.starts), floor)
    said = {key: value for key, value in known.answers.items() if key not in ("points", "scenario")}
    if scenario.is_sloped:
        said.setdefault("ramp_angle_deg", None)
    for key, one in assumed(known).items():
        said[key] = f"{one.default}  # {one.why}"
    return _filled(text, said)


def write_yaml(known: Understood) -> Path | None:
    """Writes the yaml beside the file; None where there is one, which stays as it is."""
    if known.declared or known.yaml_path.exists():
        return None
    with one_line_of(known.yaml_path):
        write_text(known.yaml_path, yaml_of(known))
    return known.yaml_path


def _completed(known: Understood) -> dict[str, Any]:
    """What an incomplete yaml declares, and what it lacks."""
    content = dict(known.declared)
    plain = {key: content[key] for key in ("scenario", "fps") if key in content}
    made = yaml.safe_load(yaml_of(replace(known, answers={**plain, **known.answers})))
    kind, other = ("video", "track") if known.is_film else ("track", "video")
    content.pop(other, None)
    content[kind] = known.source.name
    wanted = {"scenario", "objects", "floor", "track_units", "ramp_angle_deg", "pixels_per_metre"}
    wanted |= {"fps", "pixels_per_metre_sd"} & {*known.answers, *(["fps"] if known.is_film else [])}
    return {key: made[key] for key in wanted & set(made)} | content


def _has_floor(known: Understood, scenario: Scenario) -> bool:
    likely = known.likely if "floor" in scenario.keys else None
    return likely is not None and likely.bounces


def _of_film(known: Understood, scenario: Scenario) -> dict[str, Any]:
    points, shape = known.points, usual_shape(scenario.name)
    fps = known.answers.get("fps") or round(known.look.fps or USUAL_FPS, 4)
    content: dict[str, Any] = {"video": known.source.name, "scenario": scenario.name, "fps": fps}
    if _has_floor(known, scenario):
        content["floor"] = True
    if scenario.is_sloped:
        content["ramp_angle_deg"] = known.answers.get("ramp_angle_deg")
    if points and len(points) == 1:
        content["direction"] = known.path(points[0]).direction
    content["pixels_per_metre"] = known.answers.get("pixels_per_metre")
    if known.answers.get("pixels_per_metre_sd") is not None:
        content["pixels_per_metre_sd"] = known.answers["pixels_per_metre_sd"]
    if scenario.has_table and known.foot is not None:
        content |= {"origin_px": list(known.foot), "origin_sd_px": FOOT_SD_PX}
    content["objects"] = [
        {"name": f"object{n}", "shape": shape, "point_px": [round(float(x), 1), round(float(y), 1)]}
        | ({"first_frame": first} if (first := known.first_frame((x, y))) else {})
        for n, (x, y) in enumerate(points, 1)
    ]
    if scenario.has_table:  # nobody has said when object 1 is let go: its motion does
        content["objects"][0]["first_frame"] = None
    return {key: content[key] for key in ClipFile.model_fields if key in content}


def _filled(text: str, said: Mapping[str, Any]) -> str:
    """A proposal with values in place of its comments; new keys stand before the objects."""
    for key, value in said.items():
        line = f"{key}: {'null' if value is None else value}"
        if value is None and key == "ramp_angle_deg":
            line += "  # taken from the path"
        text, found = re.subn(rf"^(# )?{key}:.*$", line, text, flags=re.MULTILINE)
        if not found:
            text = text.replace("objects:\n", f"{line}\nobjects:\n", 1)
    return text

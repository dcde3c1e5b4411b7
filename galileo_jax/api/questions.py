"""What only a person can know of a clip, as questions: what is asked, why, and what is likely."""

import contextlib
import math
import re
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from galileo_jax.api.understand import Answers, Understood, listed_things
from galileo_jax.clip.look import FALL_M_S2
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.track_axes import accelerations
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.known_names import option_of
from galileo_jax.table.track_table import METRES_PER_UNIT

LENGTH = re.compile(r"(?P<size>[\d.,]+)\s*(?P<unit>px|[a-z]*)")
# Of a scale that is a thing's length in the picture, whose ends are where its texture seems to
# end: as much as the scale's key allows, a fifth, once it is rounded.
SIZE_SD_SHARE = 0.19
GIVEN = ("scenario", "ramp_angle_deg", "pixels_per_metre", "track_units", "fps")
NUMBERS = ("fps", "ramp_angle_deg")


@dataclass(frozen=True)
class Question:
    """Something that is asked of a person."""

    key: str  # of the yaml; "points" for which things are meant
    text: str  # what is asked
    why: str  # why it is asked, or what speaks for the default
    option: str  # of `galileo FILE` that answers it, as an example
    # What no answer means, as text; None where a guess would give a wrong result.
    default: str | None = None
    choices: tuple[str, ...] = ()  # what may be answered; empty: anything
    is_open: bool = True  # nobody but a person can say; else the default will do


def questions(known: Understood) -> tuple[Question, ...]:
    """What is still to be asked, in the order in which it is; changes with what is answered."""
    asked = [ask(known) for ask in (_points, _scenario, _fps, _units, _angle, _scale)]
    told = {*known.answers, *known.declared}
    return tuple(one for one in asked if one is not None and one.key not in told)


@dataclass(frozen=True)
class Answered:
    """All questions, with what was typed to them."""

    questions: tuple[Question, ...]  # in the order in which they are asked
    known: Understood  # with the answers; the defaults where nothing was typed
    problems: Mapping[str, str]  # by the question's key, one line that says what would be right


def answered(known: Understood, typed: Mapping[str, str]) -> Answered:
    """What a person answers who types this, by the questions' keys, and Enter to all others."""
    known = replace(known, answers={})
    asked: dict[str, Question] = {}
    problems: dict[str, str] = {}
    while left := [one for one in questions(known) if one.key not in asked]:
        one = asked[left[0].key] = left[0]
        try:
            known = known.with_answers(parsed(one, typed.get(one.key, ""), known))
        except InputError as error:
            problems[one.key] = str(error)
    return Answered(tuple(asked.values()), known, problems)


def assumed(known: Understood) -> dict[str, Question]:
    """By keys, the questions that nobody answered, and that the motion itself answers."""
    asked = questions(known)
    return {one.key: one for one in asked if one.key == "track_units" and not one.is_open}


def check_answered(known: Understood) -> None:
    """Raises `InputError`, one line with all that is missing, where only a person can say."""
    missing = [one for one in questions(known) if one.is_open]
    if not missing:
        return
    options = " ".join([*_given(known.answers), *(one.option for one in missing)])
    call = f"galileo {shlex.quote(str(known.source))} {options}"
    if known.is_film and known.unseen and missing[0].key == "points":
        raise InputError(
            f"{known.source}: {known.unseen}; film with a camera that rests, from before the "
            "motion to its end, or say where in the first picture the middle of the thing is, in "
            f"pixels, and what else does not show: {call}"
        )
    keys = ", ".join(f"{one.key} ({one.why})" for one in missing)
    name = known.yaml_path.name
    unsaid = f"{name} does not say" if known.declared else f"there is no {name} beside it that says"
    raise InputError(
        f"{known.source}: {unsaid} what the file does not show: {keys}; write it there, or say it "
        f"in the call, such as: {call}"
    )


def _given(answers: Answers) -> Iterator[str]:
    """What was said already, as options of a call."""
    for key in GIVEN:
        if answers.get(key) is not None:
            yield _option(key, answers[key])
    for x, y in answers.get("points") or ():
        yield f"--point {x:g} {y:g}"


def _option(key: str, value: Any) -> str:
    """An answer by the yaml's key as an option of a call."""
    shown = f"{value:g}" if isinstance(value, float) else value
    return f"{option_of(key.removesuffix('_deg'))} {shown}"


def parsed(question: Question, text: str, known: Understood) -> dict[str, Any]:
    """An answer as a person types it, by keys of the yaml; nothing typed: the default.

    Raises `InputError` where it is none, and says what would be right.
    """
    text = text.strip() or question.default or ""
    if not text:
        raise InputError(f"{question.key}: an answer is needed; {question.option}")
    if question.key == "points":
        return {"points": _chosen(text, known)}
    if question.key == "pixels_per_metre":
        return _scale_of(text, _length_px(known))
    if question.key in NUMBERS:
        return {question.key: None if text == "path" else _number(text, question.key)}
    if question.choices and text not in question.choices:
        raise InputError(f"{question.key}: {text!r}; one of {', '.join(question.choices)} expected")
    return {question.key: text}


def _points(known: Understood) -> Question | None:
    things = known.things
    if not known.is_film or known.has_objects or len(things) == 1:
        return None
    ask = "Which thing is to be followed? "
    if not things:
        text = f"{ask}x y of its middle in the first picture, pixels"
        return Question("points", text, known.unseen, "--point X Y")
    why = f"{len(things)} things move: {'; '.join(listed_things(known))}"
    likeliest = list(things).index(known.likeliest) if known.likeliest else 0
    meant = list(things)[:2] if known.is_pair else [list(things)[likeliest]]
    example = " ".join(f"--point {x:.0f} {y:.0f}" for x, y in meant)
    default = "both" if known.is_pair else str(likeliest + 1)
    text = f"{ask}A number, both (one runs into the other), or x y"
    return Question("points", text, why, example, default)


def _scenario(known: Understood) -> Question | None:
    if "scenario" in known.declared:
        return None
    likely = known.likely
    if likely is not None and likely.is_clear:
        return None
    name = likely.scenario if likely else None
    why = f"perhaps {name}: {likely.why}" if likely else "the motion could not be followed"
    example = _option("scenario", name or "ramp")
    text = "What kind of motion is it?"
    return Question("scenario", text, why, example, name, tuple(SCENARIOS))


def _fps(known: Understood) -> Question | None:
    seen, table = known.look.seen, known.look.table
    if seen is None or not seen.is_in_frames or (table is not None and table.frame_s is not None):
        return None
    text = "How many frames per second does the camera take?"
    return Question("fps", text, "the table counts frames and has no times", _option("fps", 30))


def _units(known: Understood) -> Question | None:
    seen = known.look.seen
    if seen is None or seen.unit is not None or seen.axes == ("angle",):
        return None
    if any(one.get("pixels_per_metre") is not None for one in (known.declared, known.answers)):
        return None
    text, choices = "In which unit are its lengths?", (*METRES_PER_UNIT, "px")
    unit, size = _unit_by_gravity(known), max(seen.moved)
    why = f"it falls with about 9.8 m/s^2 in {unit}, and in no other unit"
    if is_open := unit is None:
        unit = "px" if size >= 50 else "m" if size <= 20 else "cm"
        why = f"the table does not say; the way is {size:.4g} long"
    option = _option("track_units", unit)
    return Question("track_units", text, why, option, unit, choices, is_open)


def _unit_by_gravity(known: Understood) -> str | None:
    """The unit in which a body that flies falls with about 9.8 m/s^2; None where none is."""
    table, scenario = known.look.table, known.scenario
    fps = known.answers.get("fps") or known.declared.get("fps")
    if table is None or scenario is None or scenario.up_shows != "bend":
        return None
    seconds = table.motion(1).seconds(fps)
    if not np.isfinite(seconds).all():
        return None
    place = table.motion(1).position[0]
    shown = np.isfinite(place).all(axis=0)
    fallen = [accelerations(seconds[shown], one[shown]) for one in place]
    size = max((abs(float(np.median(one))) for one in fallen if one.size), default=0.0)
    low, high = FALL_M_S2
    fits = [unit for unit, metres in METRES_PER_UNIT.items() if low < size * metres < high]
    return fits[0] if len(fits) == 1 else None


def _angle(known: Understood) -> Question | None:
    scenario = known.scenario
    if scenario is None or not scenario.is_sloped:
        return None
    text = "What is the ramp's angle to the horizontal, in degrees, as measured?"
    likely = known.likely
    told = likely.slope_deg if likely is not None else None
    option, default = _option("ramp_angle_deg", 20), "path"
    if known.is_film and told is None and (known.is_pair or known.foot is not None):
        why = "else it is taken from the path in the picture"
    elif told is None or likely is None or not likely.is_clear:
        why, default = "friction cannot be told from slope without it", None
    else:
        why = f"else it is taken from the path, which lies at {told:.1f} degrees"
        option = _option("ramp_angle_deg", round(told))
    return Question("ramp_angle_deg", text, why, option, default, (), default is None)


def _scale(known: Understood) -> Question | None:
    scenario = known.scenario
    unit = known.look.seen.unit if known.look.seen else "px"
    unit = known.declared.get("track_units") or known.answers.get("track_units") or unit
    table = known.look.table
    is_told = {"rectangle", "pixels_per_metre"} & set(known.declared)
    is_told = is_told or (table is not None and table.calibration is not None)
    on_surface = scenario is not None and scenario.has_surface
    if unit != "px" or is_told or not on_surface or known.has_objects:
        return None
    text = "How many pixels are a metre? Pixels, such as 900 px"
    if (size := _length_px(known)) is not None:
        good_to = f"good to a fifth only, how long object 1 is (some {size:.0f} px), such as 0.06 m"
        text += f"; or, {good_to}"
    why = "friction cannot be told from lengths in pixels"
    if known.is_film:
        why += (
            "; the pixels of a length that you know, divided by its metres; galileo look "
            f"{shlex.quote(str(known.source))} --plot first.png draws a ruler"
        )
    return Question("pixels_per_metre", text, why, _option("pixels_per_metre", 900))


def _length_px(known: Understood) -> float | None:
    points = known.points if known.is_film else ()
    size = known.things.get(points[0]) if points else None
    return max(size) if size is not None else None


def _chosen(text: str, known: Understood) -> list[tuple[float, float]]:
    things = list(known.things)
    if text == "both" and len(things) > 1:
        return things[:2]
    if text.isdecimal() and 1 <= int(text) <= len(things):
        return [things[int(text) - 1]]
    numbers = re.findall(r"[\d.]+", text)
    if len(numbers) != 2:
        raise InputError(f"points: {text!r}; x and y expected, such as 312 221")
    return [(float(numbers[0]), float(numbers[1]))]


def _scale_of(text: str, length: float | None) -> dict[str, Any]:
    """Pixels per metre, or what they are where something of a known size is `length` pixels."""
    found = LENGTH.fullmatch(text)
    if found is None or found["unit"] not in ("", "px", *METRES_PER_UNIT):
        raise InputError(f"pixels_per_metre: {text!r}; such as 900 px or 0.06 m expected")
    size = _number(found["size"], "pixels_per_metre")
    if found["unit"] in ("", "px"):
        return {"pixels_per_metre": size}
    if length is None or size <= 0:
        raise InputError(f"pixels_per_metre: {text!r}; such as 900 px expected")
    scale = length / (size * METRES_PER_UNIT[found["unit"]])
    return {
        "pixels_per_metre": round(scale, 1),
        "pixels_per_metre_sd": float(f"{SIZE_SD_SHARE * scale:.2g}"),
    }


def _number(text: str, key: str) -> float:
    with contextlib.suppress(ValueError):
        if math.isfinite(value := float(text.replace(",", "."))):
            return value
    raise InputError(f"{key}: {text!r} is not a number")

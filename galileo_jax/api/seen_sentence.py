"""What a film or table shows, in a sentence that a person can confirm."""

import math

from galileo_jax.api.understand import Answers, Understood
from galileo_jax.clip.look import Likely, Seen
from galileo_jax.clip.schema import Clip
from galileo_jax.report.phrases import listed

KINDS = {
    "from_above": "a motion seen from above",
    "level": "a slide along a level table",
    "liquid": "a fall in a liquid",
    "multi": "several objects on a ramp",
}
HOW = {"a ": "along", "one coordinate": "in", "turns": "and", "an angle": "as"}
"""What stands before what speaks for a kind of motion."""


def sentence_of(known: Clip | Understood, answers: Answers) -> str:
    """What moves, how far and how, what it looks like, and how often it is seen."""
    if isinstance(known, Clip):
        return _of_clip(known)
    if known.look.seen is not None:
        return _of_table(known.look.seen)
    fps = known.look.fps
    rate = f" {fps:.4g} pictures a second." if fps else ""
    return f"{_of_film(known, answers)}{rate}"


def _of_film(known: Understood, answers: Answers) -> str:
    points = known.points(answers)
    if known.has_objects:
        return f"{known.yaml_path.name} says where the objects are."
    if not points:
        return f"No moving thing was found: {known.unseen}."
    things = "One thing moves" if len(known.things) < 2 else f"{len(known.things)} things move"
    if len(points) > 1:
        return f"{things}, one after the other: it looks like {_kind('ramp')}."
    path = known.path(points[0])
    if path.likely is None:
        return f"{things}, but cannot be followed."
    which = "," if len(known.things) < 2 else "; the one that is followed goes"
    return f"{things}{which} {path.moved_px:.0f} px {_looks(path.likely)}."


def _of_table(seen: Seen) -> str:
    unit = "rad" if seen.axes == ("angle",) else seen.unit or "(in a unit that it does not say)"
    who = "One thing moves" if len(seen.names) == 1 else f"{len(seen.names)} things move"
    rate = "counted in pictures" if seen.is_in_frames else f"{1 / seen.step:.3g} a second"
    return (
        f"{who}, {math.hypot(*seen.moved):.3g} {unit} {_looks(seen)}. {seen.num_rows} rows, {rate}."
    )


def _looks(likely: Likely) -> str:
    how = next((f"{word} {likely.why}" for start, word in HOW.items()
                if likely.why.startswith(start)), f"({likely.why})")  # fmt: skip
    return f"{how}: it looks like {_kind(likely.scenario)}"


def _kind(scenario: str) -> str:
    article = "an" if scenario[0] in "aeiou" else "a"
    return KINDS.get(scenario, f"{article} {scenario}")


def _of_clip(clip: Clip) -> str:
    angle = clip.ramp_angle_deg
    at = f" at {angle:g} degrees" if angle is not None else ""
    names = listed([item.name for item in clip.objects])
    return f"{clip.path.name} says all that is needed: {_kind(clip.scenario)}{at}, {names}."

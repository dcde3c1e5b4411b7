"""What the yaml's schema refuses, as one line that says what would be right."""

from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from galileo_jax.clip.fields import short
from galileo_jax.clip.schema import ClipFile, ClipObject
from galileo_jax.clip.walls import Wall
from galileo_jax.runtime.known_names import did_you_mean

EXAMPLES: dict[str, str] = {
    "scenario": "scenario: ramp",
    "fps": "fps: 30.0",
    "objects": "objects: with one entry per object (galileo label: --size NAME, --shape NAME)",
    "name": "name: object1",
    "shape": "shape: box",
    "corners_px": "corners_px: [[20, 400], [600, 400], [600, 50], [20, 50]]",
    "sides_m": "sides_m: [1.0, 0.6]",
    "k1": "k1: -0.05",
}
"""What to write for the keys that have no default."""
MODELS: dict[int | str, type[BaseModel]] = {"objects": ClipObject, "walls": Wall}
"""Of lists in the yaml, what each entry is."""


def first_problem(error: ValidationError) -> tuple[str, str]:
    """(key, problem) of the most telling of pydantic's errors.

    An unknown key comes first: it is often the misspelt form of one that is 'missing'.
    """
    errors = error.errors(include_url=False)
    first = next((e for e in errors if e["type"] in ("extra_forbidden", "invalid_key")), errors[0])
    missing = [e for e in errors if e["type"] == "missing"] if first["type"] == "missing" else []
    others = [_key(e["loc"]) for e in missing[1:]]
    more = f"; also missing: {', '.join(others)}" if others else ""
    return _key(first["loc"]), _problem(first) + more


def _key(loc: tuple[int | str, ...]) -> str:
    """('objects', 0, 'size_m', 2) -> 'objects[0].size_m[2]'."""
    first, *rest = loc or ("(top level)",)
    text = str(first)
    text += "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in rest)
    return " ".join(text.split())[:80]


PROBLEMS = {
    "clip": "{msg}",
    "literal_error": "unknown value {found}; known: {known}",
    "too_long": "{found} has too many values; [x, y] expected",
    "tuple_type": "{found} is not a list; {list} expected",
    **dict.fromkeys(
        ("model_type", "dict_type", "model_attributes_type"),
        "{found} is not a mapping; {keys} expected",
    ),
    "string_type": "{found} is not text",
    **dict.fromkeys(("bool_type", "bool_parsing"), "{found} is not true or false"),
    **dict.fromkeys(("int_type", "int_from_float"), "{found} is not a whole number"),
    "greater_than_equal": "{found} is negative; 0 or more expected",
    "finite_number": "{found} is not finite; a number expected",
    "float_type": "{found} is not a number{hint}",
}
"""By pydantic's type of an error, what to say; of others its own words."""

LISTS = {
    "objects": "a list with one entry per object",
    "size_m": "a list of metres, such as [0.06, 0.06, 0.06], or null",
}
"""By key, which list is expected; of others a point."""


def _problem(error: ErrorDetails) -> str:
    loc, value = error["loc"], error["input"]
    model = MODELS.get(loc[0] if loc else "", ClipFile)
    match error["type"]:
        case "extra_forbidden" | "invalid_key":
            return unknown_key(loc[-1], model)
        case "missing" if isinstance(loc[-1], int):
            return "missing; [x, y] expected"
        case "missing":
            return f"missing; write {EXAMPLES.get(str(loc[-1]))}"
    expected = str(error.get("ctx", {}).get("expected", ""))
    return PROBLEMS.get(error["type"], "{found}: {msg}").format(
        msg=error["msg"],
        found=short(value),
        known=expected.replace("'", "").replace(" or ", ", "),
        list=LISTS.get(str(loc[-1]) if loc else "", "[x, y] in pixels"),
        keys="from_m, to_m" if model is Wall else "name, shape, size_m, point_px",
        hint=_number_hint(value),
    )


def _number_hint(value: Any) -> str:
    """How to write what is text to yaml, but looks like a number."""
    if not isinstance(value, str):
        return ""
    try:
        float(value)
    except ValueError:
        return ""
    return "; yaml takes 1.0e+3 for a number, not 1e3" if "e" in value else "; leave out the quotes"


def unknown_key(key: Any, model: type[BaseModel]) -> str:
    """The problem with a key that `model` does not have, with the known one it is like."""
    known = list(model.model_fields)
    return "unknown key" + (did_you_mean(str(key), known) or f"; known: {', '.join(known)}")

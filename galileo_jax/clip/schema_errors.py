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


def _problem(error: ErrorDetails) -> str:
    loc, value = error["loc"], error["input"]
    found = short(value)
    model = MODELS.get(loc[0] if loc else "", ClipFile)
    match error["type"]:
        case "clip":
            return error["msg"]
        case "extra_forbidden" | "invalid_key":
            return unknown_key(loc[-1], model)
        case "missing":
            example = EXAMPLES.get(str(loc[-1]))
            is_in_pair = isinstance(loc[-1], int)
            return "missing; [x, y] expected" if is_in_pair else f"missing; write {example}"
        case "too_long":
            return f"{found} has too many values; [x, y] expected"
        case "tuple_type":
            return f"{found} is not a list; {_expected_list(loc)} expected"
        case "model_type" | "dict_type" | "model_attributes_type":
            keys = "from_m, to_m" if model is Wall else "name, shape, size_m, point_px"
            return f"{found} is not a mapping; {keys} expected"
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


def unknown_key(key: Any, model: type[BaseModel]) -> str:
    """The problem with a key that `model` does not have, with the known one it is like."""
    known = list(model.model_fields)
    return "unknown key" + (did_you_mean(str(key), known) or f"; known: {', '.join(known)}")

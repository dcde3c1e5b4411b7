"""Titles of columns to roles, objects and units: 'VideoAnalysis: X 2 (m)', 'Zeit / s', '位移'.

The words are in `words.yaml`.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import yaml

Role = Literal["time", "frame", "x", "y", "z", "line", "angle", "object", "likelihood", ""]
"""What a column is; "line": a distance along the way; "": anything else."""


def _by_word(words_of: dict[Any, str]) -> dict[str, Any]:
    return {word: meaning for meaning, words in words_of.items() for word in words.split()}


_LISTS = yaml.safe_load((Path(__file__).parent / "words.yaml").read_text("utf-8"))
POINTS: dict[str, Literal["up", "down"]] = {
    word: way for way in ("up", "down") for word in _LISTS["roles"][f"y {way}"].split()
}
"""Of words for a height and for a depth, which way they count."""

WORDS: dict[str, Role] = {
    word: meaning.split()[0] for word, meaning in _by_word(_LISTS["roles"]).items()
}
FILLERS, TURNINGS, OF_ALL_ROWS, OTHER_UNITS = (
    frozenset(_LISTS[key].split()) for key in ("fillers", "turnings", "of all rows", "other_units")
)
DERIVED = TURNINGS | frozenset(_LISTS["derived"].split())
SYMBOLS = frozenset("va")
"""Of quantities made from places; 'A X' is the place of A, and so is 'a x (cm)'."""

LENGTHS: dict[str, str] = _by_word(_LISTS["lengths"])
SECONDS: dict[str, float] = _by_word(_LISTS["seconds"])
RADIANS: dict[str, float] = _by_word(_LISTS["radians"])
UNITS = frozenset((*LENGTHS, *SECONDS, *RADIANS))

BRACKETS = re.compile(r"[(\[{]\s*(?:in\s+)?([^()\[\]{}]*?)\s*[)\]}]")
RATE = re.compile(r"(?:^|[\s(\[/])(?:px|mm|cm|m|km|ft|in|rad|deg|°)\s*/\s*(?:ms|s|h|min)(?![a-z])")
WITH_UNIT = re.compile(r"([-+\u2212]?[\d.,]*\d[\d.,]*(?:[eE][-+]?\d+)?)\s*([^\d\s.,+-]\S*)")
NUMBERED = re.compile(r"(\D+)(\d+)|([xyz])([a-z])", re.IGNORECASE)  # 'abscisse1', 'xA'


@dataclass(frozen=True)
class Title:
    """A column's title, taken apart."""

    role: Role  # what the column is
    name: str = ""  # of the object, "" where the title has none
    unit: str | None = None  # as written, lower case; None where none is


def count_words(text: str) -> int:
    """How many words of a text are known: of the right encoding the most are."""
    words = re.split(r"[\s,;|()\[\]{}/\"']+", text.lower())
    return sum(word in WORDS or word in UNITS for word in words)


def unit_of(text: str) -> str | None:
    """A unit alone, in brackets or not; None: it is none."""
    word = text.strip().strip("()[]{}").strip().lower()
    return word if word in UNITS else None


def parted_unit(cell: str) -> tuple[str, str]:
    """A number and the unit behind it, '0,033 s'; two empty texts: it is no number with a unit."""
    match = WITH_UNIT.fullmatch(cell)
    unit = unit_of(match[2]) if match else None
    return (match[1], unit) if match and unit else ("", "")


def is_no_place(text: str) -> bool:
    """Whether a title says that a column is of another kind: 'Temp. 2', 'U (V)'."""
    words = re.split(r"[\s_\-./]+", BRACKETS.sub(" ", text).lower())
    is_derived = any(word.rstrip("0123456789") in DERIVED for word in words)
    return is_derived or any(unit in OTHER_UNITS for unit in BRACKETS.findall(text))


def is_of_all_rows(text: str) -> bool:
    """Whether a text says that what stands beside it is a mean or a sum: 'Mittelwert:'."""
    return text.lower().partition(" ")[0].strip(":.") in OF_ALL_ROWS


def is_rate(text: str) -> bool:
    """Whether a title's unit is that of a speed or an acceleration: 'v (m/s)', 'a in m/s²'."""
    return RATE.search(text.lower()) is not None


def is_axis(text: str) -> bool:
    """Whether a title is its axis alone, with its unit or without."""
    return re.split(r"[\s(\[/,]", text.lower())[0] == title_of(text).role


def way_up(text: str) -> Literal["up", "down"] | None:
    """Which way a title says that an upright axis points: 'Tiefe/mm'; None: it does not."""
    words = re.split(r"[\s_\-./()\[\]{}]+", text.lower())
    return next((POINTS[word] for word in words if word in POINTS), None)


def is_turning(text: str) -> bool:
    """Whether a text says how a body lies or turns: 'Rotation'."""
    return not TURNINGS.isdisjoint(text.lower().split())


def title_of(text: str) -> Title:
    """Takes a title apart; 'X Velocity (m/s)' is no place and has no role."""
    text = text.strip().lstrip("#%").strip()
    found = BRACKETS.findall(text)
    unit = next((one.lower() for one in found if one.lower() in UNITS), None)
    foreign = [one for one in found if one.lower() not in UNITS]
    if any("/" in one for one in foreign):  # of a quotient, such as a velocity
        return Title("", unit=unit)
    words = BRACKETS.sub(lambda m: " " if m[1].lower() in UNITS else f" {m[1]} ", text)
    if ":" in words:  # the data set stands before a colon
        words = words.rsplit(":", 1)[1] or words
    head, slash, tail = words.rpartition("/")
    head, comma, tail = (head, slash, tail) if slash else words.rpartition(",")
    if (slash or comma) and unit is None and tail.strip().lower() in UNITS and head.strip():
        words, unit = head, tail.strip().lower()
    if "/" in words or "^" in words:
        return Title("", unit=unit)
    tokens = [one for one in re.split(r"[\s_\-.]+", words) if one]
    return _from_tokens(tokens, unit)


def _from_tokens(tokens: Sequence[str], unit: str | None) -> Title:
    if len(tokens) > 1 and tokens[-1].lower() in POINTS:  # 'Y m (down)'
        tokens = tokens[:-1]
    lower = [token.lower() for token in tokens]
    joined = "".join(lower).rstrip("#").replace("number", "").replace("index", "")
    if WORDS.get(joined) in ("frame", "object", "time"):
        return Title("time" if unit in SECONDS else WORDS[joined], unit=unit)  # 'Tid (s)' is Danish
    if DERIVED & set(lower) or (SYMBOLS & set(tokens) and unit not in LENGTHS):
        return Title("", unit=unit)
    if unit is None and len(lower) > 1 and lower[-1] in UNITS and lower[-1] not in WORDS:
        tokens, lower, unit = tokens[:-1], lower[:-1], lower[-1]
    core = [token for token in tokens if token.lower() not in FILLERS]
    if len(core) == 1 and (match := NUMBERED.fullmatch(core[0])):
        word, name = (match[1] or match[3]).lower(), match[2] or match[4]
        if word == "t" or WORDS.get(word) in ("x", "y", "z"):
            return Title(WORDS[word], name, unit)
    roles = [WORDS.get(token, "") for token in lower]
    for axis in ("x", "y", "z"):
        exact = [n for n, token in enumerate(lower) if token == axis]
        if exact or axis in roles:
            at = exact[0] if exact else roles.index(axis)
            rest = [n for n in range(len(tokens)) if n != at and lower[n] not in FILLERS]
            name = [tokens[n] for n in rest if lower[n] not in WORDS]
            return Title(axis, " ".join(name), unit)
    if len(lower) <= 3 or roles[0] == "time":
        for role in ("time", "likelihood", "angle", "frame", "object", "line"):
            if role in roles:
                rest = [t for t, r in zip(tokens, roles, strict=True)
                    if r != role and t.lower() not in FILLERS]  # fmt: skip
                is_named = role in ("angle", "likelihood", "line")
                return Title(role, " ".join(rest) if is_named else "", unit)
    return Title("", unit=unit)

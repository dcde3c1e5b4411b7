"""Titles of columns as laboratory programs write them: 'VideoAnalysis: X Wrist (m)', 't [s]'."""

import re
from dataclasses import dataclass

from galileo_jax.clip.track_files.track_table import UNIT_WORDS

TITLE = re.compile(
    r"\s*(?:[^:()\[\]]*:\s*)?"  # the data set, before a colon
    r"(?P<words>[^()\[\]]*?)"
    r"\s*(?:[(\[](?P<unit>[^)\]]*)[)\]])?\s*"
)
TIME_WORDS = ("t", "time")
FRAME_WORDS = ("frame", "frames", "frame number")
TIME_UNITS = {"s": 1.0, "sec": 1.0, "seconds": 1.0, "second": 1.0, "ms": 0.001}


@dataclass(frozen=True)
class Title:
    """A column's title, taken apart.

    Attributes:
      symbol: "t", "frame", "x" or "y"; "" for any other quantity.
      name: of the object, "" where the title has none.
      unit: of length as in `UNIT_WORDS`, or of time; None where none is written.
    """

    symbol: str
    name: str
    unit: str | None


def title_of(text: str) -> Title:
    """Takes a title apart; 'X Velocity (m/s)' is no position and gets the symbol ''."""
    match = TITLE.fullmatch(text.replace("_", " "))
    words = (match["words"] if match else text).strip()
    written = (match["unit"] or "").strip().lower() if match else ""
    plain = words.lower()
    if plain in FRAME_WORDS:
        return Title("frame", "", None)
    if plain in TIME_WORDS and written in ("", *TIME_UNITS):
        return Title("t", "", written or None)
    unit = UNIT_WORDS.get(written)
    if written and unit is None:
        return Title("", "", None)
    if _is_derived(plain):
        return Title("", "", unit)
    for symbol in ("x", "y"):
        if plain == symbol:
            return Title(symbol, "", unit)
        if plain.startswith(f"{symbol} "):
            return Title(symbol, words[2:].strip(), unit)
        if plain.endswith(f" {symbol}"):
            return Title(symbol, words[:-2].strip(), unit)
    return Title("", "", unit)


def _is_derived(words: str) -> bool:
    return any(word in words for word in ("velocity", "speed", "accel", "position error"))

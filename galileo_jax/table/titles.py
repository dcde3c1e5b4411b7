"""Titles of columns to roles, objects and units: 'VideoAnalysis: X 2 (m)', 'Zeit / s', '位移'.

A program or a language is a few words here and nothing else.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

Role = Literal["time", "frame", "x", "y", "z", "line", "angle", "object", "likelihood", ""]
"""What a column is; "line": a distance along the way; "": anything else."""

WORDS: dict[str, Role] = {
    **dict.fromkeys(
        "t time times zeit temps tiempo tempo tijd tid aika czas čas cas idő zaman waktu timp "
        "время час χρόνος 时间 時間 時刻 时刻 시간 זמן الزمن वक्त timestamp clock seconds secs".split(),
        "time",
    ),
    **dict.fromkeys(
        "frame frames image img bild bilder bildnummer imagen fotograma quadro picture slice "
        "framenumber frameno кадр klatka beeld ruta 帧 画面 フレーム 프레임".split(),
        "frame",
    ),
    **dict.fromkeys("x horizontal abscisse abscissa abszisse".split(), "x"),
    **dict.fromkeys(
        "y vertical ordonnée ordonnee ordinate height höhe hoehe hauteur altura altezza hoogte "
        "höjd wysokość výška высота 高度 高さ 높이 h".split(),
        "y",
    ),
    **dict.fromkeys(["z"], "z"),
    **dict.fromkeys(
        "s d distance displacement position pos weg strecke abstand ort déplacement deplacement "
        "distancia desplazamiento posición posicion posizione spostamento distanza afstand plaats "
        "sträcka droga dráha poloha координата путь перемещение 位移 位置 距离 距離 변위 위치".split(),
        "line",
    ),
    **dict.fromkeys("angle theta θ phi φ winkel angolo angulo ángulo hoek th 角度 угол".split(), "angle"),
    **dict.fromkeys("particle trajectory tid trackid track_id particleid objectid".split(), "object"),
    **dict.fromkeys("likelihood confidence".split(), "likelihood"),
}  # fmt: skip

FILLERS = frozenset(
    "position positions pos coordinate coordinates coord coords koordinate koordinaten coordonnée "
    "coordonnee coordenada coordinata координата in of the of centre center centroid mean".split()
)
"""Beside an axis these words are part of its title, not an object's name."""

DERIVED = frozenset(
    "velocity speed geschwindigkeit vitesse velocidad velocità acceleration accel "
    "beschleunigung accélération error err sd std sigma uncertainty momentum energy force "
    "vx vy vz ax ay az width radius area".split()
)
"""Quantities made from places, which are read from the places again."""

SYMBOLS = frozenset("va")  # 'A X' is the place of A

LENGTHS: dict[str, str] = {
    **{word: word for word in ("m", "cm", "mm", "km", "in", "ft", "px")},
    **dict.fromkeys("meter meters metre metres mètre metros 米 м".split(), "m"),
    **dict.fromkeys("centimeter centimeters centimetre centimetres 厘米 см".split(), "cm"),
    **dict.fromkeys("millimeter millimeters millimetre millimetres 毫米 мм".split(), "mm"),
    **dict.fromkeys(("inch", "inches"), "in"),
    **dict.fromkeys(("foot", "feet"), "ft"),
    **dict.fromkeys("pix pixel pixels 像素 ピクセル".split(), "px"),
}
SECONDS: dict[str, float] = {
    **dict.fromkeys("s sec secs second seconds sek sekunden 秒 с".split(), 1.0),
    **dict.fromkeys("ms msec millisecond milliseconds 毫秒 мс".split(), 1e-3),
    **dict.fromkeys("us µs μs usec microsecond microseconds 微秒 мкс".split(), 1e-6),
    **dict.fromkeys("ns nanosecond nanoseconds".split(), 1e-9),
    **dict.fromkeys("min minute minutes".split(), 60.0),
}
RADIANS: dict[str, float] = {
    **dict.fromkeys("rad radian radians".split(), 1.0),
    **dict.fromkeys("deg degree degrees ° grad".split(), 3.141592653589793 / 180),
}
UNITS = frozenset((*LENGTHS, *SECONDS, *RADIANS))

BRACKETS = re.compile(r"[(\[{]\s*(?:in\s+)?([^()\[\]{}]*?)\s*[)\]}]")
NUMBERED = re.compile(r"([xyz])[_ ]?(\d+|[A-Za-z])", re.IGNORECASE)


@dataclass(frozen=True)
class Title:
    """A column's title, taken apart.

    Attributes:
      role: what the column is.
      name: of the object, "" where the title has none.
      unit: as written, lower case; None where none is.
    """

    role: Role
    name: str = ""
    unit: str | None = None


def count_words(text: str) -> int:
    """How many words of a text are known: of the right encoding the most are."""
    words = re.split(r"[\s,;|()\[\]{}/\"']+", text.lower())
    return sum(word in WORDS or word in UNITS for word in words)


def unit_of(text: str) -> str | None:
    """A unit alone, in brackets or not; None: it is none."""
    word = text.strip().strip("()[]{}").strip().lower()
    return word if word in UNITS else None


def title_of(text: str) -> Title:
    """Takes a title apart; 'X Velocity (m/s)' is no place and has no role."""
    text = text.strip().lstrip("#%").strip()
    found = BRACKETS.findall(text)
    unit = next((one.lower() for one in found if one.lower() in UNITS), None)
    foreign = [one for one in found if one.lower() not in UNITS]
    words = BRACKETS.sub(lambda m: " " if m[1].lower() in UNITS else f" {m[1]} ", text)
    if ":" in words:  # the data set stands before a colon
        words = words.rsplit(":", 1)[1] or words
    head, slash, tail = words.rpartition("/")
    head, comma, tail = (head, slash, tail) if slash else words.rpartition(",")
    if (slash or comma) and unit is None and tail.strip().lower() in UNITS and head.strip():
        words, unit = head, tail.strip().lower()
    if "/" in words or "^" in words or any("/" in one for one in foreign):
        return Title("", unit=unit)
    tokens = [one for one in re.split(r"[\s_\-.]+", words) if one]
    return _from_tokens(tokens, unit)


def _from_tokens(tokens: Sequence[str], unit: str | None) -> Title:
    lower = [token.lower() for token in tokens]
    joined = "".join(lower).rstrip("#").replace("number", "").replace("index", "")
    if WORDS.get(joined) in ("frame", "object", "time"):
        return Title(WORDS[joined], unit=unit)
    if len(tokens) == 1 and (match := NUMBERED.fullmatch(tokens[0])):
        return Title(WORDS[match[1].lower()], match[2], unit)
    if DERIVED & set(lower) or SYMBOLS & set(tokens):
        return Title("", unit=unit)
    if unit is None and len(lower) > 1 and lower[-1] in UNITS and lower[-1] not in WORDS:
        tokens, lower, unit = tokens[:-1], lower[:-1], lower[-1]
    roles = [WORDS.get(token, "") for token in lower]
    for axis in ("x", "y", "z"):
        exact = [n for n, token in enumerate(lower) if token == axis]
        if exact or axis in roles:
            at = exact[0] if exact else roles.index(axis)
            name = [t for n, t in enumerate(tokens) if n != at and lower[n] not in FILLERS]
            return Title(axis, " ".join(name), unit)
    if len(lower) <= 3 or roles[0] == "time":
        for role in ("time", "likelihood", "angle", "frame", "object", "line"):
            if role in roles:
                rest = [t for t, r in zip(tokens, roles, strict=True)
                    if r != role and t.lower() not in FILLERS]  # fmt: skip
                is_named = role in ("angle", "likelihood", "line")
                return Title(role, " ".join(rest) if is_named else "", unit)
    return Title("", unit=unit)

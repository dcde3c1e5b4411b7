"""What a laboratory can set, and which settings are looked at.

In a call: `height=0.1:0.5,angle=10:30,fps=30|60|240,swap`. A laboratory describes the same as
`{"height_m": {"low": 0.1, "high": 0.5}, "fps": {"choices": [30, 60]}}`; units at the end of a name
are its own.
"""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any, NamedTuple

import numpy as np

from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.known_names import did_you_mean

UNITS = ("_m", "_deg", "_kg", "_s", "_hz")
MOST_LEVELS, MOST_SETTINGS = 9, 48


class Known(NamedTuple):
    """A setting that has a meaning here."""

    low: float
    high: float
    unit: str
    phrase: str  # of its value


KNOWN: Mapping[str, Known] = {
    "height": Known(0.01, 10.0, "m", "release object 1 from {:g} m"),
    "release": Known(0.01, 10.0, "m", "release object 1 {:g} m up the ramp"),
    "angle": Known(1.0, 89.0, "degrees", "ramp at {:g} degrees"),
    "fps": Known(5.0, 1000.0, "frames per second", "{:g} frames per second"),
    "place2": Known(0.01, 10.0, "m", "object 2 at {:g} m"),  # beyond the foot
    "swap": Known(0.0, 1.0, "", ""),  # whether the objects change places
    "mass1": Known(0.001, 100.0, "kg", "object 1 of {:g} kg"),
    "mass2": Known(0.001, 100.0, "kg", "object 2 of {:g} kg"),
}

NUMBERS = ("gain_nats", "named", "lead_nats", "hit")
"""What `choose.Expected` says of a setting, as next.json has it."""

Setting = Mapping[str, float]
"""Name to value, in the unit of `KNOWN`."""


@dataclass(frozen=True)
class Range:
    """Anything from low to high."""

    low: float
    high: float

    def levels(self, number: int) -> tuple[float, ...]:
        """So many values, the ends among them."""
        inner = np.linspace(self.low, self.high, number)[1:-1]
        return (self.low, *(float(f"{value:.4g}") for value in inner), self.high)

    def at(self, share: float) -> float:
        """The value at a share of the way from low to high."""
        return float(f"{self.low + share * (self.high - self.low):.4g}")

    def share(self, value: float) -> float:
        """Of the way from low to high at which a value is."""
        return (value - self.low) / (self.high - self.low)

    @property
    def middle(self) -> float:
        """Of the range."""
        return float(f"{(self.low + self.high) / 2:.4g}")

    @property
    def document(self) -> dict[str, Any]:
        """As JSON."""
        return {"low": self.low, "high": self.high}


@dataclass(frozen=True)
class Choices:
    """One of these values."""

    values: tuple[Any, ...]

    def levels(self, number: int) -> tuple[Any, ...]:
        """All."""
        return self.values

    def at(self, share: float) -> Any:
        """The value at a share of the way through them."""
        return self.values[min(int(share * len(self.values)), len(self.values) - 1)]

    def share(self, value: Any) -> float:
        """Of the way through them at which a value is."""
        return self.values.index(value) / max(len(self.values) - 1, 1)

    @property
    def middle(self) -> Any:
        """The one in the middle."""
        return self.values[(len(self.values) - 1) // 2]

    @property
    def document(self) -> dict[str, Any]:
        """As JSON."""
        return {"choices": list(self.values)}


Can = Mapping[str, Range | Choices]


def known_as(name: str) -> str:
    """A setting's name without its unit: height_m is height."""
    for unit in UNITS:
        if name not in KNOWN and name.endswith(unit) and name.removesuffix(unit) in KNOWN:
            return name.removesuffix(unit)
    return name


def parse_can(can: str | Mapping[str, Any]) -> Can:
    """What a lab can set, from a call or from what a lab says.

    Args:
      can: `height=0.1:0.5,fps=30|60,swap`, or a mapping from names to {"low", "high"},
        {"choices"}, a pair (low, high), a list of choices, or a value that stands alone.

    Raises:
      InputError: names the setting, the value and what would be right.
    """
    given = _parsed(can) if isinstance(can, str) else can
    if not isinstance(given, Mapping) or not given:
        raise InputError("--can: nothing given; height=0.1:0.5,fps=30|60 expected")
    return {str(name): _kind(str(name), value) for name, value in given.items()}


def check_can(can: Can) -> None:
    """Raises `InputError` for a setting that is not known or out of all bounds."""
    for name, kind in can.items():
        known = known_as(name)
        if known not in KNOWN:
            hint = did_you_mean(known, KNOWN) or ";"
            raise InputError(f"--can: unknown setting {name!r}{hint} known: {', '.join(KNOWN)}")
        low, high, unit, _ = KNOWN[known]
        for value in kind.levels(2):
            if not isinstance(value, Real) or not low <= float(value) <= high:
                raise InputError(
                    f"--can: {name}: {value!r} is outside {low:g} to {high:g} {unit}".rstrip()
                )


def grid(can: Can, seed: int = 0, most: int = MOST_SETTINGS) -> list[dict[str, Any]]:
    """Settings that cover what the lab can do, at most `most`.

    All combinations of some levels of each; where these would be too many, points of a Sobol
    sequence.
    """
    ranges = [kind for kind in can.values() if isinstance(kind, Range)]
    choices = math.prod(len(kind.levels(0)) for kind in can.values() if isinstance(kind, Choices))
    number = MOST_LEVELS
    while number > 2 and choices * number ** len(ranges) > most:
        number -= 1
    if choices * number ** len(ranges) <= most:
        columns = [kind.levels(number) for kind in can.values()]
        return [dict(zip(can, row, strict=True)) for row in itertools.product(*columns)]
    from scipy.stats import qmc  # half a second

    sobol = qmc.Sobol(len(can), rng=np.random.default_rng([seed, 61]))
    points = sobol.random(2 ** int(math.log2(most)))
    return [
        {name: kind.at(u) for (name, kind), u in zip(can.items(), row, strict=True)}
        for row in points
    ]


def text_of(setting: Mapping[str, Any]) -> str:
    """A setting in words: 'release object 1 from 0.15 m, ramp at 20 degrees'."""
    parts = []
    for name, value in setting.items():
        known = known_as(name)
        if known == "swap":
            parts.append("objects swapped" if value else "objects not swapped")
        elif known in KNOWN and isinstance(value, Real):
            parts.append(KNOWN[known].phrase.format(value))
        else:
            parts.append(f"{name} {value}")
    return ", ".join(parts)


def _parsed(text: str) -> dict[str, Any]:
    given: dict[str, Any] = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, sign, value = (piece.strip() for piece in part.partition("="))
        if name in given:
            raise InputError(f"--can: {name} is given twice")
        if not sign:
            given[name] = {"choices": [0, 1]}
        elif ":" in value:
            low, _, high = value.partition(":")
            given[name] = {"low": _number(name, low), "high": _number(name, high)}
        else:
            given[name] = {"choices": [_number(name, one) for one in value.split("|")]}
    return given


def _number(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"--can: {name}: {text!r} is not a number; LOW:HIGH or A|B|C expected")
    return value


def _kind(name: str, value: Any) -> Range | Choices:
    if isinstance(value, Mapping) and "choices" in value:
        value = value["choices"]
    elif isinstance(value, Mapping) and {"low", "high"} <= set(value):
        value = (value["low"], value["high"])
    elif isinstance(value, Mapping):
        raise InputError(f"--can: {name}: {{low, high}} or {{choices}} expected")
    if isinstance(value, tuple) and len(value) == 2:
        low, high = value
        if not all(isinstance(end, Real) and math.isfinite(end) for end in value):
            raise InputError(f"--can: {name}: low {low!r}, high {high!r}; two numbers expected")
        if low > high:
            raise InputError(f"--can: {name}: {low:g} to {high:g}; the smaller one first")
        return Range(float(low), float(high)) if low < high else Choices((float(low),))
    if isinstance(value, Sequence) and not isinstance(value, str):
        if not value:
            raise InputError(f"--can: {name}: no choices")
        return Choices(tuple(value))
    return Choices((value,))

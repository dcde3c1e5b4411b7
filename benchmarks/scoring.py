"""Estimates against the truth, the same way for clips, synthetic tracks and every method."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

QUANTITIES = ("k1", "k2", "mass_ratio")


class Score(NamedTuple):
    """One quantity of one fit."""

    error: float  # estimate - truth; of the mass ratio relative to the truth; NaN = not told
    sd: float  # that is stated for it; NaN: none is
    is_covered: bool | None  # the 95 % interval holds the truth; None where there is no interval
    is_identified: bool  # the fit says so
    is_expected: bool = True  # the truth says that the data can tell it

    @property
    def z(self) -> float:
        """The error in stated standard deviations."""
        return self.error / self.sd if self.sd else math.nan

    @property
    def is_scored(self) -> bool:
        """Whether it should have been told, and was."""
        return self.is_identified and self.is_expected

    def cells(self) -> list[Any]:
        """Error, z and coverage for a table; words where one side says that nothing can be told."""
        if self.is_scored:
            return [self.error, self.z, self.is_covered]
        if self.is_expected:
            return ["MISSED", self.z, self.is_covered]
        return ["CLAIMED" if self.is_identified else "not told", None, None]


def of_entry(
    entry: Mapping[str, Any], true: float, is_expected: bool = True, scale: float = 1.0
) -> Score:
    """The score of an entry of result.json: mean, sd, q025, q975, identified."""
    low, high = entry.get("q025", math.nan), entry.get("q975", math.nan)
    return Score(
        error=(entry["mean"] - true) / scale,
        sd=entry.get("sd", math.nan) / scale,
        is_covered=None if math.isnan(low) else bool(low <= true <= high),
        is_identified=bool(entry["identified"]),
        is_expected=is_expected,
    )


def score(
    estimates: Mapping[str, Mapping[str, Any]],
    truth: Mapping[str, float],
    is_hit: bool,
    moves: bool,
) -> dict[str, Score]:
    """Scores k1, k2 and the mass ratio.

    Args:
      estimates: by quantity, as in result.json.
      truth: m1, k1, m2, k2.
      is_hit: whether object 2 was hit, without which nothing tells k2 and the masses.
      moves: whether object 1 moves at all.
    """
    ratio = truth["m1"] / truth["m2"]
    return {
        "k1": of_entry(estimates["k1"], truth["k1"], moves),
        "k2": of_entry(estimates["k2"], truth["k2"], is_hit),
        "mass_ratio": of_entry(estimates["mass_ratio"], ratio, is_hit, scale=ratio),
    }


def of_result(result: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """The estimates in result.json's dictionary, in the form `score` takes."""
    return {**result["parameters"], **result["derived"]}


def summary(scores: Sequence[Mapping[str, Score]]) -> dict[str, dict[str, Any]]:
    """`summary_of` each quantity."""
    return {name: summary_of([one[name] for one in scores]) for name in scores[0]}


def summary_of(entries: Sequence[Score]) -> dict[str, Any]:
    """Count, median and worst absolute error, coverage, rms and mean of z, median sd, verdicts.

    `missed` counts fits that call a determined quantity undetermined, `claimed` the reverse.
    """
    told = [entry for entry in entries if entry.is_scored]
    covered = [entry.is_covered for entry in told if entry.is_covered is not None]
    error, z = (np.abs([one.error for one in told]), np.array([one.z for one in told]))
    return {
        "count": len(told),
        "median": float(np.median(error)) if told else math.nan,
        "worst": float(error.max()) if told else math.nan,
        "coverage": float(np.mean(covered)) if covered else math.nan,
        "rms_z": float(np.sqrt(np.mean(z**2))) if told else math.nan,
        "mean_z": float(z.mean()) if told else math.nan,
        "median_sd": float(np.median([one.sd for one in told])) if told else math.nan,
        "missed": sum(entry.is_expected and not entry.is_identified for entry in entries),
        "claimed": sum(entry.is_identified and not entry.is_expected for entry in entries),
    }


def missed(
    table: Mapping[str, Mapping[str, float]], bars: Mapping[str, Mapping[str, tuple[float, float]]]
) -> list[str]:
    """What is outside its bars, in words.

    Args:
      table: by quantity, as `summary` has it.
      bars: by quantity and figure, the least and the most.
    """
    return [
        f"{name} {what} {table[name][what]:.4g} not in {low:g} to {high:g}"
        for name in table
        for what, (low, high) in bars.get(name, {}).items()
        if not low <= table[name][what] <= high
    ]

"""Estimates against the truth, the same way for clips, synthetic tracks and every method."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

QUANTITIES = ("k1", "k2", "mass_ratio")


@dataclass(frozen=True)
class Score:
    """One quantity of one fit.

    Attributes:
      error: estimate - truth; of the mass ratio relative to the truth; NaN = not told.
      z: error in standard deviations.
      is_covered: the 95 % interval holds the truth; None where there is no interval.
      is_identified: the fit says so.
      is_expected: the truth says that the data can tell it.
    """

    error: float
    z: float
    is_covered: bool | None
    is_identified: bool
    is_expected: bool

    @property
    def is_scored(self) -> bool:
        """Whether it should have been told, and was."""
        return self.is_identified and self.is_expected


def score(
    estimates: Mapping[str, Mapping[str, Any]],
    truth: Mapping[str, float],
    is_hit: bool,
    moves: bool,
) -> dict[str, Score]:
    """Scores k1, k2 and the mass ratio.

    Args:
      estimates: by quantity: mean, sd, q025, q975, identified, as in result.json.
      truth: m1, k1, m2, k2.
      is_hit: whether object 2 was hit, without which nothing tells k2 and the masses.
      moves: whether object 1 moves at all.
    """
    values = {"k1": truth["k1"], "k2": truth["k2"], "mass_ratio": truth["m1"] / truth["m2"]}
    expected = {"k1": moves, "k2": is_hit, "mass_ratio": is_hit}
    scores = {}
    for name, true in values.items():
        entry = estimates[name]
        scale = true if name == "mass_ratio" else 1.0
        low, high = entry.get("q025", math.nan), entry.get("q975", math.nan)
        scores[name] = Score(
            error=(entry["mean"] - true) / scale,
            z=(entry["mean"] - true) / entry["sd"] if entry.get("sd") else math.nan,
            is_covered=None if math.isnan(low) else bool(low <= true <= high),
            is_identified=bool(entry["identified"]),
            is_expected=expected[name],
        )
    return scores


def of_result(result: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """The estimates in result.json's dictionary, in the form `score` takes."""
    return {**result["parameters"], **result["derived"]}


def summary(scores: Sequence[Mapping[str, Score]]) -> dict[str, dict[str, Any]]:
    """By quantity: count, median and worst absolute error, coverage, rms of z, false verdicts.

    `missed` counts fits that call a determined quantity undetermined, `claimed` the reverse.
    """
    table = {}
    for name in QUANTITIES:
        entries = [entry[name] for entry in scores]
        told = [entry for entry in entries if entry.is_scored]
        covered = [entry.is_covered for entry in told if entry.is_covered is not None]
        error = np.abs([entry.error for entry in told])
        table[name] = {
            "count": len(told),
            "median": float(np.median(error)) if told else math.nan,
            "worst": float(error.max()) if told else math.nan,
            "coverage": float(np.mean(covered)) if covered else math.nan,
            "rms_z": float(np.sqrt(np.mean([entry.z**2 for entry in told]))) if told else math.nan,
            "missed": sum(entry.is_expected and not entry.is_identified for entry in entries),
            "claimed": sum(entry.is_identified and not entry.is_expected for entry in entries),
        }
    return table

"""Builds compare.json from a comparison.

The keys are listed in docs/reference/result_files.md.
"""

from dataclasses import asdict
from typing import Any

from galileo_jax.comparison.compare import Comparison, Pull
from galileo_jax.inference.result import PULLED_Z


def comparison_document(comparison: Comparison) -> dict[str, Any]:
    """What the comparison says, for JSON: all cells, and the nuisances outside their priors."""
    return {
        "adequate": comparison.is_adequate if comparison.no_verdict is None else None,
        "no_verdict": comparison.no_verdict,
        "p_value": comparison.p_value,
        "noise_scale": list(comparison.noise_scale),
        "noise_misstated": comparison.is_noise_misstated,
        "where": [asdict(place) for place in comparison.where],
        "pulls": [asdict(pull) for pull in pulled(comparison)],
        "error": dict(comparison.error),
    }


def pulled(comparison: Comparison) -> list[Pull]:
    """The nuisances outside their priors."""
    return [pull for pull in comparison.pulls if abs(pull.z) > PULLED_Z]

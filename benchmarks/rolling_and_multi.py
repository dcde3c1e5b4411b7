"""Things that roll, and more than two objects: does a fit recover what `simulate` put in?

    python benchmarks/rolling_and_multi.py [--seeds 20] [--case multi ...]

Each clip is a track of 30 frames/s with 0.2 mm of noise, made by small steps that know of no events
(`truth/solver.py`), and fitted by gradients. Per parameter: median error, median standard deviation
told, how many 95 % intervals hold the truth, and how many fits call it identified.
"""

import argparse
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
import tables

from galileo_jax.api.simulate import simulate
from galileo_jax.clip.load import load_clip
from galileo_jax.inference.build_problem import make_joint_problem
from galileo_jax.inference.fit_posterior import fit_posterior
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.inference.result import make_result
from galileo_jax.measurement.measure import measure
from galileo_jax.results.truth import true_parameters
from galileo_jax.runtime import compilation_cache

CASES: dict[str, dict[str, Any]] = {
    "rolling incline": {"scenario": "incline", "shapes": ["sphere"]},
    "slipping incline": {"scenario": "incline", "shapes": ["cylinder"], "angle": 45.0},
    "multi": {"scenario": "multi"},
    "multi, a ball": {"scenario": "multi", "shapes": ["box", "sphere", "box"]},
}
COLUMNS = ("error", "sd", "covered", "told")


def main(argv: Sequence[str] | None = None) -> None:
    """Prints a table per case and one line of JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--case", action="append", choices=list(CASES))
    call = parser.parse_args(argv)
    jax.config.update("jax_enable_x64", True)
    compilation_cache.enable()
    figures: dict[str, Any] = {}
    for case in call.case or CASES:
        began = time.perf_counter()
        fits = [_fit(CASES[case], seed) for seed in range(call.seeds)]
        figures[case] = {name: _scored(name, fits) for name in fits[0][0]}
        tables.row(case, COLUMNS)
        for name, scored in figures[case].items():
            tables.row(f"  {name}", list(scored.values()))
        figures[case] |= {
            "covered": float(np.mean([scored["covered"] for scored in figures[case].values()])),
            "chi2_per_dof": float(np.median([r["error"]["chi2_per_dof"] for _, r in fits])),
            "converged": float(np.mean([result["converged"] for _, result in fits])),
            "seconds": (time.perf_counter() - began) / call.seeds,
        }
        tables.row("  covered, chi2/dof, converged, s", list(figures[case].values())[-4:])
    tables.finish("rolling_and_multi", figures)


def _fit(options: Mapping[str, Any], seed: int) -> tuple[Mapping[str, float], dict[str, Any]]:
    """The truth and what a fit of it says."""
    with tempfile.TemporaryDirectory() as folder:
        track = Path(folder) / "clip.csv"
        simulate(track, track_only=True, solver="fine", seed=seed, **options)
        clip = load_clip(track)
        measured, truth = measure(clip), true_parameters(clip)
    trials = make_joint_problem([measured.clip], [measured.observation])
    fit = GradientFitter(trials).fit(seed)
    posterior = fit_posterior(trials, fit, seed)
    result = make_result(
        trials, posterior, fit.z, clips=[], method="grad", seed=seed, timings_s={}, notes={}
    )
    # Masses alone never show; their ratios do.
    return {name: value for name, value in truth.items() if name[:1] != "m" or "_" in name}, result


def _scored(name: str, fits: Sequence[tuple[Mapping[str, float], dict[str, Any]]]) -> dict:
    told = [(result["parameters"] | result["derived"])[name] for _, result in fits]
    true = [truth[name] for truth, _ in fits]
    pairs = list(zip(told, true, strict=True))
    return {
        "error": float(np.median([abs(one["mean"] - value) for one, value in pairs])),
        "sd": float(np.median([one["sd"] for one in told])),
        "covered": float(np.mean([one["q025"] <= value <= one["q975"] for one, value in pairs])),
        "told": float(np.mean([one["identified"] for one in told])),
    }


if __name__ == "__main__":
    main()

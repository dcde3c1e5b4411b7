"""Scenarios without a ramp: does a fit of what `simulate` makes recover its parameters?

    python benchmarks/scenarios.py [--seeds 20] [--case flight ...]

Per case and parameter over the seeds: the median error, the median standard deviation told, the
root mean square of error over standard deviation (1 is right), how many 95 % intervals hold the
truth, and how many fits call the parameter identified. Tracks of 60 frames/s with 1 mm of noise
on each coordinate, made by an integrator that the fit does not know (`truth/free.py`); masses are
weighed, sizes declared, floors inferred. `unscaled`: lengths in pixels of unknown size.
"""

import argparse
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import jax
import numpy as np
import tables

from galileo_jax.clip.schema import Clip
from galileo_jax.inference.build_problem import make_joint_problem
from galileo_jax.inference.fit_posterior import fit_posterior
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.inference.result import make_result
from galileo_jax.observation.observation import NOMINAL_SCALE_PX_PER_M, Observation
from galileo_jax.runtime import compilation_cache
from galileo_jax.simulation.free import FreeTruth, draw_free, solve_free
from galileo_jax.simulation.free_clip import declared_content, noisy_track, sampled_motion

FPS, NOISE_M = 60.0, 0.001
SCALES_PX_PER_M = (250.0, 900.0)
COLUMNS = ("error", "sd", "rms z", "covered", "told")


@dataclass(frozen=True)
class Case:
    """One kind of clip."""

    scenario: str
    has_floor: bool = False
    is_scaled: bool = True


CASES = {
    "fall_floor": Case("fall", has_floor=True),
    "fall_unscaled": Case("fall", is_scaled=False),
    "flight": Case("flight"),
    "flight_floor": Case("flight", has_floor=True),
    "flight_unscaled": Case("flight", is_scaled=False),
    "spring": Case("spring"),
    "liquid": Case("liquid"),
}


def main(argv: Sequence[str] | None = None) -> None:
    """Prints a table per case and one line of JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--case", action="append", choices=list(CASES))
    call = parser.parse_args(argv)
    jax.config.update("jax_enable_x64", True)
    compilation_cache.enable()
    figures = {}
    for name in call.case or CASES:
        began = time.perf_counter()
        fits = [one_fit(CASES[name], seed) for seed in range(call.seeds)]
        tables.row(name, COLUMNS)
        figures[name] = {key: _scored(key, fits) for key in fits[0]["truth"]}
        for key, scored in figures[name].items():
            tables.row(f"  {key}", scored.values())
        chi2 = float(np.median([fit["chi2_per_dof"] for fit in fits]))
        covered = [s["covered"] for key, s in figures[name].items()]
        figures[name] |= {
            "chi2_per_dof": chi2,
            "covered": float(np.mean(covered)),
            "converged": float(np.mean([fit["converged"] for fit in fits])),
            "seconds": (time.perf_counter() - began) / call.seeds,
        }
        tables.row("  chi2/dof, covered, converged, s", list(figures[name].values())[-4:])
    tables.finish("scenarios", figures)


def one_fit(case: Case, seed: int) -> dict:
    """Draws, measures and fits one clip."""
    things, looks = np.random.default_rng([seed, 7]).spawn(2)
    truth = draw_free(things, case.scenario, {}, case.has_floor)
    frames = sampled_motion(truth, solve_free(truth)[0], FPS, truth.seconds)
    observation = noisy_track(truth, frames, NOISE_M, looks)
    true = {key: value for key, value in truth.values.items() if key != "m1"}
    if not case.is_scaled:
        scale = float(looks.uniform(*SCALES_PX_PER_M))
        observation = _in_pixels(observation, scale)
        true["pixels_per_metre"] = scale
    clip = _clip(truth, len(frames.times_s), case.is_scaled)
    trials = make_joint_problem([clip], [observation])
    fit = GradientFitter(trials).fit(seed)
    posterior = fit_posterior(trials, fit, seed)
    result = make_result(
        trials, posterior, fit.z, clips=[], method="grad", seed=seed, timings_s={}, notes={}
    )
    return {
        "truth": true,
        "told": result["parameters"],
        "chi2_per_dof": result["error"]["chi2_per_dof"],
        "converged": result["converged"],
    }


def _clip(truth: FreeTruth, num_frames: int, is_scaled: bool) -> Clip:
    content = declared_content(truth, FPS)
    content.pop("liquid_density", None)  # the ratio of the densities is to be told by the motion
    path = Path("clip.yaml")
    found = {"path": path, "track": Path("clip.csv"), "frame_count": num_frames}
    clip = Clip.model_validate({**content, **found})
    return clip if is_scaled else clip.model_copy(update={"track": None, "video": path})


def _in_pixels(seen: Observation, scale: float) -> Observation:
    """The same picture, its lengths in units of `NOMINAL_SCALE_PX_PER_M` pixels."""
    factor = scale / NOMINAL_SCALE_PX_PER_M
    return replace(
        seen,
        position_m=factor * seen.position_m,
        covariance_m2=factor**2 * seen.covariance_m2,
    )


def _scored(key: str, fits: Sequence[Mapping]) -> dict[str, float]:
    told = [fit["told"][key] for fit in fits]
    error = np.array([t["mean"] - fit["truth"][key] for t, fit in zip(told, fits, strict=True)])
    sd = np.array([t["sd"] for t in told])
    inside = [
        t["q025"] <= fit["truth"][key] <= t["q975"] for t, fit in zip(told, fits, strict=True)
    ]
    return {
        "error": float(np.median(np.abs(error))),
        "sd": float(np.median(sd)),
        "rms z": float(np.sqrt(np.mean((error / sd) ** 2))),
        "covered": float(np.mean(inside)),
        "told": float(np.mean([t["identified"] for t in told])),
    }


if __name__ == "__main__":
    main()

"""Does a fit of what `simulate` makes recover its parameters, in every scenario?

    python -m benchmarks scenarios [--seeds 20] [--case flight ...]

Per case and parameter over the seeds: the median error, the median standard deviation told, the
root mean square of error over standard deviation (1 is right), how many 95 % intervals hold the
truth, and how many fits call the parameter identified. Truths come from integrators that the fit
does not know. Without a ramp: 60 frames/s, 1 mm of noise on each coordinate, masses weighed, sizes
declared, floors inferred; `unscaled`: lengths in pixels of unknown size. On ramps, things that roll
and more than two objects: 30 frames/s, 0.2 mm.
"""

import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import tables
from benchmarks.scoring import Score, of_entry, of_result, summary_of
from galileo_jax.api.simulate import simulate
from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.schema import Clip
from galileo_jax.inference.fit_posterior import fit_posterior
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.inference.result import make_result
from galileo_jax.measurement.measure import measure
from galileo_jax.numerics.units import NOMINAL_SCALE_PX_PER_M
from galileo_jax.observation.observation import Observation
from galileo_jax.results.truth import true_parameters
from galileo_jax.runtime.precision import in_float64
from galileo_jax.search.fit import best_fit
from galileo_jax.simulation.free import draw_free, solve_free
from galileo_jax.simulation.plane import PlaneTruth
from galileo_jax.simulation.plane_clip import declared_content, noisy_track, sampled_motion

FPS, NOISE_M = 60.0, 0.001
SCALES_PX_PER_M = (250.0, 900.0)

Made = tuple[Clip, Observation, Mapping[str, float]]
"""A clip, what is seen of it, and the true values that the motion tells."""


@dataclass(frozen=True)
class Free:
    """A kind of clip without a ramp."""

    scenario: str
    has_floor: bool = False
    is_scaled: bool = True

    def make(self, seed: int) -> Made:
        """Draws and measures one clip."""
        things, looks = np.random.default_rng([seed, 7]).spawn(2)
        truth = draw_free(things, self.scenario, {}, self.has_floor)
        declared = truth.declared(FPS)
        frames = sampled_motion(declared, solve_free(truth)[0], truth.seconds)
        seen = noisy_track(truth, declared, frames, NOISE_M, looks)
        true = {key: value for key, value in truth.values.items() if key != "m1"}
        if not self.is_scaled:
            scale = float(looks.uniform(*SCALES_PX_PER_M))
            seen, true["pixels_per_metre"] = _in_pixels(seen, scale), scale
        return _declared(truth, len(frames.times_s), self.is_scaled), seen, true


@dataclass(frozen=True)
class OnRamp:
    """A kind of clip on a ramp."""

    options: Mapping[str, Any] = field(default_factory=dict)

    def make(self, seed: int) -> Made:
        """Simulates and reads one track."""
        with tempfile.TemporaryDirectory() as folder:
            track = Path(folder) / "clip.csv"
            simulate(track, track_only=True, solver="fine", seed=seed, **self.options)
            clip = load_clip(track)
            measured, truth = measure(clip), true_parameters(clip.path)
        # Masses alone never show; their ratios do.
        told = {name: value for name, value in truth.items() if name[:1] != "m" or "_" in name}
        return measured.clip, measured.observation, told


CASES: dict[str, Free | OnRamp] = {
    "fall_floor": Free("fall", has_floor=True),
    "fall_unscaled": Free("fall", is_scaled=False),
    "flight": Free("flight"),
    "flight_floor": Free("flight", has_floor=True),
    "flight_unscaled": Free("flight", is_scaled=False),
    "spring": Free("spring"),
    "liquid": Free("liquid"),
    "rolling_incline": OnRamp({"scenario": "incline", "shapes": ["sphere"]}),
    "slipping_incline": OnRamp({"scenario": "incline", "shapes": ["cylinder"], "angle": 45.0}),
    "multi": OnRamp({"scenario": "multi"}),
    "multi_with_a_ball": OnRamp({"scenario": "multi", "shapes": ["box", "sphere", "box"]}),
}


@in_float64
def main(*, seeds: int = 20, case: tuple[str, ...] = tuple(CASES)) -> dict[str, Any]:
    figures: dict[str, Any] = {}
    for name in case:
        began = time.perf_counter()
        fits = [_fitted(*CASES[name].make(seed), seed) for seed in range(seeds)]
        seconds = (time.perf_counter() - began) / seeds
        scores, results = zip(*fits, strict=True)
        found: dict[str, Any] = {}
        for key in scores[0]:
            # What is not identified counts, too: its interval has to hold the truth.
            own = [one[key] for one in scores]
            found[key] = summary_of([one._replace(is_identified=True) for one in own])
            found[key]["told"] = float(np.mean([one.is_identified for one in own]))
        tables.by_name(name, found)
        figures[name] = found | {
            "chi2_per_dof": float(np.median([one["error"]["chi2_per_dof"] for one in results])),
            "covered": float(np.mean([one["coverage"] for one in found.values()])),
            "converged": float(np.mean([one["converged"] for one in results])),
            "seconds": seconds,
        }
        tables.row("  chi2/dof, covered, converged, s", list(figures[name].values())[-4:])
    return figures


def _fitted(
    clip: Clip, seen: Observation, true: Mapping[str, float], seed: int
) -> tuple[dict[str, Score], Mapping[str, Any]]:
    """The scores of a fit, and its result."""
    trials = make_joint_problem([clip], [seen])
    fit = best_fit(GradientFitter(trials), seed)
    posterior = fit_posterior(trials, fit, seed)
    result = make_result(
        trials, posterior, fit.z, clips=[], method="grad", seed=seed, timings_s={}, notes={}
    )
    told = of_result(result)
    return {name: of_entry(told[name], value) for name, value in true.items()}, result


def _declared(truth: PlaneTruth, num_frames: int, is_scaled: bool) -> Clip:
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

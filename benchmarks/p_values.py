"""Are the p-values of `compare` uniform under the model? And is the noise scale right?

    python -m benchmarks p_values --num 400 --noise camera --case drawn [--trials 3]

Tracks of the rigid engine with the tracker's noise as stated; what the likelihood allows for beside
it (its modes, and the nuisances) is either not there ("centre") or drawn from its prior ("drawn").
"""

import itertools
import time
from dataclasses import replace
from typing import Any, get_args

import jax.numpy as jnp
import numpy as np
from scipy import stats

from benchmarks import tables
from benchmarks.tracks import make_case
from galileo_jax.comparison.compare import compare
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.problem import Problem, with_shared_parameters
from galileo_jax.runtime.precision import in_float64
from galileo_jax.search.fit import best_fit
from galileo_jax.similarity.discrepancy import crossings, modes
from galileo_jax.similarity.gaussian_likelihood import NoiseModel

NOISE_M = 5e-5  # a twentieth of a pixel at 1000 px/m
NUM_ROUNDS, NUM_DRAWS, MOST_MODES = 12, 100, 1000
SAME_M = 1e-7  # far below the noise
LEVELS = (0.01, 0.05, 0.5)
COLUMNS = ("KS p", *(f"p < {level:g}" for level in LEVELS), "chi2/dof", "scale", "CPU s")
CASES = ("centre", "drawn")


@in_float64
def main(
    *,
    num: int = 400,
    trials: int = 1,
    seed: int = 0,
    noise: tuple[NoiseModel, ...] = get_args(NoiseModel),
    case: tuple[str, ...] = CASES,
) -> dict[str, Any]:
    figures = {}
    tables.row("noise, imperfections", COLUMNS)
    for sort, is_there in itertools.product(noise, case):
        begin = time.process_time()
        rows = [one(sort, is_there == "drawn", trials, [seed, i]) for i in range(num)]
        p, chi2, scale = np.array(rows).T
        below = [float(np.mean(p < level)) for level in LEVELS]
        each = (time.process_time() - begin) / num
        told = (stats.kstest(p, "uniform").pvalue, *below, chi2.mean(), np.median(scale), each)
        figures[f"{sort} {is_there}"] = dict(zip(COLUMNS, told, strict=True))
        tables.row(f"{sort}, {is_there}", told)
    return figures


def one(noise: NoiseModel, is_drawn: bool, num_clips: int, seed: list[int]) -> tuple[float, ...]:
    """p-value, chi2 per degree of freedom and noise scale of one fitted problem."""
    rng = np.random.default_rng(seed)
    case = make_case(int(rng.integers(1 << 30)), "exact", NOISE_M)
    clips = tuple(made(case.problem, case.values, noise, is_drawn, rng) for _ in range(num_clips))
    trials = JointProblem(with_shared_parameters(clips))
    fit = best_fit(GradientFitter(trials), int(rng.integers(1 << 30)))
    found = compare(trials, fit, int(rng.integers(1 << 30)))
    return found.p_value, found.error["chi2_per_dof"], found.noise_scale[0]


def made(
    problem: Problem,
    values: dict[str, float],
    noise: NoiseModel,
    is_drawn: bool,
    rng: np.random.Generator,
) -> Problem:
    """A clip of that experiment, measured as its likelihood says."""
    model = problem.model
    theta = np.array([values.get(p.name, p.absent) for p in model.parameters])
    if is_drawn:
        for i, parameter in enumerate(model.parameters):
            if parameter.role == "nuisance":
                theta[i] = float(parameter.prior.forward(jnp.asarray(rng.standard_normal())))
    clean = problem.simulate(theta)
    clean = clean + NOISE_M * rng.standard_normal(clean.shape)
    position = clean
    if is_drawn and noise != "tracker":
        position = imperfect(clean, problem, noise == "camera", rng)
    return measured(problem, position, noise)


def measured(problem: Problem, position_m: np.ndarray, noise: NoiseModel) -> Problem:
    """The problem with these positions for its own."""
    seen = replace(problem.observation, position_m=position_m)
    return replace(problem, observation=seen, noise=noise)


def imperfect(
    clean_m: np.ndarray, problem: Problem, is_filmed: bool, rng: np.random.Generator
) -> np.ndarray:
    """`clean_m` with imperfections, those that the likelihood of the resulting track expects.

    But for what is rough across the path, of which it allows for more than bodies do.

    Which patterns there are depends on where objects are seen (which frames lie across the foot,
    when objects hit and how long they stay close), and so on the patterns themselves. About a third
    of all draws belongs to no track: a frame that its pattern shifts past the foot is not one that
    lies across it, and the likelihood lacks the pattern that is there. These are drawn anew.
    """
    scene, seen = problem.model.scene.surroundings, problem.observation
    for _ in range(NUM_DRAWS):
        normal, of_values = rng.standard_normal(MOST_MODES), rng.standard_normal(clean_m.shape)
        before = clean_m
        for _ in range(NUM_ROUNDS):
            now = replace(seen, position_m=before)
            found = modes(now, scene, is_filmed, rough_sd_m=0.0)
            # A crossing is one coordinate of one frame, and keeps its own number.
            single = crossings(now, scene).sum(axis=0) * of_values
            position = clean_m + np.tensordot(normal[: len(found)], found, axes=1) + single
            if np.abs(position - before).max() < SAME_M:
                return position
            before = position
    raise RuntimeError(f"{problem.name}: no draw agrees with the patterns of its own track")

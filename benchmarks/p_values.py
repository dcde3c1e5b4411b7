"""Are the p-values of `compare` uniform under the model? And is the noise scale right?

    python benchmarks/p_values.py [--num 400] [--trials 1] [--seed 0]
                                  [--noise camera] [--case drawn]

Tracks of the rigid engine with the tracker's noise as stated; what the likelihood allows for beside
it (its modes, and the nuisances) is either not there ("centre") or drawn from its prior ("drawn").
"""

import argparse
import time
from dataclasses import replace
from typing import get_args

import jax
import jax.numpy as jnp
import numpy as np
from scipy import stats
from synthetic_tracks import make_case

from galileo_jax.comparison.compare import compare
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.problem import Problem, with_shared_parameters
from galileo_jax.similarity.discrepancy import crossings, modes
from galileo_jax.similarity.gaussian_likelihood import NoiseModel

NOISE_M = 5e-5  # a twentieth of a pixel at 1000 px/m
NUM_ROUNDS, NUM_DRAWS, MOST_MODES = 12, 100, 1000
SAME_M = 1e-7  # far below the noise
LEVELS = (0.01, 0.05, 0.5)
CASES = ("centre", "drawn")


def main() -> None:
    """Prints a row per case."""
    jax.config.update("jax_enable_x64", True)
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--num", type=int, default=400)
    parser.add_argument("--trials", type=int, default=1, help="clips of each problem")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--noise", choices=get_args(NoiseModel), action="append")
    parser.add_argument("--case", choices=CASES, action="append")
    args = parser.parse_args()
    print(f"{'noise':<8} {'modes':<7} {'KS p':>6} {'<.01':>6} {'<.05':>6} {'<.5':>6}"
          f" {'chi2':>6} {'scale':>6} {'CPU s':>6}")  # fmt: skip
    for noise in args.noise or get_args(NoiseModel):
        for case in args.case or CASES:
            begin = time.process_time()
            rows = [
                one(noise, case == "drawn", args.trials, [args.seed, i]) for i in range(args.num)
            ]
            p, chi2, scale = np.array(rows).T
            below = " ".join(f"{np.mean(p < level):6.3f}" for level in LEVELS)
            each = (time.process_time() - begin) / args.num
            print(f"{noise:<8} {case:<7} "
                  f"{stats.kstest(p, 'uniform').pvalue:6.3f} {below} {np.mean(chi2):6.3f} "
                  f"{np.median(scale):6.3f} {each:6.2f}", flush=True)  # fmt: skip


def one(noise: NoiseModel, is_drawn: bool, num_clips: int, seed: list[int]) -> tuple[float, ...]:
    """p-value, chi2 per degree of freedom and noise scale of one fitted problem."""
    rng = np.random.default_rng(seed)
    case = make_case(int(rng.integers(1 << 30)), "exact", NOISE_M)
    clips = tuple(made(case.problem, case.values, noise, is_drawn, rng) for _ in range(num_clips))
    trials = JointProblem(with_shared_parameters(clips))
    fit = GradientFitter(trials).fit(int(rng.integers(1 << 30)))
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


if __name__ == "__main__":
    main()

"""Inference alone, on synthetic tracks with random truths: `python benchmarks/samplers.py`.

Methods on the same tracks, one after the other:

    grad      the multi-start gradient fit with its Laplace posterior
    mh        Metropolis-Hastings, started from the gradient fit (its time included)
    thesis    the thesis's 16 chains x 75 steps on our rollouts; the best sample wins
    sysid     as mujoco.sysid does: 256 random rollouts, the best 3 refined by its optimiser,
              mujoco.minimize.least_squares, on the same engine with m1, k1, m2, k2 free and no
              nuisances; intervals by its formula, s^2 (J^T J)^-1

Noise: 0.01 m/s on the velocities, that is 0.01 / (fps sqrt 2) m on positions. `--source exact`
makes the tracks in closed form (a model error for every method here), `--source engine` with
our own rollouts (none). Seconds of grad are warm, those of mh and thesis contain tracing and
compiling, which each call does anew. Stuck: velocity residuals
at the best parameters above 1.5 per degree of freedom. The last line is JSON.
"""

import argparse
import io
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np
import scoring
import synthetic_tracks
import tables

from galileo_jax import command, jax_cache
from galileo_jax.errors import InputError
from galileo_jax.inference.problem import Problem
from galileo_jax.inference.trials import Trials
from galileo_jax.rollout.engine_names import ENGINES

NOISE_M_S = 0.01
STUCK = 1.5
BARS = {"stuck": 0.02, "coverage": (0.90, 0.99)}
MAIN = ("m1", "k1", "m2", "k2")
COLUMNS = (
    *("k1 err", "in 95%", "k2 err", "in 95%", "ratio err", "in 95%"),
    *("chi2/dof", "rollouts", "seconds", "ess", "converged"),
)


@dataclass(frozen=True)
class Answer:
    """What one method says about one track.

    Attributes:
      estimates: as `scoring.score` takes them.
      best: the best parameters, model parameters in their units; for the residuals.
      num_free: how many parameters were fitted.
      seconds: of inference alone.
      num_rollouts: it took.
      ess: smallest effective sample size of k1, k2 and the mass ratio; NaN: no draws.
      is_converged: by its own account.
    """

    estimates: dict[str, Any]
    best: np.ndarray
    num_free: int
    seconds: float
    num_rollouts: float
    ess: float
    is_converged: bool


def main(argv: Sequence[str]) -> int | None:
    call = _parser().parse_args(argv)
    jax.config.update("jax_enable_x64", True)
    jax_cache.enable()
    methods = call.methods.split(",")
    if unknown := set(methods) - set(METHODS):
        raise InputError(f"--methods: unknown {sorted(unknown)}; known: {', '.join(METHODS)}")
    noise_m = NOISE_M_S / (synthetic_tracks.FPS * math.sqrt(2))
    tables.row("track, method", COLUMNS)
    answers: dict[str, list[Answer]] = {name: [] for name in methods}
    scores: dict[str, list[dict[str, scoring.Score]]] = {name: [] for name in methods}
    chi2: dict[str, list[float]] = {name: [] for name in methods}
    for seed in range(call.seed, call.seed + call.num):
        case = synthetic_tracks.make_case(seed, call.source, noise_m, call.engine)
        for name in methods:
            answer = METHODS[name](case.trials, seed)
            found = scoring.score(answer.estimates, case.values, True, True)
            answers[name].append(answer)
            scores[name].append(found)
            chi2[name].append(_velocity_chi2(case.trials, answer))
            cells: list[Any] = []
            for entry in found.values():
                cells += [entry.error, entry.is_covered]
            told = [chi2[name][-1], int(answer.num_rollouts), answer.seconds, answer.ess]
            tables.row(f"{seed} {name}", [*cells, *told, answer.is_converged])
    figures: dict[str, Any] = {}
    missed: list[str] = []
    columns = ("stuck", "seconds", "rollouts", "ess/s", "unconverged")
    print()
    tables.row("method", columns)
    for name in methods:
        table = scoring.summary(scores[name])
        seconds = np.array([answer.seconds for answer in answers[name]])
        ess = np.array([answer.ess for answer in answers[name]])
        figures[name] = {
            "stuck": float(np.mean(np.array(chi2[name]) > STUCK)),
            "seconds_median": float(np.median(seconds)),
            "rollouts_median": float(np.median([a.num_rollouts for a in answers[name]])),
            "ess_per_s_median": float(np.median(ess / seconds)),
            "unconverged": sum(not answer.is_converged for answer in answers[name]),
            **table,
        }
        tables.row(name, list(figures[name].values())[: len(columns)])
        if name in ("grad", "mh"):
            missed += [f"{name}: {what}" for what in _missed_bars(figures[name])]
    print()
    tables.row("method, quantity", list(figures[methods[0]]["k1"]))
    for name in methods:
        for quantity in scoring.QUANTITIES:
            tables.row(f"{name} {quantity}", list(figures[name][quantity].values()))
    print("bars missed: " + ("; ".join(missed) or "none"))
    figures |= {"num": call.num, "source": call.source, "bars_missed": missed}
    tables.finish("samplers", figures)
    return None


def fit_grad(trials: Trials, seed: int) -> Answer:
    fit, seconds = _warm_fit(trials, seed)
    return _of_draws(trials, fit, _laplace(trials, fit, seed), seconds, fit.stats["num_rollouts"])


def fit_mh(trials: Trials, seed: int) -> Answer:
    from galileo_jax.inference.metropolis import NUM_CHAINS, metropolis_posterior
    from galileo_jax.inference.samplers.driver import Settings

    fit, seconds = _warm_fit(trials, seed)
    began = time.perf_counter()
    posterior = metropolis_posterior(trials, fit, seed)
    seconds += time.perf_counter() - began
    steps = Settings().warmup_steps + posterior.draws.shape[1]
    rollouts = fit.stats["num_rollouts"] + NUM_CHAINS * (1 + steps)
    return _of_draws(trials, fit, posterior, seconds, rollouts)


def fit_thesis(trials: Trials, seed: int) -> Answer:
    from galileo_jax.inference.thesis_preset import thesis_posterior

    began = time.perf_counter()
    posterior, best = thesis_posterior(trials, seed, "thesis_gaussian", "coin", "best")
    seconds = time.perf_counter() - began
    theta = _middle(trials)
    theta[[trials.names.index(name) for name in MAIN]] = [best[name] for name in MAIN]
    values = {"k1": best["k1"], "k2": best["k2"], "mass_ratio": best["m1"] / best["m2"]}
    estimates = {name: {"mean": value, "identified": True} for name, value in values.items()}
    count = int(np.prod(posterior.draws.shape[:2]) + posterior.draws.shape[0])
    return Answer(estimates, theta, len(MAIN), seconds, count, math.nan, posterior.is_converged)


def fit_sysid(trials: Trials, seed: int) -> Answer:
    from mujoco import minimize

    low, high = np.array([0.05, 0.005, 0.05, 0.005]), np.array([1.5, 0.6, 1.5, 0.6])
    (problem,) = trials.problems
    where = [trials.names.index(name) for name in MAIN]
    rest = _middle(trials)
    observed = problem.observation.velocity_m_s
    rng = np.random.default_rng(seed)
    count = 0

    def residuals(x: np.ndarray) -> np.ndarray:
        """`[4, batch]` to `[value, batch]`, as mujoco.minimize has it."""
        nonlocal count
        x = x.reshape(len(MAIN), -1)
        count += x.shape[1]
        theta = np.tile(rest, (x.shape[1], 1))
        theta[:, where] = x.T
        velocity = np.diff(_centres(problem, theta), axis=-1) * synthetic_tracks.FPS
        return ((velocity - observed) / NOISE_M_S).reshape(x.shape[1], -1).T.copy()

    began = time.perf_counter()
    starts = rng.uniform([0.1, 0.02, 0.1, 0.02], [1.0, 0.35, 1.0, 0.35], (256, 4))
    cost = (residuals(starts.T) ** 2).mean(axis=0)
    refined = []
    for i in np.argsort(cost)[:3]:
        x, log = minimize.least_squares(
            starts[i],
            residuals,
            [low, high],
            eps=1e-3,
            verbose=minimize.Verbosity.FULLITER,
            output=io.StringIO(),
        )
        refined.append((float(np.mean(np.asarray(log[-1].residual) ** 2)), np.ravel(x), log[-1]))
    chi2, x, last = min(refined, key=lambda entry: entry[0])
    m1, k1, m2, k2 = x
    # By log(m1 / m2), k1 and k2 at a given m1 m2: the column of the masses' size is null.
    turn = np.zeros((4, 3))
    turn[0, 0], turn[2, 0], turn[1, 1], turn[3, 2] = m1 / 2, -m2 / 2, 1.0, 1.0
    jacobian, white = last.jacobian @ turn, np.ravel(last.residual)
    variance = white @ white / (white.size - turn.shape[1])
    sd = np.sqrt(variance * np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    half = 1.96 * sd
    seconds = time.perf_counter() - began
    estimates = {
        "k1": _interval(k1, k1 - half[1], k1 + half[1], sd[1]),
        "k2": _interval(k2, k2 - half[2], k2 + half[2], sd[2]),
        "mass_ratio": _interval(
            m1 / m2, m1 / m2 * np.exp(-half[0]), m1 / m2 * np.exp(half[0]), m1 / m2 * sd[0]
        ),
    }
    theta = rest.copy()
    theta[where] = x
    return Answer(estimates, theta, len(MAIN), seconds, count, math.nan, chi2 <= STUCK)


METHODS: dict[str, Callable[[Trials, int], Answer]] = {
    "grad": fit_grad,
    "mh": fit_mh,
    "thesis": fit_thesis,
    "sysid": fit_sysid,
}


def _warm_fit(trials: Trials, seed: int):
    from galileo_jax.inference.fits.gradient import GradientFitter

    fitter = GradientFitter(trials)
    fitter.compile()
    began = time.perf_counter()
    fit = fitter.fit(seed)
    return fit, time.perf_counter() - began


def _laplace(trials: Trials, fit, seed: int):
    from galileo_jax.inference.laplace import laplace_posterior

    return laplace_posterior(trials, fit, seed)


def _of_draws(trials: Trials, fit, posterior, seconds: float, rollouts: float) -> Answer:
    from galileo_jax.inference.convergence import convergence
    from galileo_jax.inference.result import make_result

    result = make_result(
        trials, posterior, fit.z, clips=[], method="", seed=0, timings_s={}, notes={}
    )
    ratio = posterior["m1"] / posterior["m2"]
    ess = math.nan
    if ratio.shape[0] > 1:
        draws = (posterior["k1"], posterior["k2"], ratio)
        ess = min(convergence(values).ess_bulk for values in draws)
    return Answer(
        scoring.of_result(result),
        trials.of_clip(trials.theta(fit.z), 0),
        len(trials.model_parameters),
        seconds,
        rollouts,
        ess,
        posterior.is_converged,
    )


def _middle(trials: Trials) -> np.ndarray:
    """The model's parameters at their priors' middle."""
    return trials.of_clip(trials.theta(np.zeros(len(trials.names))), 0)


def _centres(problem: Problem, theta: np.ndarray) -> np.ndarray:
    """Centres `[batch, object, 2, frame]` of plain rollouts at the frames, no nuisances."""
    position, _ = problem.engine.simulate(theta)
    step = problem.model.record_dt_s
    at = problem.observation.times_s / step
    i = np.minimum(np.floor(at).astype(int), position.shape[-1] - 2)
    share = at - i
    return position[..., i] * (1 - share) + position[..., i + 1] * share


def _velocity_chi2(trials: Trials, answer: Answer) -> float:
    """Squared velocity residuals at the best parameters per degree of freedom."""
    (problem,) = trials.problems
    velocity = np.diff(problem.simulate(answer.best), axis=-1) * synthetic_tracks.FPS
    white = velocity - problem.observation.velocity_m_s
    return float(np.sum((white / NOISE_M_S) ** 2) / (white.size - answer.num_free))


def _interval(mean: float, low: float, high: float, sd: float) -> dict[str, Any]:
    return {"mean": mean, "q025": low, "q975": high, "sd": sd, "identified": True}


def _missed_bars(figures: dict[str, Any]) -> list[str]:
    missed = []
    if figures["stuck"] > BARS["stuck"]:
        missed.append(f"stuck {figures['stuck']:.0%} > {BARS['stuck']:.0%}")
    low, high = BARS["coverage"]
    for name in scoring.QUANTITIES:
        coverage = figures[name]["coverage"]
        if not low <= coverage <= high:
            missed.append(f"{name} coverage {coverage:.0%} outside {low:.0%} to {high:.0%}")
        if figures[name]["missed"]:
            missed.append(f"{name} called undetermined in {figures[name]['missed']}")
    return missed


def _parser() -> command.Parser:
    parser = command.Parser(prog="samplers.py", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--num", type=int, default=20, help="tracks")
    parser.add_argument("--seed", type=int, default=0, help="the first track's seed")
    parser.add_argument("--source", choices=synthetic_tracks.SOURCES, default="exact")
    parser.add_argument("--methods", default="grad,sysid", help=",".join(METHODS))
    parser.add_argument("--engine", default="auto", choices=ENGINES)
    return parser


if __name__ == "__main__":
    raise SystemExit(command.run(main))

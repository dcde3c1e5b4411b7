"""Inference alone, on synthetic tracks with random truths: `python benchmarks/samplers.py`.

Methods on the same tracks, one after the other; the first named on all `--num` tracks, the others
on the first `--num-shared`, because they take longer:

    grad      the multi-start gradient fit with its Laplace posterior
    mh        Metropolis-Hastings, started from the gradient fit (its time included)
    thesis    the thesis's 16 chains x 75 steps on our rollouts; the best sample wins
    sysid     as mujoco.sysid does: 256 random rollouts of MuJoCo's C engine, the best 3 refined
              by its optimiser, m1, k1, m2, k2 free, no nuisances (peers.py)
    bullet    the thesis's sampler on PyBullet's rollouts, if PyBullet is there (peers.py)

Noise: 0.01 m/s on the velocities, that is 0.01 / (fps sqrt 2) m on positions. `--source exact`
makes the tracks in closed form (a model error for all but the rigid engine), `--source engine`
with our own rollouts. Seconds of grad are warm, those of mh and thesis contain tracing and
compiling, which each call does anew. Stuck: velocity residuals of the method's own rollout at
its best parameters above 1.5 per degree of freedom. With `--keep FILE` a run that was cut off
goes on, and methods measured apart stand in one table. The last line is JSON.
"""

import argparse
import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import jax
import numpy as np
import peers
import scoring
import synthetic_tracks
import tables

from galileo_jax.commands import command
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.rollout.engine_names import ENGINES
from galileo_jax.runtime import compilation_cache
from galileo_jax.runtime.errors import InputError

NOISE_M_S = 0.01
STUCK = 1.5
BARS = {"stuck": 0.02, "coverage": (0.90, 0.99)}
COLUMNS = (
    *("k1 err", "in 95%", "k2 err", "in 95%", "ratio err", "in 95%"),
    *("chi2/dof", "rollouts", "seconds", "ess", "converged"),
)
SUMMARY = ("tracks", "stuck", "s median", "s worst", "rollouts", "ess/s", "unconverged")


@dataclass(frozen=True)
class Answer:
    """What one method says about one track.

    Attributes:
      estimates: k1, k2 and mass_ratio as `scoring.score` takes them.
      chi2_per_dof: of the velocities, at the best parameters.
      seconds: of inference alone.
      num_rollouts: it took.
      ess: smallest effective sample size of k1, k2 and the mass ratio; NaN: no draws.
      is_converged: by its own account.
    """

    estimates: dict[str, Any]
    chi2_per_dof: float
    seconds: float
    num_rollouts: float
    ess: float
    is_converged: bool


def main(argv: Sequence[str]) -> int | None:
    call = _parser().parse_args(argv)
    jax.config.update("jax_enable_x64", True)
    compilation_cache.enable()
    methods = call.methods.split(",")
    if unknown := set(methods) - set(METHODS):
        raise InputError(f"--methods: unknown {sorted(unknown)}; known: {', '.join(METHODS)}")
    kept = _read(call.keep)
    noise_m = NOISE_M_S / (synthetic_tracks.FPS * math.sqrt(2))
    tables.row("track, method", COLUMNS)
    answers: dict[str, list[Answer]] = {name: [] for name in methods}
    scores: dict[str, list[dict[str, scoring.Score]]] = {name: [] for name in methods}
    for seed in range(call.seed, call.seed + call.num):
        is_shared = seed < call.seed + call.num_shared
        case = synthetic_tracks.make_case(seed, call.source, noise_m, call.engine)
        for name in methods if is_shared else methods[:1]:
            key = f"{call.source} {call.engine} {seed} {name}"
            if key not in kept:
                kept[key] = METHODS[name](case, seed)
                _append(call.keep, key, kept[key])
            answer = kept[key]
            answers[name].append(answer)
            scores[name].append(scoring.score(answer.estimates, case.values, True, True))
            cells: list[Any] = []
            for entry in scores[name][-1].values():
                cells += [entry.error, entry.is_covered]
            told = [answer.chi2_per_dof, int(answer.num_rollouts), answer.seconds, answer.ess]
            tables.row(f"{seed} {name}", [*cells, *told, answer.is_converged])
    figures: dict[str, Any] = {}
    missed: list[str] = []
    print()
    tables.row("method", SUMMARY)
    for name in methods:
        figures[name] = _figures(answers[name], scores[name])
        tables.row(name, list(figures[name].values())[: len(SUMMARY)])
        if name in ("grad", "mh"):
            missed += [f"{name}: {what}" for what in _missed_bars(figures[name])]
    if {"grad", "sysid"} <= set(methods):
        count = len(answers["sysid"])
        ours, theirs = (
            float(np.median([answer.seconds for answer in answers[name][:count]]))
            for name in ("grad", "sysid")
        )
        if ours > theirs:
            missed.append(f"grad takes {ours:.2g} s, sysid {theirs:.2g} s")
    print()
    tables.row("method, quantity", list(figures[methods[0]]["k1"]))
    for name in methods:
        for quantity in scoring.QUANTITIES:
            tables.row(f"{name} {quantity}", list(figures[name][quantity].values()))
    print("bars missed: " + ("; ".join(missed) or "none"))
    figures |= {"source": call.source, "engine": call.engine, "bars_missed": missed}
    tables.finish("samplers", figures)
    return None


def fit_grad(case: synthetic_tracks.Case, seed: int) -> Answer:
    from galileo_jax.inference.fit_posterior import fit_posterior

    fit, began = _warm_fit(case.trials, seed)
    posterior = fit_posterior(case.trials, fit, seed)
    seconds = time.perf_counter() - began
    return _of_draws(case.trials, fit, posterior, seconds, posterior.stats["num_rollouts"])


def fit_mh(case: synthetic_tracks.Case, seed: int) -> Answer:
    from galileo_jax.inference.metropolis import metropolis_posterior

    fit, began = _warm_fit(case.trials, seed)
    posterior = metropolis_posterior(case.trials, fit, seed)
    seconds = time.perf_counter() - began
    rollouts = fit.stats["num_rollouts"] + posterior.stats["num_evaluations"]
    return _of_draws(case.trials, fit, posterior, seconds, rollouts)


def fit_thesis(case: synthetic_tracks.Case, seed: int) -> Answer:
    from galileo_jax.thesis.estimate import thesis_posterior

    trials = case.trials
    began = time.perf_counter()
    posterior, best = thesis_posterior(trials, seed, "thesis_gaussian", "coin", "best")
    seconds = time.perf_counter() - began
    theta = trials.of_clip(trials.theta(np.zeros(len(trials.names))), 0)
    for name, value in best.items():
        theta[trials.names.index(name)] = value
    chi2 = _velocity_chi2(trials, case.problem.simulate(theta), len(best))
    estimates = peers.point(np.array([best[name] for name in peers.MAIN]))
    count = posterior.stats["num_evaluations"]
    return Answer(estimates, chi2, seconds, count, math.nan, posterior.is_converged)


def fit_sysid(case: synthetic_tracks.Case, seed: int) -> Answer:
    began = time.perf_counter()
    found = peers.sysid(case.problem, NOISE_M_S, seed)
    return _of_peer(case.trials, found, time.perf_counter() - began)


def fit_bullet(case: synthetic_tracks.Case, seed: int) -> Answer:
    began = time.perf_counter()
    found = peers.thesis_on_bullet(case.problem, case.truth, seed)
    return _of_peer(case.trials, found, time.perf_counter() - began)


METHODS: dict[str, Callable[[synthetic_tracks.Case, int], Answer]] = {
    "grad": fit_grad,
    "mh": fit_mh,
    "thesis": fit_thesis,
    "sysid": fit_sysid,
    "bullet": fit_bullet,
}


def _warm_fit(trials: JointProblem, seed: int):
    """The gradient fit, and when it began, compiled."""
    from galileo_jax.inference.fits.gradient import GradientFitter

    fitter = GradientFitter(trials)
    fitter.compile()
    began = time.perf_counter()
    return fitter.fit(seed), began


def _of_draws(trials: JointProblem, fit, posterior, seconds: float, rollouts: float) -> Answer:
    from galileo_jax.inference.convergence import convergence
    from galileo_jax.inference.result import make_result

    result = make_result(
        trials, posterior, fit.z, clips=[], method="", seed=0, timings_s={}, notes={}
    )
    estimates = scoring.of_result(result)
    ratio = posterior["m1"] / posterior["m2"]
    ess = math.nan
    if ratio.shape[0] > 1:
        draws = (posterior["k1"], posterior["k2"], ratio)
        ess = min(convergence(values).ess_bulk for values in draws)
    predicted = trials.problems[0].simulate(trials.of_clip(trials.theta(fit.z), 0))
    return Answer(
        {name: dict(estimates[name]) for name in scoring.QUANTITIES},
        _velocity_chi2(trials, predicted, len(trials.model_parameters)),
        seconds,
        rollouts,
        ess,
        posterior.is_converged,
    )


def _of_peer(trials: JointProblem, found: peers.Estimate, seconds: float) -> Answer:
    chi2 = _velocity_chi2(trials, found.centres_m, len(found.values))
    count = found.num_rollouts
    return Answer(found.entries, chi2, seconds, count, math.nan, found.is_converged)


def _velocity_chi2(trials: JointProblem, predicted_m: np.ndarray, num_free: int) -> float:
    """Squared velocity residuals of predicted centres per degree of freedom."""
    velocity = np.diff(predicted_m, axis=-1) * synthetic_tracks.FPS
    white = (velocity - trials.problems[0].observation.velocity_m_s) / NOISE_M_S
    return float(np.sum(white**2) / (white.size - num_free))


def _figures(
    answers: Sequence[Answer], scores: Sequence[dict[str, scoring.Score]]
) -> dict[str, Any]:
    seconds = np.array([answer.seconds for answer in answers])
    ess = np.array([answer.ess for answer in answers])
    return {
        "tracks": len(answers),
        "stuck": float(np.mean([answer.chi2_per_dof > STUCK for answer in answers])),
        "seconds_median": float(np.median(seconds)),
        "seconds_worst": float(seconds.max()),
        "rollouts_median": float(np.median([answer.num_rollouts for answer in answers])),
        "ess_per_s_median": float(np.median(ess / seconds)),
        "unconverged": sum(not answer.is_converged for answer in answers),
        **scoring.summary(scores),
    }


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


def _read(path: Path | None) -> dict[str, Answer]:
    """The answers that an earlier run kept, by source, engine, track and method."""
    if path is None or not path.is_file():
        return {}
    lines = (json.loads(line) for line in path.read_text(encoding="utf-8").splitlines())
    return {line.pop("key"): Answer(**line) for line in lines}


def _append(path: Path | None, key: str, answer: Answer) -> None:
    if path is None:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps({"key": key, **asdict(answer)}) + "\n")


def _parser() -> command.Parser:
    parser = command.Parser(prog="samplers.py", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--num", type=int, default=100, help="tracks")
    parser.add_argument("--num-shared", type=int, default=10, help="of these, for all methods")
    parser.add_argument("--seed", type=int, default=0, help="the first track's seed")
    parser.add_argument("--source", choices=synthetic_tracks.SOURCES, default="exact")
    parser.add_argument("--methods", default="grad,sysid", help=",".join(METHODS))
    parser.add_argument("--engine", default="auto", choices=ENGINES)
    parser.add_argument("--keep", type=Path, metavar="FILE", help="answers, to go on from")
    return parser


if __name__ == "__main__":
    raise SystemExit(command.run(main))

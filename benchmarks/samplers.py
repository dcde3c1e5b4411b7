"""How do samplers, and other people's estimators, compare on the same synthetic tracks?

    python -m benchmarks samplers --methods grad mh thesis --source prior --num 20 --num-shared 20

    grad      the multi-start gradient fit with its weighed Laplace posterior
    mh        Metropolis-Hastings from that fit (its time included)
    mh-cnn    the same, started from the network
    cnn       the network
    thesis    the thesis's 16 chains x 75 steps on our rollouts; the best sample wins
    sysid     as mujoco.sysid does: 256 random rollouts of MuJoCo's C engine, the best 3 refined
              by its optimiser, m1, k1, m2, k2 free, no nuisances (peers.py)

The first method named runs on all `--num` tracks, the others on the first `--num-shared`. Noise:
0.01 m/s on the velocities, that is 0.01 / (fps sqrt 2) m on positions. Tracks of `--source exact`
are made in closed form (a model error for all but the rigid engine), of `engine` by our rollouts,
of `prior` with all parameters, nuisances and the noise scale drawn from their priors (kept where
object 2 is driven by a centimetre or more). Of the last, with `--noise tracker`, nothing else is
wrong, so that ranks of the truth among the draws must be uniform: simulation-based calibration
(Talts et al. 2018, arXiv 1804.06788); KS p tells.

Seconds are warm, for which the first track is run twice; those of `thesis` contain tracing. Stuck:
velocity residuals of the method's own rollout at its best parameters above 1.5 per degree of
freedom (of `prior` that is the drawn noise). `off`: distance of means from those of `mh`, in sds,
root mean square. With `--keep FILE` a run that was cut off goes on, and methods measured apart
stand in one table.
"""

import itertools
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy import stats

from benchmarks import peers, scoring, tables, tracks
from benchmarks.journal import Journal
from benchmarks.tracks import Case
from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.clip.schema import ClipObject
from galileo_jax.inference.convergence import convergence
from galileo_jax.inference.fit_posterior import fit_posterior
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.metropolis import NUM_CHAINS, metropolis_posterior
from galileo_jax.inference.posterior import Posterior
from galileo_jax.inference.result import make_result
from galileo_jax.neural.estimate import cnn_posterior
from galileo_jax.neural.start import start_from_network
from galileo_jax.runtime.precision import in_float64
from galileo_jax.search.fit import best_fit
from galileo_jax.similarity.gaussian_likelihood import NoiseModel
from galileo_jax.simulation.truth import Truth
from galileo_jax.thesis.sampler import thesis_posterior

NOISE_M_S = 0.01
NOISE_M = NOISE_M_S / (tracks.FPS * math.sqrt(2))
STUCK = 1.5
BARS = {name: {"coverage": (0.90, 0.99)} for name in scoring.QUANTITIES}
BARS["all"] = {"stuck": (0.0, 0.02)}
Source = Literal["exact", "engine", "prior"]
Method = Literal["grad", "mh", "mh-cnn", "cnn", "thesis", "sysid"]
SIZE_M, RELEASE_M, OBJECT2_M, DRIVEN_M = (0.06, 0.06, 0.06), 0.5, 0.25, 0.01
COLUMNS = (
    *("k1 err", "in 95%", "k2 err", "in 95%", "ratio err", "in 95%"),
    *("chi2/dof", "rollouts", "seconds", "ess", "converged"),
)


class Answer(NamedTuple):
    """What one method says about one track."""

    estimates: Mapping[str, Any]  # k1, k2 and mass_ratio as `scoring.score` takes them
    # centres `[object, 2, frame]` of its own rollout at its best parameters
    predicted_m: np.ndarray
    num_free: int  # parameters
    num_rollouts: float  # it took
    is_converged: bool  # by its own account
    # k1, k2 and the log mass ratio `[quantity, chain, draw]`, if it draws from a posterior
    draws: np.ndarray | None = None


@in_float64
def main(
    *,
    methods: tuple[Method, ...] = ("grad", "sysid"),
    num: int = 100,
    num_shared: int = 10,
    seed: int = 0,
    source: Source = "exact",
    noise: NoiseModel = "tracker",
    keep: Path | None = None,
) -> dict[str, Any]:
    journal, warm = Journal(keep), set[str]()
    rows: dict[str, list[dict[str, Any]]] = {name: [] for name in methods}
    tables.row("track, method", COLUMNS)
    for number, case in enumerate(_cases(source, seed, num, noise)):
        for name in methods if number < num_shared else methods[:1]:

            def answered(name: str = name, case: Case = case, own: int = seed + number):
                if name not in warm:
                    METHODS[name](case, own)
                    warm.add(name)
                began = time.perf_counter()
                answer = METHODS[name](case, own)
                return _row(case, answer, time.perf_counter() - began)

            rows[name].append(
                row := journal.row(f"{source} {noise} {seed} {number} {name}", answered)
            )
            cells = [row[q][what] for q in scoring.QUANTITIES for what in ("error", "is_covered")]
            cells += [row[what] for what in ("chi2", "rollouts", "seconds", "ess", "converged")]
            tables.row(f"{seed + number} {name}", cells)
    print()
    figures = {name: _summary(rows[name], rows.get("mh", ())) for name in methods}
    costs = {n: {k: v for k, v in one.items() if k not in BARS} for n, one in figures.items()}
    tables.by_name("method", costs)
    print()
    pairs = itertools.product(methods, scoring.QUANTITIES)
    tables.by_name("method, quantity", {f"{m} {q}": figures[m][q] for m, q in pairs})
    missed = []
    for name in set(methods) & {"grad", "mh"}:
        table = {quantity: figures[name][quantity] for quantity in scoring.QUANTITIES}
        table |= {"all": figures[name]} if source != "prior" else {}
        missed += [f"{name}: {what}" for what in scoring.missed(table, BARS)]
    return figures | {"source": source, "bars_missed": tables.missed(missed)}


def _cases(source: Source, seed: int, num: int, noise: NoiseModel) -> Iterator[Case]:
    if source == "prior":
        yield from drawn_from_the_prior(seed, num, noise)
    else:
        for own in range(seed, seed + num):
            yield tracks.make_case(own, source, NOISE_M)


def drawn_from_the_prior(seed: int, count: int, noise: NoiseModel) -> list[Case]:
    """Truths from the priors, observed as the model says."""
    objects = tuple(ClipObject(name=f"object{i}", shape="box", size_m=SIZE_M) for i in (1, 2))
    angle = tracks.RAMP_ANGLE_DEG
    setting = Truth((0.4, 0.4), (0.1, 0.1), angle, objects, RELEASE_M, (OBJECT2_M,))
    start = np.array(setting.surroundings.start_m)[..., None]
    seen = tracks.observed(np.tile(start, tracks.NUM_FRAMES), tracks.FPS, NOISE_M)
    clip = tracks.declared(objects, angle, tracks.FPS, tracks.NUM_FRAMES)
    trials = make_joint_problem([clip], [seen], noise=noise)
    (problem,), names = trials.problems, trials.names
    generator = np.random.default_rng([seed, 9])
    cases: list[Case] = []
    while len(cases) < count:
        theta = trials.theta(generator.standard_normal((64, len(names))))
        predicted = problem.simulate_batch(theta[:, :-1])
        driven = np.ptp(predicted[:, 1, 0], axis=-1) > DRIVEN_M
        for row, clean in zip(theta[driven], predicted[driven], strict=True):
            noisy = clean + row[-1] * NOISE_M * generator.standard_normal(clean.shape)
            own = replace(problem, observation=tracks.observed(noisy, tracks.FPS, NOISE_M))
            m1, k1, m2, k2 = (float(row[names.index(name)]) for name in peers.MAIN)
            truth = replace(setting, mass_kg=(m1, m2), friction=(k1, k2))
            cases.append(Case(truth, JointProblem((own,))))
    return cases[:count]


def fit_grad(case: Case, seed: int) -> Answer:
    fit = best_fit(GradientFitter(case.trials), seed)
    posterior = fit_posterior(case.trials, fit, seed)
    return _of_draws(case.trials, posterior, fit.z, posterior.stats["num_rollouts"])


def fit_mh(case: Case, seed: int) -> Answer:
    return _chains(case.trials, best_fit(GradientFitter(case.trials), seed), None, seed)


def fit_mh_cnn(case: Case, seed: int) -> Answer:
    start = start_from_network(case.trials, seed, NUM_CHAINS)
    return _chains(case.trials, start.fit, start.z, seed)


def fit_cnn(case: Case, seed: int) -> Answer:
    posterior, z, _ = cnn_posterior(case.trials, seed)
    return _of_draws(case.trials, posterior, z, 0)


def fit_thesis(case: Case, seed: int) -> Answer:
    trials = case.trials
    posterior, best = thesis_posterior(trials, seed, "thesis_gaussian", "coin", "best")
    theta = trials.of_clip(trials.theta(np.zeros(len(trials.names))), 0)
    for name, value in best.items():
        theta[trials.names.index(name)] = value
    estimates = peers.point(np.array([best[name] for name in peers.MAIN]))
    count, predicted = posterior.stats["num_evaluations"], case.problem.simulate(theta)
    return Answer(estimates, predicted, len(best), count, posterior.is_converged)


def fit_sysid(case: Case, seed: int) -> Answer:
    found = peers.sysid(case.problem, NOISE_M_S, seed)
    count = found.num_rollouts
    return Answer(found.entries, found.centres_m, len(found.values), count, found.is_converged)


METHODS: dict[str, Callable[[Case, int], Answer]] = {
    "grad": fit_grad,
    "mh": fit_mh,
    "mh-cnn": fit_mh_cnn,
    "cnn": fit_cnn,
    "thesis": fit_thesis,
    "sysid": fit_sysid,
}


def _chains(trials: JointProblem, fit: GradientFit, starts: np.ndarray | None, seed: int) -> Answer:
    posterior = metropolis_posterior(trials, fit, seed, starts=starts)
    rollouts = fit.stats["num_rollouts"] + posterior.stats["num_evaluations"]
    return _of_draws(trials, posterior, fit.z, rollouts)


def _of_draws(trials: JointProblem, posterior: Posterior, z: np.ndarray, rollouts: float) -> Answer:
    result = make_result(trials, posterior, z, clips=[], method="", seed=0, timings_s={}, notes={})
    log_ratio = np.log(posterior["m1"] / posterior["m2"])
    return Answer(
        scoring.of_result(result),
        trials.problems[0].simulate(trials.of_clip(trials.theta(np.asarray(z)), 0)),
        len(trials.model_parameters),
        rollouts,
        posterior.is_converged,
        np.stack([posterior["k1"], posterior["k2"], log_ratio]),
    )


def _row(case: Case, answer: Answer, seconds: float) -> dict[str, Any]:
    """What is kept of an answer."""
    scores = scoring.score(answer.estimates, case.values, True, True)
    row: dict[str, Any] = {name: one._asdict() for name, one in scores.items()}
    velocity = np.diff(answer.predicted_m, axis=-1) * tracks.FPS
    white = (velocity - case.problem.observation.velocity_m_s) / NOISE_M_S
    row["chi2"] = float(np.sum(white**2) / (white.size - answer.num_free))
    row |= {"rollouts": float(answer.num_rollouts), "seconds": seconds, "ess": math.nan}
    row["converged"] = bool(answer.is_converged)
    if answer.draws is not None:
        values = case.values
        true = [values["k1"], values["k2"], math.log(values["m1"] / values["m2"])]
        flat = answer.draws.reshape(len(true), -1)
        row["rank"] = [float(np.mean(one < t)) for one, t in zip(flat, true, strict=True)]
        row["mean"], row["sd"] = flat.mean(1).tolist(), flat.std(1).tolist()
        is_independent = answer.draws.shape[1] == 1
        row["ess"] = (
            float(flat.shape[1])
            if is_independent
            else float(np.nanmin([convergence(values).ess_bulk for values in answer.draws]))
        )
    return row


def _summary(
    rows: Sequence[Mapping[str, Any]], reference: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """Costs, errors, coverage and calibration of one method over all tracks."""
    seconds, ess, off = (np.array([row[key] for row in rows]) for key in ("seconds", "ess", "chi2"))
    stuck = float(np.mean(off > STUCK))
    drawn = [pair for pair in zip(rows, reference, strict=False) if "mean" in pair[0]]
    apart = [(np.subtract(a["mean"], b["mean"]) / b["sd"]) ** 2 for a, b in drawn]
    figures: dict[str, Any] = {
        "tracks": len(rows),
        "stuck": stuck,
        "seconds": float(np.median(seconds)),
        "worst s": float(seconds.max()),
        "rollouts": float(np.median([row["rollouts"] for row in rows])),
        "ess": float(np.median(ess)),
        "ess/s": float(np.median(ess / seconds)),
        "converged": float(np.mean([row["converged"] for row in rows])),
        "off": float(np.sqrt(np.mean(apart))) if apart else math.nan,
    }
    scores = [{q: scoring.Score(**row[q]) for q in scoring.QUANTITIES} for row in rows]
    for i, (name, entry) in enumerate(scoring.summary(scores).items()):
        ranks = [row["rank"][i] for row in rows if "rank" in row]
        entry["KS p"] = float(stats.kstest(ranks, "uniform").pvalue) if ranks else math.nan
        figures[name] = entry
    return figures

"""All methods that give a posterior, on the same tracks: `python benchmarks/posteriors.py`.

    grad        the multi-start gradient fit with its Laplace posterior
    mh          Metropolis-Hastings from that fit, covariance learned (sampler `mixture`)
    mh-long     the same for 5000 steps of every chain, converged or not
    mh-walk     `mh` with sampler `random_walk`
    mh-fixed    a random walk of the thesis's width in z, nothing learned, for as many steps
    mh-cnn      `mh`, started from the network (`--init cnn`)
    smc         adaptive tempered sequential Monte Carlo, from the prior (inference/tempering.py)
    cnn         the network
    thesis      the thesis's preset: a search, no posterior; its chain states taken as draws
    thesis-long the same for about as many rollouts as `mh`
    thesis-true as many, of the thesis's 16 chains and proposals, but with `mh`'s likelihood and the
                true acceptance: what the thesis's sampler is worth as one; nuisances known

Tracks are drawn from the model itself: all parameters, nuisances and the noise scale included,
from their priors (kept where object 2 is driven by a centimetre or more, which the data show),
positions with the stated noise of 0.01 m/s on velocities. Nothing else is wrong with them, and
with `--noise tracker` the likelihood allows for no more than a shift of a whole track. So ranks
of the truth among the draws must be uniform: simulation-based calibration (Talts et al. 2018,
arXiv 1804.06788).

Seconds are warm: one scene, compiled once, the first track run twice. `off`: distance between a
method's mean and that of `mh`, in posterior standard deviations, root mean square over tracks: 0
but for Monte-Carlo error where both sample the same; 1 / off^2 is what the draws are worth where
chains have not converged and R-hat and ESS say little. The last line is JSON.
"""

import argparse
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import tables
from scipy import stats
from tempering import temper

from galileo_jax.clip.schema import Clip, ClipObject
from galileo_jax.commands import command
from galileo_jax.inference.build_problem import make_joint_problem
from galileo_jax.inference.convergence import convergence
from galileo_jax.inference.density import density_of, likelihood_of
from galileo_jax.inference.fit_posterior import fit_posterior
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.metropolis import NUM_CHAINS, metropolis_posterior
from galileo_jax.inference.samplers import dispersed_starts, sample
from galileo_jax.inference.samplers.driver import Settings
from galileo_jax.inference.samplers.library.random_walk import RandomWalk
from galileo_jax.neural.estimate import cnn_posterior
from galileo_jax.neural.start import start_from_network
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime import compilation_cache
from galileo_jax.runtime.errors import InputError
from galileo_jax.similarity.gaussian_likelihood import GaussianLikelihood, Whitening
from galileo_jax.simulation.truth import Truth
from galileo_jax.thesis.sampler import NARROW, NUM_STEPS, Acceptance, infer
from galileo_jax.thesis.similarity import AbstractSimilarity, similarity_class

FPS, NUM_FRAMES, RAMP_ANGLE_DEG = 30.0, 61, 20.0
NOISE_M = 0.01 / (FPS * math.sqrt(2))
SIZE_M, RELEASE_M, OBJECT2_M = (0.06, 0.06, 0.06), 0.5, 0.25
DRIVEN_M = 0.01
QUANTITIES = ("k1", "k2", "log ratio")
MAIN = ("m1", "k1", "m2", "k2")
CLAIMS_POSTERIOR = ("grad", "mh", "mh-long", "mh-walk", "mh-cnn", "smc", "cnn")
LONG = 550  # steps of 16 chains: as many rollouts as `mh` takes
LONG_STEPS = 5000
LEAST_GAIN = 20.0  # the bar: ESS per second over the thesis's


@dataclass(frozen=True)
class Track:
    """One truth and its observation.

    Attributes:
      trials: the observation with the base model.
      truth: of `QUANTITIES`.
      theta: `[parameter]`, of everything.
    """

    trials: JointProblem
    truth: np.ndarray
    theta: np.ndarray


@dataclass(frozen=True)
class Answer:
    """Draws of `QUANTITIES` `[quantity, chain, draw]` and what they cost."""

    draws: np.ndarray
    seconds: float
    num_rollouts: float
    is_converged: bool

    @cached_property
    def ess(self) -> float:
        """The least of all quantities; independent draws count as they are."""
        if self.draws.shape[1] == 1:
            return float(self.draws.shape[2])
        return float(np.nanmin([convergence(values).ess_bulk for values in self.draws]))


class ThesisSimilarity(eqx.Module):
    """The thesis's similarity of (m1, k1, m2, k2), all else at its prior's middle."""

    observed_m_s: jax.Array
    rest: jax.Array
    trials: "Same" = eqx.field(static=True)
    measure: AbstractSimilarity

    def __call__(self, main: jax.Array) -> jax.Array:
        """Higher is more alike."""
        trials = self.trials.trials
        (problem,) = trials.problems
        where = np.array([trials.names.index(name) for name in MAIN])
        velocity = FPS * jnp.diff(problem.predict(self.rest.at[where].set(main)), axis=-1)
        return self.measure(velocity, self.observed_m_s, jnp.ones(velocity.shape[::2], bool))


class MainLikelihood(eqx.Module):
    """The log-likelihood of (m1, k1, m2, k2), all else known."""

    data: Whitening
    rest: jax.Array
    trials: "Same" = eqx.field(static=True)

    def __call__(self, main: jax.Array) -> jax.Array:
        """Of `mh`, without its nuisances."""
        trials = self.trials.trials
        (problem,) = trials.problems
        where = np.array([trials.names.index(name) for name in MAIN])
        theta = self.rest.at[where].set(main)
        predicted = problem.predict(theta[:-1])
        return GaussianLikelihood.log_density(predicted, theta[-1], self.data)


@dataclass(frozen=True, eq=False)
class Same:
    """The trials that compiled code is made of: compared by identity."""

    trials: JointProblem


def main(argv: Sequence[str]) -> int | None:
    call = _parser().parse_args(argv)
    jax.config.update("jax_enable_x64", True)
    compilation_cache.enable()
    methods = call.methods.split(",")
    if unknown := set(methods) - set(METHODS):
        raise InputError(f"--methods: unknown {sorted(unknown)}; known: {', '.join(METHODS)}")
    tracks = make_tracks(call.seed, call.num, call.noise)
    same = Same(tracks[0].trials)
    truth = np.array([track.truth for track in tracks])
    answers: dict[str, list[Answer]] = {}
    figures: dict[str, dict[str, Any]] = {}
    columns = ("seconds", "rollouts", "ess", "ess/s", "converged", "off")
    tables.row(f"{len(tracks)} tracks", columns)
    for name in methods:
        METHODS[name](tracks[0], same, call.seed)
        answers[name] = [METHODS[name](t, same, call.seed + i) for i, t in enumerate(tracks)]
        figures[name] = summary(answers[name], truth, answers.get("mh"))
        tables.row(name, [figures[name][column] for column in columns])
    print()
    tables.row("method, quantity", ("median err", "in 90%", "in 95%", "KS p"))
    for name in methods:
        for quantity in QUANTITIES:
            entry = figures[name][quantity]
            is_claimed = name in CLAIMS_POSTERIOR
            shown = [entry["in_90"], entry["in_95"], entry["ks_p"]] if is_claimed else [None] * 3
            tables.row(f"{name}, {quantity}", [entry["median"], *shown])
    missed = []
    for theirs in ("thesis", "thesis-long", "thesis-true"):
        for name in [n for n in methods if n in ("mh", "mh-long", "mh-cnn") and theirs in methods]:
            gain = figures[name]["ess/s"] / figures[theirs]["ess/s"]
            figures[name][f"gain over {theirs}"] = gain
            print(f"{name}: {gain:.1f} times the ESS/s of {theirs}")
            if gain < LEAST_GAIN:
                missed.append(f"{name}: {gain:.1f} < {LEAST_GAIN:.0f} times the ESS/s of {theirs}")
    print("bars missed: " + ("; ".join(missed) or "none"))
    options = {"num": call.num, "noise": call.noise, "bars_missed": missed}
    tables.finish("posteriors", figures | options)
    return None


def make_tracks(seed: int, count: int, noise: str) -> list[Track]:
    """Truths from the priors, observed as the model says."""
    times = np.arange(NUM_FRAMES) / FPS
    objects = tuple(ClipObject(name=f"object{i}", shape="box", size_m=SIZE_M) for i in (1, 2))
    setting = Truth((0.4, 0.4), (0.1, 0.1), RAMP_ANGLE_DEG, objects, RELEASE_M, OBJECT2_M)
    start = np.array(setting.surroundings.start_m)[..., None]
    clip = Clip(
        path=Path("made.yaml"), track=Path("made.csv"), scenario="ramp", fps=FPS,
        ramp_angle_deg=RAMP_ANGLE_DEG, objects=objects, frame_count=NUM_FRAMES,
    )  # fmt: skip

    def seen(position_m: np.ndarray) -> Observation:
        shape = (2, 2, 2, NUM_FRAMES)
        return Observation(
            names=("object1", "object2"),
            times_s=times,
            position_m=position_m,
            covariance_m2=np.broadcast_to(NOISE_M**2 * np.eye(2)[None, ..., None], shape).copy(),
            mask=np.ones((2, NUM_FRAMES), bool),
        )

    (problem,) = make_joint_problem(
        [clip],
        [seen(np.tile(start, NUM_FRAMES))],
        noise=noise,  # pyright: ignore
    ).problems
    trials = JointProblem((problem,))
    generator = np.random.default_rng([seed, 9])
    tracks: list[Track] = []
    while len(tracks) < count:
        z = generator.standard_normal((64, len(trials.names)))
        theta = trials.theta(z)
        predicted = problem.simulate_batch(theta[:, :-1])
        driven = np.ptp(predicted[:, 1, 0], axis=-1) > DRIVEN_M
        for row, clean in zip(theta[driven], predicted[driven], strict=True):
            error = row[-1] * NOISE_M * generator.standard_normal(clean.shape)
            own = JointProblem((replace(problem, observation=seen(clean + error)),))
            tracks.append(Track(own, quantities(trials, row), row))
    return tracks[:count]


def quantities(trials: JointProblem, theta: np.ndarray) -> np.ndarray:
    """k1, k2 and log m1/m2 of `[..., parameter]`, the quantity in front."""
    m1, k1, m2, k2 = (theta[..., trials.names.index(name)] for name in MAIN)
    return np.stack([k1, k2, np.log(m1 / m2)])


def summary(
    answers: Sequence[Answer], truth: np.ndarray, reference: Sequence[Answer] | None
) -> dict[str, Any]:
    """Costs, errors, coverage and calibration of one method over all tracks."""
    seconds = np.array([answer.seconds for answer in answers])
    ess = np.array([answer.ess for answer in answers])
    flat = [answer.draws.reshape(len(QUANTITIES), -1) for answer in answers]
    off = math.nan
    if reference is not None:
        near = [answer.draws.reshape(len(QUANTITIES), -1) for answer in reference]
        pairs = zip(flat, near, strict=True)
        off = np.sqrt(np.mean([((a.mean(1) - b.mean(1)) / b.std(1)) ** 2 for a, b in pairs]))
    found: dict[str, Any] = {
        "seconds": float(np.median(seconds)),
        "rollouts": float(np.median([answer.num_rollouts for answer in answers])),
        "ess": float(np.median(ess)),
        "ess/s": float(np.median(ess / seconds)),
        "converged": float(np.mean([answer.is_converged for answer in answers])),
        "off": float(off),
    }
    for i, name in enumerate(QUANTITIES):
        rank = np.array([np.mean(d[i] < t[i]) for d, t in zip(flat, truth, strict=True)])
        error = np.array([d[i].mean() - t[i] for d, t in zip(flat, truth, strict=True)])
        found[name] = {
            "median": float(np.median(np.abs(error))),
            "in_90": float(np.mean((rank > 0.05) & (rank < 0.95))),
            "in_95": float(np.mean((rank > 0.025) & (rank < 0.975))),
            "ks_p": float(stats.kstest(rank, "uniform").pvalue),
        }
    return found


def fit_grad(track: Track, same: Same, seed: int) -> Answer:
    fit, seconds = _fit(track, seed)
    began = time.perf_counter()
    posterior = fit_posterior(track.trials, fit, seed)
    seconds += time.perf_counter() - began
    draws = quantities(track.trials, posterior.draws)
    return Answer(draws, seconds, posterior.stats["num_rollouts"], posterior.is_converged)


def fit_mh(
    track: Track,
    same: Same,
    seed: int,
    sampler: str = "mixture",
    settings: Settings = Settings(),  # noqa: B008
) -> Answer:
    fit, seconds = _fit(track, seed)
    return _sampled(track, seed, fit, None, sampler, settings, seconds)


def fit_mh_walk(track: Track, same: Same, seed: int) -> Answer:
    return fit_mh(track, same, seed, "random_walk")


def fit_mh_long(track: Track, same: Same, seed: int) -> Answer:
    settings = Settings(max_steps=LONG_STEPS, stops_early=False)
    return fit_mh(track, same, seed, settings=settings)


def fit_mh_fixed(track: Track, same: Same, seed: int) -> Answer:
    fit, seconds = _fit(track, seed)
    trials = track.trials
    mode, covariance = jnp.asarray(fit.z), jnp.asarray(fit.covariance)
    key = jax.random.key(seed)
    began = time.perf_counter()
    posterior = sample(
        jax.random.fold_in(key, 1),
        RandomWalk(cholesky=jnp.eye(len(mode)), log_scale=jnp.log(jnp.asarray(NARROW))),
        density_of(trials),
        dispersed_starts(key, mode, covariance, NUM_CHAINS),
        trials.names,
        settings=Settings(warmup_steps=0, max_steps=1000, stops_early=False),
    )
    seconds += time.perf_counter() - began
    theta = trials.theta(posterior.draws)
    rollouts = fit.stats["num_rollouts"] + posterior.stats["num_evaluations"]
    return Answer(quantities(trials, theta), seconds, rollouts, posterior.is_converged)


def fit_mh_cnn(track: Track, same: Same, seed: int) -> Answer:
    began = time.perf_counter()
    start = start_from_network(track.trials, seed, NUM_CHAINS)
    seconds = time.perf_counter() - began
    return _sampled(track, seed, start.fit, start.z, "mixture", Settings(), seconds)


def fit_smc(track: Track, same: Same, seed: int) -> Answer:
    trials = track.trials
    began = time.perf_counter()
    population = temper(jax.random.key(seed), likelihood_of(trials), len(trials.names))
    seconds = time.perf_counter() - began
    draws = quantities(trials, trials.theta(population.z)[None])
    return Answer(draws, seconds, population.num_evaluations, True)


def fit_cnn(track: Track, same: Same, seed: int) -> Answer:
    began = time.perf_counter()
    posterior, _, _ = cnn_posterior(track.trials, seed)
    seconds = time.perf_counter() - began
    return Answer(quantities(track.trials, posterior.draws), seconds, 0, posterior.is_converged)


def fit_thesis(track: Track, same: Same, seed: int, num_steps: int = NUM_STEPS) -> Answer:
    (problem,) = track.trials.problems
    observed = jnp.asarray(problem.observation.velocity_m_s)
    rest = jnp.asarray(track.trials.theta(np.zeros(len(track.trials.names)))[:-1])
    similarity = ThesisSimilarity(observed, rest, same, similarity_class("thesis_gaussian")())
    return _of_thesis(similarity, seed, num_steps=num_steps)


def fit_thesis_long(track: Track, same: Same, seed: int) -> Answer:
    return fit_thesis(track, same, seed, LONG)


def fit_thesis_true(track: Track, same: Same, seed: int) -> Answer:
    likelihood = MainLikelihood(track.trials.problems[0].data, jnp.asarray(track.theta), same)
    return _of_thesis(likelihood, seed, Acceptance.METROPOLIS, LONG)


def _of_thesis(
    log_similarity: Any,
    seed: int,
    acceptance: Acceptance = Acceptance.COIN,
    num_steps: int = NUM_STEPS,
) -> Answer:
    key = jax.random.key(seed)
    began = time.perf_counter()
    posterior = infer(
        key, log_similarity, MAIN, acceptance=acceptance, num_steps=num_steps
    ).posterior
    seconds = time.perf_counter() - began
    k1, k2 = posterior["k1"], posterior["k2"]
    draws = np.stack([k1, k2, np.log(posterior["m1"] / posterior["m2"])])
    return Answer(draws, seconds, posterior.stats["num_evaluations"], posterior.is_converged)


METHODS: dict[str, Callable[[Track, Same, int], Answer]] = {
    "grad": fit_grad,
    "mh": fit_mh,
    "mh-long": fit_mh_long,
    "mh-walk": fit_mh_walk,
    "mh-fixed": fit_mh_fixed,
    "mh-cnn": fit_mh_cnn,
    "smc": fit_smc,
    "cnn": fit_cnn,
    "thesis": fit_thesis,
    "thesis-long": fit_thesis_long,
    "thesis-true": fit_thesis_true,
}


def _fit(track: Track, seed: int) -> tuple[GradientFit, float]:
    began = time.perf_counter()
    fit = GradientFitter(track.trials).fit(seed)
    return fit, time.perf_counter() - began


def _sampled(
    track: Track,
    seed: int,
    fit: GradientFit,
    starts: np.ndarray | None,
    sampler: str,
    settings: Settings,
    seconds: float,
) -> Answer:
    """Chains of a fit; `seconds` is what was spent before."""
    trials = track.trials
    began = time.perf_counter()
    posterior = metropolis_posterior(
        trials, fit, seed, sampler=sampler, settings=settings, starts=starts
    )
    seconds += time.perf_counter() - began
    rollouts = fit.stats["num_rollouts"] + posterior.stats["num_evaluations"]
    draws = quantities(trials, posterior.draws)
    return Answer(draws, seconds, rollouts, posterior.is_converged)


def _parser() -> command.Parser:
    parser = command.Parser(prog="posteriors.py", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--num", type=command.whole_number(1), default=20, help="tracks")
    parser.add_argument("--seed", type=command.whole_number(0), default=0)
    parser.add_argument("--methods", default="grad,mh,mh-cnn,cnn,thesis", help=",".join(METHODS))
    parser.add_argument("--noise", choices=("tracker", "camera"), default="tracker")
    return parser


if __name__ == "__main__":
    raise SystemExit(command.run(main))

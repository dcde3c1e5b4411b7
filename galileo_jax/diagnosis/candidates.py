"""Candidates: every effect of the library as a hypothesis, all fitted in one batch.

For each candidate, a score test is computed first: how much the misfit would decrease along the
derivative with respect to the effect's strength, after removing what the other parameters can
absorb. It needs one rollout per candidate. Then the effect is fitted together with all other
parameters, from several starting points, and the evidence is computed by Laplace's method. The
evidence charges for every parameter, according to how much of its prior the data exclude.

The position, time or wavelength of an effect has many local optima near the right value. Two kinds
of starting points deal with this: scattered ones, and matched ones, whose derivative at zero
strength removes most of the misfit (a matched filter: the score test over all shapes). The best of
either kind are refined. Finally every candidate starts once more from values that reproduce the
motion of the best candidate, with all other parameters as in that candidate.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc

from galileo_jax.comparison.bootstrap import whitened
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.parameters import inverse

STARTS_PER_PARAMETER, MOST_STARTS = 32, 96
NUM_WAYS = 3  # in which they relate to the fit without the candidate; the best of each is refined
# Of a strength's prior: small enough to be a slope, large enough to be seen.
PROBE_Z = 0.1
SMALL_QUANTILE_Z = -2.0
NUM_REFITTED, OUT_OF_THE_RACE = 6, 100.0  # candidates, unless so many nats behind the best
NUM_SHAPES, NUM_MATCHED = 96, 3  # tried per candidate whose effect has a shape; kept as starts
SHOWS = 1e-9  # a slope below does not
MOST_Z = 2.5  # of a matched strength's prior
NUM_STRENGTHS, NUM_ZOOMS = 15, 4  # a grid over all strengths, then between neighbours of the best
SPREAD_Z = 0.7  # of starts round the fit without the candidate


@dataclass(frozen=True)
class Hypothesis:
    """Effects that are there, and the fit with them.

    Attributes:
      effects: names, in the order in which they were added.
      fit: of all parameters.
      trials: whose parameters these are, where not the diagnosis's own: of a law.
    """

    effects: tuple[str, ...]
    fit: GradientFit
    trials: JointProblem | None = None

    def of(self, trials: JointProblem) -> JointProblem:
        """The trials that it was fitted to, where the diagnosis's own are `trials`."""
        return self.trials or trials

    @property
    def misfit(self) -> float:
        """By how much chi2 per measured value exceeds 1, which noise alone would give."""
        return self.fit.chi2 / self.fit.num_values - 1.0


def reduced(trials: JointProblem, hypothesis: Hypothesis, effects: Sequence[str]) -> Hypothesis:
    """A hypothesis with only some of its effects, all else as it is: to start from, not a fit."""
    fit, free = hypothesis.fit, trials.free(effects)
    return Hypothesis(tuple(effects), replace(fit, z=np.where(free, fit.z, 0.0), free=free))


def fit_candidates(
    fitter: GradientFitter, base: Hypothesis, candidates: Sequence[tuple[str, ...]], seed: int
) -> list[Hypothesis]:
    """Fits every candidate (a set of effects) in one batch.

    Args:
      fitter: of trials whose models have the whole library.
      base: a fit with fewer effects, to start from.
      candidates: names of all effects of each.
      seed: of the starts.
    """
    trials = fitter.trials
    count = len(trials.model_parameters)
    free = np.stack([trials.free(effects)[:count] for effects in candidates])
    chosen = _scattered(fitter, base.fit, free, seed)
    matched = _matched(fitter, base.fit, candidates, seed)
    z = np.concatenate([np.concatenate([a, b]) for a, b in zip(chosen, matched, strict=True)])
    sizes = [(len(a), len(b)) for a, b in zip(chosen, matched, strict=True)]
    of = np.repeat(np.arange(len(sizes)), [a + b for a, b in sizes])
    kind = np.concatenate([np.repeat([0, 1], pair) for pair in sizes])
    found = fitter.fit_from(z, free[of], 2 * of + kind)
    fits = [max(pair, key=_evidence) for pair in zip(found[::2], found[1::2], strict=True)]
    fits = _seconded(fitter, base.fit, candidates, fits, seed)
    # The winners are looked at once more: their order must not hang on a side valley.
    # The search's coarse noise cannot say which of a candidate's starts ends best, either.
    evidence = np.array([fit.log_evidence for fit in fits])
    winners = np.argsort(-evidence)[:NUM_REFITTED]
    winners = winners[evidence[winners] > evidence.max() - OUT_OF_THE_RACE]
    rows = np.flatnonzero(np.isin(of, winners))
    again = fitter.fit_from(z[rows], free[of[rows]], np.arange(len(rows)))
    for i in winners:
        tried = [fit for row, fit in zip(rows, again, strict=True) if of[row] == i]
        fits[i] = max([*tried, fits[i], fitter.refit(fits[i])], key=_evidence)
    return [Hypothesis(tuple(e), fit) for e, fit in zip(candidates, fits, strict=True)]


def _seconded(
    fitter: GradientFitter,
    base: GradientFit,
    candidates: Sequence[tuple[str, ...]],
    fits: list[GradientFit],
    seed: int,
) -> list[GradientFit]:
    """Fits all candidates but the best once more, from where the best has all else.

    Another explanation that is as good leaves the masses, frictions and nuisances where the best
    one has them; from the fit without an effect, which has bent them, it may not be reached.
    """
    trials, best = fitter.trials, int(np.argmax([fit.log_evidence for fit in fits]))
    count = len(trials.model_parameters)
    without = replace(base, z=np.where(base.free, fits[best].z, 0.0), jacobian=fits[best].jacobian)
    others = [i for i in range(len(candidates)) if i != best]
    if not others:
        return fits
    starts = [own[:1] for own in _matched(fitter, without, [candidates[i] for i in others], seed)]
    of = np.arange(len(others))
    free = np.stack([trials.free(candidates[i])[:count] for i in others])
    found = fitter.fit_from(np.concatenate(starts), free[of], of)
    for i, fit in zip(others, found, strict=True):
        fits[i] = max(fits[i], fit, key=_evidence)
    return fits


def score_tests(
    trials: JointProblem, base: Hypothesis, candidates: Sequence[tuple[str, ...]]
) -> np.ndarray:
    """How many standard deviations each candidate's slope stands out, at zero strength.

        z = d.r / |d|,   d = the slope of the whitened residuals r, made orthogonal to those of
                             the parameters that are there already

    Returns:
      `[candidate]`, of the last effect of each, without a refit; signed strengths by size.
    """
    probes = np.tile(trials.theta(base.fit.z, base.fit.free), (len(candidates), 1))
    for probe, effects in zip(probes, candidates, strict=True):
        where, size = _strength(trials, effects[-1])
        probe[where] = size
    residual, slopes = _beside(trials, base.fit, probes)
    length = np.linalg.norm(slopes, axis=1)
    return np.abs(slopes @ residual) / np.where(length > SHOWS, length, np.inf)


def _strength(trials: JointProblem, effect: str) -> tuple[np.ndarray, float]:
    """Where an effect's strengths stand (one per clip, or one), and a small one."""
    names = [p.name for p in trials.model_parameters]
    where = [i for i, n in enumerate(names) if n == effect or n.startswith(f"{effect}_")]
    first = trials.model_parameters[where[0]]
    own = [i for i in where if trials.model_parameters[i].prior == first.prior]
    is_signed = float(first.prior.forward(jnp.asarray(-1.0))) < first.absent
    at = PROBE_Z if is_signed else SMALL_QUANTILE_Z
    return np.array(own if first.per_clip else own[:1]), float(first.prior.forward(jnp.asarray(at)))


def _evidence(fit: GradientFit) -> float:
    return fit.log_evidence


def _scattered(
    fitter: GradientFitter, base: GradientFit, free: np.ndarray, seed: int
) -> list[np.ndarray]:
    """For each hypothesis the best of its scattered starts in each way, `[way, z]`."""
    starts = [_starts(fitter.trials, base, row, seed) for row in free]
    of = np.repeat(np.arange(len(free)), [len(own) for own in starts])
    costs = fitter.search_costs(np.concatenate(starts), free[of])
    chosen = []
    for i, own in enumerate(starts):
        cost = costs[of == i]
        ways = [np.arange(way, len(own), NUM_WAYS) for way in range(NUM_WAYS)]
        chosen.append(own[[way[np.argmin(cost[way])] for way in ways]])
    return chosen


def _matched(
    fitter: GradientFitter, base: GradientFit, candidates: Sequence[tuple[str, ...]], seed: int
) -> list[np.ndarray]:
    """For each candidate starts that match the base fit's residuals, `[start, z]`, best first.

    Those whose effect has a strength and no shape get one more: the best of all its strengths. As
    far as the slope goes is too far where a little more of an effect changes everything, as
    friction does that nearly holds.
    """
    trials, count = fitter.trials, len(fitter.trials.model_parameters)
    starts = [_matched_shapes(trials, base, effects, seed) for effects in candidates]
    plain = [i for i, own in enumerate(starts) if len(own) == 1]
    if not plain:
        return starts
    free = np.stack([trials.free(candidates[i])[:count] for i in plain])
    where = [_strength(trials, candidates[i][-1])[0] for i in plain]
    found = _best_strengths(fitter, np.concatenate([starts[i] for i in plain]), free, where)
    for i, best in zip(plain, found, strict=True):
        starts[i] = np.stack([best, starts[i][0]])
    return starts


def _best_strengths(
    fitter: GradientFitter, z: np.ndarray, free: np.ndarray, where: Sequence[np.ndarray]
) -> np.ndarray:
    """`z` `[candidate, z]` with the strength of least cost, all else as it is: ever finer grids."""
    middle, reach = np.zeros(len(z)), MOST_Z
    for _ in range(NUM_ZOOMS):
        tried = np.repeat(z[:, None], NUM_STRENGTHS, axis=1)
        steps = np.linspace(-reach, reach, NUM_STRENGTHS)
        for own, columns, centre in zip(tried, where, middle, strict=True):
            own[:, columns] = (centre + steps)[:, None]
        of = np.repeat(np.arange(len(z)), NUM_STRENGTHS)
        costs = fitter.search_costs(tried.reshape(len(of), -1), free[of]).reshape(len(z), -1)
        best = np.argmin(costs, axis=1)
        middle = middle + steps[best]
        reach = steps[1] - steps[0]
    return tried[np.arange(len(z)), best]


def _matched_shapes(
    trials: JointProblem, base: GradientFit, effects: Sequence[str], seed: int
) -> np.ndarray:
    """The shapes of the last effect that match the base fit's residuals best, `[start, z]`.

    For each shape the strength is the one that its slope at no strength asks for.
    """
    where, size = _strength(trials, effects[-1])
    free = trials.free(effects)[: len(trials.model_parameters)]
    z, probes = _shapes(trials, base, effects, seed)
    along, power = _along(trials, base, probes)
    best = np.argsort(-_gain(along, power))[:NUM_MATCHED]
    # As far as the slope goes: the strength at which the residuals along it would vanish.
    wanted = probes[best]
    wanted[:, where] = (-along / np.maximum(power, SHOWS))[best, None] * size
    priors = [trials.model_parameters[i].prior for i in where]
    for column, prior in zip(where, priors, strict=True):
        found = np.asarray(prior.inverse(jnp.asarray(wanted[:, column])))
        z[best, column] = np.clip(np.nan_to_num(found, nan=-MOST_Z), -MOST_Z, MOST_Z)
    return np.where(free, z[best, : len(free)], 0.0)


def best_gains(
    trials: JointProblem, base: GradientFit, candidates: Sequence[tuple[str, ...]], seed: int
) -> np.ndarray:
    """By how many nats the last effect of each candidate lowers the misfit, as far as slopes tell.

    Half the square of the score test's z, of the best of the effect's shapes.

    Returns:
      `[candidate]`.
    """
    probes = [_shapes(trials, base, effects, seed)[1] for effects in candidates]
    along, power = _along(trials, base, np.concatenate(probes))
    ends = np.cumsum([len(own) for own in probes])[:-1]
    return np.array([0.5 * own.max() for own in np.split(_gain(along, power), ends)])


def _shapes(
    trials: JointProblem, base: GradientFit, effects: Sequence[str], seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Shapes of the last effect beside a fit: `[shape, z]`, and in units at a probe's size."""
    count = len(trials.model_parameters)
    where, size = _strength(trials, effects[-1])
    new = np.flatnonzero(trials.free(effects)[:count] & ~base.free[:count])
    shape = np.setdiff1d(new, where)
    number = NUM_SHAPES if len(shape) else 1
    generator = np.random.default_rng([seed, 43])
    z = np.tile(base.z, (number, 1))
    z[:, shape] = ndtri(np.clip(_latin(generator, number, len(shape)), 0.02, 0.98))
    probes = np.array(trials.theta(z, trials.free(effects)))
    probes[:, where] = size
    return z, probes


def _along(
    trials: JointProblem, base: GradientFit, probes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The slopes to each of `probes` along the base fit's residuals, and their squares."""
    residual, slopes = _beside(trials, base, probes)
    return slopes @ residual, np.sum(slopes**2, axis=1)


def _gain(along: np.ndarray, power: np.ndarray) -> np.ndarray:
    """How much of the squared residuals each slope explains; none where it does not show."""
    return np.where(power > SHOWS, along**2 / np.maximum(power, SHOWS), 0.0)


def _beside(
    trials: JointProblem, base: GradientFit, probes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The base fit's whitened residuals, and how they change to each of `probes`.

    Both without what the parameters that are there can take up. The priors' residuals count
    among them: a nuisance that is bent is a misfit, too.
    """
    here = trials.theta(base.z, base.free)
    scale = here[len(trials.model_parameters) :]
    white = np.concatenate(whitened(trials, np.vstack([here, probes]), scale), axis=1)
    residual, slopes = white[0], white[1:] - white[:1]
    free = base.free[: base.jacobian.shape[1]]
    used = np.vstack([base.jacobian[:, free], np.eye(int(free.sum()))])
    basis, _ = np.linalg.qr(used)
    whole = np.append(residual, base.z[: len(free)][free])
    padded = np.pad(slopes, [(0, 0), (0, int(free.sum()))])
    return whole - basis @ (basis.T @ whole), padded - (padded @ basis) @ basis.T


def _latin(generator: np.random.Generator, size: int, num: int) -> np.ndarray:
    """A Latin hypercube in the unit cube, `[point, axis]`."""
    return qmc.LatinHypercube(num, rng=generator).random(size)


def _starts(trials: JointProblem, base: GradientFit, free: np.ndarray, seed: int) -> np.ndarray:
    """Starts in z: new parameters over their priors, the others in one of three ways."""
    count = len(trials.model_parameters)
    generator = np.random.default_rng([seed, 41])
    new = np.flatnonzero(free & ~base.free[:count])
    size = min(STARTS_PER_PARAMETER * len(new), MOST_STARTS)
    starts = np.tile(base.z[:count], (size, 1))
    starts[:, new] = ndtri(np.clip(_latin(generator, size, len(new)), 0.02, 0.98))
    parameters = trials.model_parameters
    zero = np.array(inverse(parameters, jnp.asarray([p.absent for p in parameters])))
    rest = np.clip(zero, -1.0, 1.0)
    nuisance = np.array([p.role == "nuisance" for p in parameters])
    main = np.array([p.role != "nuisance" for p in parameters]) & base.free[:count]
    spread = generator.standard_normal((size, int(main.sum())))
    way = np.arange(size) % NUM_WAYS
    # Near the base fit; with the nuisances that it bent let go; and with all else let go, too.
    starts[np.ix_(way > 0, nuisance)] = rest[nuisance]
    starts[:, main] += np.where(way[:, None] == 2, SPREAD_Z, 0.1 * (way[:, None] == 1)) * spread
    return np.where(free, starts, 0.0)

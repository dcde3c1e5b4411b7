"""Where candidates are fitted from: scattered starts, and starts that match the residuals.

The position, time or wavelength of an effect has many local optima near the right value. Two kinds
of starting points deal with this: scattered ones, and matched ones, whose derivative at zero
strength removes most of the misfit (the score test over all shapes).
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import ndtri

from galileo_jax.diagnosis.score_tests import (
    SHOWS,
    explained,
    shapes_beside,
    slopes_along,
    strength_of,
)
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.parameters import LongTailed, Prior, in_units, inverse
from galileo_jax.runtime.latin_hypercube import latin_hypercube

STARTS_PER_PARAMETER, MOST_STARTS = 32, 96
NUM_WAYS = 3  # in which they relate to the fit without the candidate; the best of each is refined
NUM_MATCHED = 3  # shapes kept as starts
MOST_Z, MOST_FAR_Z = 2.5, 5.0  # of a matched strength's prior; of one with long tails
NUM_STRENGTHS, NUM_ZOOMS = 15, 4  # a grid over all strengths, then between neighbours of the best
SPREAD_Z = 0.7  # of starts round the fit without the candidate


def scattered(
    fitter: GradientFitter, bases: Sequence[GradientFit], free: np.ndarray, seed: int
) -> list[np.ndarray]:
    """For each hypothesis the best of its scattered starts in each way, `[way, z]`.

    Args:
      fitter: of the trials.
      bases: of each hypothesis the fit without its new effect.
      free: `[hypothesis, model parameter]`.
      seed: of the starts.
    """
    starts = [
        _starts(fitter.trials, base, row, seed) for base, row in zip(bases, free, strict=True)
    ]
    of = np.repeat(np.arange(len(free)), [len(own) for own in starts])
    costs = fitter.search_costs(np.concatenate(starts), free[of])
    chosen = []
    for i, own in enumerate(starts):
        cost = costs[of == i]
        ways = [np.arange(way, len(own), NUM_WAYS) for way in range(NUM_WAYS)]
        chosen.append(own[[way[np.argmin(cost[way])] for way in ways]])
    return chosen


def matched(
    fitter: GradientFitter,
    bases: Sequence[GradientFit],
    candidates: Sequence[tuple[str, ...]],
    seed: int,
) -> tuple[list[np.ndarray], np.ndarray]:
    """For each candidate starts that match its base fit's residuals, `[start, z]`, best first.

    Those whose effect has a strength and no shape get one more: the best of all its strengths. As
    far as the slope goes is too far where a little more of an effect changes everything, as
    friction does that nearly holds.

    Returns:
      The starts, and how much of the squared residuals each candidate's best slope explains,
      `[candidate]`.
    """
    trials, count = fitter.trials, len(fitter.trials.model_parameters)
    starts: list[np.ndarray] = [np.empty(0)] * len(candidates)
    gains = np.zeros(len(candidates))
    for base in {id(base): base for base in bases}.values():
        own = [i for i, other in enumerate(bases) if other is base]
        found = _matched_shapes(trials, base, [candidates[i] for i in own], seed)
        for i, (shapes, gain) in zip(own, found, strict=True):
            starts[i], gains[i] = shapes, gain
    plain = [i for i, own in enumerate(starts) if len(own) == 1]
    if not plain:
        return starts, gains
    free = np.stack([trials.free(candidates[i])[:count] for i in plain])
    where = [strength_of(trials, candidates[i][-1])[0] for i in plain]
    found = best_strengths(fitter, np.concatenate([starts[i] for i in plain]), free, where)
    for i, best in zip(plain, found, strict=True):
        starts[i] = np.stack([best, starts[i][0]])
    return starts, gains


def alike_or_matched(
    fitter: GradientFitter,
    best: GradientFit,
    leader: str,
    z: np.ndarray,
    free: np.ndarray,
    effects: Sequence[str],
) -> np.ndarray:
    """Starts, `[candidate, z]`: `z`, or with the leader's shape where that costs less.

    An effect with the same kind of shape (`NAME_start`, `NAME_length`) that explains the data as
    well has it where the leader has it; between the shapes that are tried a narrow one is missed.

    Args:
      fitter: of the trials.
      best: the leading fit.
      leader: its last effect.
      z: where each candidate would start.
      free: `[candidate, model parameter]`.
      effects: the last effect of each candidate.
    """
    parameters = fitter.trials.model_parameters
    shape = _shape(fitter.trials, leader)
    alike = z.copy()
    rows: list[int] = []
    for row, effect in enumerate(effects):
        own = _shape(fitter.trials, effect)
        same = [(own[end], i) for end, i in shape.items() if end in own]
        for mine, its in same:
            value = in_units(parameters[its].prior, best.z[its])
            alike[row, mine] = parameters[mine].prior.inverse(value)
        if same and np.all(np.isfinite(alike[row])):
            rows.append(row)
    if not rows:
        return z
    where = [strength_of(fitter.trials, effects[row])[0] for row in rows]
    alike[rows] = best_strengths(fitter, alike[rows], free[rows], where)
    costs, others = (fitter.search_costs(starts[rows], free[rows]) for starts in (alike, z))
    starts = z.copy()
    starts[rows] = np.where((costs < others)[:, None], alike[rows], z[rows])
    return starts


def _shape(trials: JointProblem, effect: str) -> dict[str, int]:
    """Where an effect's parameters stand beside its strength, by how their names end."""
    named = {trials.model_parameters[i].name: int(i) for i in trials.brought_by(effect)}
    start = f"{effect}_"
    return {n.removeprefix(effect): i for n, i in named.items() if n.startswith(start)}


def best_strengths(
    fitter: GradientFitter, z: np.ndarray, free: np.ndarray, where: Sequence[np.ndarray]
) -> np.ndarray:
    """`z` `[candidate, z]` with the strength of least cost, all else as it is: ever finer grids."""
    priors = [fitter.trials.model_parameters[columns[0]].prior for columns in where]
    middle, reach = np.zeros(len(z)), np.array([_most_z(prior) for prior in priors])
    for _ in range(NUM_ZOOMS):
        tried = np.repeat(z[:, None], NUM_STRENGTHS, axis=1)
        steps = np.linspace(-reach, reach, NUM_STRENGTHS, axis=-1)
        for own, columns, centre, step in zip(tried, where, middle, steps, strict=True):
            own[:, columns] = (centre + step)[:, None]
        of = np.repeat(np.arange(len(z)), NUM_STRENGTHS)
        costs = fitter.search_costs(tried.reshape(len(of), -1), free[of]).reshape(len(z), -1)
        best = np.argmin(costs, axis=1)
        middle = middle + np.take_along_axis(steps, best[:, None], axis=1)[:, 0]
        reach = steps[:, 1] - steps[:, 0]
    return tried[np.arange(len(z)), best]


def _most_z(prior: Prior) -> float:
    return MOST_FAR_Z if isinstance(prior, LongTailed) else MOST_Z


def _matched_shapes(
    trials: JointProblem, base: GradientFit, candidates: Sequence[tuple[str, ...]], seed: int
) -> list[tuple[np.ndarray, float]]:
    """Of each candidate the shapes of its last effect that match the residuals, `[start, z]`.

    For each shape the strength is the one that its slope at no strength asks for. With them how
    much of the squared residuals the best explains.
    """
    beside = [shapes_beside(trials, base, effects, seed) for effects in candidates]
    ends = np.cumsum([len(z) for z, _ in beside])[:-1]
    found = slopes_along(trials, base, np.concatenate([probes for _, probes in beside]))
    parts = (np.split(values, ends) for values in found)
    starts = []
    for effects, (z, probes), along, power in zip(candidates, beside, *parts, strict=True):
        where, size = strength_of(trials, effects[-1])
        gains = explained(along, power)
        best = np.argsort(-gains)[:NUM_MATCHED]
        # As far as the slope goes: the strength at which the residuals along it would vanish.
        wanted = probes[best]
        wanted[:, where] = (-along / np.maximum(power, SHOWS))[best, None] * size
        priors = [trials.model_parameters[i].prior for i in where]
        for column, prior in zip(where, priors, strict=True):
            own, most = prior.inverse(wanted[:, column]), _most_z(prior)
            z[best, column] = np.clip(np.nan_to_num(own, nan=-most), -most, most)
        free = trials.free(effects)[: len(trials.model_parameters)]
        starts.append((np.where(free, z[best, : len(free)], 0.0), float(gains[best[0]])))
    return starts


def _starts(trials: JointProblem, base: GradientFit, free: np.ndarray, seed: int) -> np.ndarray:
    """Starts in z: new parameters over their priors, the others in one of three ways."""
    count = len(trials.model_parameters)
    generator = np.random.default_rng([seed, 41])
    new = np.flatnonzero(free & ~base.free[:count])
    size = min(STARTS_PER_PARAMETER * len(new), MOST_STARTS)
    starts = np.tile(base.z[:count], (size, 1))
    starts[:, new] = ndtri(np.clip(latin_hypercube(size, len(new), generator), 0.02, 0.98))
    parameters = trials.model_parameters
    zero = inverse(parameters, np.array([p.absent for p in parameters]))
    rest = np.clip(zero, -1.0, 1.0)
    nuisance = np.array([p.role == "nuisance" for p in parameters])
    main = np.array([p.role != "nuisance" for p in parameters]) & base.free[:count]
    spread = generator.standard_normal((size, int(main.sum())))
    way = np.arange(size) % NUM_WAYS
    # Near the base fit; with the nuisances that it bent let go; and with all else let go, too.
    starts[np.ix_(way > 0, nuisance)] = rest[nuisance]
    starts[:, main] += np.where(way[:, None] == 2, SPREAD_Z, 0.1 * (way[:, None] == 1)) * spread
    return np.where(free, starts, 0.0)

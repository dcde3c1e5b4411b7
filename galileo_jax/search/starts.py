"""Where hypotheses are fitted from: scattered starts, and starts that match the residuals.

The position, time or wavelength of an effect has many local optima near the right value. Two kinds
of starting points deal with this: scattered ones, and matched ones, whose derivative at zero
strength removes most of the misfit (the score test over all shapes).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import ndtri

from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.parameters import LongTailed, Prior, inverse
from galileo_jax.numerics.latin_hypercube import latin_hypercube
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.search.score_tests import (
    SHOWS,
    explained,
    shapes_beside,
    slopes_along,
    strength_of,
)
from galileo_jax.search.table import Start, Table

NUM_SCATTERED = 32  # over all priors, of a hypothesis of several effects
STARTS_PER_PARAMETER, MOST_STARTS = 32, 96
NUM_WAYS = 3  # in which they relate to the fit without the candidate; the best of each is refined
NUM_MATCHED = 3  # shapes kept as starts
MOST_Z, MOST_FAR_Z = 2.5, 5.0  # of a matched strength's prior; of one with long tails
NUM_STRENGTHS, NUM_ZOOMS = 15, 4  # a grid over all strengths, then between neighbours of the best
SPREAD_Z = 0.7  # of starts round the fit without the candidate


def beside(
    table: Table,
    move: str,
    wanted: Sequence[tuple[Hypothesis, tuple[str, ...]]],
    is_scattered: bool = True,
) -> list[Start]:
    """Starts of hypotheses that are their parent and one effect more, its last.

    The shapes that match best, and scattered ones: of one effect round the parent in `NUM_WAYS`
    ways; of several, which are many hypotheses, over all priors.

    `move`: that proposes them. `wanted`: parents, and the effects of the hypotheses; those asked
    for already are left out. `is_scattered`: else the best match is all.
    """
    wanted = table.not_asked(move, wanted)
    if not wanted:
        return []
    parents = [parent.fit for parent, _ in wanted]
    sets = [effects for _, effects in wanted]
    seed = table.seed + table.num_rounds
    matching = matched(table.fitter, parents, sets, table.seed)
    starts: list[Start] = []
    for (parent, effects), free, shapes in zip(wanted, table.free(sets), matching, strict=True):
        if not is_scattered:
            shapes, others, ways = shapes[:1], np.empty((0, len(free))), 1
        elif len(effects) == 1:
            others, ways = _starts(table.trials, parent.fit, free, table.seed), NUM_WAYS
        else:
            others, ways = scattered_starts(table.trials, free, NUM_SCATTERED, seed), 1
            shapes = shapes[:1]
        labels = [*range(ways, ways + len(shapes)), *(np.arange(len(others)) % ways)]
        starts += [
            Start(effects, z, parent, move, int(label))
            for z, label in zip([*shapes, *others], labels, strict=True)
        ]
    return starts


def beside_a_formula(table: Table, formula: Hypothesis) -> list[Start]:
    """Starts of single effects, all else as beside a formula, which is of trials of its own.

    What a formula explains, one effect alone may explain as well, and a fit from nowhere have
    missed: its valley is narrow, or lies far from where the model without effects is.
    """
    trials, base = table.trials, table.base
    at = formula.of(trials).places(trials.names)
    z = np.where(at >= 0, formula.fit.z[at], 0.0)
    jacobian = formula.fit.jacobian[:, at[: len(trials.model_parameters)]]
    free = base.fit.free
    fit = replace(
        base.fit,
        z=np.where(free, z, 0.0),
        jacobian=np.where(free[: jacobian.shape[1]], jacobian, 0.0),
        log_evidence=-np.inf,
    )
    parent = Hypothesis((), fit)
    return beside(table, "formula", [(parent, (name,)) for name in trials.all_effects])


def matched(
    fitter: GradientFitter,
    bases: Sequence[GradientFit],
    candidates: Sequence[tuple[str, ...]],
    seed: int,
) -> list[np.ndarray]:
    """For each candidate starts that match its base fit's residuals, `[start, z]`, best first.

    Those whose effect has a strength and no shape get one more: the best of all its strengths. As
    far as the slope goes is too far where a little more of an effect changes everything, as
    friction does that nearly holds.
    """
    trials, count = fitter.trials, len(fitter.trials.model_parameters)
    starts: list[np.ndarray] = [np.empty(0)] * len(candidates)
    for base in {id(base): base for base in bases}.values():
        own = [i for i, other in enumerate(bases) if other is base]
        found = _matched_shapes(trials, base, [candidates[i] for i in own], seed)
        for i, shapes in zip(own, found, strict=True):
            starts[i] = shapes
    plain = [i for i, own in enumerate(starts) if len(own) == 1]
    if not plain:
        return starts
    free = np.stack([trials.free(candidates[i])[:count] for i in plain])
    where = [strength_of(trials, candidates[i][-1])[0] for i in plain]
    found = best_strengths(fitter, np.concatenate([starts[i] for i in plain]), free, where)
    for i, best in zip(plain, found, strict=True):
        starts[i] = np.stack([best, starts[i][0]])
    return starts


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
) -> list[np.ndarray]:
    """Of each candidate the shapes of its last effect that match the residuals, `[start, z]`.

    For each shape the strength is the one that its slope at no strength asks for.
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
        starts.append(np.where(free, z[best, : len(free)], 0.0))
    return starts


def _starts(trials: JointProblem, base: GradientFit, free: np.ndarray, seed: int) -> np.ndarray:
    """Starts in z: new parameters over their priors, the others in one of three ways."""
    count = len(trials.model_parameters)
    generator = np.random.default_rng([seed, 41])
    new = np.flatnonzero(free & ~base.free[:count])
    size = min(STARTS_PER_PARAMETER * len(new), MOST_STARTS)
    starts = np.tile(base.z[:count], (size, 1))
    starts[:, new] = ndtri(np.clip(latin_hypercube(size, len(new), generator), 0.02, 0.98))
    rest = absent_z(trials)
    nuisance = np.array([p.role == "nuisance" for p in trials.model_parameters])
    main = ~nuisance & base.free[:count]
    spread = generator.standard_normal((size, int(main.sum())))
    way = np.arange(size) % NUM_WAYS
    # Near the base fit; with the nuisances that it bent let go; and with all else let go, too.
    starts[np.ix_(way > 0, nuisance)] = rest[nuisance]
    starts[:, main] += np.where(way[:, None] == 2, SPREAD_Z, 0.1 * (way[:, None] == 1)) * spread
    return np.where(free, starts, 0.0)


def scattered_starts(trials: JointProblem, free: np.ndarray, num: int, seed: int) -> np.ndarray:
    """A Latin hypercube over all but the nuisances, which are where they are absent.

    `[start, model parameter]`, z; `free`: `[model parameter]`, those that are not pinned.
    """
    is_scattered = free & np.array([p.role != "nuisance" for p in trials.model_parameters])
    return scattered_round(trials, absent_z(trials)[None], is_scattered[None], num, seed)


def scattered_round(
    trials: JointProblem, centres: np.ndarray, is_scattered: np.ndarray, num: int, seed: int
) -> np.ndarray:
    """Starts round centres in turn, of which some parameters are known and others scattered.

    `[start, model parameter]`, z, as `centres` are; `is_scattered`: `[centre, model parameter]`,
    those that are not known.
    """
    turn = np.arange(num) % len(centres)
    some = np.flatnonzero(is_scattered.any(axis=0)).tolist()
    shares = latin_hypercube(num, len(some), np.random.default_rng(seed))
    starts = centres[turn].copy()
    for i, share in zip(some, shares.T, strict=True):
        column = ndtri(np.clip(_in_range(trials, i, share), 0.01, 0.99))
        starts[:, i] = np.where(is_scattered[turn, i], column, starts[:, i])
    return starts


def _in_range(trials: JointProblem, index: int, share: np.ndarray) -> np.ndarray:
    """Shares of a parameter's prior, those of friction within what motion can show."""
    parameter = trials.model_parameters[index]
    if parameter.role != "main" or not parameter.name.startswith("k"):
        return share
    scene = trials.problems[0].model.scene.surroundings
    if parameter.name != "k1" or scene.is_level:
        return 0.5 * share**2 + 0.01  # as many between 0.01 and 0.13 as above
    # Above tan(angle) nothing slides and every start looks alike.
    steepest = min(float(np.tan(scene.angle_rad)), 0.98)
    if not (any(scene.rolls) and scene.rolls[0]):
        return steepest * share + 0.01
    # Half of them where it slips as it rolls: with more friction it rolls alike.
    slips = steepest * scene.roll_inertia[0] / (1 + scene.roll_inertia[0])
    return np.interp(share, [0.0, 0.5, 1.0], [0.0, slips, steepest]) + 0.01


def absent_z(trials: JointProblem) -> np.ndarray:
    """Where nothing but the scene is there, as far as priors reach, `[model parameter]`, z."""
    parameters = trials.model_parameters
    z = inverse(parameters, np.asarray([p.absent for p in parameters]))
    return np.clip(z, -1.0, 1.0)


def positive_nuisances(trials: JointProblem, free: np.ndarray) -> np.ndarray:
    """Which of the model's parameters are nuisances that are positive and not pinned: indices."""
    is_own = [p.role == "nuisance" and p.is_positive for p in trials.model_parameters]
    return np.flatnonzero(free[: len(is_own)] & is_own)

"""All unknowns beside a Gaussian-process acceleration: a linear model, and draws from it.

Residuals are linear in accelerations and in friction coefficients k, which may be exchanged for
each other over a wide range. In the z that is searched, k is no straight line over such a range:
the prior of z would pull k to the middle of what it may be. So k is drawn from

    p(k | y, s, l)  ~  p(k) N(y; -B k, 1 + A A'),

A for all other unknowns, whose prior is normal and which have been integrated out, and the others
from their normal distribution given k.
"""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from scipy.linalg import block_diag, solve_triangular
from scipy.special import softmax

from galileo_jax.inference.free_force.along_path import along_path
from galileo_jax.inference.free_force.free_fit import FreeFit
from galileo_jax.inference.free_force.kernels import Knots, Size
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.laplace import NUM_DRAWS

NUM_STEPS = 30  # to the most probable friction
NUM_TRIED = 3000  # values of friction for each size
WIDER = (1.0, 2.0, 4.0)  # than the normal approximation, what is tried
TABLE_Z = np.linspace(-8.0, 8.0, 6401)


@dataclass(frozen=True)
class Linear:
    """All residuals as a linear function of all unknowns round a point.

    Attributes:
      z: `[parameter]`.
      jacobian: `[value, model parameter]`.
      target: `[value]`, the residuals where all unknowns are in their middle.
      white_target: the same, all but the accelerations made part of the noise.
      knots: of each object, the response likewise.
      where: of each object, where its knots stand.
      mixing: of each object, from z of its knots to accelerations.
      others: where all else stands that is free.
    """

    z: np.ndarray
    jacobian: np.ndarray
    target: np.ndarray
    white_target: np.ndarray
    knots: tuple[Knots, ...]
    where: tuple[np.ndarray, ...]
    mixing: tuple[np.ndarray, ...]
    others: np.ndarray

    @classmethod
    def of(cls, found: FreeFit) -> "Linear":
        """Round a fit."""
        trials, jacobian, z = found.trials, found.jacobian, found.z
        free = np.flatnonzero(found.free[: jacobian.shape[1]])
        where, mixing, times, places = _places(found, trials.theta(z, found.free))
        others = np.setdiff1d(free, np.concatenate(where))
        target = found.residual - jacobian[:, free] @ z[free]
        rest = jacobian[:, others]
        lower = np.linalg.cholesky(np.eye(len(target)) + rest @ rest.T)
        knots = []
        for own, mix, time_s, place_m in zip(where, mixing, times, places, strict=True):
            response = -jacobian[:, own] @ np.linalg.inv(mix)
            knots.append(Knots(solve_triangular(lower, response, lower=True), time_s, place_m))
        white_target = solve_triangular(lower, target, lower=True)
        return cls(z, jacobian, target, white_target, tuple(knots), where, mixing, others)

    def design(self, size: Size) -> tuple[np.ndarray, np.ndarray]:
        """From unit normals to z of what is free: `[parameter, unit]`; and the normal equations."""
        to_z = np.zeros((self.jacobian.shape[1],) * 2)
        to_z[self.others, self.others] = 1.0
        roots = size.roots(self.knots)
        for own, mix, root in zip(self.where, self.mixing, roots, strict=True):
            to_z[np.ix_(own, own)] = np.linalg.solve(mix, root)
        design = self.jacobian @ to_z
        return to_z, design


Arrays = tuple[np.ndarray, ...]


def _places(found: FreeFit, theta: np.ndarray) -> tuple[Arrays, Arrays, Arrays, Arrays]:
    """For each object: where its knots of all clips stand, mixing, times and places."""
    trials = found.trials
    count = len(trials.problems[0].observation.names)
    where, mixing, times, places = ([[] for _ in range(count)] for _ in range(4))
    for clip, (problem, effect) in enumerate(zip(trials.problems, found.effects, strict=True)):
        recorded, path, speed = along_path(problem, trials.of_clip(theta, clip))
        column = trials.columns[clip]
        for i in range(count):
            when = effect.knot_times_s(i)
            inside = np.clip(when, recorded[0], recorded[-1])
            # Knots beyond the motion stand where it would have come from or gone.
            beyond = (when - inside) * np.interp(inside, recorded, speed[i])
            where[i].append(column[[problem.model.index(name) for name in effect.knots(i)]])
            mixing[i].append(effect.mixing(i))
            times[i].append(when)
            places[i].append(np.interp(inside, recorded, path[i]) + beyond)
    return (
        tuple(np.concatenate(own) for own in where),
        tuple(np.asarray(block_diag(*own)) for own in mixing),
        tuple(np.concatenate(own) for own in times),
        tuple(np.concatenate(own) for own in places),
    )


@dataclass(frozen=True)
class Frictions:
    """The friction coefficients that are free, and how they go with z.

    Attributes:
      where: `[friction]`, where they stand among the parameters.
      table: `[friction, number]`, k at `TABLE_Z`.
    """

    where: np.ndarray
    table: np.ndarray

    @classmethod
    def of(cls, trials: JointProblem, free: np.ndarray) -> "Frictions":
        """Of all objects."""
        names = [f"k{i + 1}" for i in range(len(trials.problems[0].observation.names))]
        found = [trials.names.index(name) for name in names if name in trials.names]
        where = [i for i in found if free[i]]
        table = [
            np.asarray(trials.parameters[i].prior.forward(jnp.asarray(TABLE_Z))) for i in where
        ]
        return cls(np.array(where, dtype=int), np.reshape(table, (len(where), len(TABLE_Z))))

    def value(self, z: np.ndarray) -> np.ndarray:
        """Of z `[draw, friction]`, the same shape."""
        columns = [np.interp(own, TABLE_Z, k) for own, k in zip(z.T, self.table, strict=True)]
        return np.stack(columns, axis=1) if columns else np.zeros_like(z)

    def slope(self, z: np.ndarray) -> np.ndarray:
        """dk/dz of z `[friction]`."""
        step = TABLE_Z[1] - TABLE_Z[0]
        ends = self.value(np.stack([z - step, z + step]))
        return (ends[1] - ends[0]) / (2 * step)


def drawn(
    found: FreeFit,
    at: Linear,
    sizes: list[Size],
    share: np.ndarray,
    generator: np.random.Generator,
) -> np.ndarray:
    """Draws of the mixture of all sizes, `[draw, parameter]`, z."""
    count = at.jacobian.shape[1]
    z = np.tile(at.z, (NUM_DRAWS, 1))
    frictions = Frictions.of(found.trials, found.free)
    first = 0
    for size, number in zip(sizes, generator.multinomial(NUM_DRAWS, share), strict=True):
        if number:
            z[first : first + number, :count] = _of_size(at, size, frictions, number, generator)
            first += number
    spread = np.sqrt(np.diag(found.covariance)[count:])
    z[:, count:] += spread * generator.standard_normal((NUM_DRAWS, len(spread)))
    return generator.permutation(np.where(found.free, z, 0.0))


def _of_size(
    at: Linear, size: Size, frictions: Frictions, number: int, generator: np.random.Generator
) -> np.ndarray:
    """Draws given a size, `[draw, parameter]`, z."""
    where = frictions.where
    to_z, design = at.design(size)
    rest = np.setdiff1d(np.arange(design.shape[1]), where)
    others = design[:, rest]
    here = at.z[where]
    along = at.jacobian[:, where] / frictions.slope(here)
    target = at.target + at.jacobian[:, where] @ here - along @ frictions.value(here[None])[0]
    values, vectors = np.linalg.eigh(others.T @ others + np.eye(len(rest)))
    root = vectors / np.sqrt(values)
    shared = root.T @ (others.T @ along)
    power = along.T @ along - shared.T @ shared
    pull = along.T @ target - shared.T @ (root.T @ (others.T @ target))
    z_k = friction_draws(frictions, here, power, pull, number, generator)
    left = target[:, None] + along @ frictions.value(z_k).T
    mean = -root @ (root.T @ (others.T @ left))
    units = np.zeros((number, design.shape[1]))
    units[:, rest] = mean.T + generator.standard_normal((number, len(rest))) @ root.T
    z = units @ to_z.T
    z[:, where] = z_k
    return z


def friction_draws(
    frictions: Frictions,
    start: np.ndarray,
    power: np.ndarray,
    pull: np.ndarray,
    number: int,
    generator: np.random.Generator,
) -> np.ndarray:
    """Draws of z of friction whose density is exp(-(k' power k / 2 + pull k + z^2 / 2)).

    Tried are draws from the normal approximation and wider ones; weights make up for the rest.

    Args:
      frictions: k of z.
      start: `[friction]`, z from which the most probable is looked for.
      power: `[friction, friction]`.
      pull: `[friction]`.
      number: of draws.
      generator: of the draws.

    Returns:
      `[draw, friction]`.
    """
    if not start.size:
        return np.zeros((number, 0))

    def cost(z: np.ndarray) -> np.ndarray:
        k = frictions.value(z)
        return 0.5 * np.einsum("di,ij,dj->d", k, power, k) + k @ pull + 0.5 * np.sum(z**2, axis=1)

    mode, identity = start.copy(), np.eye(len(start))
    for _ in range(NUM_STEPS):
        slope = np.diag(frictions.slope(mode))
        k = frictions.value(mode[None])[0]
        step = -np.linalg.solve(slope @ power @ slope + identity, slope @ (power @ k + pull) + mode)
        tried = mode + 0.5 ** np.arange(8)[:, None] * step
        mode = tried[np.argmin(cost(tried))]
    slope = np.diag(frictions.slope(mode))
    lower = np.linalg.cholesky(np.linalg.inv(slope @ power @ slope + identity))
    wider = np.resize(WIDER, NUM_TRIED)
    normal = wider[:, None] * generator.standard_normal((NUM_TRIED, len(start)))
    tried = mode + normal @ lower.T
    distance = np.sum(normal**2, axis=1)
    density = sum(np.exp(-0.5 * distance / w**2) / w ** len(start) for w in WIDER)
    weight = softmax(-cost(tried) - np.log(density))
    return tried[generator.choice(NUM_TRIED, number, p=weight)]

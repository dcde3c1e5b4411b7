"""A fit with what no model explains allowed for: a Gaussian-process acceleration of every object.

1. Hypothesis and a free acceleration are fitted together, the latter with a wide prior.
2. Round the fit, residuals are linear in all unknowns. Sizes and lengths of the process get their
   probabilities from the marginal likelihood (`kernels`).
3. Both are fitted again, with accelerations of the size that was found, and 2. is done again.
4. The posterior: draws from the normal posteriors of all sizes, as often as these are probable. An
   interval of k1 is then marginal over the acceleration and over what is known of its size.

An object at rest, and a hit, answer an acceleration as the model says: covariances of positions
that follow from it come out of rollouts, not of a second integral.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag, solve_triangular

from galileo_jax.inference.fits.gradient import SETTLED
from galileo_jax.inference.free_force.along_path import along_path
from galileo_jax.inference.free_force.free_fit import FreeFit, free_fit, resized
from galileo_jax.inference.free_force.kernels import Knots, Size, probable_sizes
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.laplace import NUM_DRAWS
from galileo_jax.inference.posterior import Posterior, Status

SMALLEST_M_S2 = 0.001  # less shows in no track


@dataclass(frozen=True)
class Discrepancy:
    """A fit with a Gaussian-process acceleration.

    Attributes:
      free: the fit, its mode and covariance those of the mixture.
      posterior: draws of all parameters, the accelerations' knots among them.
      summary: what result.json holds under `discrepancy`.
    """

    free: FreeFit
    posterior: Posterior
    summary: dict[str, Any]


def fit_discrepancy(
    trials: JointProblem, z: np.ndarray, free: np.ndarray, seed: int
) -> Discrepancy:
    """Fits trials with a Gaussian-process acceleration beside a hypothesis.

    Args:
      trials: one clip or several of the same objects.
      z: `[parameter]`, of the hypothesis' fit, noise scales last.
      free: `[parameter]`, which parameters it has.
      seed: of the draws.
    """
    found = free_fit(trials, z, free, num_spans=1)
    at = _Linear.of(found)
    sizes, share = probable_sizes(at.white_target, at.knots)
    found = resized(found, _usual(sizes, share).tolist())
    at = _Linear.of(found)
    sizes, share = probable_sizes(at.white_target, at.knots)
    draws_z = _draws(found, at, sizes, share, np.random.default_rng([seed, 67]))
    gradient = replace(found.gradient, covariance=np.cov(draws_z, rowvar=False))
    extended = found.trials
    posterior = Posterior(
        names=extended.names,
        draws=extended.theta(draws_z, found.free)[None],
        log_density=np.zeros((1, len(draws_z))),
        status=Status.CONVERGED if gradient.code in SETTLED else Status.STEP_LIMIT,
        stats=gradient.stats,
        provenance={"method": "grad", "seed": seed, "code": gradient.code.name},
    )
    found = replace(found, gradient=gradient)
    return Discrepancy(found, posterior, _summary(found, sizes, share))


@dataclass(frozen=True)
class _Linear:
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
    def of(cls, found: FreeFit) -> "_Linear":
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


def _normal(design: np.ndarray) -> np.ndarray:
    return design.T @ design + np.eye(design.shape[1])


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


def _draws(
    found: FreeFit,
    at: _Linear,
    sizes: list[Size],
    share: np.ndarray,
    generator: np.random.Generator,
) -> np.ndarray:
    """Of the mixture, `[draw, parameter]`, z."""
    count = at.jacobian.shape[1]
    z = np.tile(at.z, (NUM_DRAWS, 1))
    first = 0
    for size, number in zip(sizes, generator.multinomial(NUM_DRAWS, share), strict=True):
        if number:
            to_z, design = at.design(size)
            values, vectors = np.linalg.eigh(_normal(design))
            root = vectors / np.sqrt(values)
            mean = root @ (root.T @ (-design.T @ at.target))
            units = mean + generator.standard_normal((number, count)) @ root.T
            z[first : first + number, :count] = units @ to_z.T
            first += number
    spread = np.sqrt(np.diag(found.covariance)[count:])
    z[:, count:] += spread * generator.standard_normal((NUM_DRAWS, len(spread)))
    return generator.permutation(np.where(found.free, z, 0.0))


def _usual(sizes: list[Size], share: np.ndarray) -> np.ndarray:
    """The geometric mean size of each object's acceleration, m/s^2."""
    table = np.array([size.sizes_m_s2 for size in sizes])
    return np.exp(share @ np.log(np.maximum(table, SMALLEST_M_S2)))


def _summary(found: FreeFit, sizes: list[Size], share: np.ndarray) -> dict[str, Any]:
    names = found.trials.problems[0].observation.names
    of_time = float(np.sum(share[[size.of == "time" for size in sizes]]))
    usual = _usual(sizes, share)
    return {
        "kind": "gp",
        "probability_of_time": of_time,
        "length_share": float(np.exp(share @ np.log([size.length for size in sizes]))),
        "size_m_s2": dict(zip(names, usual.tolist(), strict=True)),
        "spans_s": {
            problem.name: [[list(span) for span in own] for own in effect.spans_s]
            for problem, effect in zip(found.trials.problems, found.effects, strict=True)
        },
    }

"""The log posterior: of many points at once, and of one in JAX, for chains.

    log p(z | y) = log mean over x of [ p(y | z, x) / p(y | x) ] - z.z / 2

x: draws of what the data leave open of the sizes of imperfections, of which the linear model round
a fit gives p(y | x), too (`linear_clip`); of a world without them there is one, and no p(y | x).
What is measured is normal given z and x, with no linear model between.
"""

import functools
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.special import logsumexp

from galileo_jax.inference.fits.fitted_clip import FittedClip
from galileo_jax.inference.fits.kernels import FAILED, ClipArrays, left_of
from galileo_jax.inference.fits.laplace import GradientFit
from galileo_jax.inference.fits.linear_clip import linear_clips, log_likelihood
from galileo_jax.inference.fits.residuals import Residuals
from galileo_jax.inference.fits.transport_map import Valley
from galileo_jax.inference.joint_problem import NOISE_SD, JointProblem
from galileo_jax.inference.problem import Kind, Problem
from galileo_jax.model.effects.effect import Effect
from galileo_jax.model.parameters import PriorTable
from galileo_jax.rollout.engine_jax import RECORDS
from galileo_jax.rollout.rollout import in_jax
from galileo_jax.runtime.batching import FRAMES, rounded_up
from galileo_jax.similarity.gaussian_likelihood import log_density_by_modes

if TYPE_CHECKING:
    from galileo_jax.inference.samplers.sampler import LogDensity

# Of the draws of sizes: more of few measured values, whose squared number is what each costs.
LEAST_SIZES, MOST_SQUARES = 32, 500_000
IMPOSSIBLE = -(FAILED**2)  # where a rollout fails

Sizes = Mapping[str, float] | None


def sizes_of(
    trials: JointProblem, fit: GradientFit | None, num: int
) -> tuple[list[Sizes], Float[np.ndarray, " draw"]]:
    """Draws x of sizes, by name, and log p(y | x) of each; the trials' own of a fit without."""
    if fit is None or fit.sizes is None:
        return [trials.sizes], np.zeros(1)
    draws = fit.sizes.draws[:num, : len(fit.sizes.x)]
    linear = linear_clips(trials, fit)
    each = np.array([log_likelihood(linear, trials.terms, x) for x in draws])
    return [dict(zip(fit.sizes.names, x, strict=True)) for x in draws], each - each.max()


class LogPosterior:
    """The log density of parameters and noise scales, up to a constant, of many points."""

    def __init__(self, trials: JointProblem, fit: GradientFit, residuals: Residuals):
        """`fit`: the parameters that are free, and draws of sizes; `residuals`: of the trials."""
        self._residuals, self._fit = residuals, fit
        self._of_prior = -0.5 * np.sum(fit.free) * np.log(2 * np.pi)
        num = max(LEAST_SIZES, MOST_SQUARES // fit.num_values**2)
        draws, self._of_sizes = sizes_of(trials, fit, num)
        self._data = [[p.with_sizes(x).data for x in draws] for p in trials.problems]

    def __call__(self, z: Float[np.ndarray, "point parameter"]) -> Float[np.ndarray, " point"]:
        """At `z`, noise scales last."""
        count = len(self._fit.steps)
        noise = np.exp(NOISE_SD * z[:, count:])
        free = np.broadcast_to(self._fit.free[:count], (len(z), count))
        found = np.zeros((len(self._of_sizes), len(z)))
        for c, (clip, each) in enumerate(zip(self._residuals.clips, self._data, strict=True)):
            self._residuals.num_rollouts += len(z)
            predicted = clip.problem.simulate_batch(clip.theta(z[:, :count], free))
            one = each[0]  # of residuals in the stated errors, which no size changes
            with np.errstate(over="ignore", invalid="ignore"):
                off = one.observed_m - predicted
                left = np.einsum("oijt,pojt->poit", one.inverse_root, off).reshape(len(z), -1)
                left2 = np.sum(left**2, axis=1)
                for of_size, data in zip(found, each, strict=True):
                    along2 = (left @ data.rows.T) ** 2
                    of_size += log_density_by_modes(
                        left2, along2, noise[:, c], data.gain, data.num_values
                    )
        mean = np.asarray(logsumexp(found - self._of_sizes[:, None], axis=0)) - np.log(len(found))
        mean = np.nan_to_num(mean, nan=IMPOSSIBLE, neginf=IMPOSSIBLE)
        return mean - 0.5 * np.sum(z**2, axis=1) + self._of_prior


class Rolled(NamedTuple):
    """What a clip's part of a chain's density is compiled for; `num_records` is rounded up."""

    roll_out: Callable[..., Any]
    effects: tuple[Effect, ...]
    names: tuple[str, ...]
    num_records: int
    kind: Kind


class Part(NamedTuple):
    """A clip's data, and its covariances C_k = s^2 D + L B^T V_k^T g_k^2 V_k B L^T, by sizes k."""

    clip: ClipArrays  # as of a fit
    priors: PriorTable  # of its parameters
    column: Any  # `[parameter]`, where these stand among those of all clips
    seen: Any  # `[name]`, where those stand that change what is seen; as of `Share.columns`
    absent: Any  # as of `Share.absent`
    last_record: Any  # the model's last, where rollouts end
    basis: Any  # B `[mode, value]`, orthonormal rows, in the stated errors
    turned: Any  # V_k `[size, mode, mode]`, orthonormal rows, or 0
    gain: Any  # g_k `[size, mode]`


def density_of(
    trials: JointProblem, fit: GradientFit | None = None, valley: Valley | None = None
) -> "LogDensity":
    """The log density of one `z` in JAX; a `Program` where the engines are, which clips share.

    `fit`: of them, over whose sizes of imperfections is integrated, if it has any. `valley`: the
    density is one of its w, not of z.
    """
    from galileo_jax.inference.samplers.program import Program

    draws, of_sizes = sizes_of(trials, fit, LEAST_SIZES)
    rolled, parts = [], []
    for index, problem in enumerate(trials.problems):
        clip = FittedClip.of(trials, index)
        rolled.append(_rolled(problem))
        last, own = np.asarray(problem.model.num_records), problem.share
        where = (clip.priors, clip.column, own.columns, own.absent)
        parts.append(Part(clip.arrays, *where, last, *_covariances(clip, draws)))
    data = jax.tree.map(jnp.asarray, (tuple(parts), of_sizes, valley))
    if all(hasattr(problem.engine, "roll_out") for problem in trials.problems):
        return Program((log_density, tuple(rolled)), data)
    return functools.partial(log_density, tuple(rolled), data)


def _rolled(problem: Problem) -> Rolled:
    model, engine = problem.model, problem.engine

    def called_back(effects: Any, names: Any, count: Any, dt: Any, theta: jax.Array, scene: Any):
        return tuple(values[0] for values in in_jax(engine)(theta[None]))

    effects, count = model.effects + model.nuisances, model.num_records + 1
    roll_out = getattr(engine, "roll_out", None)
    long = count if roll_out is None else rounded_up(count, RECORDS)
    return Rolled(roll_out or called_back, effects, model.names, long, problem.kind)


def log_density(
    rolled: tuple[Rolled, ...],
    data: tuple[tuple[Part, ...], jax.Array, Valley | None],
    point: jax.Array,
) -> jax.Array:
    """The unnormalised posterior density of one point; -inf where a rollout failed."""
    parts, of_sizes, valley = data
    z = point if valley is None else valley(point)
    noise = jnp.exp(NOISE_SD * z[-len(parts) :])
    each = zip(rolled, parts, noise, strict=True)
    found = jnp.sum(jnp.stack([_of_clip(how, part, z, scale) for how, part, scale in each]), axis=0)
    total = jax.nn.logsumexp(found - of_sizes) - jnp.log(len(of_sizes)) - 0.5 * jnp.sum(z**2)
    return jnp.where(jnp.isfinite(total), total, -jnp.inf)


def _of_clip(how: Rolled, part: Part, z: jax.Array, noise: jax.Array) -> jax.Array:
    """The log likelihood of a clip, `[size]`."""
    clip, kind = part.clip, how.kind
    theta = part.priors.forward(z[part.column])
    position, velocity = how.roll_out(
        how.effects, how.names, how.num_records, kind.record_dt_s, theta, clip.scene
    )
    # As `padded_motion`: at rest beyond its end.
    is_over = jnp.arange(how.num_records) > part.last_record
    end = jnp.take(position, part.last_record, axis=-1)[..., None]
    position, velocity = jnp.where(is_over, end, position), jnp.where(is_over, 0.0, velocity)
    own = jnp.concatenate([theta, part.absent])[part.seen]
    left = left_of(kind, own, position, velocity, clip)
    along2 = jnp.einsum("kmn,n->km", part.turned, part.basis @ left) ** 2
    found = log_density_by_modes(
        jnp.sum(left**2), along2, noise, part.gain, clip.whitening.num_values
    )
    return jnp.where(jnp.any(jnp.abs(left) >= FAILED), -jnp.inf, found)


def _covariances(clip: FittedClip, draws: list[Sizes]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Basis, turned and gain of a `Part`, padded as the clip is."""
    named = [sizes for sizes in draws if sizes is not None]
    largest = {name: max(own[name] for own in named) for name in named[0]} if named else None
    whole = clip.problem.with_sizes(largest).data
    basis = whole.rows
    count = max(rounded_up(len(basis), FRAMES), len(clip.whitening.gain))
    turned, gain = np.zeros((len(draws), count, count)), np.zeros((len(draws), count))
    for k, sizes in enumerate(draws):
        data = clip.problem.with_sizes(sizes).data
        patterns = data.gain[:, None] * data.rows
        _, own, vectors = np.linalg.svd(patterns @ basis.T, full_matrices=False)
        turned[k, : len(own), : len(basis)], gain[k, : len(own)] = vectors, own
    frames = clip.whitening.observed_m.shape[-1] - whole.basis.shape[-1]
    padded = np.pad(whole.basis, [(0, count - len(basis)), (0, 0), (0, 0), (0, frames)])
    return padded.reshape(count, -1), turned, gain

"""A fit as ArviZ's InferenceData: what its plots and comparisons of models need.

    posterior, sample_stats   draws of all parameters, as in posterior.nc
    prior                     draws of the same parameters before the data
    observed_data             the measured positions, one number after the other
    posterior_predictive      what the fitted model would have measured, noise included
    log_likelihood            log p(y_i | y_-i) of every measured number

Positions stand along one dimension `measurement`, as gaps (NaN) are allowed neither by `az.loo` nor
by `az.plot_ppc`; its coordinates `clip`, `object`, `axis`, `frame` and `time_s` say what is what.

Leave-one-out weighs draws by 1 / p(y_i | y_-i), so that a few draws far out would decide. Where
those of `--method grad` come from a normal approximation, draws are drawn again for
`log_likelihood`, with the weights posterior density over the density that they were drawn from,
smoothed (PSIS). The attribute `importance_pareto_k` says whether that was possible: above 0.7
`az.loo` is not to be trusted. Where draws were weighed before (`inference/fit_posterior.py`), the
attribute `importance_ess` says how many of the posterior they are worth.

Source: Vehtari, Simpson, Gelman, Yao and Gabry (2024), Pareto smoothed importance sampling, Journal
of Machine Learning Research 25(72); Magnusson, Andersen, Jonasson and Vehtari (2019), Bayesian
leave-one-out cross-validation for large data, ICML.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.inference.convergence import arviz
from galileo_jax.inference.fit_posterior import TOO_FEW
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.posterior import ESS, Posterior, Status
from galileo_jax.inference.resampled import resampled
from galileo_jax.model.parameters import inverse
from galileo_jax.runtime.lazy import xr
from galileo_jax.similarity.conditional import conditional_log_density, noise_draws, noise_sd_m
from galileo_jax.similarity.gaussian_likelihood import Whitening

if TYPE_CHECKING:
    from arviz import InferenceData

NUM_PRIOR_DRAWS = 1000
NUM_PREDICTIVE_DRAWS = 200
NUM_LIKELIHOOD_DRAWS = 1000
NUM_WEIGHTED_DRAWS = 4000  # of which those are drawn again
OPEN_M = 0.5
"""Coordinates with more noise are ignored by the likelihood (across a fall): they are left out."""

FAR_M = 1e3  # the position of a rollout that failed: no likelihood to speak of, but finite


def inference_data(trials: JointProblem, posterior: Posterior, seed: int = 0) -> "InferenceData":
    """All that ArviZ asks of a fit; `az.summary`, `az.plot_ppc` and `az.loo` work on it.

    Of the posterior's draws evenly many of every chain are rolled out: at most
    `NUM_PREDICTIVE_DRAWS` for `posterior_predictive`, `NUM_LIKELIHOOD_DRAWS` for
    `log_likelihood`; their coordinate `draw` says which (it only counts draws drawn again).

    Returns:
      groups as in the module. Every variable has the attribute `units`. Written by `to_netcdf` and
      read by `Posterior.from_netcdf` it is the same posterior.

    Raises:
      ValueError: the posterior is of other parameters.

    Limits: draws whose density is not known (of the network, of the thesis's sampler) are not
    weighted: `log_likelihood` is then as good as they are.
    """
    if posterior.names != trials.names:
        raise ValueError(f"posterior of {posterior.names}, but the model has {trials.names}")
    rng = np.random.default_rng([seed, 30])
    units = {parameter.name: parameter.unit for parameter in trials.parameters}
    data = posterior.to_inference_data()
    for name in posterior.names:
        data["posterior"][name].attrs["units"] = units[name]
    z = rng.standard_normal((1, NUM_PRIOR_DRAWS, len(trials.parameters)))
    before = trials.theta(z)
    prior = {
        name: (("chain", "draw"), before[..., i], {"units": units[name]})
        for i, name in enumerate(trials.names)
    }
    measurement = _measurement(trials)
    along = ("chain", "draw", "measurement")
    indices, theta = _thinned(posterior, NUM_PREDICTIVE_DRAWS)
    rolled_out = _rolled_out(trials, theta.reshape(-1, theta.shape[-1]))
    predicted = [position + noise_draws(rng, scale, data) for data, position, scale in rolled_out]
    nats = {"units": "1", "long_name": "log p(y_i | y_-i), y in m"}
    if _is_weighed(posterior):
        nats["importance_ess"] = f"{posterior.provenance[ESS]:.3g}"
    if _has_density(posterior) and not _is_weighed(posterior):
        like_theta, pareto_k = _drawn_again(trials, posterior, rng)
        like_indices, like_theta = np.arange(len(like_theta)), like_theta[None]
        nats["importance_pareto_k"] = f"{pareto_k:.3g}"
    else:
        like_indices, like_theta = _thinned(posterior, NUM_LIKELIHOOD_DRAWS)
    rolled_out = _rolled_out(trials, like_theta.reshape(-1, theta.shape[-1]))
    density = [
        conditional_log_density(data.observed_m - position, scale, data)
        for data, position, scale in rolled_out
    ]

    def group(values: list[np.ndarray], at: np.ndarray, attrs: dict[str, str]) -> "xr.Dataset":
        chosen = _chosen(trials, values)
        shaped = chosen.reshape(-1, len(at), chosen.shape[-1])
        coords = {**measurement, "chain": np.arange(len(shaped)), "draw": at}
        return xr.Dataset({"position": (along, shaped, attrs)}, coords)

    observed = _chosen(trials, [problem.data.observed_m[None] for problem in trials.problems])[0]
    index = {"chain": [0], "draw": np.arange(NUM_PRIOR_DRAWS)}
    metres = {"units": "m", "long_name": "position"}
    seen = {"position": ("measurement", observed, metres)}
    data.add_groups(
        prior=xr.Dataset(prior, index),
        posterior_predictive=group(predicted, indices, metres),
        log_likelihood=group(density, like_indices, nats),
        observed_data=xr.Dataset(seen, measurement),
    )
    return data


def _is_compared(trials: JointProblem) -> list[np.ndarray]:
    """For each clip `[object, 2, frame]`, what was measured and means something."""
    found = []
    for problem in trials.problems:
        seen = np.broadcast_to(problem.observation.mask[:, None], problem.data.observed_m.shape)
        found.append(seen & (noise_sd_m(problem.data) < OPEN_M))
    return found


def _chosen(trials: JointProblem, values: list[np.ndarray]) -> np.ndarray:
    """Of each clip's values `[draw, object, 2, frame]` those compared, `[draw, measurement]`."""
    chosen = zip(values, _is_compared(trials), strict=True)
    return np.concatenate([value[:, compared] for value, compared in chosen], axis=1)


def _measurement(trials: JointProblem) -> dict[str, tuple]:
    """The coordinates of the dimension `measurement`, as xarray takes them."""
    parts = []
    for problem, compared in zip(trials.problems, _is_compared(trials), strict=True):
        thing, axis, frame = np.nonzero(compared)
        seen = problem.observation
        clip = np.full(len(frame), problem.name)
        time_s = seen.times_s[frame]
        parts.append((clip, np.array(seen.names)[thing], np.array(seen.axes)[axis], frame, time_s))
    columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
    named = dict(zip(("clip", "object", "axis", "frame", "time_s"), columns, strict=True))
    units = {"time_s": {"units": "s"}}
    along = {name: ("measurement", values, units.get(name, {})) for name, values in named.items()}
    return {"measurement": ("measurement", np.arange(len(columns[0]))), **along}


def _thinned(posterior: Posterior, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Evenly chosen draws of every chain: which, `[draw]`, and they, `[chain, draw, parameter]`."""
    chains, length, _ = posterior.draws.shape
    count = min(length, max(1, most // chains))
    at = np.linspace(0, length - 1, count).round().astype(int)
    return at, posterior.draws[:, at].astype(float)


def _is_weighed(posterior: Posterior) -> bool:
    """Whether draws are of the posterior itself, by weights that are known no more."""
    return posterior.provenance.get(ESS, 0.0) >= TOO_FEW


def _has_density(posterior: Posterior) -> bool:
    """Whether `log_density` is that of the draws in z, up to a constant.

    Chains run in coordinates of constant determinant (`fits/transport_map.py`).
    """
    of_chains = "sampler" in posterior.provenance and posterior.status is not Status.FIXED_LENGTH
    return of_chains or posterior.provenance.get("method") == "grad"


def _drawn_again(
    trials: JointProblem, posterior: Posterior, rng: np.random.Generator
) -> tuple[np.ndarray, float]:
    """Draws of the posterior, `[draw, parameter]`, out of draws near it; the Pareto shape."""
    at, thinned = _thinned(posterior, NUM_WEIGHTED_DRAWS)
    theta = thinned.reshape(-1, thinned.shape[-1])
    z = inverse(trials.parameters, np.asarray(theta))
    weights = -0.5 * np.sum(z**2, axis=1) - posterior.log_density[:, at].reshape(-1)
    for data, position, scale in _rolled_out(trials, theta):
        weights += np.asarray(_log_densities(jnp.asarray(position), jnp.asarray(scale), data))
    smoothed, pareto_k = arviz().psislw(weights)
    which = resampled(np.asarray(smoothed), min(len(theta), NUM_LIKELIHOOD_DRAWS), rng)
    return theta[which], float(pareto_k)


_log_densities = jax.jit(
    jax.vmap(lambda seen, scale, data: data.log_density(seen, scale), (0, 0, None))
)


def _rolled_out(
    trials: JointProblem, theta: np.ndarray
) -> Iterator[tuple[Whitening, np.ndarray, np.ndarray]]:
    """Each clip's data, positions `[draw, object, 2, frame]`, m, and noise scales `[draw]`."""
    for clip, problem in enumerate(trials.problems):
        position = problem.simulate_batch(trials.of_clip(theta, clip))
        position = np.nan_to_num(position, nan=FAR_M, posinf=FAR_M, neginf=-FAR_M)
        yield problem.data, position, theta[:, len(trials.model_parameters) + clip]

"""The amortised posterior of any ramp clip: data, network, loss, and what it is tested on."""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from flax import nnx

from galileo_jax.model.model import FRICTION_PRIOR, MASS_PRIOR
from galileo_jax.neural.config import TrainConfig
from galileo_jax.neural.posterior_network import (
    PosteriorNetwork,
    from_u,
    negative_log_density,
    to_u,
)
from galileo_jax.neural.seen import NUM_FRAMES, Seen
from galileo_jax.neural.summary import NUM_CHANNELS, NUM_FEATURES, summarise
from galileo_jax.neural.task import BENCHMARKS, PRESETS, Arrays
from galileo_jax.neural.world import IDEAL_FRICTION, Truth, draw, targets
from galileo_jax.runtime.errors import InputError

QUANTITIES = ("k1", "phi", "k2")
NUM_DRAWS = 1000
INTERVAL = (0.05, 0.95)
SHRINK = 0.01  # of the features' covariance towards the unit matrix
USUAL = 0.999
MARGIN = 0.03  # of the training features' range


class Estimates(NamedTuple):
    """Draws of k1, mass ratio and k2, each `[..., draw]`."""

    k1: np.ndarray
    mass_ratio: np.ndarray
    k2: np.ndarray


@PRESETS.register
class GalileoTask:
    """Data, network and loss of preset `galileo`."""

    name = "galileo"
    loss = staticmethod(negative_log_density)
    shard_size = 8192

    def __init__(self, config: TrainConfig):
        """Takes a config.

        Raises:
          InputError: its engine is not the rigid one.
        """
        if config.engine not in ("auto", "rigid"):
            raise InputError(
                f"engine: {config.engine}: preset galileo has another scene in every sample, "
                "which the rigid engine alone rolls out in batches"
            )
        self.config = config

    def network(self, seed: int, data: Arrays | None = None) -> PosteriorNetwork:
        """A new network; `data` set its idea of what is usual."""
        network = PosteriorNetwork(NUM_FEATURES, NUM_CHANNELS, NUM_FRAMES, nnx.Rngs(seed))
        if data is not None:
            _standardise(network, data["features"])
        return network

    def make(self, key: jax.Array, count: int) -> Arrays:
        """Samples of `world.py` in which object 1 moves."""
        made = []
        for part in jax.random.split(key, -(-count // 1024)):
            sample = _samples(jax.random.split(part, min(count, 1024)))
            made.append({name: np.asarray(values) for name, values in sample.items()})
        return {name: np.concatenate([m[name] for m in made])[:count] for name in made[0]}

    def test(self, network: PosteriorNetwork, data: Arrays, seed: int) -> dict[str, float]:
        """Errors and coverage, in every benchmark's setting and on clips of all kinds."""
        found: dict[str, float] = {}
        for name, benchmark in BENCHMARKS.items():
            drawn = benchmark.draw(jax.random.key(seed), len(data["features"]))
            found |= _score(network, drawn, seed, f"{name}: ")
        clips = {name: values[data["is_ideal"] == 0] for name, values in data.items()}
        return found | _score(network, clips, seed, "clips: ")

    def reference(self) -> dict[str, float]:
        """What is expected in the benchmarks."""
        return {
            f"{name}: {figure}": value
            for name, benchmark in BENCHMARKS.items()
            for figure, value in benchmark.reference.items()
        }


def to_sample(seen: Seen, truth: Truth) -> dict[str, jax.Array]:
    """What training needs of one clip."""
    summary = summarise(seen)
    target = targets(truth)
    single = jnp.float32
    return {
        "features": summary.features.astype(single),
        "profile": summary.profile.astype(single),
        "u": to_u(target, summary.centre, summary.scale).astype(single),
        "centre": summary.centre.astype(single),
        "scale": summary.scale.astype(single),
        "truth": jnp.stack(truth).astype(single),
        "moves": summary.moves,
        "is_hit": summary.is_hit,
        "is_ideal": seen.is_ideal.astype(single),
    }


_samples = jax.jit(jax.vmap(lambda key: to_sample(*draw(key))))


def _standardise(network: PosteriorNetwork, features: np.ndarray) -> None:
    """Sets mean, spread and the usual distance from training features."""
    mean, sd = features.mean(0), features.std(0)
    network.mean[...] = jnp.asarray(mean)
    network.sd[...] = jnp.asarray(np.where(sd > 1e-6, sd, 1.0))
    low, high = features.min(0), features.max(0)
    network.low[...] = jnp.asarray(low - MARGIN * (high - low))
    network.high[...] = jnp.asarray(high + MARGIN * (high - low))
    values = np.asarray(network.standardised(jnp.asarray(features)), np.float64)
    covariance = values.T @ values / len(values)
    covariance = (1 - SHRINK) * covariance + SHRINK * np.eye(len(mean))
    root = np.linalg.inv(np.linalg.cholesky(covariance)).T
    network.whitening[...] = jnp.asarray(root, jnp.float32)
    distance = np.asarray(network.distance(jnp.asarray(features)))
    network.usual_distance[...] = jnp.asarray(np.quantile(distance, USUAL), jnp.float32)


@functools.partial(nnx.jit, static_argnums=4)
def _draw(network: PosteriorNetwork, key, features, profile, count: int):
    return network.draw(key, features, profile.astype(features.dtype), count)


def estimate(
    network: PosteriorNetwork, sample: Arrays, seed: int, count: int = NUM_DRAWS
) -> Estimates:
    """Draws for a batch of samples; the prior where a clip cannot tell: `[sample, draw]` each.

    Where object 1 does not move, its friction is anything from the ramp's slope upwards; that
    is left to the caller, who knows the slope.
    """
    u = _draw(network, jax.random.key(seed), sample["features"], sample["profile"], count)
    centre, scale = (jnp.asarray(sample[name])[:, None] for name in ("centre", "scale"))
    t = np.array(from_u(jnp.asarray(u, float), centre, scale))
    generator = np.random.default_rng([seed, 5])
    untold = ~np.asarray(sample["is_hit"])
    t[untold, :, 1:] = generator.standard_normal((int(untold.sum()), count, 2))
    untold &= np.asarray(sample["is_ideal"], bool)
    t[untold, :, 1:] = _of_ideal_prior(generator, (int(untold.sum()), count))
    ratio = np.exp(np.sqrt(2) * MASS_PRIOR.sd * t[..., 1])
    return Estimates(
        np.asarray(FRICTION_PRIOR.forward(jnp.asarray(t[..., 0]))),
        ratio,
        np.asarray(FRICTION_PRIOR.forward(jnp.asarray(t[..., 2]))),
    )


def _of_ideal_prior(generator: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
    """The mass ratio's and k2's targets in the ideal world, `[*shape, 2]`."""
    m1, m2 = generator.uniform(1e-9, 1.0, (2, *shape))
    friction = jnp.asarray(generator.uniform(*IDEAL_FRICTION, shape))
    return np.asarray(targets(Truth(friction, friction, jnp.asarray(m1 / m2))))[..., 1:]


def _score(network: PosteriorNetwork, data: Arrays, seed: int, label: str) -> dict[str, float]:
    draws = estimate(network, data, seed)
    k1, k2, ratio = data["truth"].T
    is_known = data.get("collides", data["is_hit"]) & data["moves"]
    cases = {
        "k1": (draws.k1, k1, data["moves"]),
        "phi": (_phi(draws.mass_ratio), _phi(ratio), is_known),
        "k2": (draws.k2, k2, is_known),
    }
    found: dict[str, float] = {f"{label}collisions": float(is_known.mean())}
    for name, (drawn, true, where) in cases.items():
        low, high = np.quantile(drawn, INTERVAL, axis=1)
        error = np.abs(np.mean(drawn, axis=1) - true)[where]
        found[f"{label}{name} MAE"] = float(error.mean())
        found[f"{label}{name} median"] = float(np.median(error))
        found[f"{label}{name} MAE of medians"] = float(
            np.abs(np.median(drawn, axis=1) - true)[where].mean()
        )
        found[f"{label}{name} in 90 %"] = float(np.mean(((low <= true) & (true <= high))[where]))
        found[f"{label}{name} width"] = float(np.median((high - low)[where]))
    return found


def _phi(ratio: np.ndarray) -> np.ndarray:
    return (ratio - 1) / (ratio + 1)

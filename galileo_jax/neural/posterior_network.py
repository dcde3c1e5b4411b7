"""An amortised posterior: from a clip's summary to the density of k1, mass ratio and k2.

    t        k1, log m1/m2, k2, each where the prior of the fit is standard normal
    u        asinh((t - centre) / scale), with the closed-form estimates of summary.py
    p(u | summary) = prod_i  sum_j w_ij N(u_i; mu_ij, sd_ij),
                     (w, mu, sd)_i = network(summary, u_1 ... u_(i-1))

The network learns corrections of estimates and their errors, not physics from nothing; asinh
leaves room for estimates that are wrong altogether. An autoregressive mixture density has any
shape in one dimension and any dependence between them, is exact to evaluate and to draw from.

Source: C. Bishop (1994), Mixture density networks; G. Papamakarios and I. Murray (2016),
arXiv 1605.06376.
"""

import itertools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from flax import nnx

NUM_TARGETS = 3
FILTERS, KERNELS = (32, 32), (8, 2)  # strides as wide as kernels: products of matrices
WIDTH, NUM_COMPONENTS = 128, 6  # of what conditions the density; of each number's mixture
LARGEST_FEATURE = 8.0
LARGEST_T = 6.0
LEAST_LOG_SD, MOST_LOG_SD = -5.0, 2.0


class Mixture(NamedTuple):
    """Of one number: logarithms of weights, means, standard deviations, `[..., component]`."""

    log_weight: jax.Array
    mean: jax.Array
    sd: jax.Array

    def log_density(self, u: jax.Array) -> jax.Array:
        """Of `u` `[...]`."""
        z = (u[..., None] - self.mean) / self.sd
        normal = -0.5 * z**2 - jnp.log(self.sd) - 0.5 * jnp.log(2 * jnp.pi)
        return jax.nn.logsumexp(self.log_weight + normal, axis=-1)


class Constant(nnx.Variable):
    """What is set from the data once, and not learned."""


class PosteriorNetwork(nnx.Module):
    """The conditional density; see the module."""

    def __init__(
        self,
        num_features: int,
        num_channels: int,
        num_frames: int,
        rngs: nnx.Rngs,
    ):
        sizes = (num_channels, *FILTERS)
        self.convolutions = nnx.List(
            [
                nnx.Linear(kernel * a, b, rngs=rngs)
                for kernel, (a, b) in zip(KERNELS, itertools.pairwise(sizes), strict=True)
            ]
        )
        flat = FILTERS[-1] * num_frames // math.prod(KERNELS)
        self.profile = nnx.Linear(flat, 64, rngs=rngs)
        self.trunk1 = nnx.Linear(num_features + 64, WIDTH, rngs=rngs)
        self.trunk2 = nnx.Linear(WIDTH, WIDTH, rngs=rngs)
        self.inner = nnx.List([nnx.Linear(WIDTH + i, 64, rngs=rngs) for i in range(NUM_TARGETS)])
        self.outer = nnx.List(
            [nnx.Linear(64, 3 * NUM_COMPONENTS, rngs=rngs) for _ in range(NUM_TARGETS)]
        )
        # Of the training features: mean and spread, their range and a little more, and what whitens
        # them when they are standardised. Hardly a training clip is farther from the others.
        self.mean = Constant(jnp.zeros(num_features))
        self.sd = Constant(jnp.ones(num_features))
        self.low = Constant(jnp.full(num_features, -jnp.inf))
        self.high = Constant(jnp.full(num_features, jnp.inf))
        self.whitening = Constant(jnp.eye(num_features))
        self.usual_distance = Constant(jnp.asarray(jnp.inf))

    def standardised(self, features: jax.Array) -> jax.Array:
        """Features in units of their spread in training."""
        values = (features - self.mean[...]) / self.sd[...]
        return jnp.clip(values, -LARGEST_FEATURE, LARGEST_FEATURE)

    def distance(self, features: jax.Array) -> jax.Array:
        """How unlike the training clips, root mean square of whitened features: `[...]`."""
        white = self.standardised(features) @ self.whitening[...]
        return jnp.sqrt(jnp.mean(white**2, axis=-1))

    def outside(self, features: jax.Array) -> jax.Array:
        """Which features no training clip comes near, `[..., feature]`."""
        return (features < self.low[...]) | (features > self.high[...])

    def trunk(self, features: jax.Array, profile: jax.Array) -> jax.Array:
        """What conditions the density, `[batch, width]`."""
        x = jnp.swapaxes(profile, -1, -2)
        for kernel, convolution in zip(KERNELS, self.convolutions, strict=True):
            x = nnx.gelu(convolution(x.reshape(len(x), -1, kernel * x.shape[-1])))
        x = nnx.gelu(self.profile(x.reshape(len(x), -1)))
        x = jnp.concatenate([self.standardised(features), x], axis=-1)
        x = nnx.gelu(self.trunk1(x))
        return x + nnx.gelu(self.trunk2(x))

    def mixture(self, i: int, trunk: jax.Array, before: jax.Array) -> Mixture:
        """The density of `u_i` given those `before` it, `[..., i]`."""
        hidden = nnx.gelu(self.inner[i](jnp.concatenate([trunk, before], axis=-1)))
        weight, mean, log_sd = jnp.split(self.outer[i](hidden), 3, axis=-1)
        # Components start apart, from narrow to wide.
        spread = jnp.linspace(-1.5, 1.5, NUM_COMPONENTS)
        log_sd = jnp.clip(log_sd + spread, LEAST_LOG_SD, MOST_LOG_SD)
        return Mixture(jax.nn.log_softmax(weight), mean, jnp.exp(log_sd))

    def log_density(self, features: jax.Array, profile: jax.Array, u: jax.Array) -> jax.Array:
        """Of each `u_i` given those before: `[batch, 3]`."""
        trunk = self.trunk(features, profile)
        terms = [
            self.mixture(i, trunk, u[..., :i]).log_density(u[..., i]) for i in range(NUM_TARGETS)
        ]
        return jnp.stack(terms, axis=-1)

    def draw(
        self, key: jax.Array, features: jax.Array, profile: jax.Array, count: int
    ) -> jax.Array:
        """Draws of u for a batch of clips: `[batch, count, 3]`."""
        trunk = self.trunk(features, profile)
        trunk = jnp.repeat(trunk[:, None], count, axis=1)
        u = jnp.zeros((*trunk.shape[:2], 0))
        for i in range(NUM_TARGETS):
            mixture = self.mixture(i, trunk, u)
            key, which, how = jax.random.split(key, 3)
            component = jax.random.categorical(which, mixture.log_weight)[..., None]
            mean = jnp.take_along_axis(mixture.mean, component, axis=-1)
            sd = jnp.take_along_axis(mixture.sd, component, axis=-1)
            drawn = mean + sd * jax.random.normal(how, mean.shape, mean.dtype)
            u = jnp.concatenate([u, drawn], axis=-1)
        return u


def to_u(t: jax.Array, centre: jax.Array, scale: jax.Array) -> jax.Array:
    """Targets as the network sees them."""
    return jnp.arcsinh((t - centre) / scale)


def from_u(u: jax.Array, centre: jax.Array, scale: jax.Array) -> jax.Array:
    """The inverse; far tails are cut at six standard deviations of the prior."""
    return jnp.clip(centre + scale * jnp.sinh(u), -LARGEST_T, LARGEST_T)


def negative_log_density(network: PosteriorNetwork, batch: dict[str, jax.Array]) -> jax.Array:
    """The mean over what each clip can tell (k1; ratio and k2 where there is a hit)."""
    u = batch["u"]
    density = network.log_density(batch["features"], batch["profile"].astype(u.dtype), u)
    is_known = jnp.stack([batch["moves"], batch["is_hit"], batch["is_hit"]], axis=-1)
    return -jnp.sum(jnp.where(is_known, density, 0.0)) / jnp.maximum(is_known.sum(), 1)

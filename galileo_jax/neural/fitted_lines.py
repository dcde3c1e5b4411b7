"""Parabolas, decays and straight lines through the masked frames of one object, in pure JAX."""

from typing import NamedTuple

import jax
import jax.numpy as jnp


class Estimate(NamedTuple):
    """A number `[]` and its standard deviation."""

    value: jax.Array
    sd: jax.Array


class Line(NamedTuple):
    """A fitted parabola `value + slope (t - at) + curve (t - at)^2 / 2`."""

    value: jax.Array
    slope: jax.Array
    curve: jax.Array
    at_s: jax.Array
    curve_sd: jax.Array
    slope_sd: jax.Array

    def __call__(self, time_s: jax.Array) -> jax.Array:
        """The parabola at a time."""
        t = time_s - self.at_s
        return self.value + self.slope * t + self.curve * t**2 / 2

    def speed(self, time_s: jax.Array) -> jax.Array:
        """Its slope at a time."""
        return self.slope + self.curve * (time_s - self.at_s)


class Decay(NamedTuple):
    """A motion that comes to rest: `end - rate (stop - t)^2 / 2`, from the line of its root."""

    rate: jax.Array
    stop_s: jax.Array
    rate_sd: jax.Array


def parabola(t: jax.Array, y: jax.Array, mask: jax.Array, noise: jax.Array) -> Line:
    """Least squares through the masked frames; wide errors where they are too few."""
    weight = mask.astype(y.dtype)
    count = weight.sum()
    at = (weight * t).sum() / jnp.maximum(count, 1)
    span = jnp.sqrt((weight * (t - at) ** 2).sum() / jnp.maximum(count, 1)) + 1e-6
    u = (t - at) / span
    design = jnp.stack([jnp.ones_like(u), u, u**2 / 2])
    ridge = 1e-9 * jnp.eye(3)
    covariance = jnp.linalg.inv((design * weight) @ design.T + ridge)
    base = (weight * y).sum() / jnp.maximum(count, 1)
    c = covariance @ (design @ (weight * (y - base)))
    sd = noise * jnp.sqrt(jnp.diagonal(covariance))
    return Line(c[0] + base, c[1] / span, c[2] / span**2, at, sd[2] / span**2, sd[1] / span)


def decay(t: jax.Array, left: jax.Array, mask: jax.Array, noise: jax.Array) -> Decay:
    """Fits `sqrt(2 left) = sqrt(rate) (stop - t)`, weighted for equal errors of `left`."""
    root = jnp.sqrt(2 * jnp.maximum(left, 1e-9))
    at, mean, slope, per_noise = straight(t, root, jnp.where(mask, root**2, 0.0), 1e-12)
    slope = jnp.minimum(slope, -1e-3)
    return Decay(slope**2, at - mean / slope, 2 * jnp.abs(slope) * noise * per_noise)


def straight(
    t: jax.Array, y: jax.Array, weight: jax.Array, least: float
) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
    """The weighted straight line: its middle (t, y), its slope, and the slope's sd per noise."""
    total = jnp.maximum(weight.sum(), least)
    at, mean = (weight * t).sum() / total, (weight * y).sum() / total
    spread = jnp.maximum((weight * (t - at) ** 2).sum(), least)
    slope = (weight * (t - at) * (y - mean)).sum() / spread
    return at, mean, slope, 1 / jnp.sqrt(spread)


def combined(one: Estimate, other: Estimate) -> Estimate:
    """The mean by inverse variance."""
    weight, against = 1 / one.sd**2, 1 / other.sd**2
    total = weight + against
    return Estimate((weight * one.value + against * other.value) / total, 1 / jnp.sqrt(total))


def at_end(x: jax.Array, mask: jax.Array, noise: jax.Array) -> tuple[jax.Array, jax.Array]:
    """The mean place of the last frames that stay in one, and how many they are."""
    last = x.shape[0] - 1 - jnp.argmax(mask[::-1])
    near = mask & (jnp.abs(x - x[last]) < jnp.maximum(4 * noise, 5e-5))
    # Only an unbroken rest counts: the same place on the way is no rest.
    frames = jnp.arange(x.shape[0])
    away = jnp.where(mask & ~near, frames, -1).max()
    near = near & (frames > away)
    count = near.sum()
    return jnp.where(near, x, 0.0).sum() / jnp.maximum(count, 1), count

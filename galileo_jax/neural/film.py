"""What a camera, a coder and bodies that are no points add to the network's drawn motions.

In a fit the same imperfections are covariance (`similarity/discrepancy.py`,
`similarity/hit_discrepancy.py`, `measurement/errors_at_rest.py`); here they are drawn.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp

from galileo_jax.measurement.errors_at_rest import LEAST_SCALE, SHIFT_SHARE
from galileo_jax.similarity import discrepancy, hit_discrepancy

NUM_WAVES = 8
RESTS_M_S = 1e-4  # what is slower rests, in a motion without noise

Normal = Callable[..., jax.Array]
"""Independent standard normal numbers of a shape; new ones with each call."""


class Bodies(NamedTuple):
    """What of a scene decides how bodies that are no points differ from points."""

    angle_rad: jax.Array  # of the ramp
    half_length_m: jax.Array  # `[object]`
    foot_m: jax.Array  # how far past the foot an object lies on the table alone
    mass_kg: jax.Array  # `[object]`


def measured(
    position: jax.Array,
    times: jax.Array,
    bodies: Bodies,
    is_filmed: jax.Array,
    is_tracked_here: jax.Array,
    normal: Normal,
) -> jax.Array:
    """Centres `[object, 2, frame]`, m, of bodies that are no points, but for the noise.

    `position`: of points, the same shape. `is_filmed`: 1.0 where a camera sees them, 0.0 where none
    does. `is_tracked_here`: 1.0 where our own tracker follows them.
    """
    x = position[:, 0]
    extra = is_filmed * _by_camera(position, normal)
    extra += discrepancy.POINT_SD_M * normal((2, 2, 1))
    extra = extra.at[0].add(_step_at_foot(x[0], bodies, normal))
    extra += _wobble(x, times, bodies, normal)
    gone = jnp.abs(x[1] - x[1, 0])
    is_after = gone > 1e-6
    at_hit = jnp.where(is_after.any(), x[:, jnp.argmax(is_after)], x[:, -1])
    along = hit_discrepancy.IMPULSE_SD * normal((2, 1)) * (x - at_hit[:, None])
    step = hit_discrepancy.HIT_STEP_SD_M * normal((2, 1))
    # What moves no more drifts no more, and nothing pushes it any further.
    moves = jnp.abs(jnp.diff(x, prepend=x[:, :1])) > 1e-7
    moving_s = jax.lax.cummax(jnp.where(moves, times, 0.0), axis=1)
    drift_sd_m = jnp.where(
        is_tracked_here > 0, hit_discrepancy.OWN_DRIFT_SD_M, hit_discrepancy.HIT_DRIFT_SD_M
    )
    wave = _wave(moving_s / hit_discrepancy.HIT_DRIFT_S, (2,), normal)
    drift = is_filmed * drift_sd_m * wave
    further = _apart_after_hit(x, times, is_after, bodies, normal)
    m1, m2 = bodies.mass_kg
    shares = jnp.stack([-m2, m1]) / (m1 + m2)  # momentum is conserved
    pushed = shares[:, None] * _until_rest(further, moves & is_after)
    return position + extra.at[:, 0].add(jnp.where(is_after, along + step + drift + pushed, 0.0))


def _by_camera(position: jax.Array, normal: Normal) -> jax.Array:
    """How far a camera that is not quite square to the scene shifts what it sees, as `position`.

    Its scale is exact: how well it is known is added to the network's answer (`estimate.py`).
    """
    x, y = position[:, 0], position[:, 1]
    keystone = discrepancy.KEYSTONE_SD * normal((2,))
    shift = keystone[0] * jnp.stack([x * x, x * y], 1) + keystone[1] * jnp.stack([x * y, y * y], 1)
    return shift + discrepancy.ROLL_SD_RAD * normal() * jnp.stack([-y, x], 1)


def _step_at_foot(x: jax.Array, bodies: Bodies, normal: Normal) -> jax.Array:
    """The step that a point off the centre and a box's length make at the foot, `[2, frame]`."""
    half = 1.2 * bodies.half_length_m[0]
    share = jnp.clip((x - bodies.foot_m + half) / (2 * half), 0.0, 1.0)
    cos, sin = jnp.cos(bodies.angle_rad), jnp.sin(bodies.angle_rad)
    edge = bodies.half_length_m[0] / 2 * (1 - cos)
    sizes = jnp.hypot(discrepancy.POINT_SD_M * jnp.stack([sin, 1 - cos]), edge)
    return (sizes * normal((2,)))[:, None] * share


def _wobble(x: jax.Array, times: jax.Array, bodies: Bodies, normal: Normal) -> jax.Array:
    """How bodies rock and sink across their path, `[object, 2, frame]`."""
    # Frequencies of Cauchy's distribution, a ratio of normal numbers: an exponential correlation.
    frequency = normal((2, NUM_WAVES, 1)) / normal((2, NUM_WAVES, 1))
    wave = _wave(times / discrepancy.WOBBLE_S, (2,), normal, frequency)
    is_on_ramp = jnp.stack([x[0] < bodies.foot_m, jnp.zeros(x.shape[1], bool)])
    slope = jnp.where(is_on_ramp, bodies.angle_rad, 0.0)
    across = jnp.stack([jnp.sin(slope), jnp.cos(slope)], axis=1)
    return discrepancy.WOBBLE_SD_M * wave[:, None] * across


def _apart_after_hit(
    x: jax.Array, times: jax.Array, is_after: jax.Array, bodies: Bodies, normal: Normal
) -> jax.Array:
    """How much further apart than points the bodies come after a hit, `[frame]`, m."""
    steps = jnp.diff(times, prepend=times[:1] - (times[1] - times[0]))
    apart = x[1] - x[0] - bodies.half_length_m.sum()
    speed = jnp.diff(x, append=x[:, -1:]) / steps
    is_close = is_after & (apart < hit_discrepancy.CLOSE_M)
    is_close &= (speed > hit_discrepancy.STILL_M_S).all(axis=0)
    # Once they are apart, or one rests, it is over.
    is_over = jax.lax.cummax((is_after & ~is_close).astype(x.dtype)) > 0
    push = hit_discrepancy.PUSH_SD_M_S2 * _wave(times / hit_discrepancy.PUSH_S, (), normal)
    push = jnp.where(is_close & ~is_over, push, 0.0)
    gained = jnp.cumsum(push * steps)
    further = jnp.cumsum((gained - push * steps / 2) * steps)
    # A hit takes some milliseconds; what friction pulls the bodies apart meanwhile is missing.
    first = jnp.argmax(is_after)
    return (
        further
        - hit_discrepancy.HIT_END_S
        * _pulled_apart(speed, first, steps)
        * jnp.where(is_after, times - times[first], 0.0)
        * normal()
    )


def _pulled_apart(speed: jax.Array, first: jax.Array, steps: jax.Array) -> jax.Array:
    """By friction after a hit, m/s^2, from the two frames after it; 0 where it presses together."""
    ahead = speed[1] - speed[0]
    is_moving = (speed > hit_discrepancy.STILL_M_S).all(axis=0)
    rate = (ahead[first + 1] - ahead[first]) / steps[first + 1]
    return jnp.where(is_moving[first + 1], jnp.maximum(rate, 0.0), 0.0)


def _until_rest(values: jax.Array, moves: jax.Array) -> jax.Array:
    """Values `[frame]` for each object, held from where it comes to rest: `[object, frame]`."""
    frames = jnp.arange(values.shape[-1])
    last = jax.lax.cummax(jnp.where(moves, frames, 0), axis=1)
    return values[last]


def _wave(
    phase: jax.Array, shape: tuple[int, ...], normal: Normal, frequency: jax.Array | None = None
) -> jax.Array:
    """A random function of variance 1, `[..., frame]`; its correlation: that of the frequencies.

    By default these are normal, and it is exp(-phase^2 / 2).
    """
    frequency = normal((*shape, NUM_WAVES, 1)) if frequency is None else frequency
    start = 7 * normal((*shape, NUM_WAVES, 1))
    waves = normal((*shape, NUM_WAVES, 1)) * jnp.cos(frequency * phase[..., None, :] + start)
    return jnp.sqrt(2 / NUM_WAVES) * waves.sum(-2)


def noisy(
    position: jax.Array,
    seen: jax.Array,
    times: jax.Array,
    noise: jax.Array,
    scatter: jax.Array,
    normal: Normal,
) -> jax.Array:
    """What is seen, with the noise of a tracker and a coder.

    A coder shifts what moves from frame to frame, and what rests once: of an object at rest
    less scatters, and a share of what scatters less is one shift of the whole rest.

    Args:
      position: `[object, 2, frame]`, m, the motion itself, which tells who rests.
      seen: the same shape, see `measured`.
      times: `[frame]`, s.
      noise: `[object]`, m, of what moves.
      scatter: share of the noise that is independent in the frames of a rest, LEAST_SCALE to 1.
      normal: see `Normal`.
    """
    x = position[:, 0]
    speed = jnp.abs(jnp.diff(x, append=x[:, -1:])) / (times[1] - times[0])
    rests = (speed < RESTS_M_S)[:, None]
    has_moved = (jax.lax.cummax(speed, axis=1) >= RESTS_M_S)[:, None]
    scatter = jnp.clip(scatter, LEAST_SCALE, 1.0)
    before, after = normal((2, 2, 2, 1)) * jnp.sqrt(SHIFT_SHARE * (1 - scatter**2))
    shift = jnp.where(has_moved, after, before)
    each = normal(seen.shape)
    return seen + noise[:, None, None] * jnp.where(rests, shift + scatter * each, each)

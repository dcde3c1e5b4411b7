"""Closed-form estimates from a track: where the network starts from.

    ramp     s'' = g (sin a - k1 cos a)          a parabola through the frames on the ramp
    table    s'' = -k1 g                         another, between foot and hit
    hit      m1 (v1 - v1') = m2 v2'              momentum, whatever the rebound
    after    x(t) = x_end - d (t_end - t)^2 / 2, that is  sqrt(2 (x_end - x)) = sqrt(d) (t_end - t):
             a straight line through the frames that move; d = k2 g, or, where object 1 goes on
             pushing, (k1 m1 + k2 m2) g / (m1 + m2)

Each phase has constants of its own, so that neither the foot nor a point off the centre nor a
late release matters. The estimates know nothing of the camera, of a rebound that separates
the objects for a while, or of how good they are when few frames carry them: that is what the
network learns, as a correction and its error.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from galileo_jax.model.model import FRICTION_PRIOR, MASS_PRIOR
from galileo_jax.model.parameters import Uniform
from galileo_jax.neural.seen import Seen
from galileo_jax.similarity import discrepancy

AT_FOOT = 1.2  # half lengths either side of the foot where an object stands on two edges
MOVED_SD, MOVED_M = 6.0, 3e-4  # beyond doubt
LEAST_FRAMES = 4
# What a camera does to the two kinds of slopes (discrepancy.py), so that errors start realistic.
CAMERA_SD_M_S2 = 0.01
CAMERA_RATIO_SD = 0.02
QUARTIC = 0.02  # of t^4 / 4, what no parabola fits, root mean square
FOOT_SD, REBOUND, REBOUND_SD = 0.05, 0.012, 0.02

NUM_FEATURES, NUM_CHANNELS = 67, 8
# What features (by their place) say of the scene itself; for warnings.
DECLARED = {
    1: "the ramp's angle",
    2: "the frame rate",
    5: "object 1's tracking noise",
    6: "object 2's tracking noise",
    7: "object 1's length",
    8: "object 2's length",
    9: "object 1's height",
    10: "object 2's height",
    11: "the way to the foot",
}


class Line(NamedTuple):
    """A fitted parabola `value + slope (t - at) + curve (t - at)^2 / 2`."""

    value: jax.Array
    slope: jax.Array
    curve: jax.Array
    at_s: jax.Array
    curve_sd: jax.Array
    slope_sd: jax.Array
    count: jax.Array

    def __call__(self, time_s: jax.Array) -> jax.Array:
        """The parabola at a time."""
        t = time_s - self.at_s
        return self.value + self.slope * t + self.curve * t**2 / 2

    def speed(self, time_s: jax.Array) -> jax.Array:
        """Its slope at a time."""
        return self.slope + self.curve * (time_s - self.at_s)


class Summary(NamedTuple):
    """What is left of a track.

    Attributes:
      moves, is_hit: whether object 1 slides, whether object 2 is hit.
      centre, scale: `[3]`, estimates of `world.targets` and their errors, in the same space; 0
        and 1 (the prior) where there is none.
      features: `[feature]`, all that may tell how good the estimates are; of order one.
      misfit: how far from its parabola object 1 is on the ramp, root mean square, in units of
        tracking noise and what a camera's keystone makes of a parabola.
      profile: `[channel, frame]`, velocities of both objects, masks, and residuals of the fits.
    """

    moves: jax.Array
    is_hit: jax.Array
    centre: jax.Array
    scale: jax.Array
    features: jax.Array
    profile: jax.Array
    misfit: jax.Array


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
    return Line(c[0] + base, c[1] / span, c[2] / span**2, at, sd[2] / span**2, sd[1] / span, count)


def _combine(*estimates: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
    """The mean of `(value, sd)` pairs by inverse variance, and its sd."""
    weights = [1 / sd**2 for _, sd in estimates]
    total = sum(weights[1:], weights[0])
    values = [w * value for w, (value, _) in zip(weights, estimates, strict=True)]
    return sum(values[1:], values[0]) / total, 1 / jnp.sqrt(total)


class Decay(NamedTuple):
    """A motion that comes to rest: `end - rate (stop - t)^2 / 2`, from the line of its root."""

    rate: jax.Array
    stop_s: jax.Array
    rate_sd: jax.Array


def decay(t: jax.Array, left: jax.Array, mask: jax.Array, noise: jax.Array) -> Decay:
    """Fits `sqrt(2 left) = sqrt(rate) (stop - t)`, weighted for equal errors of `left`."""
    root = jnp.sqrt(2 * jnp.maximum(left, 1e-9))
    weight = jnp.where(mask, root**2, 0.0)
    total = jnp.maximum(weight.sum(), 1e-12)
    at, mean = (weight * t).sum() / total, (weight * root).sum() / total
    spread = (weight * (t - at) ** 2).sum()
    slope = (weight * (t - at) * (root - mean)).sum() / jnp.maximum(spread, 1e-12)
    slope = jnp.minimum(slope, -1e-3)
    slope_sd = noise / jnp.sqrt(jnp.maximum(spread, 1e-12))
    return Decay(slope**2, at - mean / slope, 2 * jnp.abs(slope) * slope_sd)


def _first(mask: jax.Array) -> jax.Array:
    return jnp.where(mask.any(), jnp.argmax(mask), mask.shape[0])


def _at_end(x: jax.Array, mask: jax.Array, noise: jax.Array) -> tuple[jax.Array, jax.Array]:
    """The mean place of the last frames that stay in one, and how many they are."""
    last = x.shape[0] - 1 - jnp.argmax(mask[::-1])
    near = mask & (jnp.abs(x - x[last]) < jnp.maximum(4 * noise, 5e-5))
    # Only an unbroken rest counts: the same place on the way is no rest.
    frames = jnp.arange(x.shape[0])
    away = jnp.where(mask & ~near, frames, -1).max()
    near = near & (frames > away)
    count = near.sum()
    return jnp.where(near, x, 0.0).sum() / jnp.maximum(count, 1), count


def summarise(seen: Seen) -> Summary:
    """All closed-form estimates of one clip; pure JAX, to be vmapped."""
    t, mask, noise, g = seen.times_s, seen.mask, seen.noise_m, seen.gravity
    frames = jnp.arange(len(t))
    dt = t[1] - t[0]
    imperfect = 1.0 - seen.is_ideal
    sin, cos = jnp.sin(seen.angle_rad), jnp.cos(seen.angle_rad)
    x1, x2 = seen.position_m[:, 0]
    along = x1 * cos - seen.position_m[0, 1] * sin
    corner = seen.half_height_m * jnp.tan(seen.angle_rad / 2)
    margin = AT_FOOT * seen.half_length_m[0]
    moved_m = jnp.maximum(MOVED_SD * noise, MOVED_M)

    # When object 2 begins to move; sure of it only after two frames.
    begin2 = jnp.where(mask[1] & (jnp.cumsum(mask[1]) <= 5), x2, 0.0).sum() / jnp.maximum(
        jnp.minimum(mask[1].sum(), 5), 1
    )
    gone2 = mask[1] & (jnp.abs(x2 - begin2) > moved_m[1])
    first_gone = _first(gone2)
    is_hit = gone2.sum() >= 3
    hit_frame = jnp.where(is_hit, first_gone, len(t))
    before_hit = frames < hit_frame - 1

    # The ramp, from the first frame that is clearly on its way.
    begin1 = along[jnp.argmax(mask[0])]
    gone1 = along - begin1
    moves = (mask[0] & (gone1 > jnp.maximum(4 * moved_m[0], 0.01))).sum() >= 4
    on_ramp = mask[0] & (x1 < corner[0] - margin * cos) & before_hit
    going = on_ramp & (gone1 > moved_m[0])
    ramp = parabola(t, along, going, noise[0])
    k_ramp = (sin - ramp.curve / g) / cos
    k_ramp_sd = jnp.hypot(ramp.curve_sd, imperfect * CAMERA_SD_M_S2) / (g * cos)
    release = ramp.at_s - ramp.slope / jnp.where(jnp.abs(ramp.curve) > 1e-3, ramp.curve, 1e-3)
    release = jnp.clip(release, -0.5, 1.0)
    # As if let go exactly at the first frame: better where that is so.
    at_once = parabola(t, along - begin1, going, noise[0])
    half_square = jnp.where(going, t**2 / 2, 0.0)
    from_rest = (half_square * gone1).sum() / jnp.maximum((half_square**2).sum(), 1e-12)
    k_at_once = (sin - from_rest / g) / cos

    # The table, between foot and hit.
    on_table = mask[0] & (x1 > corner[0] + margin) & before_hit
    end1, rest1 = _at_end(x1, mask[0], noise[0])
    sliding = on_table & (is_hit | (end1 - x1 > moved_m[0]) | (rest1 < 3))
    table = parabola(t, x1, sliding, noise[0])
    k_table = -table.curve / g
    k_table_sd = jnp.hypot(table.curve_sd, imperfect * 2 * CAMERA_SD_M_S2) / g
    use = jnp.stack([going.sum() >= LEAST_FRAMES, sliding.sum() >= LEAST_FRAMES])
    weights = use / jnp.stack([k_ramp_sd, k_table_sd]) ** 2
    total = weights.sum()
    steepest = jnp.tan(seen.angle_rad)
    middle, width = steepest / 2, steepest / 4
    k1 = (weights @ jnp.stack([k_ramp, k_table]) + middle / width**2) / (total + 1 / width**2)
    k1_sd = 1 / jnp.sqrt(total + 1 / width**2)
    k1 = jnp.clip(k1, 1e-4, 0.99)

    # After the hit.
    after = mask & (frames >= first_gone)
    end2, rest2 = _at_end(x2, mask[1], noise[1])
    left2, left1 = end2 - x2, end1 - x1
    slides2 = after[1] & (left2 > moved_m[1]) & gone2
    slides1 = after[0] & (left1 > moved_m[0])
    root2 = decay(t, left2, slides2, noise[1])
    free2 = parabola(t, x2, slides2 | (after[1] & (rest2 < 3)), noise[1])
    root1 = decay(t, left1, slides1, noise[0])
    free1 = parabola(t, x1, slides1 | (after[0] & (rest1 < 3)), noise[0])
    rests2, rests1 = (rest2 >= 3) & (slides2.sum() >= 2), (rest1 >= 3) & (slides1.sum() >= 2)
    d2 = jnp.where(rests2, root2.rate, -free2.curve)
    d2_sd = jnp.where(rests2, root2.rate_sd, free2.curve_sd)
    d2_sd = jnp.hypot(d2_sd, imperfect * 2 * CAMERA_SD_M_S2)
    d2 = jnp.clip(d2, 1e-3, g)
    distance2 = jnp.maximum(end2 - begin2, 1e-5)

    # The hit's own time: where object 2's parabola leaves its place. Object 1's tracks before and
    # after it meet there, too.
    by_distance = root2.stop_s - jnp.sqrt(2 * distance2 / d2)
    slope = free2.speed(t[jnp.minimum(first_gone, len(t) - 1)])
    stood = jnp.where(mask[1] & (frames < first_gone), t, 0.0).max()
    earliest = stood - dt
    latest = t[jnp.clip(first_gone, 0, len(t) - 1)]
    at_gone = latest - (free2(latest) - begin2) / jnp.maximum(slope, 1e-2)
    hit = jnp.clip(jnp.where(rests2, by_distance, at_gone), earliest, latest)
    v2 = jnp.where(rests2, jnp.sqrt(2 * d2 * distance2), free2.speed(hit))
    v1_own = jnp.where(rests1, root1.rate * (root1.stop_s - hit), free1.speed(hit))
    v1_own_sd = jnp.where(
        rests1, v1_own * root1.rate_sd / root1.rate, free1.slope_sd + dt * free1.curve_sd
    )
    v1_own_sd = jnp.where(slides1.sum() >= 2, jnp.clip(v1_own_sd, 1e-4, 10.0), 10.0)
    at_foot = corner[0] * cos - seen.half_height_m[0] * sin
    foot_speed = ramp.slope**2 + 2 * ramp.curve * (at_foot - ramp.value)
    foot_speed = jnp.sqrt(jnp.maximum(foot_speed, 0.0))
    from_ramp = jnp.maximum(foot_speed * jnp.maximum(cos - k1 * sin, 0.0), 0.0) ** 2
    reach = begin2 - seen.half_length_m.sum()
    from_ramp = jnp.sqrt(jnp.maximum(from_ramp - 2 * k1 * g * (reach - corner[0]), 1e-6))
    # On the table the speed alone is better than the parabola's where k1 is known.
    flat = jnp.where(sliding, x1 + k1 * g * (t - hit) ** 2 / 2, 0.0)
    weight = sliding.astype(t.dtype)
    count = jnp.maximum(weight.sum(), 1.0)
    mean_t, mean_x = (weight * t).sum() / count, flat.sum() / count
    spread = (weight * (t - mean_t) ** 2).sum()
    line = (weight * (t - mean_t) * (flat - mean_x)).sum() / jnp.maximum(spread, 1e-9)
    line_sd = noise[0] / jnp.sqrt(jnp.maximum(spread, 1e-9)) + k1_sd * g * jnp.abs(mean_t - hit)
    line_sd = jnp.where(sliding.sum() >= 2, line_sd, 10.0)
    ramp_sd = imperfect * FOOT_SD * from_ramp + k1_sd * g * reach / from_ramp + 5 * noise[0]
    v1, v1_sd = _combine((line, line_sd), (from_ramp, ramp_sd))
    # A hit is nearly plastic, so that both leave it at almost one speed.
    v2 = jnp.clip(v2, 1e-3, None)
    v2_sd = v2 * jnp.hypot(0.5 * d2_sd / d2, noise[1] / distance2)
    as_one = (v2 - imperfect * REBOUND * v1, imperfect * REBOUND_SD * v1 + v2_sd)
    v1_after, v1_after_sd = _combine((v1_own, v1_own_sd), as_one)
    lost = jnp.maximum(v1 - v1_after, 0.003 * jnp.abs(v1) + 1e-3)
    ratio = jnp.clip(v2 / lost, 3e-3, 300.0)
    ratio_sd = jnp.hypot(v2_sd / v2, jnp.hypot(v1_sd, v1_after_sd) / lost)
    ratio_sd = jnp.hypot(ratio_sd, CAMERA_RATIO_SD * imperfect) + 1e-4
    # What brakes harder in front of object 1 is pushed by it.
    pushes = d2 > g * k1
    k2_joint = (d2 * (1 + ratio) / g) - k1 * ratio
    k2 = jnp.where(pushes, k2_joint, d2 / g)
    k2_joint_sd = jnp.hypot(d2_sd * (1 + ratio), (d2 - k1 * g) * ratio * ratio_sd) / g
    k2_sd = jnp.where(pushes, jnp.hypot(k2_joint_sd, ratio * k1_sd), d2_sd / g) + 1e-5
    k2 = jnp.clip(k2, 2e-3, 0.98)

    prior_k = Uniform(FRICTION_PRIOR.low, FRICTION_PRIOR.high)
    log_ratio_sd = jnp.sqrt(2.0) * MASS_PRIOR.sd
    centre = jnp.stack([prior_k.inverse(k1), jnp.log(ratio) / log_ratio_sd, prior_k.inverse(k2)])
    density = jnp.exp(-0.5 * centre**2) / jnp.sqrt(2 * jnp.pi)
    scale = jnp.stack([k1_sd / density[0], ratio_sd / log_ratio_sd, k2_sd / density[2]])
    slid = is_hit & (slides2.sum() >= jnp.where(rests2, 2, LEAST_FRAMES))
    known = jnp.stack([moves, slid, slid])
    centre = jnp.where(known, centre, 0.0)
    scale = jnp.where(known, jnp.clip(scale, 1e-5, 1.0), 1.0)

    speed = jnp.sqrt(jnp.maximum(-2 * g * sin * (begin1 - corner[0]), 0.05))

    def log(value: jax.Array) -> jax.Array:
        return jnp.log(jnp.maximum(value, 1e-7))

    def sized(value: jax.Array) -> jax.Array:
        return jnp.arcsinh(value)

    always = [
        seen.is_ideal,
        *(seen.angle_rad, log(dt), mask[0].sum() / len(t), mask[1].sum() / len(t)),
        *(*log(noise), *seen.half_length_m, *seen.half_height_m),
        *(begin1, sized(10 * release), is_hit),
        *(log(going.sum() + 1), log(sliding.sum() + 1), going.sum() < LEAST_FRAMES),
        *(sliding.sum() < LEAST_FRAMES, log(ramp.curve_sd), log(table.curve_sd)),
        *(centre[0], log(scale[0]), steepest, sized((k_ramp - k1) / k1_sd)),
        *(sized((k_table - k1) / k1_sd), sized((k_at_once - k1) / k1_sd), sized(at_once.slope)),
        *(1 / scale[0]) ** 0.5 * jnp.ones(1) / 10,
        rests1,
    ]
    at_hit = [
        *(centre[1], centre[2], log(scale[1]), log(scale[2]), reach, hit - latest),
        *((hit - latest) / dt, log(distance2), log(v1), log(v2), log(v1_own + 1e-3), pushes),
        *(log(slides1.sum() + 1.0), log(slides2.sum() + 1.0), rests2, rest1 > 30, log(rest2 + 1.0)),
        *(log(d2), log(jnp.clip(root1.rate, 1e-3, 20)), sized((d2 / g - k1) * 10)),
        *(
            sized((-free2.curve - d2) / (d2_sd + 1e-3)),
            sized((root1.rate - k1 * g) / (d2_sd + 1e-3)),
        ),
        *(
            sized((end2 - end1 - begin2 + reach) * 30),
            sized((v1_own - v2) / (v2_sd + 1e-3)),
            log(v1_own_sd),
        ),
        *(
            sized(v1_own / v2),
            sized((line - from_ramp) / (ramp_sd + 1e-3)),
            log(line_sd),
            log(ramp_sd),
            log(v1_sd),
            log(v2_sd),
        ),
        *(sized((table(hit) - reach) * 100), log(free2.curve_sd), ratio * 0 + sized(ratio)),
        *(sized((root1.stop_s - root2.stop_s) * 10), sized(free1.slope), sized(free2.slope)),
        sized((x1[jnp.minimum(hit_frame, len(t) - 1)] - reach) * 100),
    ]
    features = jnp.concatenate(
        [
            jnp.stack([jnp.asarray(v, t.dtype) for v in always]),
            jnp.where(is_hit, jnp.stack([jnp.asarray(v, t.dtype) for v in at_hit]), 0.0),
        ]
    )
    features = jnp.nan_to_num(features)

    both = mask[:, 1:] & mask[:, :-1]
    velocity = jnp.diff(seen.position_m, axis=-1) / dt / speed
    velocity = jnp.where(both[:, None], velocity, 0.0).reshape(4, -1)
    velocity = jnp.pad(velocity, ((0, 0), (0, 1)))
    model1 = jnp.where(on_ramp, along - ramp(t), jnp.where(on_table, x1 - table(t), 0.0))
    before2 = mask[1] & before_hit
    stopping = end2 - d2 * jnp.maximum(root2.stop_s - t, 0.0) ** 2 / 2
    model2 = jnp.where(before2, x2 - begin2, jnp.where(after[1], x2 - stopping, 0.0))
    stopping1 = end1 - root1.rate * jnp.maximum(root1.stop_s - t, 0.0) ** 2 / 2
    model1 = jnp.where(after[0] & is_hit, x1 - stopping1, model1)
    residual = jnp.arcsinh(jnp.stack([model1, model2]) / noise[:, None]) / 3
    profile = jnp.concatenate([velocity, mask.astype(t.dtype), jnp.where(mask, residual, 0.0)])
    way = jnp.where(going, gone1, 0.0).max()
    off = jnp.where(going, along - ramp(t), 0.0)
    rms = jnp.sqrt((off**2).sum() / jnp.maximum(going.sum() - 3, 1))
    misfit = rms / jnp.hypot(noise[0], QUARTIC * discrepancy.KEYSTONE_SD * way**2)
    misfit = jnp.where(going.sum() >= 2 * LEAST_FRAMES, misfit, 0.0)
    profile = jnp.nan_to_num(profile)
    return Summary(moves, is_hit & moves, centre, scale, features, profile, misfit)

"""Closed-form estimates of a track, phase by phase: ramp, table, hit, and after the hit.

    ramp     s'' = g (sin a - k1 cos a)          a parabola through the frames on the ramp
    table    s'' = -k1 g                         another, between foot and hit
    hit      m1 (v1 - v1') = m2 v2'              momentum, whatever the rebound
    after    x(t) = x_end - d (t_end - t)^2 / 2, that is  sqrt(2 (x_end - x)) = sqrt(d) (t_end - t):
             a straight line through the frames that move; d = k2 g, or, where object 1 goes on
             pushing, (k1 m1 + k2 m2) g / (m1 + m2)

Each phase has constants of its own, so that neither the foot nor a point off the centre nor a
late release matters. The estimates know nothing of the camera, of a rebound that separates
the objects for a while, or of how good they are when few frames carry them.

Everything is pure JAX of one clip; a value of a phase that there is not is finite and means
nothing.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from galileo_jax.neural.fitted_lines import (
    Decay,
    Estimate,
    Line,
    at_end,
    combined,
    decay,
    parabola,
    straight,
)
from galileo_jax.neural.seen import Seen
from galileo_jax.observation.observation import AWAY_M, AWAY_SD

AT_FOOT = 1.2  # half lengths either side of the foot where an object stands on two edges
LEAST_FRAMES = 4
# What a camera does to the two kinds of slopes (discrepancy.py), so that errors start realistic.
CAMERA_SD_M_S2 = 0.01
CAMERA_RATIO_SD = 0.02
FOOT_SD, REBOUND, REBOUND_SD = 0.05, 0.012, 0.02
NEVER = 10.0  # m/s, the standard deviation of a speed that nothing tells


class Setting(NamedTuple):
    """What is known before anything is fitted."""

    frame: jax.Array  # [frame], 0, 1, ...
    dt_s: jax.Array  # between two frames
    sin: jax.Array  # of the ramp's angle
    cos: jax.Array
    along_m: jax.Array  # [frame], object 1's place along the ramp
    corner_m: (
        jax.Array
    )  # [object], x where its centre turns from the ramp's direction to the table's
    margin_m: jax.Array  # either side of it, where object 1 stands on two edges
    moved_m: jax.Array  # [object], so far no noise carries


class Onset(NamedTuple):
    """When object 2 begins to move."""

    place2_m: jax.Array  # where it stands before
    gone2: jax.Array  # [frame], where it has left
    frame: jax.Array  # the first of them; the number of frames where there is none
    is_hit: jax.Array  # whether it is sure that it moves
    hit_frame: jax.Array  # as `frame`, but the number of frames where it is not sure
    before: jax.Array  # [frame], surely before it


class Ramp(NamedTuple):
    """Object 1 on the ramp."""

    start_m: jax.Array  # its first place along the ramp
    gone_m: jax.Array  # [frame], the way from there
    moves: jax.Array  # whether it surely slides
    is_there: jax.Array  # [frame], on the ramp
    is_going: jax.Array  # [frame], and surely on its way
    path: Line  # through these
    at_once: Line  # likewise, from `start_m`
    friction: Estimate  # of `path`
    friction_at_once: jax.Array  # as if let go exactly in the first frame; better where that is so
    release_s: jax.Array  # when it was let go


class Table(NamedTuple):
    """Object 1 on the table, between foot and hit."""

    is_there: jax.Array  # [frame], on the table
    is_sliding: jax.Array  # [frame], and not at rest
    path: Line  # through these
    friction: Estimate  # of `path`


class Slide(NamedTuple):
    """An object after the hit: a decay where it comes to rest, a parabola where it does not."""

    is_there: jax.Array  # [frame], measured after the hit
    is_sliding: jax.Array  # [frame], and not at rest
    end_m: jax.Array  # where it is in the end
    rest: jax.Array  # in how many frames
    root: Decay
    free: Line
    rests: jax.Array  # whether it comes to rest


class After(NamedTuple):
    """Both objects after the hit."""

    one: Slide
    two: Slide
    decay2: Estimate  # object 2's deceleration, m/s^2
    way2_m: jax.Array  # how far object 2 goes


class Hit(NamedTuple):
    """The hit: its time, and the speeds before and after it, m/s."""

    time_s: jax.Array
    latest_s: jax.Array  # when object 2 has surely left
    reach_m: jax.Array  # x of object 1 where the objects touch
    from_table: Estimate  # object 1's speed before, by its places on the table
    from_ramp: Estimate  # by its speed at the foot
    before1: Estimate  # by both
    own1: Estimate  # object 1's speed after, by its own motion
    after1: Estimate  # and by that both leave a nearly plastic hit together
    after2: Estimate  # object 2's


class Phases(NamedTuple):
    """All of them, and what they say."""

    setting: Setting
    onset: Onset
    ramp: Ramp
    table: Table
    friction1: Estimate  # object 1's, from ramp and table
    after: After
    hit: Hit
    ratio: Estimate  # of the masses, m1 / m2; its error is relative
    pushes: jax.Array  # object 1 goes on pushing object 2
    friction2: Estimate  # object 2's


def fit_phases(seen: Seen) -> Phases:
    """All estimates of one clip."""
    setting = _setting(seen)
    onset = _onset(seen, setting)
    ramp = _ramp(seen, setting, onset)
    table = _table(seen, setting, onset)
    friction1 = _friction1(seen, ramp, table)
    after = _after(seen, setting, onset)
    hit = _hit(seen, setting, onset, ramp, table, friction1, after)
    ratio = _mass_ratio(seen, hit)
    # What brakes harder in front of object 1 is pushed by it.
    pushes = after.decay2.value > seen.gravity * friction1.value
    friction2 = _friction2(seen, friction1, after, ratio, pushes)
    return Phases(setting, onset, ramp, table, friction1, after, hit, ratio, pushes, friction2)


def _setting(seen: Seen) -> Setting:
    sin, cos = jnp.sin(seen.angle_rad), jnp.cos(seen.angle_rad)
    x1, y1 = seen.position_m[0]
    return Setting(
        frame=jnp.arange(len(seen.times_s)),
        dt_s=seen.times_s[1] - seen.times_s[0],
        sin=sin,
        cos=cos,
        along_m=x1 * cos - y1 * sin,
        corner_m=seen.half_height_m * jnp.tan(seen.angle_rad / 2),
        margin_m=AT_FOOT * seen.half_length_m[0],
        moved_m=jnp.maximum(AWAY_SD * seen.noise_m, AWAY_M),
    )


def _onset(seen: Seen, setting: Setting) -> Onset:
    """Sure of object 2's motion only after two frames."""
    x2, mask = seen.position_m[1, 0], seen.mask[1]
    begin = jnp.where(mask & (jnp.cumsum(mask) <= 5), x2, 0.0).sum() / jnp.maximum(
        jnp.minimum(mask.sum(), 5), 1
    )
    gone = mask & (jnp.abs(x2 - begin) > setting.moved_m[1])
    first = jnp.where(gone.any(), jnp.argmax(gone), len(x2))
    is_hit = gone.sum() >= 3
    hit_frame = jnp.where(is_hit, first, len(x2))
    return Onset(begin, gone, first, is_hit, hit_frame, setting.frame < hit_frame - 1)


def _ramp(seen: Seen, setting: Setting, onset: Onset) -> Ramp:
    """From the first frame in which object 1 is clearly on its way."""
    t, mask, noise, g = seen.times_s, seen.mask[0], seen.noise_m[0], seen.gravity
    along, moved = setting.along_m, setting.moved_m[0]
    sin, cos = setting.sin, setting.cos
    start = along[jnp.argmax(mask)]
    gone = along - start
    end = setting.corner_m[0] - setting.margin_m * cos
    is_there = mask & (seen.position_m[0, 0] < end) & onset.before
    going = is_there & (gone > moved)
    path = parabola(t, along, going, noise)
    release = path.at_s - path.slope / jnp.where(jnp.abs(path.curve) > 1e-3, path.curve, 1e-3)
    half_square = jnp.where(going, t**2 / 2, 0.0)
    from_rest = (half_square * gone).sum() / jnp.maximum((half_square**2).sum(), 1e-12)
    return Ramp(
        start_m=start,
        gone_m=gone,
        moves=(mask & (gone > jnp.maximum(4 * moved, 0.01))).sum() >= 4,
        is_there=is_there,
        is_going=going,
        path=path,
        at_once=parabola(t, along - start, going, noise),
        friction=Estimate(
            (sin - path.curve / g) / cos,
            jnp.hypot(path.curve_sd, seen.is_filmed * CAMERA_SD_M_S2) / (g * cos),
        ),
        friction_at_once=(sin - from_rest / g) / cos,
        release_s=jnp.clip(release, -0.5, 1.0),
    )


def _table(seen: Seen, setting: Setting, onset: Onset) -> Table:
    x, mask, noise = seen.position_m[0, 0], seen.mask[0], seen.noise_m[0]
    is_there = mask & (x > setting.corner_m[0] + setting.margin_m) & onset.before
    end, rest = at_end(x, mask, noise)
    sliding = is_there & (onset.is_hit | (end - x > setting.moved_m[0]) | (rest < 3))
    path = parabola(seen.times_s, x, sliding, noise)
    sd = jnp.hypot(path.curve_sd, seen.is_filmed * 2 * CAMERA_SD_M_S2) / seen.gravity
    friction = Estimate(-path.curve / seen.gravity, sd)
    return Table(is_there, sliding, path, friction)


def _friction1(seen: Seen, ramp: Ramp, table: Table) -> Estimate:
    """Both phases that have enough frames, and that object 1 slides at all."""
    use = [ramp.is_going.sum() >= LEAST_FRAMES, table.is_sliding.sum() >= LEAST_FRAMES]
    weights = jnp.stack(use) / jnp.stack([ramp.friction.sd, table.friction.sd]) ** 2
    total = weights.sum()
    steepest = jnp.tan(seen.angle_rad)
    middle, width = steepest / 2, steepest / 4
    both = jnp.stack([ramp.friction.value, table.friction.value])
    value = (weights @ both + middle / width**2) / (total + 1 / width**2)
    sd = 1 / jnp.sqrt(total + 1 / width**2)
    return Estimate(jnp.clip(value, 1e-4, 0.99), sd)


def _after(seen: Seen, setting: Setting, onset: Onset) -> After:
    two = _slide(seen, setting, onset, 1, onset.gone2)
    rate = jnp.where(two.rests, two.root.rate, -two.free.curve)
    sd = jnp.where(two.rests, two.root.rate_sd, two.free.curve_sd)
    sd = jnp.hypot(sd, seen.is_filmed * 2 * CAMERA_SD_M_S2)
    return After(
        one=_slide(seen, setting, onset, 0, seen.mask[0]),
        two=two,
        decay2=Estimate(jnp.clip(rate, 1e-3, seen.gravity), sd),
        way2_m=jnp.maximum(two.end_m - onset.place2_m, 1e-5),
    )


def _slide(seen: Seen, setting: Setting, onset: Onset, i: int, gone: jax.Array) -> Slide:
    """Object i's; `gone`: `[frame]`, where it may slide."""
    t, x, noise = seen.times_s, seen.position_m[i, 0], seen.noise_m[i]
    is_there = seen.mask[i] & (setting.frame >= onset.frame)
    end, rest = at_end(x, seen.mask[i], noise)
    slides = is_there & (end - x > setting.moved_m[i]) & gone
    return Slide(
        is_there=is_there,
        is_sliding=slides,
        end_m=end,
        rest=rest,
        root=decay(t, end - x, slides, noise),
        free=parabola(t, x, slides | (is_there & (rest < 3)), noise),
        rests=(rest >= 3) & (slides.sum() >= 2),
    )


def _hit(
    seen: Seen,
    setting: Setting,
    onset: Onset,
    ramp: Ramp,
    table: Table,
    friction1: Estimate,
    after: After,
) -> Hit:
    time, latest = _hit_time(seen, setting, onset, after)
    reach = onset.place2_m - seen.half_length_m.sum()
    from_table = _speed_on_table(seen, time, table, friction1)
    from_ramp = _speed_from_ramp(seen, setting, ramp, friction1, reach)
    before1 = combined(from_table, from_ramp)
    own1 = _own_speed_after(setting, time, after)
    after2 = _speed2_after(seen, time, after)
    # A hit is nearly plastic, so that both leave it at almost one speed.
    rebound, rebound_sd = (1.0 - seen.is_ideal) * REBOUND, (1.0 - seen.is_ideal) * REBOUND_SD
    as_one = Estimate(
        after2.value - rebound * before1.value, rebound_sd * before1.value + after2.sd
    )
    after1 = combined(own1, as_one)
    return Hit(time, latest, reach, from_table, from_ramp, before1, own1, after1, after2)


def _hit_time(
    seen: Seen, setting: Setting, onset: Onset, after: After
) -> tuple[jax.Array, jax.Array]:
    """Where object 2's parabola leaves its place; and when it has surely left."""
    t, last = seen.times_s, len(seen.times_s) - 1
    by_distance = after.two.root.stop_s - jnp.sqrt(2 * after.way2_m / after.decay2.value)
    slope = after.two.free.speed(t[jnp.minimum(onset.frame, last)])
    stood = jnp.where(seen.mask[1] & (setting.frame < onset.frame), t, 0.0).max()
    earliest = stood - setting.dt_s
    latest = t[jnp.clip(onset.frame, 0, last)]
    at_gone = latest - (after.two.free(latest) - onset.place2_m) / jnp.maximum(slope, 1e-2)
    return jnp.clip(jnp.where(after.two.rests, by_distance, at_gone), earliest, latest), latest


def _own_speed_after(setting: Setting, time: jax.Array, after: After) -> Estimate:
    """Object 1's speed after the hit by its own motion."""
    root, free = after.one.root, after.one.free
    speed = jnp.where(after.one.rests, root.rate * (root.stop_s - time), free.speed(time))
    sd = jnp.where(
        after.one.rests,
        speed * root.rate_sd / root.rate,
        free.slope_sd + setting.dt_s * free.curve_sd,
    )
    return Estimate(
        speed, jnp.where(after.one.is_sliding.sum() >= 2, jnp.clip(sd, 1e-4, NEVER), NEVER)
    )


def _speed2_after(seen: Seen, time: jax.Array, after: After) -> Estimate:
    """Object 2's speed after the hit."""
    rate, way = after.decay2, after.way2_m
    speed = jnp.where(after.two.rests, jnp.sqrt(2 * rate.value * way), after.two.free.speed(time))
    speed = jnp.clip(speed, 1e-3, None)
    return Estimate(speed, speed * jnp.hypot(0.5 * rate.sd / rate.value, seen.noise_m[1] / way))


def _speed_from_ramp(
    seen: Seen, setting: Setting, ramp: Ramp, friction1: Estimate, reach: jax.Array
) -> Estimate:
    """Object 1's speed at the hit, from the ramp's parabola and the friction between."""
    g, k1, corner = seen.gravity, friction1.value, setting.corner_m[0]
    at_foot = corner * setting.cos - seen.half_height_m[0] * setting.sin
    at_foot_speed = ramp.path.slope**2 + 2 * ramp.path.curve * (at_foot - ramp.path.value)
    at_foot_speed = jnp.sqrt(jnp.maximum(at_foot_speed, 0.0))
    turned = jnp.maximum(setting.cos - k1 * setting.sin, 0.0)
    square = jnp.maximum(at_foot_speed * turned, 0.0) ** 2
    speed = jnp.sqrt(jnp.maximum(square - 2 * k1 * g * (reach - corner), 1e-6))
    of_foot = (1.0 - seen.is_ideal) * FOOT_SD * speed
    return Estimate(speed, of_foot + friction1.sd * g * reach / speed + 5 * seen.noise_m[0])


def _speed_on_table(seen: Seen, time: jax.Array, table: Table, friction1: Estimate) -> Estimate:
    """Object 1's speed at the hit, from a straight line: better than the parabola's, k1 known."""
    t, g, sliding = seen.times_s, seen.gravity, table.is_sliding
    lift = friction1.value * g * (t - time) ** 2 / 2
    flat = seen.position_m[0, 0] + lift
    at, _, speed, per_noise = straight(t, flat, sliding.astype(t.dtype), 1e-9)
    sd = seen.noise_m[0] * per_noise + friction1.sd * g * jnp.abs(at - time)
    return Estimate(speed, jnp.where(sliding.sum() >= 2, sd, NEVER))


def _mass_ratio(seen: Seen, hit: Hit) -> Estimate:
    """Momentum: what object 1 loses object 2 gets."""
    v1, v2 = hit.before1, hit.after2
    lost = jnp.maximum(v1.value - hit.after1.value, 0.003 * jnp.abs(v1.value) + 1e-3)
    ratio = jnp.clip(v2.value / lost, 3e-3, 300.0)
    sd = jnp.hypot(v2.sd / v2.value, jnp.hypot(v1.sd, hit.after1.sd) / lost)
    return Estimate(ratio, jnp.hypot(sd, CAMERA_RATIO_SD * seen.is_filmed) + 1e-4)


def _friction2(
    seen: Seen, friction1: Estimate, after: After, ratio: Estimate, pushes: jax.Array
) -> Estimate:
    g, k1, (d2, d2_sd) = seen.gravity, friction1.value, after.decay2
    joint = (d2 * (1 + ratio.value) / g) - k1 * ratio.value
    value = jnp.where(pushes, joint, d2 / g)
    joint_sd = d2_sd * (1 + ratio.value)
    joint_sd = jnp.hypot(joint_sd, (d2 - k1 * g) * ratio.value * ratio.sd) / g
    sd = jnp.where(pushes, jnp.hypot(joint_sd, ratio.value * friction1.sd), d2_sd / g) + 1e-5
    return Estimate(jnp.clip(value, 2e-3, 0.98), sd)

"""Summary of a clip: where the network starts from.

The closed-form estimates of each phase (`closed_form.py`) in the space of `world.targets`, how good
they may be, and what they leave of the track. The network learns a correction and its error.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from galileo_jax.model.model import MASS_PRIOR
from galileo_jax.neural.closed_form import LEAST_FRAMES, Phases, fit_phases
from galileo_jax.neural.seen import Seen
from galileo_jax.neural.world import Truth, targets
from galileo_jax.similarity import discrepancy

QUARTIC = 0.02  # of t^4 / 4, what no parabola fits, root mean square

NUM_FEATURES, NUM_CHANNELS = 69, 8
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


class Summary(NamedTuple):
    """What is left of a track."""

    moves: jax.Array  # whether object 1 slides
    is_hit: jax.Array  # whether object 2 is hit
    # `[3]`, estimates of `world.targets` and their errors, in the same space; 0 and 1 (the prior)
    # where there is none
    centre: jax.Array
    scale: jax.Array
    features: jax.Array  # `[feature]`, all that may tell how good the estimates are; of order one
    # `[channel, frame]`, velocities of both objects, masks, and residuals of the fits
    profile: jax.Array
    # How far from its parabola object 1 is on the ramp, root mean square, in units of tracking
    # noise and what a camera's keystone makes of a parabola
    misfit: jax.Array


def summarise(seen: Seen) -> Summary:
    """The summary of one clip; pure JAX, to be vmapped."""
    phases = fit_phases(seen)
    centre, scale = _estimates(phases)
    return Summary(
        moves=phases.ramp.moves,
        is_hit=phases.onset.is_hit & phases.ramp.moves,
        centre=centre,
        scale=scale,
        features=_features(seen, phases, centre, scale),
        profile=_profile(seen, phases),
        misfit=_misfit(seen, phases),
    )


def _estimates(phases: Phases) -> tuple[jax.Array, jax.Array]:
    """`centre` and `scale` of the summary."""
    after, friction1, friction2 = phases.after, phases.friction1, phases.friction2
    centre = targets(Truth(friction1.value, friction2.value, phases.ratio.value))
    log_ratio_sd = jnp.sqrt(2.0) * MASS_PRIOR.sd
    density = jnp.exp(-0.5 * centre**2) / jnp.sqrt(2 * jnp.pi)
    scale = [friction1.sd / density[0], phases.ratio.sd / log_ratio_sd, friction2.sd / density[2]]
    scale = jnp.stack(scale)
    enough = after.two.is_sliding.sum() >= jnp.where(after.two.rests, 2, LEAST_FRAMES)
    slid = phases.onset.is_hit & enough
    known = jnp.stack([phases.ramp.moves, slid, slid])
    centre = jnp.where(known, centre, 0.0)
    return centre, jnp.where(known, jnp.clip(scale, 1e-5, 1.0), 1.0)


def _log(value: jax.Array) -> jax.Array:
    return jnp.log(jnp.maximum(value, 1e-7))


def _sized(value: jax.Array) -> jax.Array:
    return jnp.arcsinh(value)


def _features(seen: Seen, phases: Phases, centre: jax.Array, scale: jax.Array) -> jax.Array:
    """All features; trained networks know them by their place. Those of a hit are 0 without."""

    def stacked(values: list[jax.Array]) -> jax.Array:
        return jnp.stack([jnp.asarray(value, seen.times_s.dtype) for value in values])

    always = stacked(_features_always(seen, phases, centre, scale))
    at_hit = stacked(_features_of_hit(seen, phases, centre, scale))
    return jnp.nan_to_num(jnp.concatenate([always, jnp.where(phases.onset.is_hit, at_hit, 0.0)]))


def _features_always(
    seen: Seen, phases: Phases, centre: jax.Array, scale: jax.Array
) -> list[jax.Array]:
    """Features 0 to 32: of the scene, and of object 1 before the hit."""
    ramp, table, (k1, k1_sd) = phases.ramp, phases.table, phases.friction1
    num_going, num_sliding = ramp.is_going.sum(), table.is_sliding.sum()
    count = len(seen.times_s)
    return [
        seen.is_ideal,
        *(seen.angle_rad, _log(phases.setting.dt_s)),
        *(seen.mask[0].sum() / count, seen.mask[1].sum() / count),
        *(*_log(seen.noise_m), *seen.half_length_m, *seen.half_height_m),
        *(ramp.start_m, _sized(10 * ramp.release_s), phases.onset.is_hit),
        *(_log(num_going + 1), _log(num_sliding + 1)),
        *(num_going < LEAST_FRAMES, num_sliding < LEAST_FRAMES),
        *(_log(ramp.path.curve_sd), _log(table.path.curve_sd)),
        *(centre[0], _log(scale[0]), jnp.tan(seen.angle_rad)),
        *(_sized((ramp.friction.value - k1) / k1_sd), _sized((table.friction.value - k1) / k1_sd)),
        *(_sized((ramp.friction_at_once - k1) / k1_sd), _sized(ramp.at_once.slope)),
        *(1 / scale[0]) ** 0.5 * jnp.ones(1) / 10,
        *(phases.after.one.rests, seen.is_filmed, seen.is_tracked_here),
    ]


def _features_of_hit(
    seen: Seen, phases: Phases, centre: jax.Array, scale: jax.Array
) -> list[jax.Array]:
    """Features 33 to 68: of the hit and of what comes after it."""
    table, after, hit = phases.table, phases.after, phases.hit
    k1, g = phases.friction1.value, seen.gravity
    x1 = seen.position_m[0, 0]
    last = len(seen.times_s) - 1
    since = hit.time_s - hit.latest_s
    decay_sd = after.decay2.sd + 1e-3
    between = after.two.end_m - after.one.end_m - phases.onset.place2_m + hit.reach_m
    return [
        *(centre[1], centre[2], _log(scale[1]), _log(scale[2])),
        *(hit.reach_m, since, since / phases.setting.dt_s, _log(after.way2_m)),
        *(
            _log(hit.before1.value),
            _log(hit.after2.value),
            _log(hit.own1.value + 1e-3),
            phases.pushes,
        ),
        *(_log(after.one.is_sliding.sum() + 1.0), _log(after.two.is_sliding.sum() + 1.0)),
        *(after.two.rests, after.one.rest > 30, _log(after.two.rest + 1.0)),
        *(_log(after.decay2.value), _log(jnp.clip(after.one.root.rate, 1e-3, 20))),
        _sized((after.decay2.value / g - k1) * 10),
        _sized((-after.two.free.curve - after.decay2.value) / decay_sd),
        _sized((after.one.root.rate - k1 * g) / decay_sd),
        *(
            _sized(between * 30),
            _sized((hit.own1.value - hit.after2.value) / (hit.after2.sd + 1e-3)),
        ),
        *(_log(hit.own1.sd), _sized(hit.own1.value / hit.after2.value)),
        _sized((hit.from_table.value - hit.from_ramp.value) / (hit.from_ramp.sd + 1e-3)),
        *(_log(hit.from_table.sd), _log(hit.from_ramp.sd)),
        *(_log(hit.before1.sd), _log(hit.after2.sd)),
        _sized((table.path(hit.time_s) - hit.reach_m) * 100),
        *(_log(after.two.free.curve_sd), _sized(phases.ratio.value)),
        _sized((after.one.root.stop_s - after.two.root.stop_s) * 10),
        *(_sized(after.one.free.slope), _sized(after.two.free.slope)),
        _sized((x1[jnp.minimum(phases.onset.hit_frame, last)] - hit.reach_m) * 100),
    ]


def _profile(seen: Seen, phases: Phases) -> jax.Array:
    """Velocities in units of the fastest that the ramp allows, masks, and residuals."""
    setting, mask = phases.setting, seen.mask
    fall = phases.ramp.start_m - setting.corner_m[0]
    speed = jnp.sqrt(jnp.maximum(-2 * seen.gravity * setting.sin * fall, 0.05))
    both = mask[:, 1:] & mask[:, :-1]
    velocity = jnp.diff(seen.position_m, axis=-1) / setting.dt_s / speed
    velocity = jnp.where(both[:, None], velocity, 0.0).reshape(4, -1)
    velocity = jnp.pad(velocity, ((0, 0), (0, 1)))
    residual = jnp.arcsinh(_residuals(seen, phases) / seen.noise_m[:, None]) / 3
    masks = mask.astype(seen.times_s.dtype)
    return jnp.nan_to_num(jnp.concatenate([velocity, masks, jnp.where(mask, residual, 0.0)]))


def _residuals(seen: Seen, phases: Phases) -> jax.Array:
    """What the phases' fits leave of both objects' paths, `[object, frame]`, m."""
    t, onset, ramp, table = seen.times_s, phases.onset, phases.ramp, phases.table
    after = phases.after
    x1, x2 = seen.position_m[:, 0]

    def stopping(end: jax.Array, rate: jax.Array, stop_s: jax.Array) -> jax.Array:
        return end - rate * jnp.maximum(stop_s - t, 0.0) ** 2 / 2

    on_ramp = phases.setting.along_m - ramp.path(t)
    first = jnp.where(ramp.is_there, on_ramp, jnp.where(table.is_there, x1 - table.path(t), 0.0))
    after1 = x1 - stopping(after.one.end_m, after.one.root.rate, after.one.root.stop_s)
    first = jnp.where(after.one.is_there & onset.is_hit, after1, first)
    after2 = x2 - stopping(after.two.end_m, after.decay2.value, after.two.root.stop_s)
    second = jnp.where(after.two.is_there, after2, 0.0)
    second = jnp.where(seen.mask[1] & onset.before, x2 - onset.place2_m, second)
    return jnp.stack([first, second])


def _misfit(seen: Seen, phases: Phases) -> jax.Array:
    """See `Summary`; 0 where too few frames tell."""
    ramp, going = phases.ramp, phases.ramp.is_going
    way = jnp.where(going, ramp.gone_m, 0.0).max()
    off = jnp.where(going, phases.setting.along_m - ramp.path(seen.times_s), 0.0)
    rms = jnp.sqrt((off**2).sum() / jnp.maximum(going.sum() - 3, 1))
    expected = jnp.hypot(seen.noise_m[0], QUARTIC * discrepancy.KEYSTONE_SD * way**2)
    return jnp.where(going.sum() >= 2 * LEAST_FRAMES, rms / expected, 0.0)

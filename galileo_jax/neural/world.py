"""Random ramp experiments, filmed: what the posterior network is trained on.

Three worlds are mixed, and the network is told which one it looks at:

    videos  priors and nuisances of the fit (foot, restitution, release, points off the centre)
            and the imperfections of camera, coder and bodies (`film.py`); friction of object 1
            uniform among those at which it slides. Tracked by us, or by others.
    tracks  the same without a camera: positions in metres, whatever measured them.
    ideal   the thesis's: masses uniform in (0, 1) kg, friction in (0, 0.3), rigid bodies
            exactly as declared, noise only.

Scenes differ in all else: slope, sizes, distances, frame rate, length, noise, gaps.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from galileo_jax.measurement.errors_at_rest import LEAST_SCALE
from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.model.effects.nuisances import (
    NUISANCES,
    foot_transition,
    hits,
    impact_restitution,
)
from galileo_jax.model.model import FRICTION_PRIOR, MASS_PRIOR
from galileo_jax.neural.film import Bodies, measured, noisy
from galileo_jax.neural.seen import NUM_FRAMES, Seen
from galileo_jax.rollout.engine_path import roll_out
from galileo_jax.rollout.rollout import Trajectory, at_times

IDEAL_SHARE = 0.25
FILMED_SHARE, OWN_SHARE = 0.7, 0.8  # of clips that a camera saw; of those, tracked by us
IDEAL_FRICTION = (0.0, 0.3)
RECORD_DT_S, NUM_RECORDS = 1 / 120, 512  # constant forces: exact at any step
ANGLE_DEG = (8.0, 35.0)
RELEASE_M, OBJECT2_M = (0.2, 1.0), (0.12, 0.5)
SIZE_M = (0.03, 0.1)
FPS, FRAMES = (20.0, 120.0), (40, NUM_FRAMES)
NOISE_PX, SCALE_PX_PER_M = (0.005, 1.0), (300.0, 1200.0)
LATE_SHARE, LATEST_S = 0.15, 0.3  # releases seconds after the first frame
GAP_SHARE, LONGEST_GAP = 0.3, 0.15  # of the frames
CODED_SHARE = 0.4  # clips whose coder shifts what rests once
NOISE_SCALE_SD = 0.3
NAMES = (
    *("m1", "k1", "m2", "k2", "start_offset_object1", "start_offset_object2"),
    *("foot_transition", "impact_restitution", "impact_momentum_object2"),
    *("contact_gap", "release_instant"),
)


class Truth(NamedTuple):
    """What is to be found: `k1`, `k2`, `mass_ratio` = m1 / m2."""

    k1: jax.Array
    k2: jax.Array
    mass_ratio: jax.Array


class _Random:
    """Random numbers of a shape; new ones with each call."""

    def __init__(self, key: jax.Array):
        self.keys = iter(jax.random.split(key, 60))

    def uniform(self, low, high, shape=()) -> jax.Array:
        return jax.random.uniform(next(self.keys), shape, minval=low, maxval=high)

    def log_uniform(self, low, high, shape=()) -> jax.Array:
        return jnp.exp(self.uniform(jnp.log(low), jnp.log(high), shape))

    def normal(self, shape=()) -> jax.Array:
        return jax.random.normal(next(self.keys), shape)


def draw(key: jax.Array) -> tuple[Seen, Truth]:
    """One experiment and its truth; to be vmapped over keys."""
    random = _Random(key)
    uniform, log_uniform, normal = random.uniform, random.log_uniform, random.normal
    is_ideal = uniform(0, 1) < IDEAL_SHARE
    imperfect = 1.0 - is_ideal
    is_filmed = imperfect * (uniform(0, 1) < FILMED_SHARE)
    is_tracked_here = is_filmed * (uniform(0, 1) < OWN_SHARE)
    angle = jnp.deg2rad(jnp.where(uniform(0, 1) < 0.2, 20.0, uniform(*ANGLE_DEG)))
    half_length, half_height = uniform(*SIZE_M, (2,)) / 2, uniform(*SIZE_M, (2,)) / 2
    corner = half_height * jnp.tan(angle / 2)
    release = uniform(*RELEASE_M) + corner[0] + half_length[0]
    object2 = corner[0] + half_length.sum() + uniform(0.02, OBJECT2_M[1] - OBJECT2_M[0])
    (m1, m2), (k1, k2) = _masses_and_frictions(random, is_ideal, jnp.tan(angle))
    fps = jnp.where(uniform(0, 1) < 0.4, 30.0, log_uniform(*FPS))
    num_frames = jax.random.randint(next(random.keys), (), FRAMES[0], FRAMES[1] + 1)
    instant = normal() / (3 * fps)
    late = uniform(0, LATEST_S)
    instant = imperfect * jnp.where(uniform(0, 1) < LATE_SHARE, late, instant)
    foot = 1.0 + imperfect * foot_transition.EDGE_SD * normal()
    rebound = imperfect * impact_restitution.PRIOR.forward(normal())
    zero = jnp.zeros(())
    overlap = imperfect * hits.GAP_PRIOR.forward(normal())
    passed_on = 1.0 + imperfect * hits.MOMENTUM_SD * normal()
    theta = jnp.stack([m1, k1, m2, k2, zero, zero, foot, rebound, passed_on, overlap, instant])
    scene = _scene(angle, half_length, half_height, release, object2)
    position, velocity = roll_out(NUISANCES, NAMES, NUM_RECORDS, RECORD_DT_S, theta, scene)
    records = jnp.arange(NUM_RECORDS) * RECORD_DT_S
    times = jnp.arange(NUM_FRAMES) / fps
    motion = Trajectory(records, position, velocity)
    clean, _ = at_times(motion, times - instant)
    bodies = Bodies(angle, half_length, corner[0], jnp.stack([m1, m2]))
    real = measured(clean, times, bodies, is_filmed, is_tracked_here, normal)
    seen = jnp.where(imperfect > 0, real, clean)
    noise = log_uniform(*NOISE_PX, (2,)) / log_uniform(*SCALE_PX_PER_M)
    noise = jnp.where(uniform(0, 1) < 0.3, noise[0], noise)
    truly = noise * jnp.exp(imperfect * NOISE_SCALE_SD * normal())
    is_coded = is_filmed * uniform(0, 1) > 1 - CODED_SHARE
    scatter = jnp.where(is_coded, uniform(LEAST_SCALE, 1.0), 1.0)
    seen = noisy(clean, seen, times, truly, scatter, normal)
    # Rollouts end: beyond, the bodies would stand still.
    mask = _with_gaps(random, times < records[-1], num_frames)
    return (
        Seen(
            times_s=times,
            position_m=jnp.where(mask[:, None], seen, 0.0),
            mask=mask,
            noise_m=noise,
            angle_rad=angle,
            gravity=jnp.asarray(9.81),
            half_length_m=half_length,
            half_height_m=half_height,
            is_ideal=1.0 - imperfect,
            is_filmed=is_filmed,
            is_tracked_here=is_tracked_here,
        ),
        Truth(k1, k2, m1 / m2),
    )


def _masses_and_frictions(
    random: _Random, is_ideal: jax.Array, steepest: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """`[object]` of each; `steepest`: tan of the ramp's angle."""
    uniform = random.uniform
    masses = jnp.where(is_ideal, uniform(0, 1, (2,)), MASS_PRIOR.forward(random.normal((2,))))
    shares = jnp.stack([jnp.minimum(1, steepest / IDEAL_FRICTION[1]), 1.0])
    return masses, jnp.where(
        is_ideal,
        uniform(*IDEAL_FRICTION, (2,)) * shares,
        uniform(FRICTION_PRIOR.low, FRICTION_PRIOR.high, (2,)) * jnp.stack([steepest, 1.0]),
    )


def _scene(
    angle: jax.Array,
    half_length: jax.Array,
    half_height: jax.Array,
    release: jax.Array,
    object2: jax.Array,
) -> Surroundings:
    """Object 1 so far up the ramp, object 2 so far from its foot."""
    corner = half_height * jnp.tan(angle / 2)
    cos, sin = jnp.cos(angle), jnp.sin(angle)
    start1 = (half_height[0] * sin - release * cos, half_height[0] * cos + release * sin)
    return Surroundings(
        names=("object1", "object2"),
        angle_rad=angle,  # pyright: ignore
        gravity=9.81,
        half_length_m=tuple(half_length),
        half_height_m=tuple(half_height),
        corner_m=tuple(corner),
        start_m=(start1, (object2, half_height[1])),  # pyright: ignore
        start_path_m=(corner[0] - release, object2 - corner[1]),  # pyright: ignore
        has_table=True,
        comes_down=(True, False),
    )


def _with_gaps(random: _Random, is_there: jax.Array, num_frames: jax.Array) -> jax.Array:
    """Which frames each object is seen in, `[object, frame]`: two gaps at most."""
    frames = jnp.arange(NUM_FRAMES)
    mask = jnp.tile((frames < num_frames) & is_there, (2, 1))
    for _ in range(2):
        first = random.uniform(0.05, 0.95, (2, 1)) * num_frames
        is_gap = random.uniform(0, 1, (2, 1)) < GAP_SHARE
        length = jnp.where(is_gap, random.uniform(0, LONGEST_GAP, (2, 1)), 0)
        mask = mask & ~((frames >= first) & (frames < first + length * num_frames))
    return mask


def targets(truth: Truth) -> jax.Array:
    """k1, log mass ratio and k2 where each prior of the fit is standard normal: `[..., 3]`."""
    ratio = jnp.log(truth.mass_ratio) / (jnp.sqrt(2.0) * MASS_PRIOR.sd)
    k1, k2 = FRICTION_PRIOR.inverse(truth.k1), FRICTION_PRIOR.inverse(truth.k2)
    return jnp.stack([k1, ratio, k2], axis=-1)

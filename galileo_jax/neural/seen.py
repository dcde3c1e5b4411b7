"""What the posterior network is shown of a clip, padded to a fixed number of frames."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.errors import InputError

NUM_FRAMES = 128  # longer clips are thinned out evenly
WINDOW = 4  # frames before and after
MOVES_SDS = 5.0  # of the noise: who goes no further within the windows rests
LEAST_NOISE_M = 5e-6  # of the simulated clips; a more certain tracker is taken for one of these


class Seen(NamedTuple):
    """An observation and what is declared about its scene; leading axes `[...]` in batches."""

    times_s: jax.Array  # `[frame]`, evenly spaced
    position_m: jax.Array  # `[object, 2, frame]`, 0 where masked
    mask: jax.Array  # `[object, frame]`
    # `[object]`, the tracker's own standard deviation of a coordinate while it moves
    noise_m: jax.Array
    angle_rad: jax.Array  # of the scene's ramp
    gravity: jax.Array  # m/s^2
    half_length_m: jax.Array  # `[object]`
    half_height_m: jax.Array
    # 1.0 where nothing but noise stands between the rigid bodies and their positions (a simulated
    # world, the thesis's priors); 0.0 for clips
    is_ideal: jax.Array
    # 1.0 where a camera saw the bodies; 0.0 for positions in metres of unknown origin
    is_filmed: jax.Array
    is_tracked_here: jax.Array  # 1.0 where our own tracker found them in the pictures


def see(observation: Observation, scene: Surroundings, is_filmed: bool = True) -> Seen:
    """A clip of the ramp scene as the network sees it.

    A clip with one object gets a second one that is never seen.

    Raises:
      InputError: no ramp with a table.
    """
    if not scene.crosses_foot or len(scene.names) > 2:
        raise InputError(
            "--method cnn: its network knows one or two objects on a ramp that ends on a table; "
            "take --method grad"
        )
    stride = -(-len(observation.times_s) // NUM_FRAMES)
    chosen = slice(None, None, stride)
    times, mask = observation.times_s[chosen], observation.mask[:, chosen]
    position = np.where(mask[:, None], observation.position_m[..., chosen], 0.0)
    variance = np.trace(observation.covariance_m2[..., chosen], axis1=1, axis2=2) / 2
    shown = zip(position, variance, mask, strict=True)
    noise = [np.sqrt(_usual(*one)) if one[2].any() else 0.0 for one in shown]
    missing_frames, missing = NUM_FRAMES - len(times), 2 - len(mask)
    step = times[1] - times[0]
    more = times[-1] + step * np.arange(1, missing_frames + 1)
    objects = ((0, missing),)
    return Seen(
        times_s=jnp.asarray(np.concatenate([times, more])),
        position_m=jnp.asarray(np.pad(position, (*objects, (0, 0), (0, missing_frames)))),
        mask=jnp.asarray(np.pad(mask, (*objects, (0, missing_frames)))),
        noise_m=jnp.asarray(np.maximum(np.pad(noise, objects), LEAST_NOISE_M)),
        angle_rad=jnp.asarray(scene.angle_rad),
        gravity=jnp.asarray(scene.gravity),
        half_length_m=jnp.asarray(np.pad(scene.half_length_m, objects, mode="edge")),
        half_height_m=jnp.asarray(np.pad(scene.half_height_m, objects, mode="edge")),
        is_ideal=jnp.asarray(0.0),
        is_filmed=jnp.asarray(float(is_filmed)),
        is_tracked_here=jnp.asarray(float(is_filmed and observation.is_tracked_here)),
    )


def _usual(position: np.ndarray, variance: np.ndarray, mask: np.ndarray) -> float:
    """The median variance of an object's frames in which it moves; of all, where it never does."""
    frames = np.arange(len(mask))
    before, after = np.maximum(frames - WINDOW, 0), np.minimum(frames + WINDOW, len(mask) - 1)
    gone = np.linalg.norm(position[:, after] - position[:, before], axis=0)
    moves = mask & mask[before] & mask[after] & (gone > MOVES_SDS * np.sqrt(variance))
    return float(np.median(variance[moves if moves.any() else mask]))

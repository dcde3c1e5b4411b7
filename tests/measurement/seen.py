"""An observation of places with even noise, for tests of what is told by a track."""

import numpy as np

from galileo_jax.observation.observation import Observation


def seen(
    place_m: np.ndarray, times_s: np.ndarray, noise_m: float, seed: int | None = None
) -> Observation:
    """Places `[axis, frame]`, or `[object, axis, frame]`; with a seed, noise is added to them."""
    place = place_m if np.ndim(place_m) == 3 else np.asarray(place_m)[None]
    if seed is not None:
        place = place + noise_m * np.random.default_rng(seed).standard_normal(place.shape)
    objects, axes, frames = place.shape
    error = np.broadcast_to(noise_m**2 * np.eye(axes)[..., None], (objects, axes, axes, frames))
    names = tuple(f"object{i + 1}" for i in range(objects))
    return Observation(names, times_s, place, error, np.ones((objects, frames), bool))

"""DIR/errors.npz of a run: what observation.csv cannot say of a track's errors.

The csv has a covariance for each frame. Errors that many frames share (`Observation.modes_m`) and
what is known of where the track is from stand beside it, and how far pucks were seen to turn, so
that a comparison of a saved run has the likelihood of the fit. Where there is nothing to say there
is no file.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.atomic_write import replacing

ERRORS = "errors.npz"
FLAGS = ("is_squared", "num_errors")
KNOWN_TO, TURNED = "noise_known_to", "turned_rad"
NOTHING = np.zeros((0, 0, 0, 0))


def save_shared_errors(folder: Path, observation: Observation) -> None:
    """Writes them, or removes those of an older run."""
    is_plain = not any(getattr(observation, name) for name in (*FLAGS, KNOWN_TO))
    modes = NOTHING if observation.modes_m is None else observation.modes_m
    turned = NOTHING if observation.turned_rad is None else observation.turned_rad
    if is_plain and not modes.size and not turned.size:
        (folder / ERRORS).unlink(missing_ok=True)
        return
    with replacing(folder / ERRORS) as path:
        np.savez_compressed(
            path,
            modes_m=modes,
            is_squared=observation.is_squared,
            num_errors=observation.num_errors,
            noise_known_to=observation.noise_known_to,
            turned_rad=turned,
        )


def with_shared_errors(folder: Path, observation: Observation) -> Observation:
    """The observation with those of its run; as it is where there is no file."""
    if not (folder / ERRORS).is_file():
        return observation
    with np.load(folder / ERRORS) as file:
        modes = file["modes_m"]
        squared, num_errors = (int(file[name]) for name in FLAGS)
        known_to = float(file.get(KNOWN_TO, 0.0))  # runs of earlier versions have none
        turned = file.get(TURNED, NOTHING)
    return replace(
        observation,
        modes_m=modes if modes.size else None,
        is_squared=bool(squared),
        num_errors=num_errors,
        noise_known_to=known_to,
        turned_rad=turned if turned.size else None,
    )

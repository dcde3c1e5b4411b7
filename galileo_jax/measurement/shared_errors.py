"""What the csv of a track cannot say of its errors: DIR/errors.npz of a run, NAME.errors.npz.

The csv has a covariance for each frame. Errors that many frames share (`Observation.modes_m`) and
what is known of where the track is from stand beside it, and how far pucks were seen to turn, so
that a comparison of a saved run has the likelihood of the fit. Where there is nothing to say there
is no file. A bundle has the file
beside its track, by the track's name, so that the track of a film is fitted again as the film was.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.atomic_write import replacing
from galileo_jax.runtime.errors import InputError

ERRORS = "errors.npz"
FLAGS = ("is_squared", "num_errors")
KNOWN_TO, TURNED = "noise_known_to", "turned_rad"
NOTHING = np.zeros((0, 0, 0, 0))


def save_shared_errors(folder: Path, observation: Observation) -> None:
    """Writes those of a run, or removes those of an older one."""
    write_errors(folder / ERRORS, observation)


def with_shared_errors(folder: Path, observation: Observation) -> Observation:
    """The observation with those of its run; as it is where there is no file."""
    return with_errors(folder / ERRORS, observation)


def beside(track: Path) -> Path:
    """Where the errors of a csv track stand."""
    return track.with_name(f"{track.stem}.{ERRORS}")


def write_errors(path: Path, observation: Observation) -> None:
    """Writes them into a file, or removes it where there is nothing to say."""
    is_plain = not any(getattr(observation, name) for name in (*FLAGS, KNOWN_TO))
    modes = NOTHING if observation.modes_m is None else observation.modes_m
    turned = NOTHING if observation.turned_rad is None else observation.turned_rad
    if is_plain and not modes.size and not turned.size:
        path.unlink(missing_ok=True)
        return
    with replacing(path) as temporary:
        np.savez_compressed(
            temporary,
            modes_m=modes,
            is_squared=observation.is_squared,
            num_errors=observation.num_errors,
            noise_known_to=observation.noise_known_to,
            turned_rad=turned,
        )


def with_errors(path: Path, observation: Observation) -> Observation:
    """The observation with those of a file; as it is where there is no file.

    Raises:
      InputError: the file is damaged, or of another track.
    """
    if not path.is_file():
        return observation
    try:
        with np.load(path) as file:
            modes = file["modes_m"]
            squared, num_errors = (int(file[name]) for name in FLAGS)
            known_to = float(file.get(KNOWN_TO, 0.0))  # runs of earlier versions have none
            turned = file.get(TURNED, NOTHING)
    except Exception as error:  # a damaged archive raises anything
        raise InputError(f"{path}: damaged, or not the errors of a track") from error
    if modes.size and modes.shape[1:] != observation.position_m.shape:
        raise InputError(f"{path}: the errors of another track; remove it")
    return replace(
        observation,
        modes_m=modes if modes.size else None,
        is_squared=bool(squared),
        num_errors=num_errors,
        noise_known_to=known_to,
        turned_rad=turned if turned.size else None,
    )

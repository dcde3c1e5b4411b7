"""What the csv of a track cannot say of its errors: DIR/errors.npz of a run, NAME.errors.npz.

The csv has a covariance for each frame. Errors that many frames share (`Observation.modes_m`) and
what is known of where the track is from stand beside it, and how far pucks were seen to turn, so
that a comparison of a saved run has the likelihood of the fit. Where there is nothing to say there
is no file. A bundle has the file beside its track, by the track's name, so that the track of a film
is fitted again as the film was.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.atomic_write import replacing
from galileo_jax.runtime.errors import InputError

ERRORS = "errors.npz"
NUMBERS = {"is_squared": bool, "num_errors": int, "noise_known_to": float, "rows_of_noise": int}
ARRAYS = ("modes_m", "turned_rad")  # which an observation may not have
NOTHING = np.zeros((0, 0, 0, 0))


def beside(track: Path) -> Path:
    """Where the errors of a csv track stand."""
    return track.with_name(f"{track.stem}.{ERRORS}")


def write_errors(path: Path, observation: Observation) -> None:
    """Writes them into a file, or removes it where there is nothing to say."""
    own: dict[str, Any] = {name: getattr(observation, name) for name in (*NUMBERS, *ARRAYS)}
    own |= {name: NOTHING for name in ARRAYS if own[name] is None}
    if not any(np.size(own[name]) for name in ARRAYS) and not any(own[name] for name in NUMBERS):
        path.unlink(missing_ok=True)
        return
    with replacing(path) as temporary:
        np.savez_compressed(temporary, **own)


def with_errors(path: Path, observation: Observation) -> Observation:
    """The observation with those of a file; as it is where there is no file.

    Raises:
      InputError: the file is damaged, or of another track.
    """
    if not path.is_file():
        return observation
    try:
        with np.load(path) as file:
            # Runs of earlier versions do not have all of them.
            own = {name: kind(file[name]) for name, kind in NUMBERS.items() if name in file}
            modes, turned = file["modes_m"], file.get("turned_rad", NOTHING)
    except Exception as error:  # a damaged archive raises anything
        raise InputError(f"{path}: damaged, or not the errors of a track") from error
    if modes.size and modes.shape[1:] != observation.position_m.shape:
        raise InputError(f"{path}: the errors of another track; remove it")
    arrays = {"modes_m": modes, "turned_rad": turned}
    own |= {name: values if values.size else None for name, values in arrays.items()}
    return replace(observation, **own)

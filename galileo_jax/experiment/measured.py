"""From what a lab answered to a clip, or to a line that says why it is none."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.clip.load import check_clip, load_clip
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.clip.track_noise import position_noise_m
from galileo_jax.clip.yaml_file import yaml_text
from galileo_jax.experiment.lab import LabError
from galileo_jax.experiment.settings import known_as
from galileo_jax.observation.observation import Observation
from galileo_jax.results.stale_outputs import digest
from galileo_jax.runtime.atomic_write import write_text
from galileo_jax.runtime.errors import InputError

DECLARED = {"angle": "ramp_angle_deg", "fps": "fps"}
MOST_NOISE_M = 0.05  # of a coordinate: no camera is so bad, and random numbers are worse


def write_clip(
    path: Path,
    text: str,
    declared: Mapping[str, Any],
    settings: Mapping[str, Any],
    others: Mapping[int, Path] | None = None,
) -> Clip:
    """Writes a track and the yaml beside it.

    Angle and frame rate of the settings are declared, too. The track may be none of the `others`,
    by the number of their experiment.

    Raises:
      LabError: it is no track, no clip, or the same as before; nothing is left of it then.
    """
    update = {
        DECLARED[known_as(name)]: value
        for name, value in settings.items()
        if known_as(name) in DECLARED
    }
    scenario = declared.get("scenario")  # one that is not known is for `check_clip` to refuse
    if scenario in SCENARIOS and not SCENARIOS[str(scenario)].has_ramp:
        update.pop("ramp_angle_deg", None)
    content = {key: value for key, value in declared.items() if key != "video"}
    content |= {"track": path.name, **update}
    if not text.strip():
        raise LabError("an empty answer; a csv track expected")
    write_text(path, text)
    yaml = path.with_suffix(".yaml")
    try:
        _check(path)
        # Before the clip is: at another angle the same track has no place.
        _check_new(path, others or {})
        check_clip(yaml, content)
        write_text(yaml, yaml_text(content))
        return load_clip(yaml)
    except InputError as error:
        path.unlink(missing_ok=True)
        yaml.unlink(missing_ok=True)
        said = str(error).removeprefix(f"{path}: ").removeprefix(f"{yaml}: ")
        raise LabError(" ".join(said.split())) from error


def _check_new(path: Path, others: Mapping[int, Path]) -> None:
    """Raises `InputError` where a track is the same as another to the last digit."""
    own = digest(read_observation_csv(path))
    for number, other in others.items():
        if digest(read_observation_csv(other)) == own:
            raise InputError(f"{path}: the same track as in experiment {number}")


def _check(path: Path) -> None:
    """Raises `InputError` where the numbers in a track are those of no motion."""
    seen: Observation = read_observation_csv(path)
    for name, place in zip(seen.names, seen.position_m, strict=True):
        noise = max(position_noise_m(seen.times_s, row) for row in place)
        if noise > MOST_NOISE_M:
            raise InputError(
                f"{path}: {name}: places scatter by {noise:.2g} m from frame to frame; a track in "
                "metres expected"
            )
        if not np.isfinite(place).any():
            raise InputError(f"{path}: {name}: is never seen")

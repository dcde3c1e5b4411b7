"""A synthetic clip's files: the video or track, its yaml, its truth; all of them or none."""

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.clip.load import check_clip
from galileo_jax.clip.schema import ClipObject
from galileo_jax.clip.yaml_file import yaml_text
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.atomic_write import write_json, write_text

YAML_SUFFIX, TRUTH_SUFFIX = ".yaml", ".truth.json"

WriteClip = Callable[[Path], None]
"""Writes the clip's video or track to this path, and yaml and truth beside it."""


def write_yaml_and_truth(out: Path, content: Mapping[str, Any], record: Mapping[str, Any]) -> None:
    """Writes what is declared about the clip `out`, which is there already, and what is true.

    Raises:
      InputError: the clip would not load.
    """
    check_clip(out.with_suffix(YAML_SUFFIX), content)
    write_json(out.with_suffix(TRUTH_SUFFIX), record)
    write_text(out.with_suffix(YAML_SUFFIX), yaml_text(content))


def declared_objects(objects: Sequence[ClipObject]) -> list[dict[str, Any]]:
    """What a clip's yaml says of the objects of a truth."""
    return [
        {"name": each.name, "shape": each.shape, "size_m": list(each.size_m or ())}
        | ({} if each.rolls is None else {"rolls": each.rolls})
        | ({} if each.mass_kg is None else {"mass_kg": float(f"{each.mass_kg:.4g}")})
        | ({"z_m": each.z_m} if each.z_m else {})
        for each in objects
    ]


def noisy_track(
    names: Sequence[str],
    times_s: np.ndarray,
    position_m: np.ndarray,
    sd_m: np.ndarray,
    rng: np.random.Generator,
    *,
    is_turning: bool = False,
) -> Observation:
    """Positions `[object, axis, time]` with normal errors `[object, axis]`, as a track."""
    count, _, length = position_m.shape
    covariance = np.einsum("oa,ab->oab", sd_m**2, np.eye(sd_m.shape[1]))
    return Observation(
        names=tuple(names),
        times_s=times_s,
        position_m=position_m + sd_m[..., None] * rng.standard_normal(position_m.shape),
        covariance_m2=np.broadcast_to(covariance[..., None], (*covariance.shape, length)),
        mask=np.ones((count, length), bool),
        is_turning=is_turning,
    )


@contextmanager
def all_or_nothing(folder: Path) -> Iterator[Path]:
    """Yields an empty folder whose files are moved to `folder` on success only."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".simulate.", dir=folder) as temporary:
        yield Path(temporary)
        for path in Path(temporary).iterdir():
            path.replace(folder / path.name)

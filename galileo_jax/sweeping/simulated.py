"""Clips that a sweep makes for itself, with known truth."""

from collections.abc import Iterable
from pathlib import Path

from galileo_jax.api.simulate import simulate
from galileo_jax.sweeping.config import Simulated


def simulated_clips(folder: Path, wanted: Iterable[Simulated]) -> list[Path]:
    """Makes clips with `simulate`, those that are there already left as they are.

    Returns:
      their videos or tracks.

    Raises:
      InputError: there is no such effect, or it has no place in the scene.
    """
    paths = []
    for one in wanted:
        strength = "" if one.strength is None else f"{one.strength:g}"
        for seed in range(one.seed, one.seed + one.count):
            suffix = ".mp4" if one.video else ".csv"
            path = folder / f"{one.effect or 'none'}{strength}_{seed}{suffix}"
            paths.append(path)
            if all(path.with_suffix(end).is_file() for end in (suffix, ".yaml", ".truth.json")):
                continue
            simulate(
                path,
                seed=seed,
                track_only=not one.video,
                effects=(one.effect,) if one.effect else (),
                strength=one.strength,
            )
    return paths

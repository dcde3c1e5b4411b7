"""Clips that a sweep makes for itself, with known truth."""

import contextlib
import io
from collections.abc import Iterable
from pathlib import Path

from galileo_jax.commands import simulate
from galileo_jax.sweeping.config import Simulated


def simulated_clips(folder: Path, wanted: Iterable[Simulated]) -> list[Path]:
    """Makes clips with `galileo simulate`, those that are there already left as they are.

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
            words = ["--seed", str(seed), "--out", str(path)]
            words += [] if one.video else ["--track-only"]
            words += ["--effect", one.effect] if one.effect else []
            words += ["--strength", str(one.strength)] if one.strength is not None else []
            with contextlib.redirect_stdout(io.StringIO()):
                simulate.main(words)
    return paths

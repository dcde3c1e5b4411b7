"""Random ramp experiments as videos, for the benchmarks that track and fit rendered clips."""

from pathlib import Path
from typing import Any

import numpy as np
import yaml

import galileo_jax as gx
from galileo_jax.similarity.discrepancy import SCALE_SD

ANGLES_DEG, EXPOSURES_S = (10.0, 28.0), (0.001, 0.012)
FRAME_RATES, SIZES_PX = (30.0, 60.0), ((640, 360), (1280, 720))
IDEAL, FAULTY, MEASURED = "rendered", "rendered-faults", "rendered-measured"
SORTS = (IDEAL, FAULTY, MEASURED)
FAULTS: dict[str, Any] = {"faults": True, "camera_fault": ("keystone",), "solver": "fine"}


def render(folder: Path, sort: str, seed: int) -> gx.Simulated:
    """Writes one clip.

    Args:
      folder: of the files.
      sort: IDEAL: the engine that fits, a camera square to the scene; FAULTY: another solver,
        release, foot and hit that are not ideal, and a camera held askew; both declare their
        scale as exact; MEASURED: as FAULTY, with a scale that is `SCALE_SD` off, and nothing
        said about how well it is known.
      seed: of all that is drawn.
    """
    rng = np.random.default_rng([seed, 7])
    drawn: dict[str, Any] = {
        "angle": float(rng.uniform(*ANGLES_DEG)),
        "fps": float(rng.choice(FRAME_RATES)),
        "size": SIZES_PX[rng.integers(len(SIZES_PX))],
        "exposure": float(rng.uniform(*EXPOSURES_S)),
    }
    faults = {} if sort == IDEAL else FAULTS
    made = gx.simulate(folder / f"{sort}_{seed}.mp4", seed=seed, **drawn, **faults)
    if sort == MEASURED:
        for clip in made.clips:
            declared = clip.with_suffix(".yaml")
            content = yaml.safe_load(declared.read_text())
            content["pixels_per_metre"] *= 1.0 + SCALE_SD * float(rng.standard_normal())
            del content["pixels_per_metre_sd"]
            declared.write_text(yaml.safe_dump(content, sort_keys=False))
    return made

"""Runs of consecutive chosen frames."""

import numpy as np
from jaxtyping import Bool


def stretches(chosen: Bool[np.ndarray, " frame"]) -> list[slice]:
    """The runs of chosen frames that follow each other."""
    steps = np.diff(np.concatenate([[0], chosen.astype(int), [0]]))
    ends = zip(np.flatnonzero(steps > 0), np.flatnonzero(steps < 0), strict=True)
    return [slice(int(first), int(after)) for first, after in ends]

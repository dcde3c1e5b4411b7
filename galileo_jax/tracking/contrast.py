"""Pictures in one colour: grey, or where that hides what moves, the mixture that shows it best.

What moves differs from the scene by d, a colour. Mixed by weights w, |w| = 1, it stands out by

    sqrt(w' D w),    D = mean of d d' over pixels that moved

which is largest for the first eigenvector of D. An orange ball before a wall as bright is nothing
in grey.
"""

import numpy as np
from jaxtyping import Float

from galileo_jax.tracking.picture import OpenFrames, mixture, some_frames

GREY = np.array([0.114, 0.587, 0.299])  # of blue, green, red, as `template.grey` mixes them
WIDTH_PX = 320  # frames are made so small
MOVED = 30.0  # levels; by less noise differs
LEAST_PIXELS, MOST_SHARE = 30, 0.2  # fewer tell nothing; where more differ the camera moves
ENOUGH = 0.5  # of the contrast of the best mixture: then grey, whose edges films keep sharper


def in_contrast(open_frames: OpenFrames, count: int) -> OpenFrames:
    """The frames as they are, or each mixed to one colour `[height, width]` uint8.

    Args:
      open_frames: gives the frames, BGR; called once for this.
      count: of the frames.
    """
    weights = _weights(open_frames, count)
    if weights is None:
        return open_frames
    mixed = mixture(weights, -255.0 * np.minimum(weights, 0.0).sum())
    return lambda: map(mixed, open_frames())


def _weights(open_frames: OpenFrames, count: int) -> Float[np.ndarray, "3"] | None:
    """Of blue, green and red, their sizes adding up to 1; None: grey shows what moves."""
    kept = [_small(frame) for frame in some_frames(open_frames, count).values()]
    if len(kept) < 3 or kept[0].ndim < 3:
        return None
    off = (kept - np.median(kept, axis=0)).reshape(-1, 3)
    moved = off[np.einsum("ij,ij->i", off, off) > MOVED**2]
    if not LEAST_PIXELS <= len(moved) <= MOST_SHARE * len(off):
        return None
    square = moved.T @ moved
    sizes, ways = np.linalg.eigh(square)
    if GREY @ square @ GREY / (GREY @ GREY) > ENOUGH**2 * sizes[-1]:
        return None
    return ways[:, -1] / np.abs(ways[:, -1]).sum()


def _small(frame: np.ndarray) -> np.ndarray:
    step = -(-frame.shape[1] // WIDTH_PX)
    return frame[::step, ::step].astype(np.float32)

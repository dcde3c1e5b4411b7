"""Linear stochastic differential equations and the covariance of what they are seen to do.

    dx = A x dt + L dB,    x(t + h) = F x(t) + w,   w ~ N(0, Q),
    F = exp(A h),   Q = int_0^h exp(A u) L L^T exp(A u)^T du

Source: Van Loan (1978), Computing integrals involving the matrix exponential, IEEE Trans. Autom.
Control 23, 395; Sarkka and Solin (2019), Applied Stochastic Differential Equations, section 6.2.
"""

from typing import NamedTuple

import numpy as np
import scipy.linalg
from jaxtyping import Float

LARGEST_RATE = 0.5  # of a step whose exponential is taken; longer ones are doubled from it


class Transitions(NamedTuple):
    """From each frame to the next."""

    step: Float[np.ndarray, "step state state"]  # F
    noise: Float[np.ndarray, "step state state"]  # Q


def transitions(
    drift: Float[np.ndarray, "step state state"],
    diffusion: Float[np.ndarray, "step state state"],
    duration_s: Float[np.ndarray, " step"],
) -> Transitions:
    """The transitions over steps in each of which A and L L^T, of unit white noise, are constant.

    `drift`: A, 1/s. `diffusion`: L L^T, 1/s.
    """
    size = drift.shape[-1]
    rate = np.abs(drift).sum(axis=-1).max(axis=-1, initial=0.0) * duration_s
    doublings = int(np.ceil(np.log2(max(float(rate.max(initial=0.0)) / LARGEST_RATE, 1.0))))
    short = (duration_s / 2**doublings)[:, None, None]
    both = np.zeros((len(drift), 2 * size, 2 * size))
    both[:, :size, :size] = -drift
    both[:, :size, size:] = diffusion
    both[:, size:, size:] = np.swapaxes(drift, 1, 2)
    found = scipy.linalg.expm(both * short)
    step = np.swapaxes(found[:, size:, size:], 1, 2)
    noise = step @ found[:, :size, size:]
    for _ in range(doublings):
        noise = step @ noise @ np.swapaxes(step, 1, 2) + noise
        step = step @ step
    return Transitions(step, (noise + np.swapaxes(noise, 1, 2)) / 2)


def covariance(
    way: Transitions,
    start: Float[np.ndarray, "state state"],
    seen: Float[np.ndarray, "frame seen state"],
) -> Float[np.ndarray, "frame seen frame seen"]:
    """The covariance of `seen @ x` at all frames, x of covariance `start` at the first."""
    frames, num_seen, _ = seen.shape
    found = np.zeros((frames, num_seen, frames, num_seen))
    now = start
    # [earlier frame, state, seen]: covariance of the state now with what was seen then.
    with_earlier = np.zeros((frames, len(start), num_seen))
    for frame in range(frames):
        if frame:
            step, noise = way.step[frame - 1], way.noise[frame - 1]
            now = step @ now @ step.T + noise
            with_earlier[:frame] = step @ with_earlier[:frame]
        with_earlier[frame] = now @ seen[frame].T
        both = seen[frame] @ with_earlier[: frame + 1]  # [earlier, seen now, seen then]
        found[frame, :, : frame + 1] = np.swapaxes(both, 0, 1)
        found[: frame + 1, :, frame] = np.swapaxes(both, 1, 2)
    return found

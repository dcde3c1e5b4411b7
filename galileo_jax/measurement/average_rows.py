"""Fewer rows of a long track, with the errors of their means: a fit's time grows with the rows.

Of n rows that follow each other, with p the polynomial through these and n more to either side,

    x(t_mean) = mean of (x - p)(t) + p(t_mean),    which is the linear sum of w_i x_i over 3 n rows

so that a curved path is not flattened, and the covariance is that of sum w_i x_i. Rows that p does
not describe (a hit, a release) stay as they are, as do those next to a gap, and the first ones: a
start is inferred for the first row in which something is seen.
"""

import math
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from galileo_jax.observation.observation import UNMEASURED_SD_M, Observation

MOST_ROWS = 500
FEWEST, MOST_TERMS = 4, 6  # rows, and terms of p: no more than half of its rows and one
CLEAR = 4.0  # sds by which chi2 may be beyond what is expected


def with_rows_averaged(observation: Observation) -> tuple[Observation, list[str]]:
    """The observation with about `MOST_ROWS` rows, and a line that says so; as it is, if fewer."""
    seen = int(observation.mask.any(axis=0).sum())
    rows = seen
    if observation.is_tracked_here:  # as many as one object in a plane has with as many values
        rows = observation.mask.sum() * observation.position_m.shape[1] / 2
    size = math.ceil(rows / MOST_ROWS)
    if size < 2:
        return observation, []
    weights, kept = _weights(observation, size)
    if len(kept) == len(observation.times_s):
        return observation, []
    mask = observation.mask[:, kept]
    position = np.where(observation.mask[:, None], observation.position_m, 0.0) @ weights.T
    stated = np.where(observation.mask[:, None, None], observation.covariance_m2, 0.0)
    covariance = np.where(mask[:, None, None], stated @ (weights**2).T, np.nan)
    across = observation.across[..., kept]  # no mean makes known what was not measured
    missing = UNMEASURED_SD_M**2 - np.einsum("oat,oabt,obt->ot", across, covariance, across)
    covariance += np.einsum("ot,oat,obt->oabt", missing, across, across)
    modes, turned = observation.modes_m, observation.turned_rad
    # Of groups the mean, of single rows their own.
    counts = np.where((weights != 0).sum(axis=1) > 1, size, 1)
    averaged = replace(
        observation,
        times_s=np.array(
            [
                observation.times_s[first : first + count].mean()
                for first, count in zip(kept, counts, strict=True)
            ]
        ),
        position_m=np.where(mask[:, None], position, np.nan),
        covariance_m2=covariance,
        mask=mask,
        modes_m=None if modes is None else modes @ weights.T,
        turned_rad=None if turned is None else turned @ weights.T,
    )
    rows = int(mask.any(axis=0).sum())
    return averaged, [
        f"{seen} rows are averaged in groups of up to {size}, with the errors of their means: "
        f"{rows} are fitted"
    ]


def _weights(
    observation: Observation, size: int
) -> tuple[Float[np.ndarray, "row frame"], np.ndarray]:
    """What each new row takes of each frame, and the first frame of each."""
    count, start = len(observation.times_s), int(observation.mask.any(axis=0).argmax())
    single, rows = np.eye(count), []
    for first in range(0, count, size):
        group = slice(first, min(first + size, count))
        around = slice(max(first - size, 0), min(first + 2 * size, count))
        own = None if first <= start else _of_group(observation, group, around)
        if own is None:
            rows += [(i, single[i]) for i in range(group.start, group.stop)]
        else:
            rows.append((first, np.pad(own, (around.start, count - around.stop))))
    return np.array([row for _, row in rows]), np.array([first for first, _ in rows])


def _of_group(observation: Observation, group: slice, around: slice) -> np.ndarray | None:
    """The weights of the frames `around` in the mean of `group`; None: they stay as they are."""
    times, mask = observation.times_s[around], observation.mask[:, around]
    is_seen = np.asarray(mask.any(axis=1))
    width = group.stop - group.start
    terms = min(MOST_TERMS, len(times) // 2 + 1)
    if width < 2 or len(times) < FEWEST or not (mask.all(axis=1) == is_seen).all():
        return None
    since = (times - times.mean()) / (times[-1] - times[0])
    powers = np.vander(since, terms)
    fit = np.linalg.pinv(powers)
    is_own = np.zeros(len(times))
    is_own[group.start - around.start : group.stop - around.start] = 1 / width
    weights = is_own + (np.vander([is_own @ since], terms)[0] - is_own @ powers) @ fit
    if not is_seen.any():
        return weights
    place = observation.position_m[is_seen][..., around]
    left = (place - place @ fit.T @ powers.T).ravel()
    chi2 = left @ np.linalg.solve(_errors_m2(observation, is_seen, around), left)
    num_lines = (observation.across[is_seen][..., around] != 0).any(axis=(1, 2)).sum()
    degrees = (place.shape[0] * place.shape[1] - num_lines) * (len(times) - terms)
    is_smooth = chi2 < degrees + CLEAR * math.sqrt(2 * degrees)
    return weights if is_smooth else None


def _errors_m2(
    observation: Observation, is_seen: np.ndarray, around: slice
) -> Float[np.ndarray, "value value"]:
    """The covariance of all errors of the frames `around`: own ones, and those that they share."""
    own = observation.covariance_m2[is_seen][..., around]
    objects, axes, _, frames = own.shape
    whole = np.zeros((objects, axes, frames, objects, axes, frames))
    one, frame = np.arange(objects)[:, None], np.arange(frames)
    whole[one, :, frame, one, :, frame] = np.moveaxis(own, -1, 1)
    whole = whole.reshape(2 * (objects * axes * frames,))
    if observation.modes_m is None:
        return whole
    modes = observation.modes_m[:, is_seen][..., around].reshape(-1, len(whole))
    return whole + modes.T @ modes

"""Places beside a path that goes on without them: for a moment a tracker saw something else.

Some places in a row are no places of the object if

    it goes on without them     one cubic of time through `BESIDE` places before and as many after
                                leaves no more than a parabola on either side does (F ratio)
    they lie beside it          their distances from it are what `CHANCE` makes of such errors alone
    it would leap there         neither parabola leads to the nearest of them

A stop or a bounce fails the first; a bend that is quick for the frame rate fails the last.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool
from scipy import special

from galileo_jax.numerics.least_squares import LinearFit
from galileo_jax.numerics.runs import stretches
from galileo_jax.observation.observation import Observation, PointPath

BESIDE, MOST = 6, 12  # places on either side, and at most between them
CHANCE = 1e-6  # a track has hundreds of places
DOUBT = 1e-3  # of a leap alone, and of a path that goes on
AT_END = 2  # places after which the path may go on
NAMED = 4  # runs of places


def on_path(observation: Observation) -> tuple[Observation, tuple[str, ...]]:
    """An observation without such places, and a line on each object that has some."""
    off = off_path(observation)
    each = zip(observation.names, off, strict=True)
    said = tuple(_text(name, own, observation.times_s) for name, own in each if own.any())
    return replace(observation, mask=observation.mask & ~off), said


def _text(name: str, off: Bool[np.ndarray, " frame"], times_s: np.ndarray) -> str:
    """How many places of an object lie beside its path, and when."""
    ends = [times_s[run][[0, -1]] for run in stretches(off)]
    when = [f"{a:.3f} s" if a == b else f"{a:.3f} to {b:.3f} s" for a, b in ends]
    when = when if len(when) <= NAMED else [*when[:NAMED], "..."]
    one = off.sum() == 1
    return (
        f"{name}: {'a place lies' if one else f'{off.sum()} places lie'} beside its path "
        f"({', '.join(when)}), which goes on without {'it' if one else 'them'}: left out"
    )


def off_path(observation: Observation) -> Bool[np.ndarray, "object frame"]:
    """Which places of the objects lie beside a path that goes on without them."""
    found = np.zeros_like(observation.mask)
    lines = np.flatnonzero(observation.across.any(axis=(1, 2)))
    for i in range(len(observation.names)):
        path = observation.path(i)
        axes = 1 if i in lines else len(path.place_m)
        while (off := _first_run(path, axes)) is not None:
            found[i, path.frames[off]] = True
            path = path[np.setdiff1d(np.arange(len(path)), off)]
    return found


def end_of_path(observation: Observation) -> int | None:
    """The last frame of object 1 before one or two at the end to which its path does not lead.

    Neither the parabola of the `MOST` places before nor a cubic does: too few to tell what happens
    there, and not of the motion before. None where it leads to the last.
    """
    path = observation.path()
    axes = 1 if observation.across[0].any() else len(path.place_m)
    for last in (len(path) - AT_END, len(path) - AT_END + 1):
        if last < MOST:
            continue
        near = path[last - MOST :]
        fits = [near[:MOST].polynomial(degree, near.times_s[0]) for degree in (2, 3)]
        rows = range(MOST, len(near))
        if all(_is_off(near, fit, row, axes, CHANCE) for fit in fits for row in rows):
            return int(path.frames[last - 1])
    return None


def _first_run(path: PointPath, axes: int) -> np.ndarray | None:
    """The first places in a row that lie beside a path, by their numbers in it; None: none do.

    `axes`: how many were measured.
    """
    for first in range(BESIDE, len(path) - BESIDE):
        near = path[first - BESIDE : first + MOST + BESIDE]
        if not _is_off(near, near[:BESIDE].polynomial(2, near.times_s[0]), BESIDE, axes):
            continue
        for after in range(BESIDE + 1, len(near) - BESIDE + 1):
            off = _between(near, after, axes)
            if off is not None:
                return first - BESIDE + off
    return None


def _between(near: PointPath, after: int, axes: int) -> np.ndarray | None:
    """Which places from `BESIDE` to before `after` lie beside a short path; None: it is one."""
    sides = slice(BESIDE), slice(after, after + BESIDE)
    first_s = near.times_s[0]
    parabolas = [near[side].polynomial(2, first_s) for side in sides]
    if not _is_off(near, parabolas[1], after - 1, axes):
        return None
    both = np.r_[sides]
    whole = near[both].polynomial(3, first_s)
    alone = sum(float(np.sum(fit.left**2)) for fit in parabolas)
    freedom = axes * sum(len(fit.design) - fit.design.shape[1] for fit in parabolas)
    more = axes * (len(both) - 4) - freedom
    worse = (float(np.sum(whole.left**2)) - alone) / more / (alone / freedom)
    if special.fdtrc(more, freedom, worse) < DOUBT:
        return None
    rows = np.arange(BESIDE, after)
    beside, cover = _beside(near, whole, rows)
    left = float(np.sum(whole.left**2)) / (axes * (len(both) - 4))
    apart = float(np.sum(beside * np.linalg.solve(cover, beside))) / (axes * len(rows)) / left
    if special.fdtrc(axes * len(rows), axes * (len(both) - 4), apart) > CHANCE:
        return None
    return rows[[_is_off(near, whole, int(row), axes) for row in rows]]


def _beside(path: PointPath, fit: LinearFit, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far places lie beside a fit, `[row, axis]`, and its covariance in the variance of one."""
    powers = np.vander(path.times_s[rows] - path.times_s[0], fit.design.shape[1])
    cover = np.eye(len(rows)) + powers @ fit.inverse @ powers.T
    return path.place_m[:, rows].T - powers @ fit.solution, cover


def _is_off(path: PointPath, fit: LinearFit, row: int, axes: int, most: float = DOUBT) -> bool:
    """Whether a fit does not lead to a place: by errors alone with a chance of `most`."""
    beside, cover = _beside(path, fit, np.array([row]))
    freedom = axes * (len(fit.design) - fit.design.shape[1])
    left = float(np.sum(fit.left**2)) / freedom
    ratio = float(np.sum(beside**2)) / axes / (cover[0, 0] * max(left, np.finfo(float).tiny))
    return bool(special.fdtrc(axes, freedom, ratio) < most)

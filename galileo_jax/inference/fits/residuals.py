"""Whitened residuals of many hypotheses' points, and their slopes, by batches of rollouts."""

from collections.abc import Callable, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from galileo_jax.inference.fits.fitted_clip import FittedClip
from galileo_jax.inference.fits.kernels import Quadratic, seen_slopes_batch, white_batch
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.runtime.batching import MOTIONS, in_chunks, rounded_up

Motions = list[tuple[np.ndarray, ...]]
"""For each clip parameters in their units, and centres and velocities `[point, ...]`."""

Sides = Literal["ahead", "both", "open"]
"""Of differences: forward; the mean of both sides; both sides, as far as each is open (`_open`)."""

POINTS = (4, 16)  # sizes of compiled batches of hypotheses
FREE = 4  # numbers of free parameters are rounded up to multiples


class Batch(NamedTuple):
    """Points of several hypotheses."""

    z: Float[np.ndarray, "point parameter"]  # 0 where pinned
    free: Bool[np.ndarray, "point parameter"]  # `[point, model parameter]`
    noise: Float[np.ndarray, "point clip"]  # noise scales

    def take(self, index: Any) -> "Batch":
        """The points of an index array."""
        return Batch(*(leaf[index] for leaf in self))


class Slopes(NamedTuple):
    """Residuals of points and how they change with each point's free parameters."""

    # for each clip; 0 beyond a point's own number of them
    jacobian: list[Float[np.ndarray, "point value free"]]
    white: list[Float[np.ndarray, "point value"]]  # for each clip
    # where the free parameters stand among the models'; beyond, the count of all
    index: Int[np.ndarray, "point free"]
    count: int  # of the models' parameters

    def take(self, rows: Any) -> "Slopes":
        """Those of the points of an index array."""
        jacobian, white = ([own[rows] for own in each] for each in (self.jacobian, self.white))
        return Slopes(jacobian, white, self.index[rows], self.count)

    def put(self, points: np.ndarray, other: "Slopes", rows: np.ndarray) -> None:
        """Rows of others, which may have been made with fewer columns, in the place of points'."""
        width = other.index.shape[1]
        for mine, its in zip(self.jacobian, other.jacobian, strict=True):
            mine[points, :, :width] = its[rows]
        for mine, its in zip(self.white, other.white, strict=True):
            mine[points] = its[rows]

    def among_all(self, values: np.ndarray, axis: int = 1) -> np.ndarray:
        """Numbers of free parameters along an axis as numbers of all: 0 of those pinned."""
        shape = [1] * values.ndim
        shape[0], shape[axis] = self.index.shape
        found = np.zeros((*values.shape[:axis], self.count + 1, *values.shape[axis + 1 :]))
        np.put_along_axis(found, self.index.reshape(shape), values, axis)
        return np.delete(found, self.count, axis)


class Residuals:
    """Of all clips of the trials; values of a clip as in `Problem.whiten`, in padded frames.

    `clips` are ready for compiled code; `num_rollouts` were made so far.
    """

    def __init__(self, trials: JointProblem):
        self.clips = tuple(FittedClip.of(trials, c) for c in range(len(trials.problems)))
        self.num_rollouts = 0
        self._count = len(trials.model_parameters)
        self._is_simulated = np.array([p.step is not None for p in trials.model_parameters])

    def costs(self, points: Batch) -> Float[np.ndarray, " point"]:
        """chi2 / 2 and the prior's part, `[point]`."""
        return cost(self.whites(points), points.z)

    def whites(self, points: Batch) -> list[Float[np.ndarray, "point value"]]:
        """Whitened residuals, `[point, value]`, clip by clip."""
        return [self._whites(c, points) for c in range(len(self.clips))]

    def motions(self, points: Batch) -> Motions:
        """By rollouts, clip by clip."""
        self.num_rollouts += len(self.clips) * len(points.z)
        thetas = [clip.theta(points.z, points.free) for clip in self.clips]
        each = zip(self.clips, thetas, strict=True)
        return [(theta, *clip.problem.motion(theta)) for clip, theta in each]

    def whites_of(self, points: Batch, motions: Motions) -> list[Float[np.ndarray, "point value"]]:
        """Whitened residuals, `[point, value]`, clip by clip, of points that were rolled out."""
        each = zip(self.clips, motions, points.noise.T, strict=True)
        return [in_chunks(MOTIONS, _white(clip), *motion, noise) for clip, motion, noise in each]

    def slopes(
        self, points: Batch, steps: np.ndarray, sides: Sides, motions: Motions | None = None
    ) -> Slopes:
        """By differences, where the motion changes; in parameters of clock and camera by JAX.

        `steps`: `[point, model parameter]`, in z. `motions`: of the points, where they are known.
        """
        index, signs = _free_index(points.free), (1,) if sides == "ahead" else (1, -1)
        jacobians, whites = [], []
        for c, motion in enumerate(motions or self.motions(points)):
            white, jacobian = self._seen_slopes(c, points, index, motion)
            moves = np.append(self._is_simulated, False)
            moves &= np.isin(np.arange(self._count + 1), self.clips[c].column)
            point, slot = np.nonzero(moves[index])
            which = index[point, slot]
            step, rows = steps[point, which], np.arange(len(point))
            aside = [points.take(point) for _ in signs]
            for batch, sign in zip(aside, signs, strict=True):
                batch.z[rows, which] += sign * step
            moved = self._whites(c, Batch(*map(np.concatenate, zip(*aside, strict=True))))
            each = np.stack(np.split(moved, len(signs))) - white[point]
            each /= np.multiply.outer(signs, step)[..., None]
            jacobian[point, :, slot] = _open(each) if sides == "open" else each.mean(axis=0)
            whites.append(white)
            jacobians.append(jacobian)
        return Slopes(jacobians, whites, index, self._count)

    def no_slopes(self, free: Bool[np.ndarray, "point parameter"]) -> Slopes:
        """Of points that are nowhere yet: 0."""
        index = _free_index(free) if len(free) else np.zeros((0, FREE), int)
        sizes = [clip.whitening.observed_m.size for clip in self.clips]
        jacobian = [np.zeros((len(free), size, index.shape[1])) for size in sizes]
        return Slopes(jacobian, [np.zeros((len(free), size)) for size in sizes], index, self._count)

    def _seen_slopes(
        self, c: int, points: Batch, index: np.ndarray, motion: tuple[np.ndarray, ...]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Residuals of a clip's points, and slopes as of `Slopes` in clock and camera; others 0."""
        clip = self.clips[c]
        theta, *moved = motion
        share, rates = clip.problem.share, clip.rates(points.z)
        # Where each of its parameters stands among those of all clips; in none: the count of all.
        own = np.append(clip.column, np.full(len(share.absent), self._count))[share.columns]
        is_seen = np.pad(points.free & ~self._is_simulated, [(0, 0), (0, 1)])
        seen = _free_index(is_seen[:, own])
        white, slopes = in_chunks(
            POINTS,
            lambda *rows: seen_slopes_batch(clip.problem.kind, *rows, clip.arrays),
            *(share.of(theta), seen, points.noise[:, c], *moved),
        )
        jacobian = np.zeros((*white.shape, index.shape[1]))
        point, column = np.nonzero(seen < len(own))
        which = seen[point, column]
        slot = np.argmax(index[point] == own[which][:, None], axis=1)
        rate = rates[point, share.columns[which]]
        jacobian[point, :, slot] = rate[:, None] * slopes[point, :, column]
        return white, jacobian

    def _whites(self, c: int, points: Batch) -> Float[np.ndarray, "point value"]:
        """Whitened residuals of a clip, of points that were not rolled out."""
        clip = self.clips[c]
        if not len(points.z):
            return np.zeros((0, clip.whitening.observed_m.size))
        self.num_rollouts += len(points.z)
        theta = clip.theta(points.z, points.free)
        return clip.problem.of_motions(theta, _white(clip), points.noise[:, c])


def _open(each: Float[np.ndarray, "side row value"]) -> Float[np.ndarray, "row value"]:
    """The slope from those to either side, in proportion to the variance 1 / (1 + J^T J) of each.

    At a mode beside a wall (a disc that would slip, a hit that would come before the foot) the
    posterior lies on the other side, and a mean would take it for as narrow as the wall is steep.
    Where motion is smooth it is the mean.
    """
    variance = 1.0 / (1.0 + np.sum(each**2, axis=-1, keepdims=True))
    return np.sum(variance * each, axis=0) / variance.sum(axis=0)


def _white(clip: FittedClip) -> Callable[..., Any]:
    """`(theta, position, velocity, noise)`, each `[point, ...]`, to residuals `[point, value]`."""
    kind, own = clip.problem.kind, clip.problem.share.of
    return lambda theta, *part: white_batch(kind, own(theta), *part, clip.arrays)


def cost(white: Sequence[np.ndarray], z: np.ndarray) -> np.ndarray:
    """chi2 / 2 of residuals of several clips and the prior's part, over the last axis."""
    return 0.5 * (sum(np.sum(w**2, axis=-1) for w in white) + np.sum(z**2, axis=-1))


def quadratic(slopes: Slopes, z: np.ndarray) -> Quadratic:
    """The cost round points z `[point, model parameter]`."""
    gradient = np.zeros(slopes.index.shape)
    normal = np.zeros((*slopes.index.shape, slopes.index.shape[1]))
    for j, w in zip(slopes.jacobian, slopes.white, strict=True):
        turned = np.swapaxes(j, 1, 2)
        gradient += (turned @ w[..., None])[..., 0]
        normal += turned @ j
    whole = slopes.among_all(slopes.among_all(normal), axis=2)
    whole += np.eye(z.shape[1])
    return Quadratic(z, cost(slopes.white, z), z + slopes.among_all(gradient), whole)


def _free_index(free: np.ndarray) -> np.ndarray:
    """Where each point's free parameters stand, `[point, free]`; the count of all = none."""
    width = rounded_up(max(int(free.sum(axis=1).max()), 1), FREE)
    index = np.full((len(free), width), free.shape[1])
    for row, own in zip(index, free, strict=True):
        found = np.flatnonzero(own)
        row[: len(found)] = found
    return index

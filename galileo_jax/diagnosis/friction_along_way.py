"""The friction coefficient along the way, by what a fit with roughness leaves.

    f(a, b) = mean of k from t_a to t_b - (dv_b - dv_a) / (n (t_b - t_a))
    E[f | e] = f_0 + Cov(f, e) (C + J J^T)^-1 e

in the linear model round the fit (`inference.fits.linear_clip`); dv: the deviation of the speed of
`statespace.path_deviation`, which an excess of friction makes; n: what presses the body onto the
surface, over its mass. It is the smoothed process noise of what slides. How much friction there is
on a stretch is known well; how much of it is the coefficient k and how much deviates is not.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from galileo_jax.diagnosis.thresholds import PUSHES_SD
from galileo_jax.inference.fits.laplace import GradientFit
from galileo_jax.inference.fits.linear_clip import averaged, linear_clips
from galileo_jax.inference.joint_problem import NOISE_SD, JointProblem
from galileo_jax.inference.problem import Problem
from galileo_jax.rollout.motion import dynamics, state_at
from galileo_jax.similarity.gaussian_likelihood import white_patterns
from galileo_jax.statespace.kinematics import Kinematics
from galileo_jax.statespace.path_deviation import PLACE, SPEED, deviations
from galileo_jax.statespace.terms import ROUGH_LENGTH_M, ROUGHNESS, TERMS

SHOWN = 4  # steps of a stretch that tell an acceleration, as in `statespace.kinematics`
STEP = 1e-4  # of z, for slopes


class Stretch(NamedTuple):
    """The friction of one body on a stretch of its way."""

    name: str  # of the body
    steps: int  # between how many frames: 1, 2, 4, ...
    # past the foot; on a slope alone, from where the track counts
    from_m: float
    to_m: float
    # of the mean coefficient
    mean: float
    sd: float

    @property
    def pushes(self) -> bool:
        """Whether it is negative beyond doubt: no surface pushes what slides on it."""
        return self.mean + PUSHES_SD * self.sd < 0


def friction_along_way(
    trials: JointProblem, fit: GradientFit, clip: int = 0
) -> tuple[Stretch, ...]:
    """The friction of one clip's bodies on all stretches in which these move smoothly."""
    problem, linear = trials.problems[clip], linear_clips(trials, fit)[clip]
    motion, sizes = problem.seen_motion.motion, fit.sizes
    assert motion is not None and sizes is not None
    count, frames = motion.speed_m_s.shape
    body, first, last = _stretches(motion)
    size = problem.size(TERMS[ROUGHNESS], sizes.by_name[ROUGHNESS])
    both = deviations(motion, ROUGH_LENGTH_M, size, shown=(PLACE, SPEED))
    both = np.moveaxis(both.reshape(frames, 2, count, frames, 2, count), (1, 4), (0, 1))
    (places, _), (speeds_places, speeds) = both.reshape(2, 2, frames * count, -1)
    coefficient, slopes = _coefficients(trials, fit, clip)
    takes, means = _averages(motion, body, first, last)
    shown = averaged(_moved(problem, motion.tangent), problem)
    slopes = means @ slopes
    together = takes @ speeds_places @ shown - slopes @ linear.slopes.T
    scale = np.log(trials.noise_scale(trials.theta(fit.z, fit.free), clip)) / NOISE_SD
    others = [term for term in trials.terms if term.name != ROUGHNESS]
    x = np.array([sizes.by_name[term.name] for term in others])
    cover = linear.covariance(others, x, scale) + linear.slopes @ linear.slopes.T
    gain = np.linalg.solve(cover + shown.T @ places @ shown, together.T).T
    at_middle = means @ coefficient - slopes @ fit.z[: slopes.shape[1]]  # where z is 0
    variance = np.einsum("st,tu,su->s", takes, speeds, takes, optimize=True)
    variance += np.sum(slopes**2, axis=1) - np.sum(gain * together, axis=1)
    sd = np.sqrt(np.maximum(variance, 0.0))
    ends = motion.path_m[body, first], motion.path_m[body, last]
    columns = (last - first, *ends, at_middle + gain @ linear.e, sd)
    names = (problem.observation.names[i] for i in body)
    return tuple(map(Stretch, names, *(column.tolist() for column in columns)))


def _stretches(motion: Kinematics) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bodies, first and last frames of stretches in which a body moves and nothing is hit."""
    smooth = motion.moves.copy()
    for hit in motion.hits:
        smooth[:, hit.step] = False
    found = []
    for body, steps in enumerate(smooth):
        gone = np.append(0, np.cumsum(steps))
        length = 1
        while length <= len(steps):
            first = np.flatnonzero(gone[length:] - gone[:-length] == length)
            found.append(np.stack([np.full(len(first), body), first, first + length]))
            length *= 2
    body, first, last = np.concatenate(found, axis=1) if found else np.zeros((3, 0), int)
    return body, first, last


def _averages(
    motion: Kinematics, body: np.ndarray, first: np.ndarray, last: np.ndarray
) -> tuple[Float[np.ndarray, "stretch case"], Float[np.ndarray, "stretch case"]]:
    """What a stretch's mean takes of speeds' deviations and of coefficients, each in each frame."""
    count, frames = motion.speed_m_s.shape
    takes, means = np.zeros((2, len(body), frames, count))
    row = np.arange(len(body))
    pressed = np.append(np.zeros((count, 1)), np.cumsum(motion.normal_m_s2, axis=1), axis=1)
    normal = (pressed[body, last + 1] - pressed[body, first]) / (last + 1 - first)
    over = normal * (motion.times_s[last] - motion.times_s[first])
    takes[row, first, body] = 1 / over
    takes[row, last, body] = -1 / over
    frame = np.arange(frames)
    inside = (frame >= first[:, None]) & (frame <= last[:, None])
    means[row, :, body] = inside / inside.sum(axis=1, keepdims=True)
    return takes.reshape(len(body), -1), means.reshape(len(body), -1)


def _moved(problem: Problem, tangent: np.ndarray) -> np.ndarray:
    """What is seen, in stated errors, if one body is 1 m farther in one frame, `[case, ...]`."""
    count, axes, frames = tangent.shape
    unit = np.zeros((frames, count, count, axes, frames))
    for i in range(count):
        unit[np.arange(frames), i, i, :, np.arange(frames)] = tangent[i].T
    return white_patterns(unit.reshape(-1, count, axes, frames), problem.data.inverse_root)


def _coefficients(
    trials: JointProblem, fit: GradientFit, clip: int
) -> tuple[Float[np.ndarray, " case"], Float[np.ndarray, "case parameter"]]:
    """The model's coefficients in each frame of each body, where it was seen, and their slopes."""
    problem = trials.problems[clip]
    model, motion = problem.model, problem.seen_motion.motion
    assert motion is not None
    scene, parts = model.scene.surroundings, model.effects + model.nuisances
    count = len(trials.model_parameters)
    z = np.tile(fit.z, (count + 1, 1))
    z[1:, :count] += STEP * np.diag(fit.free[:count].astype(float))
    theta = trials.of_clip(trials.theta(z, fit.free), clip)
    law = dynamics(parts, scene, model.by_name(theta), np)
    found = []
    for time, path, speed in zip(motion.times_s, motion.path_m.T, motion.speed_m_s.T, strict=True):
        state = state_at(path[None], speed[None], np.asarray(time), scene)
        found.append(np.broadcast_to(law.coefficient(state), (count + 1, len(path))))
    values = np.stack(found, axis=1).reshape(count + 1, -1)
    return values[0], ((values[1:] - values[0]) / STEP).T

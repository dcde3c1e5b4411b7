"""`Motion`: where a model has a clip's objects, beside where they were seen."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from galileo_jax.clip.picture_plane import picture_plane
from galileo_jax.clip.schema import Clip
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.problem import Problem
from galileo_jax.numerics.units import NOMINAL_SCALE_PX_PER_M
from galileo_jax.report.side_view import outline
from galileo_jax.rollout.motion import pitch
from galileo_jax.runtime.errors import InputError


@dataclass(frozen=True, eq=False)
class Motion:
    """One clip's motion, measured and as a model has it.

    Attributes:
      clip: its name.
      objects: their names.
      times_s: `[frame]`.
      is_visible: `[object, frame]`, whether it was seen.
      measured_m, sd_m: `[object, 2, frame]`, x along the travel, y up, from the foot; NaN where
        it was not seen.
      predicted_m: `[object, 2, frame]`, with the constant distance of the followed point from
        the centre, so that it lies on what was measured.
      residuals: `[object, 2, frame]`, tracking errors that the model leaves, in units of the
        stated noise.
      measured_px, predicted_px: `[object, frame, 2]`, in the picture; None where nobody knows
        where its origin is.
      turned_rad: `[object, frame]`, how the model's bodies are turned in the picture, clockwise.
      outlines_px: by object the body's corners `[corner, 2]` around its centre, not turned.
    """

    clip: str
    objects: tuple[str, ...]
    times_s: Float[np.ndarray, " frame"]
    is_visible: Bool[np.ndarray, "object frame"]
    measured_m: Float[np.ndarray, "object axis frame"]
    sd_m: Float[np.ndarray, "object axis frame"]
    predicted_m: Float[np.ndarray, "object axis frame"]
    residuals: Float[np.ndarray, "object axis frame"]
    measured_px: Float[np.ndarray, "object frame 2"] | None
    predicted_px: Float[np.ndarray, "object frame 2"] | None
    turned_rad: Float[np.ndarray, "object frame"]
    outlines_px: tuple[Float[np.ndarray, "corner 2"], ...]

    @property
    def misfit(self) -> float:
        """The root mean square of the residuals; about 1 where only noise is left."""
        return float(np.sqrt(np.nanmean(self.residuals**2)))


def motions_at(
    trials: JointProblem, clips: Sequence[Clip], theta: np.ndarray, best: np.ndarray | None = None
) -> tuple[Motion, ...]:
    """The motion of every clip with parameters `theta`, in their units, noise scales last.

    `best`: those of the fit, which say how far the followed points are from the centres; None:
    `theta`.
    """
    best = theta if best is None else best
    return tuple(
        _motion(problem, clip, trials.of_clip(theta, i), trials.of_clip(best, i))
        for i, (problem, clip) in enumerate(zip(trials.problems, clips, strict=True))
    )


def replaced(
    trials: JointProblem, theta: np.ndarray, values: Mapping[str, float] | None
) -> np.ndarray:
    """Parameters of which some have other values; refuses a name that is none of them."""
    theta = np.array(theta, float)
    for name, value in (values or {}).items():
        if name not in trials.names:
            raise InputError(
                f"{name}: no parameter of this model; known: {', '.join(trials.names)}"
            )
        theta[trials.names.index(name)] = value
    return theta


def _motion(problem: Problem, clip: Clip, theta: np.ndarray, best: np.ndarray) -> Motion:
    seen, scene = problem.observation, problem.model.scene
    predicted, fitted = problem.simulate_batch(np.stack([theta, best]))
    white = problem.tracking_errors(predicted).reshape(predicted.shape)
    shown = seen.mask[:, None]
    measured = np.where(shown, seen.position_m, np.nan)
    offset = seen.offset_m(fitted)[..., None]
    turned = pitch(np.nan_to_num(predicted.transpose(2, 0, 1)), scene.surroundings).T
    scale = clip.pixels_per_metre or NOMINAL_SCALE_PX_PER_M
    corners = [outline(clip, scene, i) for i in range(len(seen.names))]
    return Motion(
        problem.name,
        tuple(seen.names),
        seen.times_s,
        seen.mask,
        measured,
        seen.sd_m[:, :2],
        predicted + offset,
        np.where(shown, white, np.nan),
        _in_pixels(clip, measured),
        _in_pixels(clip, predicted + offset),
        -clip.sign * turned,
        tuple(one * (clip.sign, -1.0) * scale for one in corners),
    )


def _in_pixels(clip: Clip, place_m: np.ndarray) -> np.ndarray | None:
    """`[object, frame, 2]`: the way back from what `tracking.to_metres` does."""
    origin = clip.origin_px or clip.objects[0].point_px
    if clip.video is None or origin is None:
        return None
    return picture_plane(clip, origin).to_pixels(np.moveaxis(place_m, 1, 2))

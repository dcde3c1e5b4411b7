"""The posterior predictive of a clip: simulated positions in its frames, and residuals."""

from dataclasses import dataclass

import numpy as np

from galileo_jax.comparison.phases import Phase, phases, phases_of
from galileo_jax.observation.observation import Observation
from galileo_jax.prediction.extrapolate import (
    GRID_S,
    Fitted,
    as_measured,
    draw_theta,
    hit_s,
    roll_out,
)

NUM_DRAWS = 100


@dataclass(frozen=True)
class PosteriorPredictive:
    """The fit in the frames of the clip."""

    observation: Observation  # what was measured
    position_m: np.ndarray  # `[draw, object, 2, frame]`, predicted positions of the tracked points
    # `[object, 2]`, tracked point minus centre; `position_m` contains each draw's
    offset_m: np.ndarray
    # `[object, 2, frame]`, the tracking errors that the best fit leaves, in units of the stated
    # noise; NaN where nothing was measured
    residuals: np.ndarray
    phases: tuple[tuple[Phase, ...], ...]  # of each object
    # when each object but the last hits the next; None = it does not
    hits_s: tuple[float | None, ...]

    @property
    def moves(self) -> np.ndarray:
        """`[object]`, whether each predicted position changes by more than 2 mm."""
        span = np.ptp(np.median(self.position_m, axis=0), axis=-1)
        return np.linalg.norm(span, axis=-1) > 2e-3


def posterior_predictive(fit: Fitted, seed: int) -> PosteriorPredictive:
    """Rolls out the best fit, for the residuals, and draws, for the bands."""
    problem = fit.problem
    observation, surroundings = problem.observation, problem.model.scene.surroundings
    # Not the mean or the median: along a curved ridge these are no fit.
    best = fit.best[None, : len(problem.model.names)]
    frames = observation.times_s
    draws = roll_out(problem.model, problem.engine, draw_theta(fit, NUM_DRAWS, seed), frames)
    # Objects may touch between two frames only.
    times = np.union1d(frames, np.arange(frames[0], frames[-1], GRID_S))
    centre = roll_out(problem.model, problem.engine, best, times)
    shown = as_measured(problem.model, centre)[0][..., np.searchsorted(times, frames)]
    errors = problem.tracking_errors(shown).reshape(shown.shape)
    is_measured = np.broadcast_to(observation.mask[:, None], shown.shape)
    drawn = as_measured(problem.model, draws)
    drawn = drawn + observation.offset_m(drawn)[..., None]
    hits = [float(hit_s(centre, surroundings, i)[0]) for i in range(len(surroundings.names) - 1)]
    return PosteriorPredictive(
        observation=observation,
        position_m=drawn,
        offset_m=observation.offset_m(shown),
        residuals=np.where(is_measured, errors, np.nan),
        phases=tuple(phases_of(labels, frames) for labels in phases(problem, best[0])),
        hits_s=tuple(None if np.isnan(one) else one for one in hits),
    )

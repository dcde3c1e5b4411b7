"""Prediction: posterior draws rolled out, during the clip and beyond it, and what they say.

Everything is on the clip's clock (s after the first frame) and in the model's metres: x along
the travel, y up, origin at the foot of the ramp.
"""

from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from galileo_jax import __version__
from galileo_jax.inference.posterior import Posterior
from galileo_jax.inference.problem import Problem, since_release
from galileo_jax.inference.summarise import summarise
from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.model.model import Model
from galileo_jax.rollout.engines import make_engine
from galileo_jax.rollout.rollout import Engine
from galileo_jax.runtime.errors import InputError

MOVING_M_S = 5e-3  # contacts at rest creep at 0.2 mm/s, bumpers part at a few mm/s
SLIDES_M = 1e-3  # contacts take up some hundredths of a millimetre at the start
TOUCH_M = 1e-3  # bumpers give way by less
GRID_S = 1 / 240


class Fitted(Protocol):
    """A finished fit of one clip."""

    @property
    def problem(self) -> Problem:
        """Observation, model, and engine, as fitted."""
        ...

    @property
    def posterior(self) -> Posterior:
        """Draws in the parameters' units."""
        ...

    @property
    def best(self) -> np.ndarray:
        """`[parameter]`, the best fit in the parameters' units."""
        ...


@dataclass(frozen=True)
class Motions:
    """The motions of several parameter vectors."""

    theta: np.ndarray  # `[draw, parameter]`, the model's parameters in their units
    times_s: np.ndarray  # `[time]`, on the clip's clock
    position_m: np.ndarray  # `[draw, object, 2, time]`, centres
    velocity_m_s: np.ndarray  # `[draw, object, 2, time]`
    num_failed: int  # rollouts that the engine gave up; they are not among the draws

    @property
    def speed_m_s(self) -> np.ndarray:
        """`[draw, object, time]`."""
        return np.linalg.norm(self.velocity_m_s, axis=2)


def draw_theta(fit: Fitted, num_draws: int, seed: int) -> np.ndarray:
    """`num_draws` draws of the model's parameters from the posterior, `[draw, parameter]`."""
    draws = fit.posterior.flat()
    columns = [fit.posterior.names.index(name) for name in fit.problem.model.names]
    chosen = np.random.default_rng(seed).choice(
        len(draws), num_draws, replace=num_draws > len(draws)
    )
    return draws[chosen][:, columns]


def roll_out(model: Model, engine: Engine, theta: np.ndarray, times_s: np.ndarray) -> Motions:
    """Rolls out `theta` `[draw, parameter]` and reads the motions at `times_s`.

    Linear between the engine's records, 1/240 s apart: within 0.02 mm.

    Raises:
      InputError: every rollout failed.
    """
    position, velocity = engine.simulate(theta)
    has_succeeded = np.isfinite(position).all(axis=(1, 2, 3))
    if not has_succeeded.any():
        raise InputError("no simulation of a posterior draw succeeded; fit the clip again")
    theta, position, velocity = (a[has_succeeded] for a in (theta, position, velocity))
    recorded = np.arange(position.shape[-1]) * model.record_dt_s
    shape = (*position.shape[:-1], len(times_s))
    at_position, at_velocity = np.empty(shape), np.empty(shape)
    for i, row in enumerate(theta):
        times = since_release(model, row, times_s)
        for place in np.ndindex(shape[1:3]):
            at_position[i][place] = np.interp(times, recorded, position[i][place])
            at_velocity[i][place] = np.interp(times, recorded, velocity[i][place])
    num_failed = int(np.sum(~has_succeeded))
    return Motions(theta, np.asarray(times_s), at_position, at_velocity, num_failed)


def extrapolate(fit: Fitted, seconds: float, num_draws: int, seed: int) -> Motions:
    """The clip's motion and `seconds` more, drawn from the posterior, every 1/240 s."""
    model = fit.problem.model
    theta = draw_theta(fit, num_draws, seed)
    until_s = float(fit.problem.observation.times_s[-1]) + seconds
    longest = max(float(since_release(model, row, np.asarray(until_s))) for row in theta)
    longer = replace(model, duration_s=max(longest, GRID_S))
    engine = make_engine(fit.problem.engine.name, longer)
    times_s = np.linspace(0.0, until_s, int(np.ceil(until_s / GRID_S)) + 1)
    return roll_out(longer, engine, theta, times_s)


def as_measured(model: Model, motions: Motions) -> np.ndarray:
    """The centres as the clip shows them (its scale), `[draw, object, 2, time]`, m."""
    shown = motions.position_m.copy()
    for i, row in enumerate(motions.theta):
        named = model.by_name(row)
        for effect in model.effects + model.nuisances:
            shown[i] = effect.measure(shown[i], named, model.scene.surroundings)
    return shown


def hit_s(motions: Motions, surroundings: Surroundings, index: int = 0) -> np.ndarray:
    """When an object first touches the next, `[draw]`, s; NaN where it never does."""
    reach = surroundings.half_length_m[index] + surroundings.half_length_m[index + 1] + TOUCH_M
    gap = motions.position_m[:, index + 1, 0] - motions.position_m[:, index, 0]
    touches = gap <= reach
    is_hit = touches.any(axis=1)
    before = np.maximum(touches.argmax(axis=1) - 1, 0)
    return np.where(is_hit, crossing_s(motions.times_s, gap, before, reach), np.nan)


def answers(fit: Fitted, motions: Motions, seconds: float, seed: int) -> dict[str, Any]:
    """Will it slide, how far, where does it stop, does it hit: prediction.json.

    Probabilities are shares of the draws; quantities are mean, sd and central 95 % interval over
    the draws to which they apply (rest: those that stop), null where there are none.
    """
    surroundings = fit.problem.model.scene.surroundings
    clip_end_s = float(fit.problem.observation.times_s[-1])
    beyond = np.searchsorted(motions.times_s, clip_end_s)
    steps = np.linalg.norm(np.diff(motions.position_m, axis=-1), axis=2)
    is_moving = motions.speed_m_s > MOVING_M_S
    steps = np.where(is_moving[..., 1:], steps, 0.0)
    objects = {}
    for i, name in enumerate(surroundings.names):
        slides = steps[:, i].sum(axis=1) > SLIDES_M
        stops = ~is_moving[:, i, -1]
        last = motions.times_s.size - 1 - is_moving[:, i, ::-1].argmax(axis=1)
        rest_s = crossing_s(motions.times_s, motions.speed_m_s[:, i], last, MOVING_M_S)
        end_x = motions.position_m[:, i, 0, -1]
        objects[name] = {
            "slides_probability": float(slides.mean()),
            "stops_probability": float(stops.mean()),
            "rest_x_m": _summary(end_x[stops]),
            "rest_time_s": _summary(rest_s[stops & slides]),
            "travelled_m": _summary(steps[:, i].sum(axis=1)),
            "travelled_beyond_clip_m": _summary(steps[:, i, beyond:].sum(axis=1)),
            "end_x_m": _summary(end_x),
            "end_y_m": _summary(motions.position_m[:, i, 1, -1]),
            "end_speed_m_s": _summary(motions.speed_m_s[:, i, -1]),
        }
    hit = None
    if len(surroundings.names) > 1:
        when = hit_s(motions, surroundings)
        happens = np.isfinite(when)
        hit = {"probability": float(happens.mean()), "time_s": _summary(when[happens])}
    return {
        "clip_end_s": clip_end_s,
        "predicted_until_s": float(motions.times_s[-1]),
        "seconds_beyond_clip_s": seconds,
        "objects": objects,
        "hit": hit,
        "num_draws": len(motions.theta),
        "num_failed": motions.num_failed,
        "seed": seed,
        "engine": fit.problem.engine.name,
        "version": __version__,
    }


def crossing_s(
    times_s: np.ndarray, values: np.ndarray, index: np.ndarray, level: float
) -> np.ndarray:
    """When `values` `[draw, time]` fall through `level` between `index` `[draw]` and the next."""
    index = np.minimum(index, len(times_s) - 2)
    rows = np.arange(len(values))
    before, after = values[rows, index], values[rows, index + 1]
    falls = before > after  # what goes on moving crosses nothing
    share = np.divide(before - level, before - after, out=(before > level) * 1.0, where=falls)
    share = np.clip(share, 0.0, 1.0)
    return times_s[index] + share * (times_s[index + 1] - times_s[index])


def _summary(values: np.ndarray) -> dict[str, float] | None:
    return summarise(values) if values.size > 1 else None

"""The inverse problem of one clip: its data, and a model of it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from galileo_jax.model.effects.effect import Effect, Surroundings
from galileo_jax.model.model import Model
from galileo_jax.model.parameters import Parameter, joined
from galileo_jax.observation.observation import Observation
from galileo_jax.rollout.acting_laws import Share, seen_share
from galileo_jax.rollout.engine_jax import EngineJax
from galileo_jax.rollout.engines import make_engine
from galileo_jax.rollout.rollout import Engine, Motion, Trajectory, at_times, in_jax
from galileo_jax.runtime.batching import FRAMES, MOTIONS, in_chunks, padded_motion, rounded_up
from galileo_jax.runtime.progress import check_cancelled
from galileo_jax.runtime.trace_cache import trace_cached
from galileo_jax.similarity.discrepancy import across_path
from galileo_jax.similarity.gaussian_likelihood import (
    NoiseModel,
    Whitening,
    fixed_patterns,
    inverse_root_of,
    white_patterns,
    whitening_of,
)
from galileo_jax.statespace.kinematics import kinematics
from galileo_jax.statespace.term import Seen, Term
from galileo_jax.statespace.terms import TERMS


@dataclass(frozen=True)
class Problem:
    """A clip and a model."""

    observation: Observation  # what was measured
    model: Model  # scene and effects
    engine: Engine  # rolls the model out
    name: str = "clip"  # of the clip
    noise: NoiseModel = "camera"  # see `whitening_in`
    # of imperfections by name, `statespace.sizes.Sizes.x`; None: there are none
    sizes: Mapping[str, float] | None = None

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The model's."""
        return self.model.parameters

    @cached_property
    def share(self) -> Share:
        """What of the model changes what is seen of a motion."""
        return seen_share(self.model)

    @property
    def kind(self) -> "Kind":
        """What programs are compiled for that take its motions as data."""
        return Kind(self.share.effects, self.share.names, self.model.record_dt_s)

    @cached_property
    def data(self) -> Whitening:
        """The data and their covariance, decomposed."""
        every = [self.fixed_patterns]
        if self.sizes is not None:
            every += [self._sized(name) for name in self.patterns]
        return whitening_of(self.observation, self._inverse_root, np.concatenate(every))

    def _sized(self, name: str) -> Float[np.ndarray, "pattern object axis frame"]:
        """Patterns of a term at its size, in the stated errors."""
        assert self.sizes is not None
        return TERMS[name].factor ** self.sizes.get(name, 0.0) * self.patterns[name]

    @cached_property
    def fixed_patterns(self) -> Float[np.ndarray, "pattern object axis frame"]:
        """Imperfections of known size, in units of the stated errors."""
        scene = self.model.scene.surroundings
        fixed = fixed_patterns(self.observation, scene, self.noise)
        return white_patterns(fixed, self._inverse_root)

    @cached_property
    def patterns(self) -> dict[str, Float[np.ndarray, "pattern object axis frame"]]:
        """By the term's name, its patterns at the median of its size, in the stated errors."""
        if self.noise == "tracker":
            return {}
        seen, found = self.seen_motion, {}
        for name, term in TERMS.items():
            patterns = term.patterns(seen)
            if len(patterns):
                median = term.median(seen)
                found[name] = white_patterns(median * patterns, self._inverse_root)
        return found

    @cached_property
    def seen_motion(self) -> Seen:
        """What terms are made of."""
        scene = self.model.scene.surroundings
        return Seen(self.observation, scene, kinematics(self.observation, scene))

    @property
    def terms(self) -> tuple[Term, ...]:
        """Those that have a place in the clip."""
        return tuple(TERMS[name] for name in self.patterns)

    def size(self, term: Term, x: float) -> float:
        """The size of a term in its unit; `x` as in `sizes`."""
        return term.median(self.seen_motion) * term.factor**x

    @cached_property
    def _inverse_root(self) -> Float[np.ndarray, "object axis axis frame"]:
        return inverse_root_of(self.observation)

    def with_sizes(self, sizes: Mapping[str, float] | None) -> "Problem":
        """The same with other sizes of imperfections; what they are made of is not made again."""
        if sizes == self.sizes:
            return self
        other = replace(self, sizes=sizes)
        for name in ("fixed_patterns", "patterns", "seen_motion", "share", "_inverse_root"):
            other.__dict__[name] = getattr(self, name)
        return other

    @cached_property
    def errors_in_full(self) -> Float[np.ndarray, "mode mode"] | None:
        """What of the modes of `data` has no size in common with the others, as covariance.

        Errors that follow each other in time, whose size was measured, and what bodies do across
        their path, of which more is allowed for than is there. None where there are neither.
        """
        seen, scene = self.observation, self.model.scene.surroundings
        aside = [] if self.noise == "tracker" else across_path(seen, scene)
        found = [*aside, *seen.lasting_m]
        if not found:
            return None
        root, basis = self.data.inverse_root, self.data.basis
        white = np.einsum("oijt,mojt->moit", root, np.stack(found))
        along = basis.reshape(len(basis), -1) @ white.reshape(len(found), -1).T
        return along @ along.T

    def predict(
        self, theta: Float[jax.Array, " parameter"]
    ) -> Float[jax.Array, "object axis frame"]:
        """What the camera would see, in JAX: `[parameter]` to `[object, 2, frame]`, m."""
        position, velocity = in_jax(self.engine)(theta[None])
        frames = jnp.asarray(self.observation.times_s)
        surroundings = self.model.scene.surroundings
        own = self.share.of(theta)
        return seen(self.kind, own, position[0], velocity[0], frames, surroundings)

    def simulate(
        self, theta: Float[np.ndarray, " parameter"]
    ) -> Float[np.ndarray, "object axis frame"]:
        """What the camera would see: `[parameter]` to `[object, 2, frame]`, m."""
        return self.simulate_batch(theta[None])[0]

    def simulate_batch(
        self, theta: Float[np.ndarray, "batch parameter"]
    ) -> Float[np.ndarray, "batch object axis frame"]:
        """`simulate` of `[batch, parameter]`: `[batch, object, 2, frame]`."""
        check_cancelled()
        times = self.observation.times_s
        frames = np.pad(times, (0, rounded_up(len(times), FRAMES) - len(times)), mode="edge")
        kind, scene = self.kind, self.model.scene.surroundings
        found = self.of_motions(
            theta,
            lambda part, *motion: _seen_batch(kind, self.share.of(part), *motion, frames, scene),
        )
        return found[..., : len(times)]

    def motion(self, theta: Float[np.ndarray, "batch parameter"]) -> Motion:
        """Centres and velocities as long as programs are compiled for, if not as long as seen."""
        return self.of_motions(theta, lambda _, *motion: motion)

    def of_motions(
        self,
        theta: Float[np.ndarray, "batch parameter"],
        then: Callable[..., Any],
        *rows: np.ndarray,
    ) -> Any:
        """What follows from the motion with each of `theta`.

        `then` maps parts of the batch, as large as programs are compiled for: `(theta, position,
        velocity, *rows)`, motions as of `motion` and `rows` `[batch, ...]`, to a PyTree of arrays
        `[part, ...]`. Returned is what it would of the whole batch, as NumPy arrays.
        """
        if isinstance(self.engine, EngineJax):
            return self.engine.each(theta, self.last_seen_s(theta), then, *rows)
        motion = padded_motion(*self.engine.simulate(theta))
        return in_chunks(MOTIONS, then, theta, *motion, *rows)

    def last_seen_s(
        self, theta: Float[np.ndarray, "batch parameter"]
    ) -> Float[np.ndarray, " batch"]:
        """When the objects are last seen, s since the release: no rollout need last longer."""
        times = np.repeat(self.observation.times_s[:, None], len(theta), axis=1)
        return since_release(self.model, theta, times).max(axis=0, initial=0.0)

    def whiten(self, predicted_m: np.ndarray, noise_scale: float) -> np.ndarray:
        """Whitened residuals `[..., object * 2 * frame]`, unit normal if the model is right.

        `predicted_m`: `[..., object, 2, frame]`. `noise_scale`: on the tracker's errors.
        """
        difference = self.data.observed_m - predicted_m
        return self.data.whiten_batch(difference, noise_scale)

    def followed(self, predicted_m: np.ndarray, is_usual: bool = True) -> np.ndarray:
        """Where bodies were, if they deviate from a prediction as bodies usually do.

            d = U_b U_b^T C^-1 r,    U_b: patterns of what bodies do, not of errors of the marks

        All imperfections are of their priors' medians in it, whatever sizes were found: d is the
        same linear function of the residuals r, and what it leaves falls as models get better.

        The prediction itself in an exact world, and where imperfections have no place.
        `predicted_m`: `[object, axis, frame]`. `is_usual`: else imperfections are of the sizes that
        were found, as part of the model.
        """
        if self.sizes is None:
            return predicted_m
        whose = self._usual if is_usual else self
        own = [whose._sized(name) for name in self.patterns if not TERMS[name].is_of_marks]
        if not own:
            return predicted_m
        patterns = np.concatenate(own)
        left = whose.tracking_errors(predicted_m)  # in stated errors, C^-1 of them at scale 1
        white = np.tensordot(patterns.reshape(len(patterns), -1) @ left, patterns, 1)
        # [object, frame, axis, axis]
        root = np.linalg.pinv(np.moveaxis(self._inverse_root, -1, 1))
        return predicted_m + np.einsum("otij,ojt->oit", root, white)

    @cached_property
    def _usual(self) -> "Problem":
        """The same with imperfections of usual sizes."""
        return self.with_sizes(dict.fromkeys(self.patterns, 0.0))

    def tracking_errors(self, predicted_m: np.ndarray, noise_scale: float = 1.0) -> np.ndarray:
        """The tracking errors that a prediction leaves, in units of their sd.

        Args and returns as `whiten`; see `Whitening.tracking_errors`.
        """
        difference = self.data.observed_m - predicted_m
        return self.data.tracking_errors(difference, noise_scale)


def with_shared_parameters(problems: Sequence[Problem]) -> tuple[Problem, ...]:
    """The problems of several clips, with one prior for each of the parameters they share."""
    found: dict[str, Parameter] = {}
    for problem in problems:
        for parameter in problem.parameters:
            if parameter.role != "nuisance" and not parameter.per_clip:
                found[parameter.name] = joined(found.get(parameter.name, parameter), parameter)
    sharing = []
    for problem in problems:
        if others := tuple(found[p.name] for p in problem.parameters if found.get(p.name, p) != p):
            model = replace(problem.model, shared=others)
            problem = replace(problem, model=model, engine=make_engine(problem.engine.name, model))
        sharing.append(problem)
    return tuple(sharing)


def since_release(model: Model, theta: np.ndarray, times_s: np.ndarray) -> np.ndarray:
    """The clip's times as the time since the release, s; `theta` is `[..., parameter]`."""
    named = model.by_name(theta)
    for effect in model.effects + model.nuisances:
        times_s = np.asarray(effect.time(times_s, named, model.scene.surroundings))
    return times_s


class Kind(NamedTuple):
    """What programs are compiled for that take a motion as data: the same for many clips."""

    effects: tuple[Effect, ...]  # that change what is seen of a motion
    names: tuple[str, ...]  # of the parameters that these may ask for
    record_dt_s: float


def seen(
    kind: Kind,
    theta: Float[jax.Array, " parameter"],
    position: Float[jax.Array, "object axis record"],
    velocity: Float[jax.Array, "object axis record"],
    times_s: Float[Any, " frame"],
    scene: Surroundings,
) -> Float[jax.Array, "object axis frame"]:
    """What a camera sees of a motion at its frames' times, m; `theta` as `kind` names it."""
    named = {name: theta[i] for i, name in enumerate(kind.names)}
    for effect in kind.effects:
        times_s = jnp.asarray(effect.time(times_s, named, scene))
    # The drawn pitch is no measurement, so that none is made up here.
    recorded = jnp.arange(position.shape[-1]) * kind.record_dt_s
    found, _ = at_times(Trajectory(recorded, position, velocity), times_s)
    for effect in kind.effects:
        found = jnp.asarray(effect.measure(found, named, scene))
    return found


@trace_cached(num_static=1)
def _seen_batch(kind, theta, position, velocity, times_s, scene):
    return jax.vmap(lambda t, p, v: seen(kind, t, p, v, times_s, scene))(theta, position, velocity)

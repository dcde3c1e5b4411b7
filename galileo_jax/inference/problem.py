"""The inverse problem: one clip's data, a model, and the density of its parameters.

The unknowns are `z` (the model's parameters where every prior is standard normal) and, last,
`z_noise`: the logarithm of the noise scale in units of its prior's width.

    log p(z, z_noise | data) = log N(observed; predicted(z), C(noise)) - (z.z + z_noise^2) / 2
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.observation import Observation
from galileo_jax.parameters import LogNormal, Parameter, forward
from galileo_jax.rollout.model import Model
from galileo_jax.rollout.rollout import Engine, Rollout, at_times, make_rollout
from galileo_jax.rollout.trajectory import Trajectory
from galileo_jax.similarity.gaussian_likelihood import GaussianLikelihood, Whitening

NOISE_SD = 0.3  # the tracker knows its noise within some thirty per cent
NOISE_SCALE = Parameter("noise_scale", "1", LogNormal(1.0, NOISE_SD), 1.0, "nuisance", step=None)
FAILED = 1e6  # the whitened residual of a rollout that failed: worse than any that did not


@dataclass(frozen=True)
class Problem:
    """A clip and a hypothesis.

    Attributes:
      observation: what was measured.
      model: scene and effects.
      engine: rolls the model out.
    """

    observation: Observation
    model: Model
    engine: Engine

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The model's parameters and the noise scale."""
        return (*self.model.parameters, NOISE_SCALE)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The parameters' names, in order."""
        return tuple(parameter.name for parameter in self.parameters)

    @cached_property
    def data(self) -> Whitening:
        """The data and their covariance, decomposed."""
        return GaussianLikelihood.prepare(self.observation, self.model.scene.surroundings)

    @cached_property
    def coarse_steps(self) -> np.ndarray:
        """Steps in `z` before the posterior's scale is known, `[model parameter]`."""
        return np.array([p.step or 1.0 for p in self.model.parameters])

    @cached_property
    def rollout(self) -> Rollout:
        """The engine as a differentiable function."""
        return make_rollout(self.engine)

    def measure(self, z: jax.Array, motion: Trajectory, times_s: Any = None) -> jax.Array:
        """What the camera sees of a motion: `[object, 2, frame]`, m, at the frames' times.

        Pure JAX, no rollout: clock, scale and camera act here.
        """
        scene = self.model.scene.surroundings
        theta = self.model.by_name(forward(self.model.parameters, z))
        times = jnp.asarray(self.observation.times_s if times_s is None else times_s)
        effects = self.model.effects + self.model.nuisances
        for effect in effects:
            times = effect.time(times, theta, scene)
        position, _ = at_times(motion, times)
        for effect in effects:
            position = effect.measure(position, theta, scene)
        return position

    def predict(self, z: jax.Array, steps: jax.Array, times_s: Any = None) -> jax.Array:
        """Predicted centres `[object, 2, frame]`, m, at the frames' (or given) times."""
        return self.measure(z, self.rollout(z, steps), times_s)

    def simulate(self, z: np.ndarray) -> np.ndarray:
        """`predict` outside of any JAX transformation: nothing but one rollout and a jit."""
        position, velocity = self.engine.simulate(self.theta(np.append(z, 0.0))[None, :-1])
        return np.asarray(self._measure(jnp.asarray(z), position[0], velocity[0]))

    @cached_property
    def _measure(self) -> Any:
        times = np.arange(self.model.num_records + 1) * self.model.record_dt_s

        def measure(z: jax.Array, position: jax.Array, velocity: jax.Array) -> jax.Array:
            return self.measure(z, Trajectory(times, position, velocity, position[:, 0]))  # pyright: ignore

        return jax.jit(measure)

    def whiten(self, predicted_m: jax.Array, noise_scale: Any) -> jax.Array:
        """Whitened residuals, unit normal if the model is right: `[object * 2 * frame]`."""
        difference = jnp.asarray(self.data.observed_m) - predicted_m
        white = GaussianLikelihood.whiten(difference, noise_scale, self.data).reshape(-1)
        return jnp.where(jnp.isfinite(white), white, FAILED)

    def residuals(self, z: jax.Array, noise_scale: Any, steps: jax.Array) -> jax.Array:
        """Whitened residuals of the predicted centres at `z`."""
        return self.whiten(self.predict(z, steps), noise_scale)

    def log_density(self, z_all: jax.Array, steps: jax.Array) -> jax.Array:
        """The unnormalised posterior density of `(z, z_noise)`; -inf where a rollout failed."""
        noise_scale = NOISE_SCALE.prior.forward(z_all[-1])
        predicted = self.predict(z_all[:-1], steps)
        value = GaussianLikelihood.log_density(predicted, noise_scale, self.data)
        return jnp.where(jnp.isfinite(value), value, -jnp.inf) - 0.5 * jnp.sum(z_all**2)

    def theta(self, z_all: Any) -> np.ndarray:
        """Parameters in their units, `[..., parameter]`, noise scale last."""
        return np.asarray(self._forward(jnp.asarray(z_all)))

    @cached_property
    def _forward(self) -> Any:
        return jax.jit(lambda z: forward(self.parameters, z))

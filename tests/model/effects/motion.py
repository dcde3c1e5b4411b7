"""Motions of the rigid engine with effects in it, for tests against closed forms."""

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import jax.numpy as jnp
import numpy as np

from galileo_jax.clip.schema import ClipObject
from galileo_jax.model.effects import make_effects
from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.model.model import Model
from galileo_jax.model.parameters import absent
from galileo_jax.model.scene.scene import Scene
from galileo_jax.rollout.engine_path import EnginePath
from galileo_jax.rollout.rollout import Trajectory, at_times
from tests.ramp_model import HIT, make_model, make_surroundings, make_theta
from tests.reference_ramp import Experiment

# The effects that docs/reference/effects.md lists.
LIBRARY = (
    "air_drag",
    "constant_force",
    "frame_rate",
    "friction_patch",
    "initial_push",
    "magnetic_brake",
    "ramp_angle",
    "release_delay",
    "restitution",
    "rolling",
    "scale_error",
    "spring_tether",
    "static_friction",
    "stribeck",
    "surface_friction",
    "table_tilt",
    "viscous_drag",
)
# Listed there, too, and without a place on a ramp: of falls, flights and pendulums.
OFF_THE_RAMP = (
    *(
        "added_mass",
        "camera_roll",
        "magnus",
        "bearing_friction",
        "dry_friction",
        "rod_mass",
        "spring_stiffening",
        "thread_stretch",
    ),
    *("oval_rim", "uneven_pressure"),
)
ALONE = replace(HIT, object2_x_m=None)
# Object 2 stands where nothing comes, so that one compiled program serves all experiments.
LONG_RAMP = replace(HIT, release_m=20.0, object2_x_m=50.0)  # the foot is not reached in time
LONG_TABLE = replace(HIT, friction=(0.0, 0.0), release_m=0.3, object2_x_m=50.0)
DURATION_S = 2.0
PAIR = make_surroundings(HIT)
ONE = make_surroundings(ALONE)
INCLINE: Surroundings = replace(
    ONE,
    corner_m=(math.inf,),
    start_path_m=(0.0,),
    has_table=False,
    comes_down=(False,),
)


@dataclass(frozen=True)
class Motion:
    """One rollout."""

    times_s: np.ndarray  # `[record]`
    position_m: np.ndarray  # `[object, 2, record]`
    velocity_m_s: np.ndarray  # `[object, 2, record]`

    @property
    def gone_m(self) -> np.ndarray:
        """`[object, record]`, from the start, positive downhill; wrong by a bend's corner cut."""
        step = self.position_m - self.position_m[..., :1]
        return np.hypot(step[:, 0], step[:, 1]) * np.sign(step[:, 0])

    @property
    def speed_m_s(self) -> np.ndarray:
        """`[object, record]`, positive downhill and away from the ramp."""
        x, y = self.velocity_m_s[:, 0], self.velocity_m_s[:, 1]
        return np.hypot(x, y) * np.sign(x)


@functools.cache
def library_engine(experiment: Experiment) -> EnginePath:
    """The engine with the whole library; only the experiment's geometry matters."""
    model = make_model(experiment, DURATION_S)
    return EnginePath(replace(model, effects=make_effects(LIBRARY)))


def geometry(experiment: Experiment) -> Experiment:
    """The experiment with masses and frictions that are no part of the scene."""
    return replace(experiment, mass_kg=HIT.mass_kg, friction=HIT.friction)


def move(experiment: Experiment, given: Mapping[str, float] = {}) -> Motion:
    """Rolls the experiment out with the whole library in it, everything not given absent."""
    engine = library_engine(geometry(experiment))
    theta = make_theta(engine.model, experiment, given)
    position, velocity = engine.simulate(theta[None])
    times = np.arange(position.shape[-1]) * engine.model.record_dt_s
    return Motion(times, position[0], velocity[0])


def film(experiment: Experiment, given: Mapping[str, float], times_s: np.ndarray) -> np.ndarray:
    """What the camera measures at the clip's times, `[object, 2, frame]`: as `Problem.measure`."""
    motion = move(experiment, given)
    model = library_engine(geometry(experiment)).model
    theta = model.by_name(jnp.asarray(make_theta(model, experiment, given)))
    effects, scene = model.effects + model.nuisances, model.scene.surroundings
    times: Any = jnp.asarray(times_s)
    for effect in effects:
        times = effect.time(times, theta, scene)
    dense = Trajectory(
        jnp.asarray(motion.times_s),
        jnp.asarray(motion.position_m),
        jnp.asarray(motion.velocity_m_s),
    )
    position, _ = at_times(dense, times)
    for effect in effects:
        position = effect.measure(position, theta, scene)
    return np.asarray(position)


def model_of(scene: Surroundings, names: tuple[str, ...], duration_s: float = 1.0) -> Model:
    """A model of given surroundings, not of an experiment (an incline)."""
    boxes = tuple(ClipObject(name=name, shape="box", size_m=(0.06,) * 3) for name in scene.names)
    return Model(Scene(scene, boxes), duration_s, make_effects(names))


def absent_theta(model: Model, m: tuple[float, ...], k: tuple[float, ...]) -> np.ndarray:
    """Masses and frictions, all effects and nuisances absent: `[parameter]`."""
    theta = absent(model.parameters)
    for i in range(len(model.scene.names)):
        theta[model.index(f"m{i + 1}")], theta[model.index(f"k{i + 1}")] = m[i], k[i]
    return theta


def slide_m_s2(experiment: Experiment, angle_rad: float | None = None) -> float:
    """Object 1's acceleration down the ramp."""
    angle = experiment.angle_rad if angle_rad is None else angle_rad
    return experiment.gravity * (math.sin(angle) - experiment.friction[0] * math.cos(angle))

"""Scenes of any number of objects, sliding or rolling, for tests of the rollouts."""

import math
from collections.abc import Sequence

import numpy as np

from galileo_jax.clip.schema import ClipObject
from galileo_jax.clip.sizes import extents, rolling
from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.model.model import Model
from galileo_jax.model.parameters import absent
from galileo_jax.model.scene.scene import Scene, laid_out, on_ramp
from galileo_jax.rollout.engine_path import EnginePath

BOX = ClipObject(name="box", shape="box", size_m=(0.06, 0.06, 0.06))
BALL = ClipObject(name="ball", shape="sphere", size_m=(0.03,))
ROLLER = ClipObject(name="roller", shape="cylinder", size_m=(0.03, 0.05), rolls=True)
WHEEL = ClipObject(name="wheel", shape="torus", size_m=(0.022, 0.008), rolls=True)


def scene_of(
    objects: Sequence[ClipObject],
    angle_deg: float = 20.0,
    release_m: float = 0.5,
    beyond_m: Sequence[float] = (),
    *,
    has_table: bool = True,
) -> Surroundings:
    """Object 1 on the ramp, the others `beyond_m` past its foot."""
    angle = math.radians(angle_deg)
    half = [extents(each) for each in objects]
    first = on_ramp(-release_m, half[0][1], angle)
    starts = (first, *((x, h) for x, (_, h) in zip(beyond_m, half[1:], strict=True)))
    return Surroundings(
        names=tuple(f"object{i + 1}" for i in range(len(objects))),
        angle_rad=angle,
        gravity=9.81,
        **laid_out(half, starts, angle, has_table),
        **rolling(objects),
    )


def model_of(objects: Sequence[ClipObject], surroundings: Surroundings, duration_s: float) -> Model:
    """The model with its nuisances."""
    return Model(Scene(surroundings, tuple(objects)), duration_s)


def theta_of(
    model: Model, mass_kg: Sequence[float], friction: Sequence[float], **given: float
) -> np.ndarray:
    """Parameters `[parameter]`, what is not given absent."""
    theta = absent(model.parameters)
    for i, (mass, k) in enumerate(zip(mass_kg, friction, strict=True)):
        given |= {f"m{i + 1}": mass, f"k{i + 1}": k}
    for name, value in given.items():
        theta[model.index(name)] = value
    return theta


def speeds(model: Model, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times `[record]` and speeds along the path `[object, record]` by the rigid engine."""
    _, velocity = EnginePath(model).simulate(theta[None])
    found = np.hypot(velocity[0, :, 0], velocity[0, :, 1]) * np.sign(velocity[0, :, 0])
    return np.arange(found.shape[-1]) * model.record_dt_s, found

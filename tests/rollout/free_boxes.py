"""Two cubes on a table after a ramp, for tests of the engines in which bodies turn and tip."""

from collections.abc import Sequence

import numpy as np

from galileo_jax.clip.schema import ClipObject
from galileo_jax.model.effects.effect import Effect
from galileo_jax.model.model import Model
from galileo_jax.model.scene.scene import Scene
from tests.rollout.objects import scene_of

SIDE_M = 0.06
MASS_KG, FRICTION, SMOOTH = (0.5, 0.3), (0.1, 0.2), (0.0, 0.0)


def cubes(z_m: float = 0.0, side_m: tuple[float, ...] = (SIDE_M,) * 3) -> list[ClipObject]:
    """Two boxes, the second off the plane."""
    return [
        ClipObject(name="object1", shape="box", size_m=(SIDE_M,) * 3),
        ClipObject(name="object2", shape="box", size_m=side_m, z_m=z_m),
    ]


def model_of(
    objects: Sequence[ClipObject],
    duration_s: float = 1.6,
    effects: tuple[Effect, ...] = (),
    **scene,
) -> Model:
    """The model of bodies that move freely."""
    scene.setdefault("beyond_m", [0.25, 0.36][: len(objects) - 1])
    compiled = Scene(scene_of(objects, **scene), tuple(objects))
    return Model(compiled, duration_s, effects, motion="free")


def hit_record(velocity_m_s: np.ndarray) -> int:
    """The first record after the hit, from `[object, axis, record]`."""
    return int(np.argmax(velocity_m_s[1, 0] > 0.01))


def yaw_rad(quaternion: np.ndarray) -> np.ndarray:
    """Of each object, about the vertical, counter-clockwise from above, `[object, record]`."""
    return np.unwrap(2 * np.arctan2(quaternion[:, 3], quaternion[:, 0]))

"""The particle engine: what has a place, and at most one angle, and follows no given path.

Falls, flights, springs, what moves in a liquid (`particle_free`), pendulums (`particle_pendulum`),
and discs on a level table (`particle_discs`): under one name, since one clip has one of them.
"""

from galileo_jax.model.effects.effect import PENDULUM
from galileo_jax.model.model import Model
from galileo_jax.rollout.acting_laws import ActingLaws
from galileo_jax.rollout.engine_jax import EngineJax
from galileo_jax.rollout.events import Motion, Task, of_task
from galileo_jax.rollout.particle_discs import DiscSystem
from galileo_jax.rollout.particle_free import FreeSystem
from galileo_jax.rollout.particle_pendulum import PendulumSystem
from galileo_jax.runtime.errors import InputError


@of_task
def roll_out(task: Task) -> Motion:
    """What moves in the scene."""
    if task.scene.is_level:
        return task.motion(DiscSystem(task))
    is_pendulum = PENDULUM in task.scene.laws
    return task.motion(PendulumSystem(task) if is_pendulum else FreeSystem(task))


class EngineParticle(EngineJax):
    """Particles, see the module."""

    roll_out = staticmethod(roll_out)

    def __init__(self, model: Model, laws: ActingLaws | None = None):
        """Raises `InputError` for a pendulum's track in space."""
        scene = model.scene.surroundings
        if PENDULUM in scene.laws and scene.num_axes != 2:
            raise InputError(
                "scenario pendulum: a track in the plane (x, y) expected, not in space"
            )
        super().__init__(model, laws)

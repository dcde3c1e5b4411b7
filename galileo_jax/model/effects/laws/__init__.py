"""Laws of motion that are always there in the scenarios that name them.

They are effects like any other, but not in question: their parameters are what the user asks
for (role "main"). A law brings parameters only where `Surroundings.laws` names it.
"""

from galileo_jax.model.effects.effect import Effect
from galileo_jax.model.effects.laws.floor import Floor
from galileo_jax.model.effects.laws.liquid import Liquid
from galileo_jax.model.effects.laws.pendulum import Pendulum
from galileo_jax.model.effects.laws.pucks import Pucks
from galileo_jax.model.effects.laws.spring import Spring
from galileo_jax.model.effects.laws.start_velocity import StartVelocity
from galileo_jax.model.effects.laws.walls import StraightWalls

LAWS: tuple[Effect, ...] = (
    *(Spring(), Liquid(), Pendulum(), StartVelocity(), Floor()),
    *(Pucks(), StraightWalls()),
)

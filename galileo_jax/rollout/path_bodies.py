"""Bodies on their path, one number at a time: what the rigid engine moves and knocks together.

Numbers of objects are tuples, not arrays `[object]`: a batch of rollouts is then one vector for
each, which a core computes several entries of at a time. Loops over objects are unrolled.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Float

from galileo_jax.model.effects.effect import State, Surroundings
from galileo_jax.rollout.motion import Dynamics, state_at

TOUCH_M, TOUCH_M_S = 1e-9, 1e-9

Number = Float[jax.Array, ""]
Numbers = tuple[Number, ...]
"""One for each object."""
Links = tuple[jax.Array | bool, ...]
"""Whether neighbours are of one group, one for each pair of them."""


class Bodies(NamedTuple):
    """All bodies of one rollout.

    Attributes:
      path_m, speed_m_s: of the centres.
      rim_m_s: angular velocity times radius; 0 of what does not roll.
    """

    path_m: Numbers
    speed_m_s: Numbers
    rim_m_s: Numbers

    @property
    def slip_m_s(self) -> Numbers:
        """How fast each slides over its surface."""
        return tuple(v - u for v, u in zip(self.speed_m_s, self.rim_m_s, strict=True))

    def gap_m(self, law: Dynamics, scene: Surroundings) -> Numbers:
        """Between the faces of neighbours; below 0 where these knock as soon as they approach."""

        def between(i: int) -> Number:
            x = [self.path_m[j] + scene.corner_m[j] for j in (i, i + 1)]
            apart = x[1] - x[0] - scene.half_length_m[i + 1] - scene.half_length_m[i]
            # What stands in the way is past its start, or about to be, once it was hit.
            past_m = self.path_m[i + 1] - law.start_m[i + 1]
            hit = (past_m > TOUCH_M) | ((past_m > -TOUCH_M) & (self.speed_m_s[i + 1] > 0))
            return apart - jnp.where(hit, law.overlap_m, 0.0)

        return tuple(between(i) for i in range(len(self.path_m) - 1))

    def touches(self, law: Dynamics, scene: Surroundings) -> Links:
        """Whether neighbours rest against each other or move as one."""
        v = self.speed_m_s
        return tuple(
            (gap < TOUCH_M) & (jnp.abs(v[i + 1] - v[i]) < TOUCH_M_S)
            for i, gap in enumerate(self.gap_m(law, scene))
        )

    def state(self, speed_m_s: Numbers, time_s: jax.Array, scene: Surroundings) -> State:
        """What a law sees, with its speed."""
        return state_at(jnp.stack(self.path_m), jnp.stack(speed_m_s), time_s, scene)


def rolls(scene: Surroundings, i: int) -> bool:
    """Whether object `i` is round and may turn."""
    return bool(scene.rolls) and scene.rolls[i]


def of_group(values: Sequence[Number], links: Links) -> Numbers:
    """Of each object the sum over its group."""

    def beside(i: int, step: int) -> list[Number]:
        found, is_linked = [], True
        for j in range(i + step, len(values) if step > 0 else -1, step):
            link = links[min(j, j - step)]
            if link is False:
                break
            is_linked = link if is_linked is True else is_linked & link
            found.append(jnp.where(is_linked, values[j], 0.0))
        return found

    return tuple(sum(beside(i, 1), sum(beside(i, -1), own)) for i, own in enumerate(values))


def apart(count: int) -> Links:
    """Every object a group of its own."""
    return (False,) * (count - 1)


def with_link(links: Links, i: int, when: jax.Array) -> Links:
    """The groups of neighbours i and i + 1 made one."""
    return (*links[:i], links[i] | when, *links[i + 1 :])

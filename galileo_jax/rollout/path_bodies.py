"""Bodies on their path, one number at a time: their state, and what those that touch do together.

Numbers of objects are tuples, not arrays `[object]`: a batch of rollouts is then one vector for
each, which a core computes several entries of at a time. Loops over objects are unrolled.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Float

Number = Float[jax.Array, ""]
Numbers = tuple[Number, ...]
"""One for each object."""
Links = tuple[jax.Array | bool, ...]
"""Whether neighbours are of one group, one for each pair of them."""


class Bodies(NamedTuple):
    """All bodies of one rollout."""

    path_m: Numbers  # of the centres
    speed_m_s: Numbers
    rim_m_s: Numbers  # angular velocity times radius; 0 of what does not roll

    @property
    def slip_m_s(self) -> Numbers:
        """How fast each slides over its surface."""
        return tuple(v - u for v, u in zip(self.speed_m_s, self.rim_m_s, strict=True))

    def after(self, a: "Accelerations", t: jax.Array) -> "Bodies":
        """The bodies after a time `t` of constant accelerations."""
        q, v, u = self
        return Bodies(
            tuple(q + v * t + 0.5 * a * t**2 for q, v, a in zip(q, v, a.centre, strict=True)),
            tuple(v + a * t for v, a in zip(v, a.centre, strict=True)),
            tuple(u + a * t for u, a in zip(u, a.rim, strict=True)),
        )


class Accelerations(NamedTuple):
    """Of centres and rims, m/s^2."""

    centre: Numbers
    rim: Numbers


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
    """Every body a group of its own."""
    return (False,) * (count - 1)


def in_groups(
    move: Callable[[Links], tuple[Numbers, Any]], alone: tuple[Numbers, Any], touches: Links
) -> tuple[Numbers, Any]:
    """How bodies move when those that touch, and would pass those ahead, move as one.

    `move`: what groups do, the first of it to compare; `alone`: what each does by itself. Groups
    grow until nobody passes anybody.
    """
    found, links = alone, apart(len(touches) + 1)
    for _ in touches:
        for i, touch in enumerate(touches):
            link = links[i] | (touch & (found[0][i] > found[0][i + 1]))
            links = (*links[:i], link, *links[i + 1 :])
            found = move(links)
    return found


class Forces(NamedTuple):
    """What acts on each body: pull and brake, N; whether it sticks; kg; what rolling adds, kg."""

    pull: Numbers
    brake: Numbers
    sticks: tuple[jax.Array, ...]
    inertia: Numbers
    turning: dict[int, Number]

    def move(self, links: Links) -> tuple[Numbers, dict[int, Number]]:
        """Accelerations of groups, and the way those that should roll slip all the same.

        Of a group's members those that slip are braked by all their friction; those at rest hold it
        with up to theirs; and those that roll turn with it, each as long as its friction can turn
        it so fast.
        """
        pull, brake, sticks, inertia, turning = self
        objects = range(len(pull))
        rest = [
            jnp.zeros_like(pull[i]) if i in turning else jnp.where(sticks[i], brake[i], 0.0)
            for i in objects
        ]
        both = zip(of_group(pull, links), of_group(rest, links), strict=True)
        left = [force - jnp.clip(force, -held, held) for force, held in both]
        masses = of_group(inertia, links)
        slips = {i: jnp.zeros_like(pull[i]) for i in turning}

        def with_grip() -> Numbers:
            rubs, turns = ([jnp.zeros_like(one) for one in pull] for _ in range(2))
            for i, slip in slips.items():
                rubs[i] = slip * brake[i]
                turns[i] = jnp.where(sticks[i] & (slip == 0), turning[i], 0.0)
            rubbed, turned = of_group(rubs, links), of_group(turns, links)
            return tuple((left[i] - rubbed[i]) / (masses[i] + turned[i]) for i in objects)

        if not turning:
            return tuple(force / mass for force, mass in zip(left, masses, strict=True)), slips
        a = with_grip()
        for _ in turning:
            for i in turning:
                fails = sticks[i] & (jnp.abs(a[i]) * turning[i] > brake[i])
                slips[i] = jnp.where(fails, jnp.sign(left[i]), slips[i])
            a = with_grip()
        return a, slips

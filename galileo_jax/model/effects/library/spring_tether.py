"""Spring tether: a spring (a rubber band) ties object 1 to where it is let go.

    F = -K (q - q_start)

along the path, slack at the declared start.

Source: Hooke, De potentia restitutiva (1678).
Confused with: constant_force and k1 on a short path; air_drag in part (both grow on the way).
"""

from typing import ClassVar

from galileo_jax.model.effects.effect import Effect, Force, State, Surroundings, Theta
from galileo_jax.model.effects.registry import register
from galileo_jax.model.parameters import LogNormal, Parameter

PRIOR = LogNormal(median=1.0, sd=1.2)


@register
class SpringTether(Effect):
    """A spring pulls object 1 back to its start."""

    name: ClassVar[str] = "spring_tether"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The stiffness K."""
        return (Parameter("spring_tether", "N/m", PRIOR, 0.0, "effect", 0.1),)

    def force(self, theta: Theta, scene: Surroundings) -> Force:
        """The pull back."""
        stiffness = scene.only(theta["spring_tether"], 0)
        start = scene.start_path_m[0]

        def pull(state: State):
            return -stiffness * (state.path_m - start)

        return pull

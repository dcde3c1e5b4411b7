"""Frame rate: the camera took its frames slower (or faster) than declared.

    true time = declared time (1 + r)

counted from the first frame. The clock is corrected before the release is looked for:
release_delay and release_instant are true seconds. Effects' clocks are applied in
alphabetical order (`make_effects`), nuisances last, which is this order.

Source: SMPTE 170M (30 declared for 30 / 1.001); phones that call 240 frames/s 29.97.
Confused with: scale_error (both act like another gravity, g (1 + s) against g (1 + r)^2);
rolling; on one slope k1 and ramp_angle.
"""

from galileo_jax.model.effects.effect import Array, Effect, Surroundings, Theta
from galileo_jax.model.effects.registry import register
from galileo_jax.model.parameters import Normal, Parameter

PRIOR = Normal(0.0, 0.07)


@register
class FrameRate(Effect):
    """The declared frame rate is wrong."""

    name = "frame_rate"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The relative error r of times; no rollout depends on it."""
        return (Parameter("frame_rate", "1", PRIOR, 0.0, "effect", step=None),)

    def time(self, time_s: Array, theta: Theta, scene: Surroundings) -> Array:
        """The true time since the first frame."""
        return time_s * (1.0 + theta["frame_rate"])

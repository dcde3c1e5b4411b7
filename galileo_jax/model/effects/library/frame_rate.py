"""Frame rate: the camera took its frames slower (or faster) than declared.

    true time = declared time (1 + r)

counted from the first frame. The clock is corrected before the release is looked for:
release_delay and release_instant are true seconds. Effects' clocks are applied in
alphabetical order (`make_effects`), nuisances last, which is this order.

Source: SMPTE 170M (30 declared for 30 / 1.001); phones that call 240 frames/s 29.97.
Confused with: scale_error (both act like another gravity, g (1 + s) against g (1 + r)^2);
rolling; on one slope k1 and ramp_angle.
"""

from galileo_jax.model.effects import Effect, Normal, Parameter, register


@register
class FrameRate(Effect):
    name = "frame_rate"
    unknowns = (Parameter("frame_rate", "1", Normal(0.0, 0.07), 0.0, "effect", step=None),)

    def time(self, time_s, theta, scene):
        return time_s * (1.0 + theta["frame_rate"])

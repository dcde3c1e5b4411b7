"""Cubic drag, F = -c v^3: an effect of one's own, for `--effects-from examples/my_effect.py`."""

from galileo_jax import Effect, LogNormal, Parameter, register_effect


@register_effect
class CubicDrag(Effect):
    """Drag of all objects that grows with the cube of the speed."""

    name = "cubic_drag"

    def parameters(self, scene):
        """The constant c: name, unit, prior, absent value, role, first step in z."""
        return (Parameter("cubic_drag", "kg s/m^2", LogNormal(0.3, 1.2), 0.0, "effect", 0.1),)

    def force(self, theta, scene):
        """The force on each object, N."""
        c = theta["cubic_drag"][..., None]
        return lambda state: -c * state.speed_m_s**3

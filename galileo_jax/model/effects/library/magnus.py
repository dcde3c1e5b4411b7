"""Magnus force: the air carried round by a spinning ball bends its path.

    F = C rho A r / 2 (w x v) / (1 + 2 S),    A = pi r^2,    S = r |w x v| / v^2

w: the spin, rad/s, constant in so short a flight; C: the lift per slow spin, about 1. A ball whose
rim moves as fast as its flight (S = 1) carries hardly more air round than one at half that spin:
with C = 1 this is the lift coefficient S / (1 + 2 S) of the source, 0.15 at S = 0.2 and 0.33 at 1;
tennis balls. In the plane of a picture only the spin about the line of sight shows: backspin of
what flies to the right is positive. In space all of the spin shows but what is along the velocity.
Curves show the force alone: a spin inferred is as uncertain as C, unless flights of known spin
(`spin_rad_s`) tell C, and a fast spin is less certain still.

Source: Stepanek (1988), The aerodynamics of tennis balls - the topspin lob, Am. J. Phys. 56, 138.
Confused with: another gravity (scale_error, frame_rate) or a tilted camera in a short flight, for
steady backspin lifts almost evenly.
"""

import math

from galileo_jax.model.effects import Effect, LogNormal, Normal, Parameter, Surroundings, register
from galileo_jax.model.effects.air import AIR_KG_M3
from galileo_jax.model.effects.effect import SPIN

LIFT = "magnus_lift"
SPIN_PRIOR = Normal(0.0, 200.0)  # a table-tennis ball that is cut: 500 rad/s and more
LIFT_PRIOR = LogNormal(median=1.0, sd=0.3)
SLOW_M_S, LEAST_RAD_S = 1e-3, 1e-3  # at rest S has no value, and without spin no slope


@register
class Magnus(Effect, where=lambda scene: scene.moves_in_plane):
    name = "magnus"

    def parameters(self, scene):
        found = []
        for name, axis in _spins(scene):
            known = scene.expected.get(f"{SPIN}_{axis}")
            prior = SPIN_PRIOR if known is None else Normal(*known)
            found.append(Parameter(name, "rad/s", prior, 0.0, "effect", 0.1, per_clip=True))
        lift = Parameter(LIFT, "1", LIFT_PRIOR, LIFT_PRIOR.median, "effect", 0.1)
        return (*found, lift)

    def push(self, theta, scene):
        radius = scene.half_height_m[0]
        size = theta[LIFT] * (0.5 * AIR_KG_M3 * math.pi * radius**3)
        spin = [theta[name] for name, _ in _spins(scene)]

        def lift(velocity_m_s, time_s):
            xp = velocity_m_s.__array_namespace__()
            if scene.num_axes == 2:
                x, y = velocity_m_s
                turned = spin[0] * xp.stack([-y, x])
            else:
                turned = xp.linalg.cross(xp.stack(spin), velocity_m_s)
            speed = xp.sqrt(xp.sum(velocity_m_s**2) + SLOW_M_S**2)
            share = radius * xp.sqrt(xp.sum((turned / speed) ** 2) + LEAST_RAD_S**2) / speed
            return size * turned / (1 + 2 * share)

        return lift


def _spins(scene: Surroundings) -> tuple[tuple[str, str], ...]:
    """The spin's parameters, each with its axis."""
    if scene.num_axes == 2:
        return (("magnus", "z"),)
    return tuple((f"magnus_{axis}", axis) for axis in "xyz")

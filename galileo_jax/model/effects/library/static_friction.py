"""Static friction: what rests, or nearly, holds on harder than what slides.

    k(v) = k + s exp(-(v / v_s)^2),    v_s = 0.02 m/s

on every object: a body rests on a ramp up to tan a = k + s, and a sliding one is caught at
the end. Above 0.05 m/s there is nothing of it, so that a body which sets off at once hardly
shows it.

Source: Coulomb, Théorie des machines simples (1785); Bo and Pavelescu (1982), Wear 82, 277,
the Gaussian fall.
Confused with: a larger k where all motion is slow; release_delay (a late start).

An object that comes down a ramp starts late only where k + s is within a hundredth or so of
tan a: with less it sets off at once, with more never. How late follows from the force that is
left, g cos a (tan a - k - s):

    dv/dt = g cos a (left + s (v / v_s)^2)  for v << v_s
    delay = pi v_s / (2 g cos a sqrt(left s))
"""

import math

from galileo_jax.model.effects import Effect, LogNormal, Parameter, register

PRIOR = LogNormal(median=0.1, sd=1.0)
SLOW_M_S = 0.02
SEEN_DELAY_S = 0.05  # three frames of 60 per second
LEAST_SHARE = 1e-3


@register
class StaticFriction(Effect, where=lambda scene: scene.has_surface):
    name = "static_friction"
    unknowns = (Parameter("static_friction", "1", PRIOR, 0.0, "effect", 0.1),)

    def odds(self, theta, scene):
        """High where it makes the start late: of all s its prior holds few for that.

        What it competes with is not that some s is there, but that one is there that shows: the
        prior's share of these is no evidence against it.
        """
        if scene.has_table and not scene.comes_down[0]:
            return 1.0
        extra, angle = float(theta["static_friction"]), float(scene.angle_rad)
        most = math.tan(angle) - float(theta["k1"])
        if most <= 0.0:
            return 1.0
        pull = scene.gravity * math.cos(angle)
        left = (0.5 * math.pi * SLOW_M_S / (pull * SEEN_DELAY_S)) ** 2 / most
        least = max(most - left, 0.0)
        share = _share_below(most) - _share_below(least)
        return 1.0 / max(share, LEAST_SHARE) if least < extra < most else 1.0

    def friction(self, theta, scene):
        extra = theta["static_friction"][..., None]
        xp = extra.__array_namespace__()
        return lambda state, k: k + extra * xp.exp(-((state.speed_m_s / SLOW_M_S) ** 2))


def _share_below(extra: float) -> float:
    """Of the prior."""
    if extra <= 0.0:
        return 0.0
    return 0.5 * (1.0 + math.erf(math.log(extra / PRIOR.median) / (PRIOR.sd * math.sqrt(2.0))))

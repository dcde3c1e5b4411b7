"""Pendulum: a bob at a fixed distance from a pivot, drawn down by gravity.

    L a'' = -g sin a,    a: the angle from the vertical, positive forward

for any angle: beyond 90 degrees it is a rod that holds it. The bob is a point, and the length that
of the simple pendulum; what turns with it is the effect `rod_mass`. A tilted camera turns the
picture's vertical away from gravity's.

Closed form, from rest at a0: sin(a / 2) = k cd(w t, k), k = sin(a0 / 2), w^2 = g / L, with Jacobi's
cd = cn / dn; period 4 K(k) / w.

Source: Huygens, Horologium oscillatorium (1673); Baker and Blackburn, The Pendulum (2005).
"""

import math

from galileo_jax.model.effects import PENDULUM, Effect, LogNormal, Normal, Parameter

LENGTH, ANGLE = "thread_length", "start_angle"


class Pendulum(Effect, where=lambda scene: PENDULUM in scene.laws):
    name = PENDULUM

    def parameters(self, scene):
        length = LogNormal(*scene.expected[LENGTH])
        angle = Normal(*scene.expected[ANGLE])
        return (
            Parameter(LENGTH, "m", length, length.median, "main", 0.02),
            Parameter(ANGLE, "rad", angle, angle.mean, "main", 0.02, per_clip=True),
        )

    def derived(self, theta, scene):
        length, angle = theta[LENGTH], theta[ANGLE]
        xp = length.__array_namespace__()
        x, y, *_ = scene.start_m[0]
        return {
            "small_period": (2 * math.pi * (length / scene.gravity) ** 0.5, "s"),
            "pivot_x": (x - length * xp.sin(angle), "m"),
            "pivot_y": (y + length * xp.cos(angle), "m"),
        }

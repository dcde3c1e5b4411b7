"""Added mass: what a body moves through is pushed aside, and some of it comes along.

    m (1 + a) q'' = F + 2 a m g (upward),    a: the fluid carried along over the body's mass

Half of the displaced fluid moves with a sphere, and all of what is displaced lifts it: hence 2 a.
In air a is 0.0003 for a steel ball, 0.007 for one of table tennis and 0.3 for a balloon. In the
scenario `liquid`, whose own law holds a sphere's share and the lift, it is what other shapes carry
beyond that, and lifts nothing. The vertical is the picture's; flow that lags behind is left out.

Closed form: a fall, or a flight, with gravity g (1 - 2 a) / (1 + a); a pendulum as slow as there.

Source: Bessel (1828), on the length of the simple pendulum; Poisson (1831); Batchelor, An
Introduction to Fluid Dynamics (1967), section 6.8.
Confused with: scale_error, frame_rate: each of them acts like another gravity; rod_mass.
"""

from galileo_jax.model.effects import (
    PENDULUM,
    Effect,
    LogNormal,
    LongTailed,
    Parameter,
    Surroundings,
    register,
)
from galileo_jax.model.effects.air import undeclared_odds
from galileo_jax.model.effects.laws.liquid import Liquid
from galileo_jax.model.effects.laws.pendulum import LENGTH
from galileo_jax.model.effects.laws.spring import Spring

PRIOR = LogNormal(median=0.01, sd=1.2)  # of balls in air; where size and mass are declared: theirs
LIQUID_PRIOR = LogNormal(median=0.2, sd=0.7)
LIFT = 2.0  # what is displaced over what a sphere carries along


def _shows_mass(scene: Surroundings) -> bool:
    """Whether gravity pulls at the mass, and nothing else hides it."""
    return not scene.has_surface and Spring.name not in scene.laws


@register
class AddedMass(Effect, where=_shows_mass):
    name = "added_mass"

    def parameters(self, scene):
        prior = LIQUID_PRIOR if Liquid.name in scene.laws else PRIOR
        if self.name in scene.expected:
            prior = LongTailed(*scene.expected[self.name])
        return (Parameter("added_mass", "1", prior, 0.0, "effect", 0.1),)

    def odds(self, theta, scene):
        """High where more is found than a ball of known size and mass carries along in air.

        A fluid that nobody declared is as likely as if nothing had been.
        """
        return undeclared_odds(self.name, theta, scene, PRIOR)

    def force(self, theta, scene):
        if Liquid.name in scene.laws or scene.is_thrown:
            return None
        lift = (LIFT * theta["added_mass"] * theta["m1"] * scene.gravity)[..., None]
        if PENDULUM not in scene.laws:
            return lambda state: -lift
        length = theta[LENGTH][..., None]
        return lambda state: lift * lift.__array_namespace__().sin(state.path_m / length)

    def push(self, theta, scene):
        if not scene.is_thrown:
            return None
        # The engine adds gravity to forces over the inertia: what is carried along weighs nothing.
        upward = (LIFT + 1.0) * theta["added_mass"] * theta["m1"] * scene.gravity

        xp = upward.__array_namespace__()
        lift = upward[..., None] * xp.asarray([axis == 1 for axis in range(scene.num_axes)])
        return lambda velocity_m_s, time_s: lift

    def inertia(self, theta, scene):
        return theta["added_mass"][..., None]

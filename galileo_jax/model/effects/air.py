"""The air on a falling ball: how much drag is to be expected before any look.

    c = C_d rho A / 2,    b = c v,   v = sqrt(g h), of the middle of the fall

After a fall of more than a few metres, air drag on a light ball is a tenth of its weight or more in
every clip, whereas scale and frame rate are wrong by several per cent only in a few clips. At
Reynolds numbers of thousands it grows with the square of the speed; a drag of that size which grows
with the speed itself is that of no air, and as likely as any other effect. Where speeds span so
little that the data do not tell the form, that does.

Source: Hoerner, Fluid-Dynamic Drag (1965), chapter 3: spheres have C_d 0.1 (fast and rough) to
0.5, perforated ones up to 1.
"""

import math

from galileo_jax.model.effects.effect import Surroundings, Theta
from galileo_jax.model.parameters import LogNormal

AIR_KG_M3 = 1.2
DRAG_COEFFICIENT = (0.4, 0.5)  # middle, and the width of its logarithm
CARRIED_SD = 0.1  # of its logarithm, as size, mass and the air's density are known
# Of a drag of this size against any other effect of the library.
EXPECTED_ODDS = {"air_drag": 30.0, "viscous_drag": 1.0}


def expected_drags(radius_m: float, length_m: float, gravity: float) -> dict[str, tuple]:
    """The middle and the width of the logarithm of the drags on a ball, by their names."""
    middle, width = DRAG_COEFFICIENT
    quadratic = middle * AIR_KG_M3 * math.pi * radius_m**2 / 2
    linear = quadratic * math.sqrt(gravity * length_m)
    return {"air_drag": (quadratic, width), "viscous_drag": (linear, width)}


def expected_added_mass(radius_m: float, mass_kg: float) -> dict[str, tuple]:
    """The air that a ball carries along over its mass: half of what it displaces."""
    displaced = AIR_KG_M3 * 4.0 / 3.0 * math.pi * radius_m**3
    return {"added_mass": (displaced / 2.0 / mass_kg, CARRIED_SD)}


def expected_odds(name: str, theta: Theta, scene: Surroundings, prior: LogNormal) -> float:
    """1 + EXPECTED_ODDS[name] p(strength | air) / p(strength | prior); 1 where nothing is expected.

    With the evidence under `prior` it makes that under the mixture of both.
    """
    strength = float(theta[name])
    if name not in scene.expected or strength <= 0:
        return 1.0
    middle, width = scene.expected[name]
    log_ratio = _log_normal(strength, middle, width) - _log_normal(strength, prior.median, prior.sd)
    return 1.0 + EXPECTED_ODDS[name] * math.exp(log_ratio)


def undeclared_odds(name: str, theta: Theta, scene: Surroundings, prior: LogNormal) -> float:
    """1 + p(strength | prior) / p(strength | air); 1 where nothing is expected.

    With the evidence under the long tails of what air does it makes the sum of both: of air, and
    of what `prior` allows for where nothing is known.
    """
    strength = float(theta[name])
    if name not in scene.expected or strength <= 0:
        return 1.0
    middle, width = scene.expected[name]
    far = math.asinh(math.log(strength / middle) / width)
    log_air = -0.5 * far**2 - math.log(width * math.cosh(far))
    return 1.0 + math.exp(_log_normal(strength, prior.median, prior.sd) - log_air)


def _log_normal(value: float, median: float, sd: float) -> float:
    """The logarithm of the density of log(value), up to a constant."""
    return -0.5 * (math.log(value / median) / sd) ** 2 - math.log(sd)

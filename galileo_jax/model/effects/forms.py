"""Forms: general ways a force can depend on time, place or speed, without a physical name.

The library's effects are certain dependences: on two powers of the speed (drags) or near rest
(Stribeck), on a place (a patch). The rest of that table stands here,

                 steadily               at one                 in waves
    time         friction_with_time     force_at_a_time,       force_waves_in_time
                                        friction_from_a_time
    place        friction_with_place    (friction_patch)       friction_waves_in_place
    speed        drag_of_a_power        (stribeck)

and runs in every diagnosis beside the library. A name is given only to what explains the data
better than all of these: one that does not has merely the right shape on this clip, as a
patch of friction has that of a gust.

They are effects like any other but in no list of names: `fit --effects` does not know them.
"""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar

from galileo_jax.model.effects.effect import Array, Effect, Surroundings, Theta, not_negative
from galileo_jax.model.effects.law import changed_friction
from galileo_jax.model.parameters import LogNormal, Normal, Parameter, Uniform

# Against an effect of the library. Who looks for what is missing has no reason to believe that the
# library holds it: each form is as probable as an effect, all seven a third of the library.
UNNAMED_ODDS = 1.0
# Before the data. Drags are well known: nearly all have a power with a name.
OTHER_POWER_ODDS = 0.05
# Of drags as the library has them, at 1 m/s and, in a fall, at 10 m/s.
DRAG_PRIOR, FALL_DRAG_PRIOR = LogNormal(median=0.3, sd=1.2), LogNormal(median=0.3, sd=1.5)
USUAL_M_S, USUAL_FALL_M_S = 1.0, 10.0
SMALL = 0.01  # of the usual speed: there the slope of a root ends
POWER_PRIOR = Uniform(0.25, 3.0)  # below a quarter it is friction
DURATION_PRIOR = LogNormal(median=0.08, sd=0.7)
PERIOD_PRIOR = LogNormal(median=0.2, sd=0.7)
LENGTH_PRIOR = LogNormal(median=0.2, sd=0.7)
LAST_FALLS = 6.0  # moments are looked for until so many times the free fall through the start's way
LEAST_WAY_M = 0.2
EDGE_S = 0.02
AHEAD = math.pi / 2  # the cosine as a sine: XLA computes it three times as fast


class Form(Effect):
    """An effect without a name; `meaning` says what it does, `name` only labels it."""

    meaning: ClassVar[str]
    # The shape of its formula, as `diagnosis.laws` calls it; a law of that shape is the same
    family: ClassVar[str]
    nature: ClassVar[str] = "friction"  # what has that shape, as in `model.effects.law`
    is_on_all: ClassVar[bool] = True  # else on object 1 alone
    how_likely: ClassVar[float] = UNNAMED_ODDS  # before the data, against an effect with a name
    # Which of its constants is known of effects that have a name; empty: there are none
    constant: ClassVar[str] = ""
    constant_words: ClassVar[str] = ""
    # The constant's value of each of these effects
    named_values: ClassVar[Mapping[str, float]] = MappingProxyType({})

    def odds(self, theta: Theta, scene: Surroundings) -> float:
        """The same for whatever strength and scene."""
        return self.how_likely


class DragOfAPower(Form):
    """F = -drag_of_a_power (|v| / V)^power sign(v) on every object; V = 1, in a fall 10 m/s."""

    name = "drag_of_a_power"
    meaning = "a drag that grows with another power of the speed"
    family = "power_v"
    nature = "drag"
    how_likely = OTHER_POWER_ODDS
    constant = "power"
    constant_words = "the power of the speed"
    named_values = MappingProxyType({"viscous_drag": 1.0, "air_drag": 2.0})

    def parameters(self, scene):
        prior = DRAG_PRIOR if scene.has_surface else FALL_DRAG_PRIOR
        return (
            Parameter(self.name, "N", prior, 0.0, "effect", 0.1),
            Parameter(f"{self.name}_power", "1", POWER_PRIOR, 1.0, "effect", 0.1),
        )

    def force(self, theta, scene):
        size = theta[self.name][..., None]
        beside_linear = (theta[f"{self.name}_power"][..., None] - 1.0) / 2
        usual = USUAL_M_S if scene.has_surface else USUAL_FALL_M_S

        def drag(state):
            share = state.speed_m_s / usual
            return -size * share * (share**2 + SMALL**2) ** beside_linear

        return drag


class ForceAtATime(Form):
    """a(t) = force_at_a_time exp(-((t - moment) / duration)^2), wherever object 1 is then."""

    name = "force_at_a_time"
    meaning = "a push or pull on object 1 at one moment"
    family = "pulse_t"
    nature = "push"
    is_on_all = False

    def parameters(self, scene):
        lasts = f"{self.name}_duration", "s", DURATION_PRIOR, DURATION_PRIOR.median
        return (
            Parameter(self.name, "m/s^2", Normal(0.0, 2.0), 0.0, "effect", 0.1, per_clip=True),
            _moment(self.name, scene),
            Parameter(*lasts, "effect", 0.1, per_clip=True),
        )

    def force(self, theta, scene):
        size = scene.only(theta[self.name] * theta["m1"], 0)
        moment, duration = theta[f"{self.name}_moment"], theta[f"{self.name}_duration"]
        exp = size.__array_namespace__().exp
        return lambda state: size * exp(-(((state.time_s - moment) / duration) ** 2))[..., None]


class ForceWavesInTime(Form):
    """a(t) = A cos(2 pi t / period) + B sin(2 pi t / period), as on a table that shakes.

    A = force_waves_in_time, B = force_waves_in_time_later, for every object.
    """

    name = "force_waves_in_time"
    meaning = "a force that oscillates in time"
    family = "wave_t"
    nature = "push"
    unknowns = (
        Parameter(name, "m/s^2", Normal(0.0, 1.0), 0.0, "effect", 0.1, per_clip=True),
        Parameter(f"{name}_later", "m/s^2", Normal(0.0, 1.0), 0.0, "effect", 0.1, per_clip=True),
        Parameter(f"{name}_period", "s", PERIOD_PRIOR, PERIOD_PRIOR.median, "effect", 0.1),
    )

    def force(self, theta, scene):
        rate = 2 * math.pi / theta[f"{self.name}_period"]
        mass = rate.__array_namespace__().stack(scene.mass(theta), axis=-1)
        return lambda state: mass * _wave(self.name, (rate * state.time_s)[..., None], theta)


class FrictionFromATime(Form, where=lambda scene: scene.has_surface):
    """k(t) = max(0, k + friction_from_a_time (1 + tanh((t - moment) / 20 ms)) / 2) of object 1.

    As a surface that has dried or is wetted. In a single passage a moment is a place: this does
    what a patch of friction does that is longer than the rest of the way.
    """

    name = "friction_from_a_time"
    meaning = "friction of object 1 that changes at one moment"
    family = "step_t"
    is_on_all = False

    def parameters(self, scene):
        strength = Parameter(self.name, "1", Normal(0.0, 0.2), 0.0, "effect", 0.05, per_clip=True)
        return strength, _moment(self.name, scene)

    def friction(self, theta, scene):
        rougher = scene.only(theta[self.name], 0)
        moment = theta[f"{self.name}_moment"][..., None]
        tanh = moment.__array_namespace__().tanh
        return lambda state, k: not_negative(
            k + rougher * (0.5 * (1.0 + tanh((state.time_s - moment) / EDGE_S)))
        )


class FrictionWavesInPlace(Form, where=lambda scene: scene.has_surface):
    """k(q) = max(0, k + A cos(2 pi q / length) + B sin(2 pi q / length)), as over planks.

    A = friction_waves_in_place, B = friction_waves_in_place_later, for every object.
    """

    name = "friction_waves_in_place"
    meaning = "friction that goes up and down along the path"
    family = "wave_q"
    unknowns = (
        Parameter(name, "1", Normal(0.0, 0.1), 0.0, "effect", 0.1),
        Parameter(f"{name}_later", "1", Normal(0.0, 0.1), 0.0, "effect", 0.1),
        Parameter(f"{name}_length", "m", LENGTH_PRIOR, LENGTH_PRIOR.median, "effect", 0.1),
    )

    def friction(self, theta, scene):
        rate = (2 * math.pi / theta[f"{self.name}_length"])[..., None]
        return lambda state, k: not_negative(k + _wave(self.name, rate * state.path_m, theta))


class FrictionWithPlace(Form, where=lambda scene: scene.has_surface):
    """k(q) = max(0, k (1 + friction_with_place q)) of every object, as of one less polished."""

    name = "friction_with_place"
    meaning = "friction that grows or falls along the path"
    family = "linear_q"
    unknowns = (Parameter(name, "1/m", Normal(0.0, 1.0), 0.0, "effect", 0.1),)

    def friction(self, theta, scene):
        share = theta[self.name][..., None]
        return lambda state, k: changed_friction(k, share * state.path_m)


class FrictionWithTime(Form, where=lambda scene: scene.has_surface):
    """k(t) = max(0, k (1 + friction_with_time t)) of every object, as surfaces that warm up."""

    name = "friction_with_time"
    meaning = "friction that grows or falls with time"
    family = "power_t"
    unknowns = (Parameter(name, "1/s", Normal(0.0, 1.0), 0.0, "effect", 0.1),)

    def friction(self, theta, scene):
        share = theta[self.name][..., None]
        return lambda state, k: changed_friction(k, share * state.time_s)


def _moment(name: str, scene: Surroundings) -> Parameter:
    """When something happens once, at any time while object 1 may still be on its way."""
    way = max(abs(scene.start_path_m[0]), LEAST_WAY_M)
    last = LAST_FALLS * math.sqrt(2 * way / scene.gravity)
    prior = Uniform(0.0, last)
    return Parameter(f"{name}_moment", "s", prior, last / 2, "effect", 0.1, per_clip=True)


def _wave(name: str, phase: Array, theta: Theta) -> Array:
    """A cos(phase) + B sin(phase), `[..., object]`."""
    first, later = (theta[part][..., None] for part in (name, f"{name}_later"))
    sin = phase.__array_namespace__().sin
    return first * sin(phase + AHEAD) + later * sin(phase)


FORMS: tuple[Form, ...] = (
    DragOfAPower(),
    ForceAtATime(),
    ForceWavesInTime(),
    FrictionFromATime(),
    FrictionWavesInPlace(),
    FrictionWithPlace(),
    FrictionWithTime(),
)
"""In the order in which their hooks are applied, after the library's."""

FORM_BY_NAME = {form.name: form for form in FORMS}
FORM_NAMES = tuple(FORM_BY_NAME)

"""What a user needs to write an effect: see docs/how-to/write_an_effect.md."""

from galileo_jax.model.effects.effect import (
    PENDULUM,
    SPRING,
    Array,
    Bounce,
    Effect,
    Force,
    Friction,
    Push,
    Rims,
    State,
    Surroundings,
    Theta,
    Walls,
    by_object,
    not_negative,
)
from galileo_jax.model.effects.registry import effect_names, load_file, make_effects, register
from galileo_jax.model.parameters import (
    HalfNormal,
    LogNormal,
    LongTailed,
    Normal,
    Parameter,
    Role,
    Uniform,
)

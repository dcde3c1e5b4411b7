"""What a user needs to write an effect: see docs/how-to/write_an_effect.md."""

from galileo_jax.model.effects.effect import (
    Array,
    Effect,
    Force,
    Friction,
    State,
    Surroundings,
    Theta,
)
from galileo_jax.model.effects.registry import effect_names, load_file, make_effects, register
from galileo_jax.model.parameters import HalfNormal, LogNormal, Normal, Parameter, Uniform

__all__ = [
    "Array",
    "Effect",
    "Force",
    "Friction",
    "HalfNormal",
    "LogNormal",
    "Normal",
    "Parameter",
    "State",
    "Surroundings",
    "Theta",
    "Uniform",
    "effect_names",
    "load_file",
    "make_effects",
    "register",
]

"""Metropolis-Hastings samplers and the driver that runs them."""

from galileo_jax.inference.samplers import mixture, random_walk, thesis
from galileo_jax.inference.samplers.driver import (
    Progress,
    Settings,
    dispersed_starts,
    sample,
)
from galileo_jax.inference.samplers.registry import sampler_class, sampler_names
from galileo_jax.inference.samplers.sampler import (
    AbstractSampler,
    AbstractTunedSampler,
    Info,
    LogDensity,
    State,
)

__all__ = [
    "AbstractSampler",
    "AbstractTunedSampler",
    "Info",
    "LogDensity",
    "Progress",
    "Settings",
    "State",
    "dispersed_starts",
    "mixture",
    "random_walk",
    "sample",
    "sampler_class",
    "sampler_names",
    "thesis",
]

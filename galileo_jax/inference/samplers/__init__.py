"""Metropolis-Hastings samplers and the driver that runs them."""

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
    "sample",
    "sampler_class",
    "sampler_names",
]

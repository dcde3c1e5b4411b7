"""The samplers by name."""

from galileo_jax.inference.samplers.sampler import AbstractSampler
from galileo_jax.runtime.registry import Registry

_SAMPLERS = Registry(AbstractSampler, "sampler", "samplers")

register = _SAMPLERS.register
sampler_names = _SAMPLERS.names
sampler_class = _SAMPLERS.get

"""The samplers by name."""

from galileo_jax.inference.samplers.sampler import AbstractSampler
from galileo_jax.runtime.registry import Registry

_SAMPLERS: Registry[type[AbstractSampler]] = Registry(
    "sampler", "samplers", "galileo_jax.inference.samplers.library"
)

register = _SAMPLERS.register
sampler_names = _SAMPLERS.names
sampler_class = _SAMPLERS.get

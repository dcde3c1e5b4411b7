"""The samplers by name."""

from typing import TypeVar

from galileo_jax.inference.samplers.sampler import AbstractSampler

Sampler = TypeVar("Sampler", bound=AbstractSampler)

_SAMPLERS: dict[str, type[AbstractSampler]] = {}


def register(sampler: type[Sampler]) -> type[Sampler]:
    """Class decorator: makes the sampler known under its `name`."""
    if sampler.name in _SAMPLERS:
        raise ValueError(f"two samplers are named {sampler.name!r}")
    _SAMPLERS[sampler.name] = sampler
    return sampler


def sampler_names() -> tuple[str, ...]:
    """All names, sorted."""
    return tuple(sorted(_SAMPLERS))


def sampler_class(name: str) -> type[AbstractSampler]:
    """The sampler of that name.

    Raises:
      ValueError: nothing is registered under `name`; the message lists what is.
    """
    if name not in _SAMPLERS:
        raise ValueError(f"unknown sampler {name!r}; known: {', '.join(sampler_names())}")
    return _SAMPLERS[name]

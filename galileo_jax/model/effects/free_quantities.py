"""Declared quantities that a fit may infer, by name: `--free gravity`.

Each is an effect that is always there and in no question, in a file of `free/` that registers
itself. Its parameter has the role "main", and the declared value in its prior.
"""

from collections.abc import Sequence

from galileo_jax.model.effects.effect import Effect
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.registry import Registry

_registry: Registry[type[Effect]] = Registry(
    "quantity", "quantities", "galileo_jax.model.effects.free"
)
register = _registry.register


def make_free_quantities(names: Sequence[str]) -> tuple[Effect, ...]:
    """The effects that make these quantities parameters, in alphabetical order.

    Raises:
      InputError: a name is unknown (the message lists the known) or given twice.
    """
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"free: {name!r} is named twice")
    try:
        return tuple(_registry[name]() for name in sorted(names))
    except InputError as error:
        raise InputError(f"free: {error}") from error

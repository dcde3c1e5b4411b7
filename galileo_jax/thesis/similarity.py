"""What a similarity of velocity profiles is, and the similarities by name."""

from abc import abstractmethod
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from galileo_jax.runtime.registry import Registry


class AbstractSimilarity(eqx.Module):
    """How alike two velocity profiles are; higher is more alike.

    Attributes:
      name: in the registry.
    """

    name: ClassVar[str]

    def __call__(
        self, predicted_m_s: ArrayLike, observed_m_s: ArrayLike, mask: ArrayLike
    ) -> jax.Array:
        """The similarity `[]`.

        Arguments:
          predicted_m_s: `[object, 2, frame - 1]`, m/s.
          observed_m_s: likewise; anything, NaN too, where masked.
          mask: `[object, frame - 1]`, True where a velocity was measured (both its frames
            were). What is masked counts for nothing, in the derivative neither.
        """
        both = jnp.broadcast_to(jnp.asarray(mask)[:, None, :], jnp.shape(predicted_m_s))
        # Masked values are replaced before the arithmetic: a NaN times zero stays a NaN.
        return self._of_measured(
            jnp.where(both, predicted_m_s, 0.0), jnp.where(both, observed_m_s, 0.0), both
        )

    @abstractmethod
    def _of_measured(self, predicted: jax.Array, observed: jax.Array, mask: jax.Array) -> jax.Array:
        """The similarity; all three `[object, 2, frame - 1]`, zeros where masked."""


_SIMILARITIES: Registry[type[AbstractSimilarity]] = Registry(
    "similarity", "similarities", "galileo_jax.thesis.similarities"
)

register = _SIMILARITIES.register
similarity_names = _SIMILARITIES.names
similarity_class = _SIMILARITIES.get

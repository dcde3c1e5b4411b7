"""Benchmarks: settings of their own on which trained networks are tested, by name."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from galileo_jax.runtime.registry import Registry

if TYPE_CHECKING:
    import jax

    from galileo_jax.neural.task import Arrays


@dataclass(frozen=True)
class Benchmark:
    """A setting to test a network in.

    Attributes:
      name: in the registry, and before its figures.
      draw: makes so many samples from a key, in the form `GalileoTask.make` gives, and with them
        `collides`: whether object 2 is hit.
      reference: what is expected, by the figure's name.
    """

    name: str
    draw: "Callable[[jax.Array, int], Arrays]"
    reference: Mapping[str, float]


BENCHMARKS: Registry[Benchmark] = Registry("benchmark", "benchmarks")

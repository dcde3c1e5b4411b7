"""A log density whose code has a name and whose data are arrays: compiled once for many data."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import numpy as np

from galileo_jax.runtime.trace_cache import trace_cached


class Program(eqx.Module):
    """`code[0](*code[1:], arrays, position)`, a `LogDensity`.

    Two of the same code and shapes share compiled programs, also those that `kept` leaves on
    disk; a closure over its data is compiled for itself alone.
    """

    # a function and what it is to be compiled for; hashable, and named as `kept` asks
    code: tuple = eqx.field(static=True)
    arrays: Any  # PyTree of arrays, the data

    def __call__(self, position: jax.Array) -> jax.Array:
        """`[dim] -> []`."""
        function, *static = self.code
        return function(*static, self.arrays, position)


def compiled(function: Callable[..., Any], like: Any, log_density: Any, *args: Any) -> Any:
    """`function(log_density, *args)`, compiled; kept between processes for a `Program`.

    `function`: of a module, so that it has a name. `like`: PyTree of the structure of what it
    returns. `log_density`: a `LogDensity`. `args`: PyTrees of arrays.
    """
    if not isinstance(log_density, Program):
        return _jitted(function, log_density, *args)
    kinds = tuple(type(arg) for arg in args if isinstance(arg, eqx.Module))
    # NumPy's arrays all look alike to jit; JAX's, by where they come from, are compiled anew.
    args = jax.tree.map(np.asarray, args)
    leaves = _leaves_of(function, log_density.code, kinds, log_density.arrays, args)
    return jax.tree.unflatten(jax.tree.structure(like), leaves)


@trace_cached(num_static=3)
def _leaves_of(function, code, kinds, arrays, args):
    del kinds  # a sampler from outside the package may change unseen
    return tuple(jax.tree.leaves(function(Program(code, arrays), *args)))


_jitted = eqx.filter_jit(lambda function, log_density, *args: function(log_density, *args))

"""The engines by name, and which one `auto` takes."""

import jax

from galileo_jax.errors import InputError
from galileo_jax.rollout.engine_names import ENGINES
from galileo_jax.rollout.model import Model
from galileo_jax.rollout.rollout import Engine


def make_engine(name: str, model: Model) -> Engine:
    """The engine `name` for a model.

    `auto` takes MJX where JAX has an accelerator, and otherwise the C engine, which is many
    times faster than MJX on a CPU (benchmarks/rollouts.py).

    Raises:
      InputError: unknown name; lists the known.
    """
    if name not in ENGINES:
        raise InputError(f"engine: unknown value {name!r}; known: {', '.join(ENGINES)}")
    if name == "auto":
        name = "c" if jax.default_backend() == "cpu" else "mjx"
    if name == "mjx":
        from galileo_jax.rollout.engine_mjx import EngineMJX

        return EngineMJX(model)
    from galileo_jax.rollout.engine_c import EngineC

    return EngineC(model)

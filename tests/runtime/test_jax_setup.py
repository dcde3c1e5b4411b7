"""How JAX is set up before it computes anything."""

import os

import jax
import jax.numpy as jnp

from galileo_jax.runtime import jax_setup

ONE_KERNEL = "xla_cpu_small_call"


def test_a_loop_over_a_batch_becomes_one_kernel():
    """Without the flag, which conftest sets as the public functions do, only loops of 1 kB do."""

    def loop(x: jax.Array) -> jax.Array:
        return jax.lax.fori_loop(0, 100, lambda _, x: jnp.sin(x) + jnp.roll(x, 1), x)

    program = jax.jit(loop).lower(jnp.ones(4096)).compile().as_text()
    assert program is not None and ONE_KERNEL in program


def test_other_flags_stay(monkeypatch):
    monkeypatch.setenv("XLA_FLAGS", "--xla_dump_to=x")
    jax_setup.compile_loops_whole()
    assert os.environ["XLA_FLAGS"].startswith("--xla_dump_to=x --xla_backend_extra_options=")
    own = "--xla_backend_extra_options=xla_cpu_small_while_loop_byte_threshold=1"
    monkeypatch.setenv("XLA_FLAGS", own)
    jax_setup.compile_loops_whole()
    assert os.environ["XLA_FLAGS"] == own

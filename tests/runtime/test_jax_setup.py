"""How JAX is set up before it computes anything."""

import os

import jax
import jax.numpy as jnp
import pytest

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
    jax_setup.set_xla_flags()
    flags = os.environ["XLA_FLAGS"].split()
    assert flags[0] == "--xla_dump_to=x"
    assert flags[-1] == jax_setup.EXTRA_OPTIONS + jax_setup.WHOLE_LOOPS
    own = f"{jax_setup.EXTRA_OPTIONS}{ONE_KERNEL}=1 {jax_setup.FUSION_EMITTERS}True"
    monkeypatch.setenv("XLA_FLAGS", own)
    jax_setup.set_xla_flags()
    assert os.environ["XLA_FLAGS"] == own


@pytest.mark.parametrize("jaxlib, is_told", [("0.10.2", True), ("0.11.0", False)])
def test_only_a_jaxlib_that_knows_a_flag_is_told(monkeypatch, jaxlib: str, is_told: bool):
    monkeypatch.setenv("XLA_FLAGS", "")
    monkeypatch.setattr(jax_setup, "version", lambda _: jaxlib)
    jax_setup.set_xla_flags()
    assert (jax_setup.FUSION_EMITTERS in os.environ["XLA_FLAGS"]) == is_told

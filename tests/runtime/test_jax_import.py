"""JAX is imported without a search through all installed packages, and is the same JAX."""

import subprocess
import sys

import pytest

COUNTED = """
import importlib.metadata as metadata
searches = []
search = metadata.distributions
def counted(**options):
    searches.append(sys._getframe(1).f_globals["__name__"])
    return search(**options)
metadata.distributions = counted
"""
SHOWN = """
import jax.numpy as jnp
assert float(jnp.arange(3).sum()) == 3
assert metadata.distributions is counted
print("jax._src.numpy.array_constructors" in searches)
"""
SPARED = "from galileo_jax.runtime.jax_import import without_search_for_rocm\n"


def has_searched(*lines: str) -> bool:
    code = "\n".join(["import sys", COUNTED, *lines, SHOWN])
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert not done.returncode, done.stderr
    return done.stdout.strip() == "True"


def test_the_search_is_spared():
    assert not has_searched(SPARED, "without_search_for_rocm()")


def test_a_plugin_is_found_by_the_search(tmp_path):
    """Else accelerators of AMD would be there in notebooks and not in commands."""
    (tmp_path / "jax_rocm7_plugin").mkdir()
    line = f"sys.path.append({str(tmp_path)!r})"
    assert has_searched(SPARED, line, "without_search_for_rocm()")


def test_jax_still_searches():
    """Fails when a new JAX has ended the search: then `jax_import` can go."""
    assert has_searched()


@pytest.mark.parametrize("times", [1, 2])
def test_jax_imported_already_is_left_alone(times):
    lines = ["import jax.numpy", *["without_search_for_rocm()"] * times]
    lines.append("assert 'galileo' not in repr(sys.meta_path)")
    assert has_searched(SPARED, *lines)

"""Programs that are traced once per machine."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.experimental.compilation_cache import compilation_cache

from galileo_jax.model.effects.library.air_drag import AirDrag
from galileo_jax.runtime.trace_cache import FOLDER, TraceCached
from galileo_jax.runtime.trace_cache import trace_cached as public_decorator

CACHE, SWITCH = "jax_compilation_cache_dir", "jax_enable_compilation_cache"


@pytest.fixture
def folder(tmp_path):
    before = getattr(jax.config, CACHE)
    jax.config.update(CACHE, str(tmp_path))
    yield tmp_path / FOLDER
    jax.config.update(CACHE, before)
    compilation_cache.reset_cache()


class Traced:
    """A function that counts how often Python runs it."""

    def __init__(self):
        self.count = 0

    def __call__(self, power, x, rest):
        self.count += 1
        return x**power + rest["y"], x.sum()


def fresh() -> tuple[TraceCached, Traced]:
    """As another process would have it: nothing but the folder remembers."""
    traced = Traced()

    def function(power, x, rest):
        return traced(power, x, rest)

    return TraceCached(function, 1), traced


X, REST = np.arange(3.0), {"y": 2.0}


def test_another_process_does_not_trace_again(folder):
    first, traced = fresh()
    expected = first(3, X, REST)
    np.testing.assert_array_equal(expected[0], X**3 + 2)
    assert traced.count == 1 and len(list(folder.iterdir())) == 1
    second, traced = fresh()
    for got, want in zip(second(3, X, REST), expected, strict=True):
        np.testing.assert_array_equal(got, want)
    assert traced.count == 0


@pytest.mark.parametrize("args", [(2, X, REST), (3, X[:2], REST), (3, X.astype(np.int64), REST)])
def test_what_differs_is_another_program(folder, args):
    fresh()[0](3, X, REST)
    other, traced = fresh()
    np.testing.assert_array_equal(other(*args)[0], args[1] ** args[0] + 2)
    assert traced.count == 1 and len(list(folder.iterdir())) == 2


def test_other_code_is_another_program(folder, monkeypatch):
    fresh()[0](3, X, REST)
    monkeypatch.setattr("galileo_jax.runtime.trace_cache._code", lambda: "edited")
    other, traced = fresh()
    other(3, X, REST)
    assert traced.count == 1


@pytest.mark.parametrize("damage", [b"", b"not a program", None])
def test_a_damaged_file_is_made_again(folder, damage):
    fresh()[0](3, X, REST)
    (path,) = folder.iterdir()
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2] if damage is None else damage)
    other, traced = fresh()
    np.testing.assert_array_equal(other(3, X, REST)[0], X**3 + 2)
    assert traced.count == 1
    third, traced = fresh()
    third(3, X, REST)
    assert traced.count == 0


def test_nothing_is_kept_with_the_cache_off(folder):
    before = getattr(jax.config, SWITCH)
    jax.config.update(SWITCH, False)
    try:
        np.testing.assert_array_equal(fresh()[0](3, X, REST)[0], X**3 + 2)
    finally:
        jax.config.update(SWITCH, before)
    assert not folder.exists()


def test_a_folder_that_cannot_be_written_is_done_without(folder):
    folder.write_text("a file")
    np.testing.assert_array_equal(fresh()[0](3, X, REST)[0], X**3 + 2)


class UsersEffect(AirDrag):
    """Its text may change, and no hash would know."""


@pytest.mark.parametrize(("effect", "is_kept"), [(AirDrag, True), (UsersEffect, False)])
def test_only_programs_of_the_package_are_kept(folder, effect, is_kept):
    @public_decorator(num_static=1)
    def function(kind, x):
        return 2 * x

    np.testing.assert_array_equal(function((effect(), ("m1",)), X), 2 * X)
    assert folder.exists() == is_kept


def test_inside_another_trace_it_is_a_jitted_function(folder):
    function, _ = fresh()
    slope = jax.jit(jax.grad(lambda x: function(3, x, REST)[0].sum()))(jnp.asarray(X))
    np.testing.assert_allclose(slope, 3 * X**2)
    rows = jax.vmap(lambda x: function(2, x, REST)[0])(jnp.stack([X, X]))
    np.testing.assert_array_equal(rows, np.stack([X**2 + 2] * 2))
    assert not folder.exists()


def test_each_precision_has_its_own(folder):
    function, traced = fresh()
    with jax.enable_x64(True):
        assert function(3, X, REST)[0].dtype == np.float64
    with jax.enable_x64(False):
        assert function(3, X, REST)[0].dtype == np.float32
    assert traced.count == 2


def test_it_holds_the_last_programs_only(folder, monkeypatch):
    monkeypatch.setattr("galileo_jax.runtime.trace_cache.MOST_PROGRAMS", 2)
    function, traced = fresh()
    for power in (1, 2, 1, 3, 1):  # 1 is used again and again, 2 is dropped
        np.testing.assert_array_equal(function(power, X, REST)[0], X**power + 2)
    assert traced.count == 3 and function._programs.cache_info()[:2] == (2, 3)  # hits, misses
    np.testing.assert_array_equal(function(2, X, REST)[0], X**2 + 2)
    assert traced.count == 3  # read from the folder
    assert function._programs.cache_info()[1:] == (4, 2, 2)  # misses, as many as it may hold

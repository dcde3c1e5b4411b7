"""Calls of several threads in one: each gets what it would get alone."""

import threading

import jax.numpy as jnp
import numpy as np
import pytest

from galileo_jax.runtime.call_merging import Together, current
from galileo_jax.runtime.progress import Cancelled
from galileo_jax.runtime.trace_cache import trace_cached


@trace_cached(num_static=1)
def powers(power: int, x, scale):
    return jnp.cumsum(x**power) * scale, x.max()


@trace_cached(num_static=0)
def halves(x):
    return x / 2


def in_threads(group: Together, *works):
    """What each function returns, or the error that it raises."""
    found: list = [None] * len(works)

    def run(i):
        with group.member():
            try:
                found[i] = works[i]()
            except Exception as error:
                found[i] = error

    group.expect(len(works))
    threads = [threading.Thread(target=run, args=(i,), daemon=True) for i in range(len(works))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    return found


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_each_gets_what_it_would_get_alone_and_all_in_one_call(count):
    inputs = [np.arange(4.0) + i for i in range(count)]
    expected = [powers(3, x, float(i)) for i, x in enumerate(inputs)]
    group = Together()
    works = [lambda x=x, i=i: powers(3, x, float(i)) for i, x in enumerate(inputs)]
    for got, want in zip(in_threads(group, *works), expected, strict=True):
        np.testing.assert_array_equal(got[0], want[0])
        np.testing.assert_array_equal(got[1], want[1])
    assert (group.num_calls, group.num_made) == (count, 1)


def test_other_shapes_and_other_programs_are_calls_of_their_own():
    group = Together()
    works = [
        lambda: powers(2, np.ones(3), 1.0)[0],
        lambda: powers(3, np.ones(3), 1.0)[0],  # another static argument
        lambda: powers(2, np.ones(4), 1.0)[0],
        lambda: halves(np.ones(3)),
    ]
    found = in_threads(group, *works)
    assert [len(own) for own in found] == [3, 3, 4, 3]
    assert group.num_made == 4


def test_who_is_a_step_behind_in_a_loop_is_soon_in_step():
    group = Together()

    def loop(is_behind):
        x = np.arange(3, dtype=np.float32)
        if is_behind:
            x = np.asarray(halves(x))
        for _ in range(10):
            x = np.asarray(halves(np.asarray(powers(1, x, np.float32(0.5))[0])))
        return x

    found = in_threads(group, *(lambda behind=b: loop(behind) for b in (True, False, False)))
    np.testing.assert_array_equal(found[1], found[2])
    assert group.num_calls == 3 * 20 + 1
    assert group.num_made <= 20 + 3


def test_members_that_leave_are_not_waited_for():
    group = Together()
    found = in_threads(group, lambda: None, lambda: halves(np.full(2, 6.0)))
    np.testing.assert_array_equal(found[1], [3.0, 3.0])


def test_an_error_reaches_all_who_asked():
    @trace_cached(num_static=0)
    def broken(x):
        raise ValueError(f"no program for {x.shape}")

    found = in_threads(Together(), lambda: broken(np.ones(2)), lambda: broken(np.ones(2)))
    assert [str(error) for error in found] == ["no program for (2,)"] * 2


def test_what_waits_when_the_group_is_closed_is_cancelled():
    group, begun = Together(), threading.Event()
    group.expect(1)  # somebody who never comes

    def wait():
        begun.set()
        return halves(np.ones(2))

    closer = threading.Thread(target=lambda: (begun.wait(60), group.close()), daemon=True)
    closer.start()
    (found,) = in_threads(group, wait)
    assert isinstance(found, Cancelled)


def test_outside_a_group_nothing_waits():
    assert current() is None
    np.testing.assert_array_equal(halves(np.ones(2)), [0.5, 0.5])

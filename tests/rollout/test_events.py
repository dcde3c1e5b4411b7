"""The event kernel: roots and steps against closed forms, and slopes of what events make."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from galileo_jax.rollout.events import (
    CLASSICAL,
    DORMAND_PRINCE,
    Tableau,
    cubic,
    newton,
    reaches_s,
    runge_kutta,
    step_by_events,
    to_crossing,
)

G = 9.81
EXACT = 1e-12


def test_the_instant_of_an_event_never_loses_its_derivative(x64):
    """Of 100,000 falls h - v t - c t^2 one in 200 ends in bounds that are a rounding apart."""
    draws = np.random.default_rng(0).uniform((0.001, 0.1, 0.0), (1.0, 3.0, 2.0), (100_000, 3)).T
    h, v, c = jnp.asarray(draws)

    def instant(h: jax.Array) -> jax.Array:
        return newton(lambda t: (h - v * t - c * t**2, -v - 2 * c * t), h / v, 100.0, 8)[0]

    t, slope = jax.jvp(instant, (h,), (jnp.ones_like(h),))
    np.testing.assert_allclose(slope, 1 / (v + 2 * c * t), rtol=1e-6)


@pytest.mark.parametrize(
    ("distance", "v", "a", "expected"),
    [
        (1.0, 2.0, 0.0, 0.5),
        (1.0, 3.0, -4.0, 0.5),  # and again on the way back
        (1.0, 0.0, 2.0, 1.0),
        (1.0, -1.0, 4.0, 1.0),  # away at first
        (1.0, 1.0, -1.0, math.inf),  # it turns back before
        (1.0, -1.0, 0.0, math.inf),
        (-0.1, 1.0, 0.0, 0.0),
    ],
)
def test_when_a_distance_is_reached(distance, v, a, expected):
    arrays = np.asarray(distance), np.asarray(v), np.asarray(a)
    assert float(reaches_s(*arrays)) == pytest.approx(expected, abs=EXACT)
    assert float(reaches_s(*map(jnp.asarray, arrays))) == pytest.approx(expected, abs=EXACT)


def test_a_cubic_is_hermites():
    def f(x):
        return x**3 - 2 * x + 1

    slope = jax.grad(f)
    value, rate = cubic(f(0.0), f(1.0), slope(0.0), slope(1.0), 0.3)
    assert float(value) == pytest.approx(f(0.3), abs=EXACT)
    assert float(rate) == pytest.approx(float(slope(0.3)), abs=EXACT)


def test_newtons_last_step_carries_the_slope_of_the_root():
    """Of 1 - c t^2, from a guess at which Newton alone would leave the interval."""

    def root(c: jax.Array) -> jax.Array:
        return newton(lambda t: (1 - c * t**2, -2 * c * t), jnp.asarray(0.01), 2.0, 8)[0]

    at, slope = jax.jvp(root, (jnp.asarray(4.0),), (jnp.asarray(1.0),))
    assert float(at) == pytest.approx(0.5, abs=EXACT)
    assert float(slope) == pytest.approx(-0.5 * 4.0**-1.5, abs=EXACT)


@pytest.mark.parametrize("method, order", [(CLASSICAL, 4), (DORMAND_PRINCE, 5)])
def test_runge_kutta_is_of_its_order(method: Tableau, order: int):
    def end(steps: int) -> float:
        state = {"x": jnp.asarray(1.0), "v": jnp.asarray(0.0)}
        for k in range(steps):
            state = runge_kutta(
                lambda at, t: {"x": at["v"], "v": -at["x"]}, state, k / steps, 1 / steps, method
            )
        return abs(float(state["x"]) - math.cos(1.0))

    assert end(8) / end(16) == pytest.approx(2.0**order, rel=0.2)


def ball(height: jax.Array, e: jax.Array, last_s: float, most: int) -> jax.Array:
    """How high a ball is that is dropped, and loses 1 - e of its speed at every bounce."""

    def advance(state, _, left_s, is_last):
        def after(spent_s):
            y, v = state
            return y + v * spent_s - G * spent_s**2 / 2, v - G * spent_s

        def jump(at, _):
            return jnp.zeros_like(at[0]), jnp.where(is_last, 0.0, -e * at[1])

        def level(at, _):
            return at

        return to_crossing(state, after, level, jump, left_s, jnp.asarray(True))

    return step_by_events(advance, (height, jnp.zeros(())), 0.0, last_s, most)[0]


def test_bounces_within_one_step_are_met_at_their_time():
    """The second after the first, from the floor on; parabolas have no error."""
    height, e, last_s = 0.5, 0.6, 0.75
    first_s = math.sqrt(2 * height / G)
    speed = G * first_s
    second_s = first_s + 2 * e * speed / G
    assert first_s < second_s < last_s
    since = last_s - second_s
    expected = e**2 * speed * since - G * since**2 / 2
    assert expected > 0
    at = jnp.array([height, e])

    def end(at: jax.Array) -> jax.Array:
        return ball(at[0], at[1], last_s, 8)

    assert float(end(at)) == pytest.approx(expected, abs=1e-10)
    slopes = jax.jacfwd(end)(at)
    for way, slope in zip(1e-6 * jnp.eye(2), slopes, strict=True):
        difference = float(end(at + way) - end(at - way)) / 2e-6
        assert float(slope) == pytest.approx(difference, rel=1e-6)

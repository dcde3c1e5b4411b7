"""What all effects of the library share: names, places, nothing at absent, finite slopes."""

import importlib
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from galileo_jax.model.effects import effect_names, make_effects
from galileo_jax.model.effects.effect import State
from galileo_jax.model.parameters import PriorTable, absent, inverse
from galileo_jax.rollout.engine_path import EnginePath
from galileo_jax.rollout.motion import dynamics, state_at
from tests.model.effects.motion import (
    INCLINE,
    LIBRARY,
    ONE,
    PAIR,
    absent_theta,
    library_engine,
    model_of,
)
from tests.precision import in_64_bit
from tests.ramp_model import HIT, make_theta

SCENES = {"pair": PAIR, "one": ONE, "incline": INCLINE}
LONG = replace(INCLINE, way_m=1.2)
NO_PLACE = {
    "pair": set(),
    "one": {"restitution"},
    "incline": {"restitution", "surface_friction", "table_tilt"},
}
MEASURED = {"release_delay", "frame_rate"}  # no rollout depends on them
NUMPY_JAX_RTOL = 1e-13
ROUNDING_M = 1e-12  # one program goes from event to event, the other step by step
# The engine's derivative against a forward difference: the step's curvature and rounding.
SLOPE_STEP, SLOPE_ATOL = 1e-6, 2e-4


def test_the_library_is_what_was_agreed():
    assert set(LIBRARY) <= set(effect_names())


@pytest.mark.parametrize("name", LIBRARY)
def test_documentation(name):
    doc = importlib.import_module(f"galileo_jax.model.effects.library.{name}").__doc__
    assert doc and "Source:" in doc and "Confused with:" in doc


@pytest.mark.parametrize("scene", SCENES)
def test_places(scene):
    without = {e.name for e in make_effects(LIBRARY) if not e.parameters(SCENES[scene])}
    assert without == NO_PLACE[scene]


def test_scale_error_has_no_place_where_the_scale_is_unknown():
    (effect,) = make_effects(["scale_error"])
    unknown = replace(INCLINE, is_scale_known=False)
    assert effect.parameters(unknown) == ()
    track = np.ones((1, 2, 3))
    assert effect.measure(track, {}, unknown) is track
    assert effect.start(track, {}, unknown) is track


@pytest.mark.parametrize("name", LIBRARY)
def test_parameters(name):
    (effect,) = make_effects([name])
    strength, *others = effect.parameters(PAIR)
    assert strength.name == name and strength.absent == 0.0
    assert all(p.name.startswith(f"{name}_") for p in others)
    for parameter in (strength, *others):
        assert parameter.role == "effect"
        assert (parameter.step is None) == (name in MEASURED)
        assert parameter.per_clip == (name in {"release_delay", "initial_push"})
    z = jnp.linspace(-2.0, 2.0, 5)[:, None] * jnp.ones(1 + len(others))
    theta = PriorTable.of((strength, *others)).forward(z)
    assert np.isfinite(theta).all() and (np.diff(theta, axis=0) > 0).all()
    assert inverse((strength, *others), theta) == pytest.approx(np.asarray(z), abs=1e-9)


@pytest.mark.parametrize(("scene", "end"), [(PAIR, 0.3), (ONE, 0.3), (INCLINE, 0.5), (LONG, 1.2)])
def test_zones_cover_the_path(scene, end):
    for name in ("friction_patch", "magnetic_brake"):
        _, start, *_ = make_effects([name])[0].parameters(scene)
        low, high = (float(start.prior.forward(jnp.asarray(z))) for z in (-6.0, 6.0))
        assert low == pytest.approx(scene.start_path_m[0], abs=1e-6)
        assert high == pytest.approx(end, abs=1e-6)


@pytest.fixture(scope="module")
def engines():
    """Of each scene: without and with the whole library."""
    with in_64_bit():
        return {
            name: [EnginePath(model_of(scene, names)) for names in ((), LIBRARY)]
            for name, scene in SCENES.items()
        }


@pytest.mark.parametrize("scene", SCENES)
@settings(max_examples=15)
@given(
    masses=st.tuples(*[st.floats(0.05, 3.0)] * 2), frictions=st.tuples(*[st.floats(0.0, 0.6)] * 2)
)
def test_absent_is_the_base_rollout(scene, engines, masses, frictions):
    base, whole = (
        engine.simulate(absent_theta(engine.model, masses, frictions)[None])
        for engine in engines[scene]
    )
    for without, with_all in zip(base, whole, strict=True):
        np.testing.assert_allclose(with_all, without, rtol=0, atol=ROUNDING_M)


@pytest.mark.parametrize("name", LIBRARY)
@pytest.mark.parametrize("scene", SCENES)
def test_absent_measures_nothing(name, scene):
    (effect,) = make_effects([name])
    surroundings = SCENES[scene]
    theta = {p.name: np.asarray(p.absent) for p in effect.parameters(surroundings)}
    times = np.linspace(-1.0, 3.0, 50)
    assert (effect.time(times, theta, surroundings) == times).all()
    track = np.random.default_rng(0).normal(size=(len(surroundings.names), 2, 50))
    assert (effect.measure(track, theta, surroundings) == track).all()


@pytest.mark.parametrize("scene", ["pair", "incline"])
def test_slopes_at_absent_are_finite_and_right(scene, engines):
    engine = engines[scene][1]
    names = engine.model.names
    theta = absent_theta(engine.model, HIT.mass_kg, HIT.friction)
    usual = theta.copy()
    if scene == "pair":  # at exactly no restitution at all a bounce has no two-sided slope
        usual[names.index("impact_restitution")] = 0.01
    one = jax.jacfwd(lambda t: engine.traceable(t[None])[0][0])
    slopes = np.asarray(jax.jit(jax.vmap(one))(jnp.stack([theta, usual])))
    assert np.isfinite(slopes).all()
    strengths = [i for i, name in enumerate(names) if name in LIBRARY]
    moved = np.stack([usual, *(usual + SLOPE_STEP * np.eye(len(theta))[strengths])])
    position, _ = engine.simulate(moved)
    differences = (position[1:] - position[0]) / SLOPE_STEP
    without = MEASURED | ({"scale_error"} if scene == "incline" else set())
    for i, difference in zip(strengths, differences, strict=True):
        assert slopes[1][..., i] == pytest.approx(difference, abs=SLOPE_ATOL), names[i]
        assert (np.abs(difference).max() > 1e-3) == (names[i] not in without), names[i]


def draw(engine, rng, count):
    """Random parameters of everything, `[count, parameter]`."""
    z = rng.normal(size=(count, len(engine.model.parameters)))
    return np.asarray(PriorTable.of(engine.model.parameters).forward(jnp.asarray(z)))


def test_numpy_and_jax_agree():
    """The C engine sees a batch in NumPy, the rigid engine one at a time in JAX."""
    engine = library_engine(HIT)
    rng = np.random.default_rng(0)
    theta = draw(engine, rng, 5)
    path, speed = rng.uniform(-0.5, 0.5, (5, 2)), rng.normal(size=(5, 2))
    for xp in (np, jnp):
        named = engine.model.by_name(xp.asarray(theta))
        law = dynamics(engine.model.effects, PAIR, named, xp)
        state = state_at(xp.asarray(path), xp.asarray(speed), xp.asarray(0.3), PAIR)
        found = law.drive(state), law.brake(state), law.inertia, law.start_m, law.start_speed_m_s
        if xp is np:
            expected = found
            assert all(isinstance(a, np.ndarray) and a.shape == (5, 2) for a in found)
        else:
            for a, b in zip(expected, found, strict=True):
                assert np.asarray(b) == pytest.approx(a, rel=NUMPY_JAX_RTOL)


def test_coefficients_are_never_negative():
    engine = library_engine(HIT)
    rng = np.random.default_rng(1)
    named = engine.model.by_name(draw(engine, rng, 200))
    law = dynamics(engine.model.effects, PAIR, named, np)
    path, speed = rng.uniform(-0.5, 0.5, (200, 2)), rng.normal(size=(200, 2))
    assert (law.coefficient(State(path, speed, np.array(0.0), path < 0)) >= 0).all()


def test_any_parameters_roll_out():
    """All effects at once, from the prior: no rollout fails, nothing goes up for ever."""
    engine = library_engine(HIT)
    position, velocity = engine.simulate(draw(engine, np.random.default_rng(2), 64))
    assert np.isfinite(position).all() and np.isfinite(velocity).all()
    assert np.abs(velocity).max() < 30.0


def test_absent_vector_is_the_models():
    engine = library_engine(HIT)
    theta = make_theta(engine.model, HIT)
    assert theta == pytest.approx(absent_theta(engine.model, HIT.mass_kg, HIT.friction))
    assert (absent(engine.model.parameters)[[engine.model.index(n) for n in LIBRARY]] == 0).all()

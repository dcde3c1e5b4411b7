"""Deviations of bodies on a path: what rests stays, what two do to each other leaves their sum."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.statespace.kinematics import kinematics
from galileo_jax.statespace.path_deviation import deviations
from galileo_jax.statespace.term import Seen
from galileo_jax.statespace.terms import TERMS
from tests.oracle_trials import observe
from tests.ramp_model import HIT, make_surroundings
from tests.reference_ramp import solve

SCENE = make_surroundings(HIT)


@pytest.fixture(scope="module")
def motion():
    return kinematics(observe(HIT, 0, noise_m=1e-6), SCENE)


def test_speeds_and_the_hit_are_those_of_the_motion(motion):
    """Within some per cent of the exact ones, but beside the hit."""
    exact = solve(HIT, motion.times_s)
    speed = np.linalg.norm(exact.velocity_m_s, axis=1)
    [hit] = motion.hits
    beside = np.abs(np.arange(len(motion.times_s)) - hit.step) > 4
    crosses = np.abs(np.gradient(exact.position_m[0, 1])) < 1e-9
    is_clear = beside & (speed[0] > 0.1) & (crosses | (exact.position_m[0, 1] > 0.05))
    np.testing.assert_allclose(motion.speed_m_s[0, is_clear], speed[0, is_clear], rtol=0.1)
    after = hit.step + 2
    assert hit.given == pytest.approx(speed[1, after] / speed[0, hit.step], rel=0.15)


def test_what_rests_does_not_creep(motion):
    """From where a body stops on its deviation is one number."""
    found = deviations(motion, 0.01, 1.0)[:, 0, :, 0]
    moves = np.flatnonzero(motion.moves[0])
    rests = np.arange(moves[-1] + 1, len(found))
    assert len(rests) > 3
    at_rest = found[np.ix_(rests, rests)]
    np.testing.assert_allclose(at_rest, at_rest[0, 0], rtol=1e-9)
    assert at_rest[0, 0] > 0


def test_pushes_leave_the_common_momentum(motion):
    """The sum of both places, each times its mass, does not vary by what they do to each other."""
    [hit] = motion.hits
    patterns = TERMS["contact_push"].patterns(Seen(observe(HIT, 0), SCENE, motion))
    ratio = hit.gained_m_s / hit.lost_m_s  # m1 / m2
    while_both_move = slice(hit.step + 1, 1 + np.flatnonzero(motion.moves.all(axis=0))[-1])
    x = patterns[:, :, 0, while_both_move]
    assert np.abs(x[:, 0]).max() > 0
    np.testing.assert_allclose(ratio * x[:, 0] + x[:, 1], 0.0, atol=1e-9 * np.abs(x).max())


def test_nothing_happens_before_its_cause(motion):
    """No hit moves what was seen before it."""
    [hit] = motion.hits
    for name in ("hit_impulse", "contact_push"):
        patterns = TERMS[name].patterns(Seen(observe(HIT, 0), SCENE, motion))
        assert np.abs(patterns[..., : hit.step + 1]).max() == 0
        assert np.abs(patterns).max() > 0


def test_terms_have_no_place_where_their_cause_is_absent():
    """No hit, no push; no surface, no friction; on a surface, no gusts."""
    seen = observe(HIT, 0)
    motion = kinematics(seen, SCENE)
    assert motion is not None
    motion = replace(motion, hits=())
    assert not len(TERMS["contact_push"].patterns(Seen(seen, SCENE, motion)))
    assert not len(TERMS["gusts"].patterns(Seen(seen, SCENE, motion)))
    assert not len(TERMS["friction_roughness"].patterns(Seen(seen, SCENE, None)))


def test_times_that_are_late_shift_bodies_along_their_velocity():
    """A time that is off by t shifts a body by v t in that frame, and in no other."""
    seen = observe(HIT, 0, noise_m=1e-6)
    patterns = TERMS["late_times"].patterns(Seen(seen, SCENE, None))
    exact = solve(HIT, seen.times_s).velocity_m_s
    for pattern in patterns:
        frames = np.flatnonzero(np.abs(pattern).max(axis=(0, 1)))
        assert len(frames) == 1
    shifts = np.abs(patterns).sum(axis=0)
    speed = np.linalg.norm(exact, axis=1)[0]
    steady = np.flatnonzero(np.convolve(np.abs(np.gradient(speed)), np.ones(7), "same") < 0.35)
    steady = steady[(steady > 4) & (steady < len(speed) - 4) & (speed[steady] > 0.2)]
    assert len(steady) > 5
    np.testing.assert_allclose(np.linalg.norm(shifts[0], axis=0)[steady], speed[steady], rtol=0.1)

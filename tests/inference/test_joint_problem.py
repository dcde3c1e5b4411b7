"""Joint problems: which parameter is whose, what a hypothesis pins, and the density by hand."""

from dataclasses import replace
from math import radians

import jax.numpy as jnp
import numpy as np
import pytest

from galileo_jax.inference.fits.residuals import Batch, Residuals
from galileo_jax.inference.joint_problem import NOISE_SD, JointProblem
from galileo_jax.inference.log_posterior import density_of
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.model.parameters import Uniform
from tests.oracle_trials import make_trials
from tests.precision import in_64_bit
from tests.ramp_model import HIT

STEEPER = replace(HIT, angle_rad=radians(25), release_m=0.4)
EFFECTS = ("air_drag", "release_delay")
SAME = 1e-9  # relative; the same sum in another order
BETWEEN_PROGRAMS = 1e-6  # relative; rollouts in programs compiled separately


@pytest.fixture(autouse=True)
def precision():
    with in_64_bit():
        yield


@pytest.fixture(scope="module")
def base():
    return make_trials([HIT, STEEPER])


@pytest.fixture(scope="module")
def library():
    return make_trials([HIT, STEEPER], effects=make_effects(EFFECTS))


def draw(trials, seed=0):
    """A z in which the experiment happens: nothing is far from the prior's middle."""
    z = 0.3 * np.random.default_rng(seed).standard_normal(len(trials.names))
    for name, value in (("k1", -1.2), ("k2", -0.8)):
        z[trials.names.index(name)] = value
    return z


def log_density(trials, z):
    return float(density_of(trials)(jnp.asarray(z)))


def test_objects_are_shared_and_trials_are_not(library):
    shared = {"m1", "k1", "m2", "k2", "air_drag"}
    own = {name for name in library.names if name.endswith(("_1", "_2"))}
    assert set(library.names) == shared | own
    stems = {name.removesuffix("_1") for name in own if name.endswith("_1")}
    assert own == {f"{stem}_{clip}" for stem in stems for clip in (1, 2)}
    assert stems >= {"release_delay", "foot_transition", "start_offset_object1", "noise_scale"}
    assert len(set(library.names)) == len(library.names)
    assert library.names[-2:] == ("noise_scale_1", "noise_scale_2")


def test_columns_lead_to_the_clips_own_parameters(library):
    for clip, problem in enumerate(library.problems):
        names = [library.names[column] for column in library.columns[clip]]
        expected = [p.name for p in problem.parameters]
        assert [n.removesuffix(f"_{clip + 1}") for n in names] == expected
        columns = library.columns_of(clip)
        assert library.alone(clip).names == (*expected, "noise_scale")
        assert library.names[columns[-1]] == f"noise_scale_{clip + 1}"


def test_one_clip_keeps_plain_names(base):
    alone = base.alone(1)
    assert alone.names == (*(p.name for p in base.problems[1].parameters), "noise_scale")
    assert base.num_values == sum(base.alone(clip).num_values for clip in (0, 1))


def test_a_hypothesis_pins_the_others_effects(library):
    free = library.free(("release_delay",))
    pinned = [name for name, is_free in zip(library.names, free, strict=True) if not is_free]
    assert pinned == ["air_drag"]
    none = library.free(())
    pinned = {name for name, is_free in zip(library.names, none, strict=True) if not is_free}
    assert pinned == {"air_drag", "release_delay_1", "release_delay_2"}
    assert library.free(EFFECTS).all()
    theta = library.theta(draw(library), none)
    assert (theta[~none] == 0).all()
    assert (theta[none] == library.theta(draw(library))[none]).all()
    with pytest.raises(ValueError, match=r"not in the model: \['stribeck'\]"):
        library.free(("stribeck",))


def log_density_by_hand(trials, z, predicted):
    theta, total = trials.theta(np.asarray(z)), -0.5 * float(z @ z)
    for clip, problem in enumerate(trials.problems):
        noise = np.exp(NOISE_SD * z[len(trials.model_parameters) + clip])
        assert trials.noise_scale(theta, clip) == pytest.approx(noise, rel=SAME)
        total += float(problem.data.log_density(predicted[clip], noise))
    return total


@pytest.mark.parametrize("noise_z", [-0.7, 0.0, 1.3])
def test_log_density_by_hand(base, noise_z):
    z = draw(base)
    z[-2:] = noise_z, 0.4
    theta = base.theta(z)
    predicted = [p.simulate(base.of_clip(theta, clip)) for clip, p in enumerate(base.problems)]
    by_hand = log_density_by_hand(base, z, predicted)
    assert log_density(base, z) == pytest.approx(by_hand, rel=BETWEEN_PROGRAMS)


def test_clips_are_independent_given_the_objects(base):
    """The joint density is the clips' product; the shared prior counts once."""
    z = draw(base)
    parts = [log_density(base.alone(clip), z[base.columns_of(clip)]) for clip in (0, 1)]
    shared = np.intersect1d(base.columns[0], base.columns[1])
    assert [base.names[i] for i in shared] == ["m1", "k1", "m2", "k2"]
    twice = -0.5 * float(np.sum(z[shared] ** 2))
    assert log_density(base, z) == pytest.approx(sum(parts) - twice, rel=BETWEEN_PROGRAMS)


def test_all_effects_pinned_is_the_base_model(base, library):
    free = library.free(())
    z = np.zeros(len(library.names))
    z[free] = draw(base)
    names = [n for n, is_free in zip(library.names, free, strict=True) if is_free]
    assert names == list(base.names)
    costs = [
        Residuals(trials).costs(batch(trials, own, is_free))[0]
        for trials, own, is_free in ((base, z[free], free[free]), (library, z, free))
    ]
    assert costs[0] == pytest.approx(costs[1], rel=BETWEEN_PROGRAMS)


def batch(trials, z, free):
    count = len(trials.model_parameters)
    return Batch(z[None, :count], free[None, :count], np.ones((1, len(trials.problems))))


def test_a_place_is_the_same_in_all_clips():
    """Each clip sees another part of the way, and its own prior would put a z elsewhere."""
    trials = make_trials([HIT, STEEPER], effects=make_effects(("friction_patch",)))
    where = trials.names.index("friction_patch_start")
    priors = [
        next(p.prior for p in problem.parameters if p.name == "friction_patch_start")
        for problem in trials.problems
    ]
    assert priors[0] == priors[1]
    assert isinstance(priors[0], Uniform)
    assert priors[0].low == pytest.approx(-max(HIT.release_m, STEEPER.release_m), abs=0.05)
    z = draw(trials)
    z[trials.names.index("friction_patch")] = 1.0
    z[where] = 0.4
    found = Residuals(trials).whites(batch(trials, z, np.ones(len(z), bool)))
    expected = trials.whitened(trials.theta(z)[None], np.ones(2))
    for own, joint in zip(found, expected, strict=True):
        assert np.sum(own**2) == pytest.approx(np.sum(joint**2), rel=BETWEEN_PROGRAMS)


def test_clips_that_disagree_about_a_prior_are_refused():
    trials = make_trials([HIT, STEEPER], effects=make_effects(("friction_patch",)))
    parted = [replace(p, model=replace(p.model, shared=())) for p in trials.problems]
    own = JointProblem(tuple(parted))
    with pytest.raises(ValueError, match="friction_patch_start has another prior"):
        own.names  # noqa: B018

"""Which pairs are tried, and what a second effect promises beside a fit that is bent already."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from galileo_jax.api.simulate import simulate
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.diagnosis.fitted_pairs import pairs_from_base
from galileo_jax.diagnosis.pairs import pairs_from_scratch
from galileo_jax.diagnosis.score_tests import best_gains
from galileo_jax.diagnosis.verdict import ranked
from galileo_jax.inference.build_problem import make_joint_problem
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.inference.problem import Problem
from galileo_jax.model.effects.registry import make_effects
from tests.diagnosis.test_verdict import candidate
from tests.precision import in_64_bit

EFFECTS = ("initial_push", "viscous_drag")


def count_rollouts(monkeypatch) -> list[int]:
    """Sizes of the batches that are rolled out from here on."""
    sizes, simulate_batch = [], Problem.simulate_batch

    def counted(self, theta):
        sizes.append(len(theta))
        return simulate_batch(self, theta)

    monkeypatch.setattr(Problem, "simulate_batch", counted)
    return sizes


def test_pairs_from_scratch_are_the_best_so_far_and_those_of_the_best_singles():
    names = ("a", "b", "c", "d", "e", "b+a", "x+y", "x+z", "y+z")
    odds = (9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0)
    table = ranked(candidate(name, value) for name, value in zip(names, odds, strict=True))
    found = {frozenset(pair) for pair in pairs_from_scratch(table)}
    expected = {"ab", "xy", "xz", "ac", "ad", "bc", "bd", "cd"}
    assert found == {frozenset(pair) for pair in expected}


def test_a_library_of_one_effect_has_no_pairs():
    nothing: Any = SimpleNamespace(base=None)  # what is called, fails
    assert pairs_from_base(nothing, ranked([candidate("a", 9.0)])) == []


def test_a_nuisance_far_out_promises_its_own_to_the_effect_that_it_stands_for(
    tmp_path, monkeypatch
):
    path = tmp_path / "clip.csv"
    simulate(
        path,
        seed=971,
        effects={"initial_push": {}},
        strength=0.5,
        track_noise=1e-4,
        fps=60.0,
        track_only=True,
    )
    clip = load_clip(path.with_suffix(".yaml"))
    trials = make_joint_problem(
        [clip], [read_observation_csv(path)], effects=make_effects(list(EFFECTS))
    )
    with in_64_bit():
        fitter = GradientFitter(trials)
        base, whole = (fitter.fit(0, effects=names) for names in ((), EFFECTS[:1]))
        rolled = count_rollouts(monkeypatch)
        push, drag = best_gains(trials, base, [(name,) for name in EFFECTS], 0)
    # The base fit and each effect; then the base fit and less of each.
    assert rolled == [1 + len(EFFECTS), 1 + len(EFFECTS)]
    released = base.z[list(trials.names).index("release_instant")]
    assert abs(released) > 5  # sds: an early release does what the push does
    assert push > 0.5 * np.square(released) / 2
    assert push > 2 * drag
    assert whole.log_evidence > base.log_evidence

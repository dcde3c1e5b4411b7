"""A formula on object 1 and the same on all count once where the clip shows no difference."""

from typing import Any

import numpy as np
import pytest

from galileo_jax.api.simulate import simulate
from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.diagnosis.laws.fit_formulas import FittedLaw, _with_laws, without_twins
from galileo_jax.diagnosis.laws.grammar import FACTORS, Structure, class_source, name_of
from galileo_jax.inference.fits.laplace import Code, GradientFit
from galileo_jax.model.parameters import inverse
from galileo_jax.search.hypothesis import Hypothesis

(DECAY,) = (factor for factor in FACTORS if factor.label == "decay_t")
OVER_BEFORE_THE_HIT_S, LASTS_S = 0.05, 1.0


@pytest.fixture(scope="module")
def clip_of_two(tmp_path_factory):
    path = tmp_path_factory.mktemp("clip") / "clip.csv"
    made = simulate(path, seed=931, angle=20.0, track_only=True)
    clip = load_clip(path.with_suffix(".yaml"))
    return make_joint_problem([clip], [read_observation_csv(path)], effects=()), made.truths[0]


def law(trials, truth, structure: Structure, tau: float, evidence: float) -> FittedLaw:
    """As if it had been fitted: friction twice as large at first."""
    name, source = name_of(structure), class_source(structure, {})
    own = _with_laws(trials, [structure], [source])
    values = truth | {name: 0.5, f"{name}_tau": tau}
    for k in ("k1", "k2") if structure.is_on_all else ("k1",):
        values[k] = 2.0 * truth[k]  # a coefficient is that at the release
    parameters = own.model_parameters
    z = np.append(inverse(parameters, [values.get(p.name, p.absent) for p in parameters]), 0.0)
    free, none = own.free((name,)), np.empty(0)
    fit: Any = GradientFit(
        z=np.where(free, z, 0.0), free=free, covariance=none, chi2=0.0, log_evidence=evidence,
        num_values=1, steps=none, jacobian=none, code=Code.CONVERGED, stats={}, pull=0.0,
        num_pulled=0.0,
    )  # fmt: skip
    return FittedLaw(structure, source, Hypothesis((name,), fit, own), 0.0)


@pytest.mark.parametrize(("tau", "num"), [(OVER_BEFORE_THE_HIT_S, 1), (LASTS_S, 2)])
@pytest.mark.parametrize("all_ahead", [False, True])
def test_twins_count_once(clip_of_two, tau, num, all_ahead):
    trials, truth = clip_of_two
    structures = [Structure("friction", is_on_all, (DECAY,)) for is_on_all in (True, False)]
    laws = [law(trials, truth, one, tau, 0.0) for one in structures]
    found = without_twins(laws if all_ahead else laws[::-1])
    assert len(found) == num
    assert not all(one.structure.is_on_all for one in found)  # the shorter claim is left


@pytest.mark.parametrize(("ahead", "is_on_all"), [(0.1, False), (0.5, True), (-0.5, False)])
def test_the_more_evident_twin_is_left(clip_of_two, ahead, is_on_all):
    trials, truth = clip_of_two
    both, one = (Structure("friction", is_all, (DECAY,)) for is_all in (True, False))
    laws = [
        law(trials, truth, both, OVER_BEFORE_THE_HIT_S, ahead),
        law(trials, truth, one, OVER_BEFORE_THE_HIT_S, 0.0),
    ]
    laws = sorted(laws, key=lambda each: -each.hypothesis.fit.log_evidence)
    (found,) = without_twins(laws)
    assert found.structure.is_on_all == is_on_all

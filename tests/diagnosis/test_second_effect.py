"""Pairs that say what one effect says are looked for before that is named."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

from galileo_jax.api.simulate import simulate
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.diagnosis import diagnose as diagnose_module
from galileo_jax.diagnosis import reasons, second_effect
from galileo_jax.diagnosis.candidates import Hypothesis
from galileo_jax.diagnosis.diagnosis import Verdict
from galileo_jax.diagnosis.race import Race
from galileo_jax.diagnosis.second_effect import (
    NearPair,
    contesting_pairs,
    pairs_near,
    shares_of_seconds,
    with_second,
)
from galileo_jax.diagnosis.verdict import DECISIVE, NUM_SWAPPED, log_prior, ranked
from galileo_jax.inference.build_problem import make_joint_problem
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.model.effects.registry import make_effects
from tests.diagnosis.test_verdict import candidate
from tests.precision import in_64_bit

LIBRARY = ("air_drag", "constant_force", "frame_rate", "restitution", "surface_friction")


def looked_at(path: Path, **recipe):
    """The best single effect of a simulated clip, pairs near it, and those that may contest it."""
    simulate(path, track_only=True, **recipe)
    clip = load_clip(path.with_suffix(".yaml"))
    trials = make_joint_problem(
        [clip], [read_observation_csv(path)], effects=make_effects(list(LIBRARY))
    )
    with in_64_bit():
        fitter = GradientFitter(trials)
        base = Hypothesis((), fitter.fit(0, effects=()))
        race = Race(fitter, base, False, 0, lambda _: None)
        singles = ranked(race([base] * len(LIBRARY), [(name,) for name in LIBRARY]))
        near = pairs_near(race, singles, LIBRARY, DECISIVE)
        return singles[0], near, contesting_pairs(race, singles, near, DECISIVE)


def test_two_effects_that_pass_for_one_are_found(tmp_path):
    """A force and another friction of the second surface: as a wrong frame rate, and named that."""
    best, near, contesting = looked_at(
        tmp_path / "clip.csv",
        seed=1637478252,
        angle=23.704859039402656,
        track_noise=1.76e-4,
        fps=30.0,
        strength=0.6771709276997053,
        effects={"surface_friction": {}, "constant_force": {}},
        solver="fine",
        faults=True,
    )
    assert best.name == "frame_rate"
    hidden = {"constant_force", "surface_friction"}
    (found,) = (pair for pair in contesting if set(pair.effects) == hidden)
    (rough,) = (pair for pair in near if set(pair.effects) == hidden)
    assert found.log_evidence > best.log_evidence  # the price of a second effect is 4 nats
    assert found.log_odds > best.log_odds - DECISIVE
    assert rough.log_odds == pytest.approx(found.log_odds, abs=3.0)


def test_a_second_effect_that_shows_is_found(tmp_path):
    effects = {"air_drag": {"air_drag": 1.0}, "frame_rate": {"frame_rate": 0.05}}
    best, near, contesting = looked_at(
        tmp_path / "clip.csv", seed=11, angle=18.0, effects=effects, track_noise=3e-4, fps=60.0
    )
    assert best.name in effects
    assert set(near[0].effects) == set(effects)
    assert ranked(contesting)[0].log_odds > best.log_odds + DECISIVE  # wrong by 5 %: by far


def test_beside_the_only_effect_no_pair_is_as_probable(tmp_path):
    effects = {"air_drag": {"air_drag": 1.0}}
    best, near, contesting = looked_at(
        tmp_path / "clip.csv", seed=11, angle=18.0, effects=effects, track_noise=3e-4, fps=60.0
    )
    assert best.name == "air_drag" and near
    assert all(pair.log_odds < best.log_odds - 2.0 for pair in contesting)
    beside = [pair for pair in near if "air_drag" in pair.effects]
    price = log_prior([1.0], len(LIBRARY)) - log_prior([1.0, 1.0], len(LIBRARY))
    # One that is not there has no more evidence, and costs what is written on it.
    assert best.log_odds - price - 3.0 < beside[0].log_odds < best.log_odds - price + 1.0
    assert [pair.log_odds for pair in near] == sorted((p.log_odds for p in near), reverse=True)


def test_a_library_of_one_effect_has_no_pairs():
    race: Any = None
    assert pairs_near(race, [candidate("air_drag", 40.0)], ["air_drag"], DECISIVE) == []


def test_of_pairs_without_the_best_effect_only_the_nearest_are_refined(monkeypatch):
    """All that have it come near, and of the others none that is far."""
    library = ["air_drag", *(f"other{i}" for i in range(8))]
    singles = [candidate(name, 40.0 - i) for i, name in enumerate(library)]
    refined = []

    def search(fitter, bases, pairs, seed, lowest, most):
        assert most == len(pairs) == 36
        costs = [99.0 if "other7" in pair and "air_drag" not in pair else 1.0 for pair in pairs]
        return np.zeros((len(pairs), 0)), np.array(costs) + 0.01 * np.arange(len(pairs))

    def refine(race, starts, error):
        refined.extend(effects for effects, _ in starts)
        return [pair("+".join(effects), 0.0) for effects, _ in starts]

    monkeypatch.setattr(second_effect, "short_search", search)
    monkeypatch.setattr(second_effect, "_refined", refine)
    fitter = SimpleNamespace(
        trials=SimpleNamespace(model_parameters=()), search_costs=lambda z, free: np.zeros(1)
    )
    stub: Any = SimpleNamespace(fitter=fitter, seed=0, log_odds=lambda _: 40.0)
    pairs_near(stub, singles, library, DECISIVE)
    with_best = [effects for effects in refined if "air_drag" in effects]
    assert len(with_best) == 8 and len(refined) == 8 + second_effect.MOST_OTHERS
    assert all("other7" not in effects for effects in refined if effects not in with_best)


def test_what_may_contest_a_name_is_fitted_from_where_it_was_refined_to():
    """Less than the margin behind, and a nat, for it was refined roughly; at most six."""
    asked = []

    def race(bases, sets, starts):
        asked.append((bases, sets, [len(own) for own in starts]))
        return [candidate("+".join(effects), 38.0) for effects in sets]

    fitter = SimpleNamespace(trials=SimpleNamespace(model_parameters=()))
    stub: Any = MagicMock(side_effect=race, fitter=fitter)
    singles = [NAMED, candidate("rolling", 10.0)]
    near = [pair("rolling+restitution", 41.0), pair("air_drag+frame_rate", 36.1)]
    far = pair("air_drag+restitution", 35.9)
    found = contesting_pairs(stub, singles, [*near, far], DECISIVE)
    assert [one.name for one in found] == ["rolling+restitution", "air_drag+frame_rate"]
    ((bases, sets, starts),) = asked
    assert bases == [singles[1].hypothesis, NAMED.hypothesis]
    assert sets == [one.effects for one in near] and starts == [1, 1]
    many = [pair(f"air_drag+{i}", 39.0) for i in range(9)]
    assert len(contesting_pairs(stub, singles, many, DECISIVE)) == NUM_SWAPPED
    assert contesting_pairs(stub, singles, [far], DECISIVE) == []


def test_a_pair_that_is_ahead_brings_in_all_that_is_done_for_pairs(monkeypatch):
    race: Any = None
    monkeypatch.setattr(diagnose_module, "pairs_near", lambda *_: [pair("a+b", 41.0)])
    for log_odds, names in ((41.0, ["a+b", "c+d"]), (39.0, ["a+b"])):
        contesting = [candidate("a+b", log_odds)]
        monkeypatch.setattr(diagnose_module, "contesting_pairs", lambda *_, it=contesting: it)
        others = (candidate("a+b", 30.0), candidate("c+d", 35.0))
        monkeypatch.setattr(diagnose_module, "fitted_pairs", lambda *_, it=others: it)
        found, near, why = diagnose_module._pairs(race, [NAMED], LIBRARY, DECISIVE, lambda _: None)
        assert sorted(one.name for one in found) == names and len(near) == 1
        assert max(one.log_odds for one in found) == log_odds
        rules = [one.rule for one in why]
        assert rules == ["pairs_beside", "pairs_further"][: len(names)]
        assert why[0].numbers["num_pairs"] == 1 and why[-1].numbers["num_pairs"] == len(names)


def test_the_reasons_say_which_pairs_were_looked_at():
    why = reasons.pairs_beside(NAMED, 16, 3)
    assert "16 pairs of effects that come near it were fitted roughly" in why.sentence
    assert "the 3 most probable of them with care" in why.sentence
    assert (why.numbers["num_near"], why.numbers["num_pairs"]) == (16, 3)
    why = reasons.no_pair_contests(NAMED, "air_drag+rolling", 4.4, 16)
    assert "air_drag+rolling, is 81 times less probable" in why.sentence
    assert why.numbers["log_odds_behind"] == 4.4


def pair(effects: str, log_odds: float) -> NearPair:
    return NearPair(candidate(effects, log_odds).hypothesis, log_odds)


NAMED = candidate("air_drag", 40.0)
NEAR = [
    pair("air_drag+frame_rate", 38.5),
    pair("air_drag+restitution", 36.0),
    pair("rolling+restitution", 47.0),  # beside another
]


def test_the_probability_of_a_second_effect_is_that_of_all_pairs_with_what_is_named():
    shares = shares_of_seconds(NAMED, [NAMED], NEAR)
    total = 1.0 + 0.2231 + 0.0183  # e^-1.5 and e^-4
    assert shares == pytest.approx(
        {"frame_rate": 0.2231 / total, "restitution": 0.0183 / total}, rel=1e-3
    )


def test_a_pair_that_was_fitted_with_care_is_worth_that():
    others = [candidate("restitution+air_drag", 39.0), candidate("rolling+frame_rate", 39.5)]
    shares = shares_of_seconds(NAMED, [NAMED, *others], NEAR)
    total = 1.0 + 0.2231 + 0.3679  # e^-1.5 and e^-1
    assert shares == pytest.approx(
        {"frame_rate": 0.2231 / total, "restitution": 0.3679 / total}, rel=1e-3
    )


def test_a_second_effect_is_said_beside_a_name_if_it_is_probable_enough():
    named = Verdict("named", ("air_drag",))
    (why,) = with_second(named, [NAMED], NEAR).reasons
    assert why.rule == "second_possible" and why.numbers["second"] == "frame_rate"
    assert why.numbers["probability"] == pytest.approx(0.195, abs=0.001)
    assert "probability 19 %, most likely frame_rate (18 %)" in why.sentence
    assert with_second(named, [NAMED], NEAR[1:]) == named
    for other in (Verdict("ambiguous", ("air_drag", "rolling")), Verdict("none", ())):
        assert with_second(other, [NAMED], NEAR) == other

"""The loop finds what is hidden, whatever the table holds when it begins."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from galileo_jax.api.simulate import simulate
from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.diagnosis.laws.fit_formulas import _with_laws
from galileo_jax.diagnosis.laws.grammar import FACTORS, Structure, class_source, name_of
from galileo_jax.diagnosis.stakes import VerdictStakes, log_prior
from galileo_jax.diagnosis.thresholds import DECISIVE
from galileo_jax.inference.fits.gradient import SETTLED_IN_TURN_NATS, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.model.parameters import inverse
from galileo_jax.search.fit import best_fit
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.search.loop import search
from galileo_jax.search.starts import beside, beside_a_formula
from galileo_jax.search.table import Entry, Table
from tests.precision import in_64_bit

PAIRS = ("air_drag", "constant_force", "frame_rate", "restitution", "surface_friction")
DRAG: Any = {"seed": 11, "angle": 18.0, "track_noise": 3e-4, "fps": 60.0}
FAULTS: Any = {"solver": "fine", "faults": True}


def trials_of(path: Path, library: tuple[str, ...], **recipe: Any) -> JointProblem:
    """Trials of a simulated clip with a library of these effects."""
    simulate(path, track_only=True, **recipe)
    clip = load_clip(path.with_suffix(".yaml"))
    effects = make_effects(list(library))
    return make_joint_problem([clip], [read_observation_csv(path)], effects=effects)


def table_of(trials: JointProblem) -> Table:
    """The model without effects alone."""
    fitter = GradientFitter(trials)
    base = Hypothesis((), best_fit(fitter, 0, effects=()))
    return Table.of(fitter, VerdictStakes(trials, False), 0, base)


def searched(path: Path, library: tuple[str, ...], **recipe: Any) -> Table:
    """The table after a search for single effects, and for pairs."""
    with in_64_bit():
        return search(search(table_of(trials_of(path, library, **recipe)), 1), 2)


def test_two_effects_that_pass_for_one_are_found(tmp_path):
    """A force and another friction of the second surface: as a wrong frame rate, and named that."""
    table = searched(
        tmp_path / "clip.csv",
        PAIRS,
        seed=1637478252,
        angle=23.704859039402656,
        track_noise=1.76e-4,
        fps=30.0,
        strength=0.6771709276997053,
        effects={"surface_friction": {}, "constant_force": {}},
        **FAULTS,
    )
    best = max(table.named(1), key=table.log_odds)
    assert best.effects == ("frame_rate",)
    found = table.entries[frozenset(["constant_force", "surface_friction"])].hypothesis
    assert found.evidence_over(table.base) > best.evidence_over(table.base)
    assert table.log_odds(found) > table.log_odds(best) - DECISIVE


def test_a_second_effect_that_shows_is_found(tmp_path):
    effects = {"air_drag": {"air_drag": 1.0}, "frame_rate": {"frame_rate": 0.05}}
    table = searched(tmp_path / "clip.csv", PAIRS, effects=effects, **DRAG)
    (best,) = table.leaders(1)
    assert set(best.effects) == set(effects)
    alone = max(table.log_odds(one) for one in table.named(1))
    assert table.log_odds(best) > alone + DECISIVE  # wrong by 5 %: by far


def test_beside_the_only_effect_no_pair_is_as_probable(tmp_path):
    effects = {"air_drag": {"air_drag": 1.0}}
    table = searched(tmp_path / "clip.csv", PAIRS, effects=effects, **DRAG)
    best, *others = table.best_first
    assert best.hypothesis.effects == ("air_drag",)
    pairs = [row.hypothesis for row in others if len(row.hypothesis.effects) == 2]
    lead = [table.log_odds(best.hypothesis) - table.log_odds(pair) for pair in pairs]
    assert pairs and min(lead) > 2.0
    price = log_prior([1.0], len(PAIRS)) - log_prior([1.0, 1.0], len(PAIRS))
    (first, *_) = (by for by, pair in zip(lead, pairs, strict=True) if "air_drag" in pair.effects)
    # One that is not there has no more evidence, and costs what is written on it.
    assert price - 1.0 < first < price + 3.0


def test_a_library_of_one_effect_has_no_pairs(tmp_path):
    table = searched(tmp_path / "clip.csv", PAIRS[:1], **DRAG)
    assert set(table.entries) == {frozenset(), frozenset(PAIRS[:1])}


@pytest.mark.slow
def test_what_does_the_same_as_one_of_a_pair_is_found_where_slopes_mean_nothing(tmp_path):
    """A late release and rolling; with the release, a wrong frame rate passes for the rest."""
    truth, rival = ("release_delay", "rolling"), ("release_delay", "frame_rate")
    effects = {"release_delay": {"release_delay": 0.34}, "rolling": {"rolling": 0.88}}
    recipe: Any = {"seed": 4711, "angle": 28.0, "track_noise": 1e-4, "fps": 60.0, **FAULTS}
    others = ("frame_rate", "surface_friction", "restitution", "table_tilt", "viscous_drag")
    with in_64_bit():
        trials = trials_of(tmp_path / "clip.csv", (*truth, *others), effects=effects, **recipe)
        table = table_of(trials)
        fit = best_fit(table.fitter, 0, effects=rival)
        table = table.with_entry(Entry(Hypothesis(rival, fit), (fit,), 0.0))
        kept = replace(
            table.entries[frozenset(rival)].hypothesis,
            effects=truth[:1],
            fit=replace(
                fit,
                z=np.where(trials.free(truth[:1]), fit.z, 0.0),
                free=trials.free(truth[:1]),
            ),
        )
        wanted = [(kept, (truth[0], name)) for name in trials.all_effects if name not in rival]
        found = search(table, 0, starts=beside(table, "test", wanted))
    best, other = found.leaders(1)[0], found.entries[frozenset(rival)].hypothesis
    assert set(best.effects) == set(truth)
    # By what the data say: beforehand a box on wheels is not likely.
    assert best.fit.log_evidence > DECISIVE + other.fit.log_evidence


RUBS = ("air_drag", "stribeck")
DECAY = next(factor for factor in FACTORS if factor.label == "decay_v")
STRIBECK_S_FORMULA = Structure("friction", False, (DECAY,))


@pytest.fixture(scope="module")
def rubs_at_low_speed(tmp_path_factory):
    """A table of a clip with Stribeck friction in which two effects are stuck; and the truth."""
    path = tmp_path_factory.mktemp("clip") / "clip.csv"
    recipe: Any = {"seed": 921, "effects": ("stribeck",), "strength": 0.9, "angle": 20.0}
    with in_64_bit():
        table = table_of(trials_of(path, RUBS, **recipe))
        truth = json.loads(path.with_suffix(".truth.json").read_text())
        for name in RUBS:  # as if the search had ended where it began
            fit = replace(table.base.fit, free=table.trials.free((name,)))
            table = table.with_entry(Entry(Hypothesis((name,), fit), (fit,), 7.0))
        yield table, truth


def from_truth(trials: JointProblem, values, effects) -> Hypothesis:
    """Fitted from the truth; the same parameters have other names in a formula."""
    parameters = trials.model_parameters
    z = inverse(parameters, np.array([values.get(p.name, p.absent) for p in parameters]))
    free = trials.free(effects)[: len(parameters)]
    fitter = GradientFitter(trials)
    (fit,) = fitter.fit_from(np.where(free, z, 0.0)[None], free[None], np.zeros(1, int))
    return Hypothesis(effects, fit, trials)


def test_an_effect_that_was_missed_is_found_from_its_own_formula(rubs_at_low_speed):
    table, truth = rubs_at_low_speed
    own = truth["effect_parameters"]
    source, name = class_source(STRIBECK_S_FORMULA, {}), name_of(STRIBECK_S_FORMULA)
    values = {name: own["stribeck"], f"{name}_speed": own["stribeck_speed"]}
    with in_64_bit():
        others = _with_laws(table.trials, [STRIBECK_S_FORMULA], [source])
        law = from_truth(others, truth | values, (name,))
        found = search(table, 1, starts=beside_a_formula(table, law))
    (better,) = [one for one in found.named(1) if one.effects == ("stribeck",)]
    assert law.evidence_over(table.base) > 10.0  # it is there to be seen
    assert better.fit.log_evidence > law.fit.log_evidence - DECISIVE
    assert found.entries[frozenset(["stribeck"])].score_z == 7.0


def test_an_effect_that_was_missed_is_found_from_a_pair_that_has_it(rubs_at_low_speed):
    table, truth = rubs_at_low_speed
    values = truth | truth["effect_parameters"] | {"air_drag": 1e-3}
    with in_64_bit():
        both = replace(from_truth(table.trials, values, ("stribeck", "air_drag")), trials=None)
        table = table.with_entry(Entry(both, (both.fit,), 0.0))
        found = search(table, 2)
    (better,) = [one for one in found.named(1) if one.effects == ("stribeck",)]
    assert better.fit.log_evidence > both.fit.log_evidence - DECISIVE


DECIDING_NATS = 12.8  # behind the best: what luck may make of 3 nats
AGREES_NATS = SETTLED_IN_TURN_NATS
SHAPED = ("air_drag", "friction_patch", "stribeck", "spring_tether", "viscous_drag")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hidden", "seed"), [((), 911), (("air_drag",), 912), (("friction_patch",), 913)]
)
def test_no_effect_that_may_decide_is_dropped(tmp_path, hidden, seed):
    """Every start followed to its end by itself finds no better valley."""
    strength = 0.6 if hidden else None
    recipe: Any = {"seed": seed, "effects": hidden, "strength": strength, **FAULTS}
    shown = []
    with in_64_bit():
        trials = trials_of(tmp_path / "clip.csv", SHAPED, **recipe)
        table = table_of(trials)
        found = search(table, 1, lambda _, entry: shown.append(entry.hypothesis.key))
        again = search(table, 1)
        full = []
        for name in SHAPED:
            starts = beside(table, "test", [(table.base, (name,))])
            z = np.stack([start.z for start in starts])
            best = np.argsort(table.fitter.search_costs(z, table.free([[name]] * len(z))))[:8]
            free = table.free([[name]] * len(best))
            fits = table.fitter.fit_from(z[best], free, np.arange(len(best)))
            full.append(max(fit.log_evidence for fit in fits))
    evidence = np.array(
        [found.entries[frozenset([name])].hypothesis.fit.log_evidence for name in SHAPED]
    )
    assert {frozenset([name]) for name in SHAPED} <= set(shown)
    assert evidence.tolist() == [
        again.entries[frozenset([name])].hypothesis.fit.log_evidence for name in SHAPED
    ]
    decides = np.array(full) > max(full) - DECIDING_NATS
    assert np.all(evidence[decides] > np.array(full)[decides] - AGREES_NATS)

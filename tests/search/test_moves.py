"""What each move proposes: pure functions of the table."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.model.effects import make_effects
from galileo_jax.model.parameters import Normal, Parameter, Uniform
from galileo_jax.search.fit import best_fit
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.search.loop import search
from galileo_jax.search.moves import MOVES, add, copy_shape, drop, jolt, scatter, swap
from galileo_jax.search.table import Entry, Stakes, Table
from tests.oracle_trials import make_trials
from tests.precision import in_64_bit
from tests.ramp_model import HIT

FOUND, BEHIND = 3.0, 30.0  # nats
LIBRARY = ("restitution", "air_drag")


class Even(Stakes):
    """Stakes by which all effects are as probable as none, and all hypotheses may decide."""

    def may_decide(self, log_odds, is_form, num_effects):
        return log_odds > log_odds.max() - 20.0


@pytest.fixture(scope="module")
def table():
    """A clip without an effect: the fits without one, with each, and with both."""
    with in_64_bit():
        trials = make_trials([HIT], effects=make_effects(list(LIBRARY)))
        fitter = GradientFitter(trials)
        found = Table.of(fitter, Even(), 0, Hypothesis((), best_fit(fitter, 0, effects=())))
        for effects in (LIBRARY[:1], LIBRARY[1:], LIBRARY):
            fit = best_fit(fitter, 0, effects=effects)
            found = found.with_entry(Entry(Hypothesis(effects, fit), (fit,), 0.0))
        yield found


def with_evidence(table: Table, effects: tuple[str, ...], log_evidence: float) -> Table:
    """The table with another evidence of one hypothesis."""
    entry = table.entries[frozenset(effects)]
    fit = replace(entry.hypothesis.fit, log_evidence=log_evidence)
    return table.with_entry(Entry(replace(entry.hypothesis, fit=fit), (fit,), entry.score_z))


def only(table: Table, *sets: tuple[str, ...]) -> Table:
    """The table with only some of its hypotheses with effects."""
    keys = {frozenset(), *map(frozenset, sets)}
    return replace(table, entries={k: e for k, e in table.entries.items() if k in keys})


def of_two(table: Table) -> Table:
    """The table when hypotheses of two effects are looked for."""
    return replace(table, most_effects=2)


def test_every_file_of_the_folder_is_a_move():
    assert set(MOVES) == {
        *("add", "copy_shape", "drop", "jolt", "nudge", "prefix", "scatter", "swap"),
    }


def test_every_effect_is_added_once_and_every_pair_to_the_better_of_its_effects(table):
    with in_64_bit():
        some = only(table, LIBRARY[:1], LIBRARY[1:])
        singles = add.propose(some)
        both = add.propose(of_two(with_evidence(some, LIBRARY[1:], 1e6)))
        base = some.base
        asked = {
            ("add", base.key, frozenset([name]), base.fit.log_evidence // 3) for name in LIBRARY
        }
        again = add.propose(replace(some, asked=frozenset(asked)))
    assert {start.effects for start in singles} == {(name,) for name in LIBRARY}
    pairs = {
        (start.parent and start.parent.effects, start.effects)
        for start in both
        if len(start.effects) == 2
    }
    assert pairs == {(LIBRARY[1:], (LIBRARY[1], LIBRARY[0]))}
    assert again == []
    free = some.free([start.effects for start in singles])
    assert not (np.stack([start.z for start in singles]) * ~free).any(), "no other effect in it"


def test_the_leader_s_effect_is_swapped_for_every_other(table):
    with in_64_bit():
        leading = with_evidence(only(table, LIBRARY[:1], LIBRARY[1:]), LIBRARY[:1], 1e6)
        starts = swap.propose(leading)
    assert {start.effects for start in starts} == {LIBRARY[1:]}
    m1 = leading.trials.names.index("m1")
    leader = leading.entries[frozenset(LIBRARY[:1])].hypothesis
    assert all(start.z[m1] == leader.fit.z[m1] for start in starts)


def test_jolts_are_of_positive_nuisances_alone(table):
    with in_64_bit():
        starts = jolt.propose(only(table, LIBRARY[:1]))
    fit = table.entries[frozenset(LIBRARY[:1])].hypothesis.fit
    moved = np.any([start.z != fit.z[: len(start.z)] for start in starts], axis=0)
    roles = {
        p.role for p, is_moved in zip(table.trials.model_parameters, moved, strict=True) if is_moved
    }
    assert roles == {"nuisance"} and all(start.is_near for start in starts)


def test_pairs_are_scattered_where_nothing_explains_the_data(table, monkeypatch):
    with in_64_bit():
        monkeypatch.setattr(GradientFitter, "is_explained", lambda *_: False)
        starts = scatter.propose(of_two(table))
        assert scatter.propose(table) == []
        monkeypatch.setattr(GradientFitter, "is_explained", lambda *_: True)
        assert scatter.propose(of_two(table)) == []
    assert {start.key for start in starts} == {frozenset(LIBRARY)}
    assert len(starts) == scatter.NUM_STARTS


def test_a_missed_valley_of_the_model_without_effects_is_found(table):
    """Where an effect leads only by a better valley of the nuisances."""
    count = len(table.trials.model_parameters)
    base = table.base.fit
    worse = base.z.copy()
    worse[:count] += 0.5 * base.free[:count]
    missed = replace(base, z=worse, log_evidence=base.log_evidence - BEHIND)
    some = only(table, LIBRARY[:1]).with_entry(Entry(Hypothesis((), missed), (missed,), 0.0))
    with in_64_bit():
        starts = drop.propose(some)
        found = search(some, 1, starts=starts).base
    assert {start.effects for start in starts} == {()}
    assert found.fit.log_evidence == pytest.approx(base.log_evidence, abs=FOUND)
    assert not (found.fit.z[:count] * ~table.trials.free(())[:count]).any(), "no effect in it"


def test_a_good_fit_is_not_looked_for_again(table):
    with in_64_bit():
        assert drop.propose(only(table, LIBRARY[:1])) == []


def test_the_others_make_up_for_the_effect(table):
    """Where a nuisance acts as the effect does, it takes over what the effect did."""
    trials = table.trials
    names = [p.name for p in trials.model_parameters]
    other = table.entries[frozenset(LIBRARY[:1])].hypothesis.fit
    e, impact = names.index("restitution"), names.index("impact_restitution")
    count, slope = len(names), np.random.default_rng(0).standard_normal((400, 1))
    z, jacobian = np.zeros_like(other.z), np.zeros((400, count))
    z[e], z[impact] = -1.0, 0.3
    jacobian[:, [e, impact]] = 100.0 * slope * np.array([1.0, 2.0])
    fit = replace(other, z=z, jacobian=jacobian)
    moved = drop.without_effects(trials, Hypothesis(LIBRARY[:1], fit))
    prior = trials.model_parameters[e].prior
    value, ahead = (float(prior.forward(jnp.asarray(at))) for at in (-1.0, -1.0 + 1e-5))
    expected = 0.3 + value / ((ahead - value) / 1e-5) / 2.0
    assert moved.z[impact] == pytest.approx(expected, rel=1e-3)
    assert moved.z[e] == 0.0 and not moved.free[e]


PLACE = 0.3  # metres along the way
UNIT = Normal(0.0, 1.0)
PARAMETERS = [
    Parameter("friction_patch", "1", UNIT, 0.0),
    Parameter("friction_patch_start", "m", Uniform(0.0, 1.0), 0.0),
    Parameter("magnetic_brake", "1", UNIT, 0.0),
    Parameter("magnetic_brake_start", "m", Uniform(-0.5, 1.5), 0.0),
    Parameter("magnetic_brake_rate", "1", Uniform(0.0, 1.0), 0.0),
    Parameter("air_drag", "1", UNIT, 0.0),
]


def shaped(place: float) -> tuple[Any, Any]:
    """Trials of three effects, and a fit with a patch in one place."""
    of = {"friction_patch": (0, 1), "magnetic_brake": (2, 3, 4), "air_drag": (5,)}
    trials = SimpleNamespace(
        model_parameters=PARAMETERS, brought_by=lambda name: np.array(of[name])
    )
    z = np.zeros(6)
    z[0], z[1] = 0.8, float(PARAMETERS[1].prior.inverse(jnp.asarray(place)))
    return trials, SimpleNamespace(fit=SimpleNamespace(z=z), effects=("friction_patch",))


def test_another_effect_takes_the_same_place_in_metres():
    trials, leader = shaped(PLACE)
    z = copy_shape.with_shape_of(trials, leader, "friction_patch", "magnetic_brake")
    assert z is not None
    value = float(PARAMETERS[3].prior.forward(jnp.asarray(z[3])))
    assert value == pytest.approx(PLACE, abs=1e-5)
    assert z[4] == 0.0, "the leader has no rate to take over"


def test_what_has_no_place_takes_none():
    trials, leader = shaped(PLACE)
    assert copy_shape.with_shape_of(trials, leader, "friction_patch", "air_drag") is None

"""The table of hypotheses: which row is best, and what was asked for already."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from galileo_jax.inference.fits.laplace import Code, GradientFit
from galileo_jax.model.effects.forms import FORM_NAMES
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.search.table import Entry, Table, ask

FIT = GradientFit(
    z=np.zeros(3), free=np.array([True, True, False]), covariance=np.diag([0.01, 1.0, 0.0]),
    chi2=0.0, log_evidence=-100.0, num_values=9, steps=np.ones(2), jacobian=np.zeros((9, 2)),
    code=Code.CONVERGED, stats={}, pull=0.0, num_pulled=0.0,
)  # fmt: skip


def entry(name: str, log_evidence: float) -> Entry:
    fit = replace(FIT, log_evidence=log_evidence)
    return Entry(Hypothesis(tuple(name.split("+")), fit), (fit,), 0.0)


@pytest.fixture
def table() -> Table:
    """Single effects and pairs, each of which costs 5 nats more."""

    def decides(log_odds, is_form, num_effects):
        return log_odds > log_odds.max() - 10.0 * (~is_form)

    stakes: Any = SimpleNamespace(log_prior=lambda one: -5.0 * len(one.effects), may_decide=decides)
    fitter: Any = SimpleNamespace(
        trials=SimpleNamespace(
            all_effects=("a", "b", *FORM_NAMES[:1]), model_parameters=(), free=lambda _: np.zeros(0)
        ),
        is_explained=lambda fit: True,
    )
    found = Table.of(fitter, stakes, 0, Hypothesis((), FIT))
    for row in (entry("a", -70.0), entry("b", -60.0), entry("b+a", -56.0), entry("a+c", -75.0)):
        found = found.with_entry(row)
    return found


def test_the_most_probable_come_first(table):
    names = ["+".join(row.hypothesis.effects) for row in table.best_first]
    assert names == ["b", "b+a", "a", "a+c"]
    assert [one.effects for one in table.named(1)] == [("b",), ("a",)]
    assert [one.effects for one in table.named(2)] == [("b", "a"), ("a", "c")]
    assert [one.effects for one in table.leaders(1)] == [("b",)]
    assert table.library == ["a", "b"]


def test_two_orders_of_the_same_effects_are_one_row(table):
    again = table.with_entry(entry("a+b", -50.0))
    assert len(again.entries) == len(table.entries)


def test_what_may_decide(table):
    assert table.deciding() == [frozenset("ba"), frozenset("b")]


def test_while_no_fit_is_explained_by_noise_any_may_decide(table):
    table.fitter.is_explained = lambda fit: False
    assert len(table.deciding()) == 4


def test_a_better_fit_takes_the_old_one_s_place():
    old = entry("a", -70.0)
    worse, better = (replace(FIT, log_evidence=nats) for nats in (-71.0, -69.5))
    same = old.with_fits([worse])
    assert same.hypothesis is old.hypothesis and len(same.fits) == 2
    assert old.with_fits([better]).hypothesis.fit is better
    assert old.with_fits([better], by=1.0).hypothesis is old.hypothesis


def test_a_table_is_better_by_a_fit_that_the_other_has_not(table):
    assert not table.is_better_than(table)
    better = table.with_entry(entry("a", -50.0))
    assert better.is_better_than(table)


def test_a_move_asks_again_only_from_a_parent_whose_evidence_is_another(table):
    parent = table.named(1)[0]
    wanted = [(parent, ("b", "c"))]
    asked = replace(table, asked=frozenset([ask("add", parent, frozenset("bc"))]))
    assert asked.not_asked("add", wanted) == []
    assert asked.not_asked("swap", wanted) == wanted
    better = replace(parent, fit=replace(parent.fit, log_evidence=-50.0))
    assert asked.not_asked("add", [(better, ("b", "c"))])

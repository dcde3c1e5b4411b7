"""The loop: moves propose where to look, a race sorts the proposals, what comes near is refined.

    propose: every move looks at the table and names starts (`moves/`).
    race:    all starts descend in one batch, at more noise than the clip's. A start leaves it where
             it comes to the valley of a better one of its hypothesis, or falls far behind.
    refine:  the best end of each hypothesis at the clip's own noise, the most promising first; of
             those on which the conclusion may hang, every end.

It ends when a round changes nothing on which the conclusion may hang.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from galileo_jax.inference.fits.descent import (
    BEHIND_IN_SEARCH,
    SAME_VALLEY_NATS,
    Descended,
    ends_of,
    in_valley,
    valleys,
)
from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.search.moves import MOVES, Move
from galileo_jax.search.score_tests import score_tests
from galileo_jax.search.table import BASE, CHANGED_NATS, Entry, Key, Start, Table, ask

MOST_ROUNDS = 4
NUM_AT_ONCE = 8  # refined in one batch: the sooner the first can be shown
MOST_WITH_CARE = 6  # hypotheses whose every end is refined until it has settled
MOST_REFINED = 24  # hypotheses of several effects in a round, those that come nearest
MAY_STILL_GAIN = 5.0  # nats that a valley with more cost in the race may yet have the better of


def search(
    table: Table,
    most: int,
    on_entry: Callable[[Table, Entry], None] = lambda *_: None,
    starts: Sequence[Start] = (),
    moves: Sequence[Move] = tuple(MOVES.values()),
    on_round: Callable[[Sequence[Start]], None] = lambda _: None,
) -> Table:
    """The table with all that the moves find, of hypotheses of up to `most` effects.

    Of 0 effects it is the one model that is fitted. `on_entry`: called with a table and each of its
    rows that is new or better, as soon as that is. `starts`: where to look first, beside what the
    moves propose. `on_round`: called before each round with what was proposed.
    """
    table = replace(table, most_effects=most)
    for _ in range(MOST_ROUNDS):
        proposed = [*starts, *(one for move in moves for one in move(table))]
        if not proposed:
            break
        on_round(proposed)
        before = table
        asked = {ask(one.move, one.parent, one.key) for one in proposed}
        table = replace(table, asked=table.asked | asked, num_rounds=table.num_rounds + 1)
        table = _round(table, proposed, on_entry)
        starts = ()
        if not _has_changed(before, table):
            break
    return table


def _has_changed(before: Table, after: Table) -> bool:
    """Whether anything on which the conclusion may hang is new, or better than it was."""
    for key in (BASE, *after.deciding()):
        known = before.entries.get(key)
        if known is None:
            return True
        now = after.entries[key].hypothesis.fit.log_evidence
        if now - known.hypothesis.fit.log_evidence > CHANGED_NATS:
            return True
    return False


def _round(
    table: Table, starts: Sequence[Start], on_entry: Callable[[Table, Entry], None]
) -> Table:
    """The table after one round of the loop."""
    known = _known_costs(table)
    ends = _raced(table, [one for one in starts if not one.is_near], known)
    first = _first_of_each(ends, min(known.values(), default=np.inf))
    scores = _scores(table, first)

    def take(table: Table, end: Start, fit: GradientFit) -> Table:
        key = end.key
        old = table.entries.get(key)
        if old is None:
            hypothesis = Hypothesis(end.effects, fit)
            entry = Entry(hypothesis, (fit,), scores.get(key, 0.0), end.num_agreeing)
        else:
            # What was compared with the data stays, unless another valley is found.
            is_compared = key == BASE and table.most_effects > 0
            entry = old.with_fits([fit], CHANGED_NATS if is_compared else 0.0)
        table = table.with_entry(entry)
        if old is None or entry.hypothesis.fit is fit:
            on_entry(table, entry)
        return table

    for end, fit in _refined_in_turn(table, [end for end in first if end.key != BASE]):
        table = take(table, end, fit)
    deciding = {BASE, *table.deciding()[:MOST_WITH_CARE]}
    near = [one for one in starts if one.is_near]
    # What was refined in its turn was so roughly: it goes on.
    rough = [
        replace(end, z=table.entries[end.key].hypothesis.fit.z[: len(end.z)])
        for end in first
        if end.key in deciding - {BASE} and end.key in table.entries
    ]
    rest = [
        end
        for end in ends
        if end.key == BASE or (end.key in table.entries and not any(end is o for o in first))
    ]
    for end, fit in _refined(table, [*rough, *(e for e in (*near, *rest) if e.key in deciding)]):
        table = take(table, end, fit)
    return table


def _scores(table: Table, ends: Sequence[Start]) -> dict[Key, float]:
    """How many standard deviations the slope of each new hypothesis' last effect explains."""
    new: dict[Hypothesis, list[Start]] = {}
    for end in ends:
        if not end.effects or end.parent is None or end.key in table.entries:
            continue
        if set(end.effects[:-1]) == set(end.parent.effects):
            new.setdefault(end.parent, []).append(end)
    scores: dict[Key, float] = {}
    for parent, own in new.items():
        found = score_tests(table.trials, parent.fit, [one.effects for one in own])
        scores |= {one.key: float(score) for one, score in zip(own, found, strict=True)}
    return scores


def _raced(table: Table, starts: Sequence[Start], known: Mapping[Key, float]) -> list[Start]:
    """Where starts come to in a race, the best end of every valley of each hypothesis.

    Without those that are far behind, and those in valleys that are known; `known`: the costs of
    the table's fits.
    """
    if not starts:
        return []
    fitter = table.fitter
    z, free = _points(table, starts)
    costs = fitter.search_costs(z, free)
    best: dict[tuple[Key, str, int], int] = {}
    for i in np.argsort(costs, kind="stable"):
        best.setdefault((starts[i].key, starts[i].move, starts[i].rivals), int(i))
    rows = np.array(sorted(best.values()))
    keys, owner = _owners([starts[i].key for i in rows])
    found = fitter.race(z[rows], free[rows], owner, min(known.values(), default=np.inf))
    volume, whose = -0.5 * np.linalg.slogdet(found.best.normal)[1], ends_of(found.joined)
    ends = []
    for number, key in enumerate(keys):
        own = whose[owner == number]
        tops = valleys(found.best, np.unique(own))
        num_agreeing = int(in_valley(found.best, tops[0], own).sum())
        for row in tops:
            start, cost = starts[rows[row]], float(found.best.cost[row])
            if key in known and _is_no_news(table.entries[key], known[key], found, row):
                continue
            at, promise = found.best.z[row], cost - volume[row]
            end = replace(start, z=at, cost=cost, promise=promise, num_agreeing=num_agreeing)
            ends.append(end)
    return ends


def _known_costs(table: Table) -> dict[Key, float]:
    """What the fits of the table cost in a race, nats."""
    if not table.entries:
        return {}
    count = len(table.trials.model_parameters)
    z = np.stack([entry.hypothesis.fit.z[:count] for entry in table.entries.values()])
    costs = table.fitter.search_costs(z, table.free(list(table.entries)))
    return dict(zip(table.entries, costs.tolist(), strict=True))


def _is_no_news(entry: Entry, known: float, found: Descended, row: int) -> bool:
    """Whether an end of a race is behind the fit of its hypothesis, or in a valley of its fits."""
    cost, z = float(found.best.cost[row]), found.best.z[row]
    if cost > known + MAY_STILL_GAIN:
        return True
    steps = np.stack([fit.z[: len(z)] - z for fit in entry.fits])
    far = 0.5 * np.einsum("fi,ij,fj->f", steps, found.best.normal[row], steps)
    return bool(far.min() < SAME_VALLEY_NATS and cost > known - SAME_VALLEY_NATS)


def _first_of_each(ends: Sequence[Start], lowest: float) -> list[Start]:
    """The best end of each hypothesis, by promise; of several effects only what comes near.

    `lowest`: the least cost of the table's fits.
    """
    best: dict[Key, Start] = {}
    for end in sorted(ends, key=lambda end: end.cost):
        best.setdefault(end.key, end)
    lowest = min([lowest, *(end.cost for end in ends)])
    near = [end for end in best.values() if end.cost < lowest + BEHIND_IN_SEARCH]
    kept = {end.key for end in near[:MOST_REFINED]}
    chosen = [end for key, end in best.items() if len(key) <= 1 or key in kept]
    return sorted(chosen, key=lambda end: end.promise)


def _refined_in_turn(table: Table, ends: Sequence[Start]) -> list[tuple[Start, GradientFit]]:
    """Fits from ends, roughly, a few at a time, without those far behind others."""
    if not ends:
        return []
    # A part takes as many steps as its slowest, so that many parts would take many.
    cuts = [NUM_AT_ONCE] if all(len(end.key) <= 1 for end in ends) else None
    parts = np.split(np.arange(len(ends)), cuts or range(NUM_AT_ONCE, len(ends), NUM_AT_ONCE))
    fits = table.fitter.polish_in_turn(*_points(table, ends), [p for p in parts if p.size])
    return [(ends[row], fit) for row, fit in fits]


def _refined(table: Table, ends: Sequence[Start]) -> list[tuple[Start, GradientFit]]:
    """Fits from ends, until they have settled; one for each valley."""
    if not ends:
        return []
    _, owner = _owners([end.key for end in ends])
    order = np.argsort(owner, kind="stable")
    ends = [ends[i] for i in order]
    fits = table.fitter.polish(*_points(table, ends), owner[order])
    return [(ends[row], fit) for row, fit in fits.items()]


def _points(table: Table, rows: Sequence[Start]) -> tuple[np.ndarray, np.ndarray]:
    """Z of the model's parameters, and which are free, `[row, parameter]`."""
    return np.stack([one.z for one in rows]), table.free([one.effects for one in rows])


def _owners(keys: Sequence[Key]) -> tuple[list[Key], np.ndarray]:
    """The hypotheses, each once, and which of them each key is of."""
    every = list(dict.fromkeys(keys))
    return every, np.array([every.index(key) for key in keys])

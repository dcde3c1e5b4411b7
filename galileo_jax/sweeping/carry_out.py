"""Carrying out a sweep: tracks the clips, computes the cells, keeps each as it comes."""

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass

from galileo_jax.runtime import progress
from galileo_jax.sweeping.cell import Cell
from galileo_jax.sweeping.clip_files import ClipFiles
from galileo_jax.sweeping.store import Store
from galileo_jax.sweeping.task import Engine, Failure, Outcome, Task
from galileo_jax.sweeping.work import measure_files, run_cell


@dataclass(frozen=True)
class Watch:
    """Who is notified how far a sweep is.

    Attributes:
      on_begin: called with "tracking" or "cells", and how many there are.
      on_done: called after each.
      on_failure: called with a cell's name and why it has no result.
    """

    on_begin: Callable[[str, int], None] = lambda what, count: None
    on_done: Callable[[], None] = lambda: None
    on_failure: Callable[[str, Failure], None] = lambda name, failure: None


def carry_out(
    cells: Sequence[Cell],
    store: Store,
    engine: Engine,
    watch: Watch = Watch(),
    *,
    with_page: Collection[str] = (),
    computed_again: Collection[str] = (),
) -> None:
    """Computes the cells that have neither a result nor a failure.

    Args:
      cells: of the sweep.
      store: where results are and go; each is written before the next is waited for.
      engine: carries out the tasks.
      watch: is notified.
      with_page: names of the cells that get a page of their own.
      computed_again: names of cells that are computed though they have a result.

    Raises:
      Cancelled: the caller asked for it; what is done is in the store.
    """
    left = [
        cell
        for cell in cells
        if cell.name in computed_again
        or (not store.has_result(cell.name) and store.failure(cell.name) is None)
    ]
    clips = {clip.key: clip for cell in left for clip in cell.clips}
    wrong = _track(clips, store, engine, watch)

    def fail(name: str, failure: Failure) -> None:
        store.save_failure(name, failure)
        watch.on_failure(name, failure)

    to_compute = []
    for cell in left:
        if first := next((wrong[c.key] for c in cell.clips if c.key in wrong), None):
            fail(cell.name, first)
        else:
            to_compute.append(cell)

    def tasks() -> Iterator[Task]:
        for cell in to_compute:
            measured = tuple(store.clip(clip.key).measurement for clip in cell.clips)
            folder = store.cell_folder(cell.name) if cell.name in with_page else None
            yield Task(cell.name, run_cell, (cell.settings, measured, folder))

    watch.on_begin("cells", len(to_compute))
    for outcome in _each(engine, tasks()):
        if outcome.failure is None:
            store.save_result(outcome.key, outcome.value)
        else:
            fail(outcome.key, outcome.failure)
        watch.on_done()


def _track(
    clips: dict[str, ClipFiles], store: Store, engine: Engine, watch: Watch
) -> dict[str, Failure]:
    """Tracks the clips that are not yet; returns what is wrong with some of them."""
    left = [clip for key, clip in clips.items() if not store.has_clip(key)]
    wrong: dict[str, Failure] = {}
    watch.on_begin("tracking", len(left))
    tasks = (Task(clip.key, measure_files, (clip.packed(),)) for clip in left)
    for outcome in _each(engine, tasks):
        if outcome.failure is None:
            store.save_clip(outcome.key, outcome.value)
        else:
            wrong[outcome.key] = outcome.failure
        watch.on_done()
    return wrong


def _each(engine: Engine, tasks: Iterable[Task]) -> Iterator[Outcome]:
    """The outcomes, until the caller asks to stop."""
    for outcome in engine.outcomes(tasks):
        yield outcome
        progress.check_cancelled()

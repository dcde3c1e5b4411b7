"""Carrying out a sweep: tracks the clips, computes the cells, keeps each as it comes."""

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from typing import Any

from galileo_jax.runtime import progress
from galileo_jax.sweeping.cell import Cell, ClipFiles
from galileo_jax.sweeping.store import Store
from galileo_jax.sweeping.task import Engine, Failure, Outcome, Task
from galileo_jax.sweeping.work import measure_files, run_cell

TRACKED, COMPUTED = 0.2, 0.98  # shares of a sweep's work, for progress
Report = Callable[[str, float, Any], None]
"""Called with a stage, the share done and, of a cell that fails, its name and why."""


def carry_out(
    cells: Sequence[Cell],
    store: Store,
    engine: Engine,
    report: Report = lambda stage, share, partial: None,
    *,
    with_page: Collection[str] = (),
    computed_again: Collection[str] = (),
) -> None:
    """Computes the cells that have neither a result nor a failure.

    Those of `computed_again` although they have a result; those of `with_page` get a page of
    their own. Each is written into the store before the next is waited for, and `report` is
    told how far it is.

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
    wrong = _track(clips, store, engine, report)
    to_compute = []
    for cell in left:
        if first := next((wrong[c.key] for c in cell.clips if c.key in wrong), None):
            store.save_failure(cell.name, first)
            report("tracking", TRACKED, {"failed": cell.name, "why": first.line})
        else:
            to_compute.append(cell)

    def tasks() -> Iterator[Task]:
        for cell in to_compute:
            measured = tuple(store.clip(clip.key).measurement for clip in cell.clips)
            folder = store.cell_folder(cell.name) if cell.name in with_page else None
            yield Task(cell.name, run_cell, (cell.settings, measured, folder))

    def keep(outcome: Outcome) -> Any:
        if outcome.failure is None:
            store.save_result(outcome.key, outcome.value)
            return None
        store.save_failure(outcome.key, outcome.failure)
        return {"failed": outcome.key, "why": outcome.failure.line}

    _carry_out(tasks(), engine, keep, report, ("cells", len(to_compute), TRACKED, COMPUTED))


def _track(
    clips: dict[str, ClipFiles], store: Store, engine: Engine, report: Report
) -> dict[str, Failure]:
    """Tracks the clips that are not yet; returns what is wrong with some of them."""
    left = [clip for key, clip in clips.items() if not store.has_clip(key)]
    wrong: dict[str, Failure] = {}

    def keep(outcome: Outcome) -> None:
        if outcome.failure is None:
            store.save_clip(outcome.key, outcome.value)
        else:
            wrong[outcome.key] = outcome.failure

    tasks = (Task(clip.key, measure_files, (clip.packed(),)) for clip in left)
    _carry_out(tasks, engine, keep, report, ("tracking", len(left), 0.0, TRACKED))
    return wrong


def _carry_out(
    tasks: Iterable[Task],
    engine: Engine,
    keep: Callable[[Outcome], Any],
    report: Report,
    stage: tuple[str, int, float, float],
) -> None:
    """Keeps every outcome as it comes, until the caller asks to stop.

    What `keep` returns of an outcome is reported. `stage`: its name, how many tasks it has, the
    shares of the sweep at its begin and end.
    """
    name, count, start, end = stage
    report(f"{name}, 0 of {count} done", start if count else end, None)
    for done, outcome in enumerate(engine.outcomes(tasks), 1):
        share = start + (end - start) * done / count
        report(f"{name}, {done} of {count} done", share, keep(outcome))
        progress.check_cancelled()

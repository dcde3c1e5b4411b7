"""`sweep`: evaluate many clips, with several methods; can be stopped and resumed."""

import sys
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import yaml

from galileo_jax import __version__
from galileo_jax.api.options import options_of
from galileo_jax.report.class_chart import Agreement
from galileo_jax.report.sweep_page import write_sweep_page
from galileo_jax.results.command_line import command_line
from galileo_jax.runtime import progress
from galileo_jax.runtime.atomic_write import write_json, write_text
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.progress import CancelFlag, OnProgress
from galileo_jax.sweeping.agreement import agreements, with_remarks
from galileo_jax.sweeping.cell import Cell, ClipFiles, make_cells
from galileo_jax.sweeping.clip_rows import make_clip_rows, names_of
from galileo_jax.sweeping.config import SweepConfig, make_configs, read_config
from galileo_jax.sweeping.engine_local import EngineHere, EngineLocal
from galileo_jax.sweeping.resources import Computing, num_workers
from galileo_jax.sweeping.run_cells import COMPUTED, Report, carry_out
from galileo_jax.sweeping.store import Store
from galileo_jax.sweeping.summary import Row, columns_of, make_rows, write_tables
from galileo_jax.sweeping.task import Engine
from galileo_jax.sweeping.work import PAGE

if TYPE_CHECKING:
    import pandas as pd

MOST_PAGES = 60  # cells up to which each gets a page of its own, where the config does not say
CONFIG = "config.yaml"  # in the sweep's folder, of a config that was no file


@dataclass(frozen=True, eq=False)
class Sweep:
    """A finished sweep.

    Attributes:
      folder: where it lies; `cells/NAME` in it is a run as `galileo fit` leaves it.
      tables: summary.csv and, where pyarrow is installed, summary.parquet.
      summary: of each cell, in the config's order; `rows` as plain mappings.
      agreements: of each quantity that most groups determined what they find together, and who
        lies outside: `sentence`, `groups`, `values`, `found`.
    """

    folder: Path
    tables: tuple[Path, ...]
    summary: tuple[Row, ...]
    agreements: tuple[Agreement, ...] = ()

    @property
    def report_path(self) -> Path:
        """The page: what the class found, each clip, then errors by effect and by method."""
        return self.folder / PAGE

    @property
    def rows(self) -> "pd.DataFrame":
        """One row per cell, in the config's order; empty where there is nothing to say.

        `cell, clips, method, options, effects, seed, hidden, status, failure, converged, verdict,
        effect, adequate, p_value, outside` (quantities), `remark` (why the clip stands apart); of
        `k1`, `k2`, `mass_ratio` and what else the motion determines the value and `_sd, _q025,
        _q975, _unit, _identified` and, where the truth is known, `_true, _error, _covered`; `rmse,
        noise` (m/s), `chi2_per_dof, rms_mm, rms_percent_of_way, frames_used, frames`.
        """
        import pandas as pd

        return pd.DataFrame(list(self.summary), columns=columns_of(self.summary))

    @property
    def failures(self) -> "pd.DataFrame":
        """One row per cell without a result: `cell, clips, method, failure` (a sentence)."""
        import pandas as pd

        failed = [row for row in self.summary if row["status"] == "failed"]
        return pd.DataFrame(failed, columns=["cell", "clips", "method", "failure"])

    def __repr__(self) -> str:
        """In one line."""
        failed = sum(row["status"] == "failed" for row in self.summary)
        done = len(self.summary) - failed
        return f"<Sweep {self.folder}: {done} cells done, {failed} failed>"

    def _repr_html_(self) -> str:
        shown = self.rows.dropna(axis="columns", how="all")
        return shown._repr_html_()  # pyright: ignore


def sweep(
    config: str | Path | Mapping[str, Any],
    *,
    out: str | Path | None = None,
    set: Sequence[str] = (),
    multirun: Sequence[str] = (),
    retry: bool = False,
    engine: Literal["local", "ray"] = "local",
    address: str | None = None,
    workers: int | None = None,
    cpus_per_worker: int = 1,
    gpus_per_worker: int = 0,
    together: int | None = None,
    on_progress: OnProgress | None = None,
    cancel: CancelFlag | None = None,
) -> Sweep:
    """Fits or diagnoses many clips in many ways, and computes only what is not there yet.

    Each cell (a clip, or trials fitted together, with one set of options) gets what `fit`,
    `diagnose` or `explain` would give. What is wrong with a clip is its cells' failure, and the
    sweep goes on. Stopped in any way, the same call goes on where it was
    (docs/how-to/many_clips.md).

    With workers, a script needs its call below `if __name__ == "__main__":`, because each of them
    imports the script; a notebook does not.

    Args:
      config: a YAML file, the name of a ready config, or its keys as a mapping; or a folder of
        films and tables, each of which is explained alone (`explain` fits them together).
      out: the folder, where what is done stays done; None: sweeps/CONFIG, sweeps/FOLDER.
      set: "key=value" each: another value in the config, such as "common.seed=3".
      multirun: "key=a,b" each: the config once with each value, or combination of values.
      retry: whether to try again what failed.
      engine: "local": this machine; "ray": a Ray cluster.
      address: of a Ray cluster; None: one on this machine.
      workers: processes of the local engine; None: as many as there is room for (0: none,
        all is computed in the calling process).
      cpus_per_worker: cores of each.
      gpus_per_worker: GPUs of each.
      together: cells that are computed at once in the calling process, their batches of rollouts
        merged into larger ones: what an accelerator is good for. None: 64 where JAX has an
        accelerator and neither `workers` nor `gpus_per_worker` is given, else 1 (no merging; a
        CPU is twice as fast without).
      on_progress: called with the stage, the share done (0 to 1) and, first, a mapping `cells`,
        `done`, `folder`; for each cell that fails a mapping `failed` (its name) and `why`; at the
        end the `Sweep`; else None.
      cancel: a flag with `is_set`, such as `threading.Event`; with workers it is looked at when a
        cell is done, and what was in flight is dropped.

    Raises:
      InputError: the config is wrong, the folder is in use, or no Ray cluster answers.
      Cancelled: `cancel` was set; the same call goes on where it was.

    Example:
      >>> import galileo_jax as gx
      >>> made = gx.simulate("slide.csv", scenario="incline", seed=1, track_only=True)
      >>> found = gx.sweep({"clips": ["slide.csv"]}, out="sweeps/class", workers=0)
      >>> list(found.rows["status"])
      ['done']
    """
    _check_not_imported_by_worker()
    computing = options_of(Computing, locals())
    computing.check()
    called, name, content = read_config(config)
    configs = make_configs(called, content, set, multirun)
    _check_effects(configs)
    groups = [one.clip_groups() for one in configs]
    is_file = not isinstance(config, Mapping)
    name = name if is_file or out is None else Path(out).name
    store = Store(Path(out) if out is not None else Path("sweeps") / name)

    # What one cell reports is not the sweep's progress; its cancellation is.
    with progress.scope(lambda *_: None, cancel), store.locked():
        report = _reporter(on_progress)
        if not is_file:
            write_text(store.folder / CONFIG, yaml.safe_dump(content, sort_keys=False))
        report("simulating", 0.0, None)
        cells, with_page, again = _cells(configs, groups, store)
        command = command_line(
            "sweep",
            [str(config) if is_file else store.folder / CONFIG],
            set=tuple(set),
            multirun=tuple(multirun),
            out=None if out is None and is_file else store.folder,
            engine=None if engine == "local" else engine,
            address=address,
        )
        document = {
            "command": command,
            "configs": [one.model_dump(mode="json") for one in configs],
            "cells": [cell.name for cell in cells],
            "version": __version__,
        }
        write_json(store.folder / "sweep.json", document)
        for cell in cells if retry else ():
            store.forget_failure(cell.name)
        done = sum(store.has_result(cell.name) and cell.name not in again for cell in cells)
        report("starting", 0.0, {"cells": len(cells), "done": done, "folder": store.folder})
        with closing(_engine(computing)) as worker:
            carry_out(cells, store, worker, report, with_page=with_page, computed_again=again)
        report("writing the page", COMPUTED, None)
        made = _written(name, cells, store, command)
        report("done", 1.0, made)
        return made


def _written(name: str, cells: Sequence[Cell], store: Store, command: str) -> Sweep:
    """The finished sweep, with its tables and its page."""
    called = names_of(cells)
    names = [" + ".join(called[clip.key] for clip in cell.clips) for cell in cells]
    rows = make_rows(cells, store)
    found = agreements(rows, names)
    rows = with_remarks(rows, names, cells, found)
    tables = write_tables(store.folder, rows)
    clips = make_clip_rows(cells, store, rows)
    write_sweep_page(store.folder / PAGE, name, rows, command, clips, found)
    return Sweep(store.folder, tuple(tables), tuple(rows), found)


def _check_not_imported_by_worker() -> None:
    """Refuses the call of a script that a worker imports: it would start workers of its own."""
    script = sys.modules.get("__mp_main__")
    if script is not None and script is not sys.modules["__main__"]:
        raise InputError(
            'sweep: workers import your script; put the call below if __name__ == "__main__":, or '
            "call it with workers=0"
        )


def _reporter(on_progress: OnProgress | None) -> Report:
    def report(stage: str, share: float, partial: Any = None) -> None:
        progress.check_cancelled()
        if on_progress is not None:
            on_progress(stage, share, partial)

    return report


def _check_effects(configs: Sequence[SweepConfig]) -> None:
    """Refuses effects that there are not, before anything is computed."""
    named = {
        effect
        for config in configs
        for settings in config.all_settings()
        for effect in (*getattr(settings, "effects", ()), getattr(settings, "add", "auto"))
    } | {one.effect for config in configs for one in config.simulate}
    if named <= {"auto", "none", None}:
        return
    from galileo_jax.model.effects.registry import effect_names

    known = ("auto", "none", None, *effect_names())
    if unknown := sorted(str(name) for name in named if name not in known):
        raise InputError(f"effects: unknown {unknown[0]!r}; known: {', '.join(effect_names())}")


def _cells(
    configs: Sequence[SweepConfig], groups: Sequence[tuple[tuple[str, ...], ...]], store: Store
) -> tuple[tuple[Cell, ...], frozenset[str], frozenset[str]]:
    """All cells of all configs, each once; makes the clips that are to be simulated.

    Returns:
      the cells, the names of those that get a page, and of those that have a result and no page
      though the config asks for one.
    """
    of = cache(ClipFiles.of)
    cells: dict[str, Cell] = {}
    reports: dict[str, bool | None] = {}
    for config, named in zip(configs, groups, strict=True):
        folder = store.folder / "simulated"
        made = [(str(path),) for one in config.simulate for path in one.made(folder)]
        together = [*named, *made]
        found = make_cells([tuple(map(of, group)) for group in together], config.all_settings())
        cells |= {cell.name: cell for cell in found}
        reports |= {cell.name: config.reports for cell in found}
    few = len(cells) <= MOST_PAGES
    with_page = frozenset(name for name, said in reports.items() if (few if said is None else said))
    again = frozenset(
        name
        for name, cell in cells.items()
        if reports[name] and store.has_result(name) and store.page(name, cell.clips[0].name) is None
    )
    return tuple(cells.values()), with_page, again


def _engine(computing: Computing) -> Engine:
    each = computing.each
    if computing.engine == "ray":
        from galileo_jax.sweeping.engine_ray import EngineRay

        return EngineRay(computing.address, each)
    if (together := computing.num_together()) > 1:
        from galileo_jax.sweeping.engine_together import EngineTogether

        return EngineTogether(together)
    if computing.workers == 0:
        return EngineHere()
    return EngineLocal(computing.workers or num_workers(each), each)

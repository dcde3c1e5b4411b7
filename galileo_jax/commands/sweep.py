"""`galileo sweep`: many clips, many ways, from one config; stopped and taken up again at will."""

import argparse
import shlex
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from galileo_jax import __version__
from galileo_jax.commands import command
from galileo_jax.files.package_data import config_path
from galileo_jax.runtime.atomic_write import write_json
from galileo_jax.runtime.errors import InputError

if TYPE_CHECKING:
    from galileo_jax.sweeping.cell import Cell
    from galileo_jax.sweeping.config import SweepConfig
    from galileo_jax.sweeping.store import Store
    from galileo_jax.sweeping.task import Engine, Failure

ENGINES = ("local", "ray")
MAX_LINES = 10  # failures that are told one by one


def main(argv: Sequence[str]) -> int | None:
    """Computes what is missing of a sweep, and writes its tables and its page."""
    call = _parser().parse_args(argv)
    if call.address and call.engine != "ray":
        raise InputError("--address: for --engine ray only")
    from galileo_jax.sweeping.config import load_config
    from galileo_jax.sweeping.store import Store

    path = _config_file(call.config)
    configs = load_config(path, call.set, call.multirun)
    _check_effects(configs)
    groups = [config.clip_groups() for config in configs]
    store = Store(Path(call.out) if call.out else Path("sweeps") / path.stem)
    with store.locked():
        cells = _cells(configs, groups, store)
        again = shlex.join(["galileo", "sweep", *argv])
        write_json(
            store.folder / "sweep.json",
            {
                "command": again,
                "configs": [config.model_dump(mode="json") for config in configs],
                "cells": [cell.name for cell in cells],
                "version": __version__,
            },
        )
        if call.retry:
            for cell in cells:
                store.forget_failure(cell.name)
        _carry_out(cells, store, call)
        _conclude(path.stem, cells, store, again)
    return None


def _config_file(name: str) -> Path:
    """A config by its path; a ready one also by its name, wherever the call is made."""
    path = Path(name)
    if path.is_file():
        return path
    return config_path(path.name if path.suffix else f"{path.name}.yaml")


def _check_effects(configs: "Sequence[SweepConfig]") -> None:
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
    configs: "Sequence[SweepConfig]", groups: Sequence[tuple[tuple[Path, ...], ...]], store: "Store"
) -> "tuple[Cell, ...]":
    """All cells of all configs, each once; makes the clips that are to be simulated."""
    from galileo_jax.sweeping.cell import make_cells
    from galileo_jax.sweeping.clip_files import ClipFiles
    from galileo_jax.sweeping.simulated import simulated_clips

    files: dict[Path, ClipFiles] = {}

    def of(path: Path) -> ClipFiles:
        if path not in files:
            files[path] = ClipFiles.of(path)
        return files[path]

    cells: dict[str, Cell] = {}
    for config, named in zip(configs, groups, strict=True):
        with command.console().status("simulating"):
            made = simulated_clips(store.folder / "simulated", config.simulate)
        together = [*named, *((path,) for path in made)]
        found = make_cells([tuple(map(of, group)) for group in together], config.all_settings())
        cells |= {cell.name: cell for cell in found}
    return tuple(cells.values())


def _carry_out(cells: "Sequence[Cell]", store: "Store", call: argparse.Namespace) -> None:
    """Computes what is missing, with a bar and a line for each failure."""
    from galileo_jax.sweeping.carry_out import Watch, carry_out

    done = sum(store.has_result(cell.name) for cell in cells)
    command.console().print(f"{len(cells)} cells, {done} of them done; {store.folder}")
    told = 0
    with command.progress() as bar, _engine(call) as engine:
        task = bar.add_task("", total=None)

        def begin(what: str, count: int) -> None:
            bar.reset(task, description=what, total=count)

        def fail(name: str, failure: "Failure") -> None:
            nonlocal told
            told += 1
            if told <= MAX_LINES:
                bar.console.print(f"failed: {name}: {failure.line}", soft_wrap=True, markup=False)

        carry_out(cells, store, engine, Watch(begin, lambda: bar.advance(task), fail))


@contextmanager
def _engine(call: argparse.Namespace) -> "Iterator[Engine]":
    from galileo_jax.sweeping.engine_local import EngineHere, EngineLocal
    from galileo_jax.sweeping.resources import Resources, num_workers

    each = Resources(call.cpus_per_worker, call.gpus_per_worker)
    if call.engine == "ray":
        from galileo_jax.sweeping.engine_ray import EngineRay

        engine = EngineRay(call.address, each)
    elif call.workers == 0:
        engine = EngineHere()
    else:
        engine = EngineLocal(call.workers or num_workers(each), each)
    try:
        yield engine
    finally:
        engine.close()


def _conclude(name: str, cells: "Sequence[Cell]", store: "Store", again: str) -> None:
    """Writes tables and page, and tells in a few lines what came out."""
    from galileo_jax.report.sweep_page import write_sweep_page
    from galileo_jax.sweeping.summary import make_rows, write_tables

    rows = make_rows(cells, store)
    files = write_tables(store.folder, rows)
    write_sweep_page(page := store.folder / "report.html", name, rows, again)
    count = Counter(row["status"] for row in rows)
    print(f"{count['done']} cells done, {count['failed']} failed")
    command.console().print(", ".join(map(str, [*files, page])), soft_wrap=True)


def _parser() -> command.Parser:
    parser = command.Parser(prog="galileo sweep", description=__doc__)
    parser.add_argument("config", metavar="CONFIG", help="a yaml file, or the name of a ready one")
    parser.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", help="such as common.seed=3"
    )
    parser.add_argument(
        "--multirun",
        action="append",
        default=[],
        metavar="KEY=A,B",
        help="a config for each",
    )
    parser.add_argument("--out", help="folder (default sweeps/CONFIG); what is there is kept")
    parser.add_argument("--retry", action="store_true", help="try again what failed")
    group = parser.add_argument_group("where")
    group.add_argument("--engine", choices=ENGINES, default="local")
    group.add_argument("--address", help="of a Ray cluster (default: one on this machine)")
    group.add_argument(
        "--workers",
        type=command.whole_number(0),
        help="of the local engine (default: as many as there is room for; 0: in this process)",
    )
    group.add_argument("--cpus-per-worker", type=command.whole_number(1), default=1)
    group.add_argument("--gpus-per-worker", type=command.whole_number(0), default=0)
    return parser

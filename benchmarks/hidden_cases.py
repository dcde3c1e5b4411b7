"""The exam's cases: a grid of our own, or clips that lie in a folder."""

import itertools
import json
import multiprocessing
import tempfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from galileo_jax.api.simulate import simulate
from galileo_jax.assembly.build_problem import with_library
from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import measure
from galileo_jax.model.effects.forms import FORM_NAMES
from galileo_jax.runtime.errors import InputError

EXOTIC_FILE = Path(__file__).with_name("exotic_effects.py")
EXOTICS = (
    "exotic_bump",
    "exotic_drying",
    "exotic_dying_wind",
    "exotic_growing_force",
    "exotic_gust",
    "exotic_heating",
    "exotic_magnet",
    "exotic_ripple",
    "exotic_root_drag",
)
PAIRS = ("initial_push+restitution", "air_drag+friction_patch")
ANGLES_DEG = (20.0, 10.0, 15.0)
TRACK: dict[str, Any] = {"track_only": True, "solver": "fine", "faults": True}
"""No video; by an integrator that the fit does not know, with the small faults of real clips."""


@dataclass(frozen=True)
class Case:
    """Clips that are diagnosed together."""

    name: str  # no two have the same
    yamls: tuple[Path, ...]  # the clips' yamls, a NAME.truth.json beside each
    effect: str  # what is hidden in them, as the truth says it
    # of our own clips, 0 to 1; None where it is not known or nothing is hidden
    strength: float | None = None
    # the arguments of `simulate` that make the clips; None if they are there
    recipe: Mapping[str, Any] | None = None


def ramp_effects() -> list[str]:
    """The library's effects that have a place on a ramp: the candidates of its diagnosis."""
    with tempfile.TemporaryDirectory() as folder:
        plain = simulate(Path(folder) / "plain.csv", seed=0, track_only=True).paths[0]
        measured = measure(load_clip(plain))
        trials = with_library([measured.clip], [measured.observation], "auto")
    return [name for name in trials.all_effects if name not in FORM_NAMES]


def grid(
    folder: Path,
    effects: Sequence[str],
    strengths: Sequence[float],
    seeds: int,
    num_none: int,
    noise_m: float,
    fps: float,
    series: int | None,
) -> Iterator[Case]:
    """Effects x strengths x seeds (library's, pairs, exotic ones), then clips without an effect.

    Angles go round with the seed. Every case has a seed of its own, so that a case is the same
    in a smaller grid.
    """
    hidden = itertools.product((*effects, *PAIRS, *EXOTICS), strengths, range(seeds))
    cells = [(effect, strength, seed) for effect, strength, seed in hidden]
    for effect, strength, seed in [*cells, *(("none", None, i) for i in range(num_none))]:
        level = "" if strength is None else f"_{round(100 * strength)}"
        name = f"{effect}{level}_{seed}"
        recipe: dict[str, Any] = {
            "out": folder / f"{name}.csv",
            "seed": zlib.crc32(name.encode()),
            "angle": ANGLES_DEG[seed % 3],
            "track_noise": noise_m,
            "fps": fps,
            "series": series,
            **TRACK,
        }
        if strength is not None:
            told = {each: {} for each in effect.split("+")}
            recipe |= {"effects": told, "strength": strength}
        if effect in EXOTICS:
            recipe["effects_from"] = [EXOTIC_FILE]
        names = [f"{name}_{i + 1}" for i in range(series)] if series else [name]
        yamls = tuple(folder / f"{each}.yaml" for each in names)
        yield Case(name, yamls, effect, strength, recipe)


def make_clips(case: Case) -> None:
    """Simulates the clips of a case that are not there."""
    if case.recipe is not None and not all(path.is_file() for path in case.yamls):
        simulate(**case.recipe)


def made_meanwhile(
    make: Callable[..., Any], arguments: Mapping[str, tuple[Any, ...] | None]
) -> Iterator[tuple[str, Any]]:
    """Names, and what `make` made of their arguments (None: nothing); the next are made meanwhile.

    In a process of its own, so that exotic effects stay unknown to the diagnosis in this one.
    """
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        made = {name: pool.submit(make, *given) for name, given in arguments.items() if given}
        try:
            for name in arguments:
                yield name, made[name].result() if name in made else None
        finally:
            pool.shutdown(cancel_futures=True)


def folder_cases(folder: Path, series: int | None, only: str) -> list[Case]:
    """The clips with a truth in a folder; with `series` those of a series, so many together.

    Raises:
      InputError: there is none.
    """
    groups: dict[str, list[tuple[Path, dict[str, Any]]]] = {}
    for path in sorted(folder.glob(f"{only}.truth.json")):
        truth, name = json.loads(path.read_text()), path.name.removesuffix(".truth.json")
        group = truth.get("series") if series else name
        if group:
            groups.setdefault(str(group), []).append((path.with_name(f"{name}.yaml"), truth))
    cases = [
        Case(name, tuple(path for path, _ in clips[:series]), clips[0][1]["effect"])
        for name, clips in groups.items()
        if not series or len(clips) >= series
    ]
    if not cases:
        raise InputError(f"{folder}: no {only}.truth.json there" + (" of a series" * bool(series)))
    return cases

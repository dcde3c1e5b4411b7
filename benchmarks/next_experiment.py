"""Clips until `named`: settings that `next` chooses against settings at random.

    python -m benchmarks next_experiment --out DIR --most 6 --first 100

For every pair of docs/reference/effects.md that is easily confused, the first effect is hidden in a
lab. Both ways begin with the same clip (the middle of what the lab allows); then one asks
`next_experiment`, the other draws a setting, and all clips are diagnosed together until the effect
is named, or `--most` clips are made. A lab whose first clip names the effect already says nothing
here and is left out. What is finished stays in DIR, every clip and verdict for itself, so that what
is interrupted goes on.

With `--pairs` only no effect and the two of a pair are hypotheses, for each of the pairs: a step
then takes seconds. Named is what is ahead of the other two by the margin of a verdict.
"""

import argparse
import json
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import galileo_jax as gx
from benchmarks import labs, tables
from galileo_jax.api.diagnose import with_library
from galileo_jax.clip.load import load_clip
from galileo_jax.commands import command
from galileo_jax.comparison.compare import compare
from galileo_jax.diagnosis.candidates import Hypothesis
from galileo_jax.diagnosis.diagnose import fitter_of
from galileo_jax.diagnosis.diagnosis import Diagnosis, Round, Verdict
from galileo_jax.diagnosis.race import Race
from galileo_jax.diagnosis.verdict import ranked
from galileo_jax.experiment.belief import beliefs_of
from galileo_jax.experiment.choose import best_first, expect
from galileo_jax.experiment.measured import write_clip
from galileo_jax.experiment.plan import middle
from galileo_jax.experiment.settings import Can, Range, grid
from galileo_jax.measurement.measure import measure
from galileo_jax.runtime.atomic_write import write_json
from galileo_jax.runtime.precision import in_float64

PAIRS = (
    ("air_drag", "viscous_drag"),
    ("viscous_drag", "air_drag"),
    ("viscous_drag", "magnetic_brake"),
    ("stribeck", "static_friction"),
    ("static_friction", "release_delay"),
    ("rolling", "scale_error"),
    ("rolling", "frame_rate"),
    ("release_delay", "static_friction"),
    ("table_tilt", "surface_friction"),
    ("friction_patch", "surface_friction"),
    ("friction_patch", "magnetic_brake"),
    ("surface_friction", "table_tilt"),
    ("magnetic_brake", "friction_patch"),
    ("spring_tether", "constant_force"),
    ("scale_error", "frame_rate"),
    ("frame_rate", "scale_error"),
    ("frame_rate", "rolling"),
)
"""(hidden, easily confused with): the pairs of the table whose partner is an effect, too."""

WAYS = ("next", "random")
MOST_SETTINGS = 16  # that are rehearsed for a pair


def main(call: argparse.Namespace) -> dict[str, Any]:
    hidden = call.effects.split(",") if call.effects else [first for first, _ in PAIRS]
    races: list[tuple[str, str]] = [(effect, "") for effect in dict.fromkeys(hidden)]
    if call.pairs:
        races = [pair for pair in PAIRS if pair[0] in hidden]
    tables.row("hidden", ("next", "random"))
    rows = []
    for seed in range(call.first, call.first + call.seeds):
        for effect, rival in races:
            row = _race(call, effect, rival, seed)
            title = f"{effect} ({rival})" if rival else effect
            tables.row(f"{title} {seed}", [row["next"], row["random"]])
            rows.append(row)
    told = [row for row in rows if row["next"] > 1]
    medians = {way: float(np.median([row[way] for row in told] or [0])) for way in WAYS}
    tables.row(f"median of {len(told)}", [medians[way] for way in WAYS])
    return {"most": call.most, "medians": medians, "labs": rows}


def _race(call: argparse.Namespace, effect: str, rival: str, seed: int) -> dict[str, Any]:
    folder: Path = call.out / "_".join([effect, *([rival] if rival else []), str(seed)])
    (folder / "lab").mkdir(parents=True, exist_ok=True)
    lab = labs.SimulatedLab(folder / "lab", effect, seed, call.noise)
    first = _step(folder, lab, rival, (), middle(lab.describe().can), call.most)
    row: dict[str, Any] = {"hidden": effect, "rival": rival, "seed": seed, "first": first["says"]}
    for way in WAYS:
        steps = [first]
        # One more than allowed stands for "not named within them".
        while steps[-1]["says"] != ["named", effect] and len(steps) < call.most:
            setting = steps[-1]["next"]
            if way == "random":
                setting = _drawn(lab.describe().can, seed, len(steps))
            steps.append(
                _step(folder, lab, rival, [one["clip"] for one in steps], setting, call.most)
            )
        is_named = steps[-1]["says"] == ["named", effect]
        row[way] = len(steps) if is_named else call.most + 1
        row[f"{way}_says"] = steps[-1]["says"]
    return row


def _step(
    folder: Path,
    lab: labs.SimulatedLab,
    rival: str,
    before: Sequence[str],
    setting: Mapping[str, Any],
    most: int,
) -> dict[str, Any]:
    """One more clip, the verdict of all, and where to measure next; done once, then on disk.

    The same clips are the same step, whichever way asks for it.
    """
    text = json.dumps([*before, setting], sort_keys=True)
    name = f"c{len(before) + 1}_{zlib.crc32(text.encode()):08x}"
    done = folder / f"{name}.json"
    if done.is_file():
        return json.loads(done.read_text())
    clip = folder / f"{name}.csv"
    if not clip.is_file():
        write_clip(clip, lab.measure(setting), lab.describe().clip, setting)
    clips = [folder / each for each in (*before, clip.name)]
    may_ask = len(clips) < most
    says, ahead = _of_two(lab, rival, clips, may_ask) if rival else _of_all(lab, clips, may_ask)
    step = {"clip": clip.name, "setting": dict(setting), "says": says, "next": ahead}
    write_json(done, step)
    return step


Said = tuple[list[str], dict[str, Any] | None]
"""The verdict, and where to measure next."""


def _of_all(lab: labs.SimulatedLab, clips: Sequence[Path], may_ask: bool) -> Said:
    """By the diagnosis, all effects and forms being hypotheses."""
    found = gx.diagnose(clips, seed=lab.seed, add="none")
    says = [found.verdict.status, *found.verdict.effects]
    if says == ["named", lab.effect] or not may_ask:
        return says, None
    return says, dict(gx.next_experiment(found, can=labs.SETTINGS, seed=lab.seed).best)


@in_float64
def _of_two(lab: labs.SimulatedLab, rival: str, clips: Sequence[Path], may_ask: bool) -> Said:
    """No effect, the hidden one and its rival being hypotheses."""
    declared = [load_clip(clip.with_suffix(".yaml")) for clip in clips]
    trials = with_library(declared, [measure(clip).observation for clip in declared], "auto")
    fitter = fitter_of(trials)
    base = Hypothesis((), fitter.fit(lab.seed, effects=()))
    first = Round(base, compare(trials, base.fit, lab.seed))
    race = Race(fitter, base, first.comparison.is_adequate, lab.seed, lambda _: None)
    candidates = ranked(race([base, base], [(lab.effect,), (rival,)]))
    beliefs = beliefs_of(Diagnosis((first,), candidates, Verdict("ambiguous", ())))
    best, *others = beliefs.of
    if all(best.log_odds - other.log_odds >= beliefs.margin for other in others):
        says = ["named", *best.effects]
    else:
        says = ["ambiguous", *(belief.name for belief in beliefs.of)]
    if says == ["named", lab.effect] or not may_ask:
        return says, None
    settings = grid(lab.describe().can, lab.seed, MOST_SETTINGS)
    rows = expect(declared[0], trials, beliefs, settings, None, lab.seed)
    return says, dict(best_first(rows)[0].setting)


def _drawn(can: Can, seed: int, number: int) -> dict[str, Any]:
    """A setting at random."""
    generator = np.random.default_rng([seed, number])
    return {
        name: float(generator.uniform(kind.low, kind.high))
        if isinstance(kind, Range)
        else kind.values[int(generator.integers(len(kind.values)))]
        for name, kind in can.items()
    }


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--effects", default="", help="hidden ones (default: of all pairs)")
    parser.add_argument("--pairs", action="store_true", help="each pair by itself")
    parser.add_argument("--noise", choices=labs.NOISES, default="px")
    parser.add_argument("--most", type=command.whole_number(2), default=6, help="clips")
    parser.add_argument("--seeds", type=command.whole_number(1), default=1)
    parser.add_argument("--first", type=command.whole_number(0), default=100, help="seed")

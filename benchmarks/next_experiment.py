"""How many clips until a name: settings that `next` chooses against settings at random.

    python -m benchmarks next_experiment --out DIR --most 6 --first 100

For every pair of docs/reference/effects.md that is easily confused, the first effect is hidden in a
lab; no effect and the two of the pair are the hypotheses. Both ways begin with the same clip (the
middle of what the lab allows); then one asks `next_experiment`, the other draws a setting, until
the effect is named (ahead of the other two by the margin of a verdict), or `--most` clips are made.
A lab whose first clip names the effect already says nothing here and is left out. What is finished
stays in DIR, every clip and verdict for itself, so that what is interrupted goes on.
"""

import itertools
import json
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import labs, tables
from galileo_jax.assembly.build_problem import with_library
from galileo_jax.clip.load import load_clip
from galileo_jax.comparison.compare import compare
from galileo_jax.diagnosis.candidates import candidates_of
from galileo_jax.diagnosis.diagnosis import Diagnosis, Round, Verdict
from galileo_jax.diagnosis.stakes import VerdictStakes
from galileo_jax.diagnosis.verdict import ranked
from galileo_jax.experiment.choose import best_first, expect
from galileo_jax.experiment.hypothesis_probabilities import beliefs_of
from galileo_jax.experiment.lab import write_clip
from galileo_jax.experiment.plan import middle
from galileo_jax.experiment.settings import Can, Range, grid
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.measurement.measure import measure
from galileo_jax.runtime.atomic_write import write_json
from galileo_jax.runtime.precision import in_float64
from galileo_jax.search.fit import best_fit
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.search.loop import search
from galileo_jax.search.table import Table

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


def main(
    *,
    out: Path,
    effects: str = "",
    noise: labs.Noise = "px",
    most: int = 6,
    seeds: int = 1,
    first: int = 100,
) -> dict[str, Any]:
    pairs = [pair for pair in PAIRS if not effects or pair[0] in effects.split(",")]
    tables.row("hidden", WAYS)
    rows = []
    for seed, (effect, rival) in itertools.product(range(first, first + seeds), pairs):
        folder = out / f"{effect}_{rival}_{seed}"
        (folder / "lab").mkdir(parents=True, exist_ok=True)
        lab = labs.SimulatedLab(folder / "lab", effect, seed, noise)
        rows.append({"hidden": effect, "rival": rival, "seed": seed, **_race(lab, rival, most)})
        tables.row(f"{effect} ({rival}) {seed}", [rows[-1][way] for way in WAYS])
    told = [row for row in rows if row["next"] > 1]
    medians = {way: float(np.median([row[way] for row in told] or [0])) for way in WAYS}
    tables.row(f"median of {len(told)}", [medians[way] for way in WAYS])
    return {"most": most, "medians": medians, "labs": rows}


def _race(lab: labs.SimulatedLab, rival: str, most: int) -> dict[str, Any]:
    """Clips until the effect is named, by way; one more than allowed: not within them."""
    named, can = ["named", lab.effect], lab.describe().can
    first = _step(lab, rival, (), middle(can), most)
    row: dict[str, Any] = {"first": first["says"]}
    for way in WAYS:
        steps = [first]
        while steps[-1]["says"] != named and len(steps) < most:
            setting = steps[-1]["next"] if way == "next" else _drawn(can, lab.seed, len(steps))
            steps.append(_step(lab, rival, [one["clip"] for one in steps], setting, most))
        row[way] = len(steps) if steps[-1]["says"] == named else most + 1
        row[f"{way}_says"] = steps[-1]["says"]
    return row


def _step(
    lab: labs.SimulatedLab,
    rival: str,
    before: Sequence[str],
    setting: Mapping[str, Any],
    most: int,
) -> dict[str, Any]:
    """One more clip, the verdict of all, and where to measure next; done once, then on disk.

    The same clips are the same step, whichever way asks for it.
    """
    folder = lab.folder.parent
    text = json.dumps([*before, setting], sort_keys=True)
    name = f"c{len(before) + 1}_{zlib.crc32(text.encode()):08x}"
    done = folder / f"{name}.json"
    if done.is_file():
        return json.loads(done.read_text())
    clip = folder / f"{name}.csv"
    if not clip.is_file():
        write_clip(clip, lab.measure(setting), lab.describe().clip, setting)
    clips = [folder / each for each in (*before, clip.name)]
    says, ahead = _of_two(lab, rival, clips, len(clips) < most)
    step = {"clip": clip.name, "setting": dict(setting), "says": says, "next": ahead}
    write_json(done, step)
    return step


@in_float64
def _of_two(
    lab: labs.SimulatedLab, rival: str, clips: Sequence[Path], may_ask: bool
) -> tuple[list[str], dict[str, Any] | None]:
    """The verdict on no effect, the hidden one and its rival; and where to measure next."""
    declared = [load_clip(clip.with_suffix(".yaml")) for clip in clips]
    trials = with_library(declared, [measure(clip).observation for clip in declared], "auto")
    fitter = GradientFitter(trials)
    base = Hypothesis((), best_fit(fitter, lab.seed, effects=()))
    first = Round(base, compare(trials, base.fit, lab.seed))
    stakes = VerdictStakes(trials, first.comparison.is_adequate)
    table = search(Table.of(fitter, stakes, lab.seed, base), 1)
    candidates = ranked(c for c in candidates_of(table) if c.name in (lab.effect, rival))
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

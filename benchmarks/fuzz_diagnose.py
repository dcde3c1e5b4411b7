"""Odd tracks through `diagnose`: each ends in a verdict or a sentence, none in a traceback.

    python benchmarks/fuzz_diagnose.py --out fuzz --cases 200 --minutes 15

Tracks are drawn: scenario, effect, noise, rate and length; then made odd: cut to a few frames, an
object never seen or only at rest, gaps, single frames lost, rows that stand still, an outlier, a
misstated noise. Each is given to `diagnose`. To be refused with an `InputError` is fine, and so is
any verdict whose probabilities sum to 1; all else is written to OUT/failures.txt, its track kept
beside it. The last line is JSON.
"""

import argparse
import time
import traceback
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import tables

from galileo_jax.api.diagnose import diagnose
from galileo_jax.api.simulate import simulate
from galileo_jax.commands import command
from galileo_jax.model.effects.registry import effect_names
from galileo_jax.runtime.errors import InputError

SCENARIOS = ("ramp", "ramp", "ramp", "incline", "multi", "fall", "flight", "spring", "liquid")
ON_A_RAMP = ("ramp", "incline", "multi")
Table = pd.DataFrame
Oddity = Callable[[Table, np.random.Generator], Table]


def main(argv: Sequence[str]) -> int | None:
    call = _parser().parse_args(argv)
    call.out.mkdir(parents=True, exist_ok=True)
    began, outcomes, failures = time.monotonic(), Counter[str](), []
    for seed in range(call.first, call.first + call.cases):
        if time.monotonic() - began > 60 * call.minutes:
            break
        said = _one(call.out / f"fuzz_{seed}.csv", seed)
        outcomes[said.split(":")[0]] += 1
        if said.startswith("FAILED"):
            failures.append(seed)
            with (call.out / "failures.txt").open("a") as file:
                file.write(f"{seed}\n{said}\n")
        print(f"{seed:>6}  {said.splitlines()[0]}", flush=True)
    tables.finish("fuzz_diagnose", {"outcomes": dict(outcomes), "failures": failures})
    return 1 if failures else None


def _one(track: Path, seed: int) -> str:
    """What comes of one drawn track: a verdict, a refusal, or FAILED and the traceback."""
    try:
        oddities = _draw(track, seed)
    except InputError as error:
        return f"not made: {error}"
    try:
        found = diagnose(track, seed=seed)
        total = found.document["probability_none"] + found.candidates["probability"].sum()
        if not abs(total - 1.0) < 1e-6:
            return f"FAILED: probabilities sum to {total} ({oddities})"
        return f"{found.verdict.status}: {'+'.join(found.verdict.effects)} ({oddities})"
    except InputError as error:
        return f"refused: {error} ({oddities})"
    except Exception:  # whatever it is, it is what this looks for
        return f"FAILED: {oddities}\n{traceback.format_exc()}"


def _draw(track: Path, seed: int) -> str:
    """Writes a drawn track made odd; the names of its oddities."""
    generator = np.random.default_rng([seed, 71])
    scenario = str(generator.choice(SCENARIOS))
    effect = str(generator.choice(effect_names()))
    hidden = {effect: {}} if scenario == "ramp" and generator.random() < 0.5 else {}
    simulate(
        track,
        seed=seed,
        scenario=scenario,
        angle=float(generator.uniform(8, 32)) if scenario in ON_A_RAMP else 20.0,
        fps=float(generator.choice([12, 25, 30, 60])),
        track_only=True,
        track_noise=float(generator.choice([1e-6, 1e-5, 2e-4, 3e-3])),
        effects=hidden,
    )
    chosen = generator.choice(list(ODDITIES), generator.integers(1, 4), replace=False)
    table = pd.read_csv(track)
    for name in chosen:
        table = ODDITIES[name](table, generator)
    table.to_csv(track, index=False)
    return ", ".join([scenario, *hidden, *map(str, chosen)])


def _objects(table: Table) -> list[str]:
    return sorted({name.rsplit("_", 2)[0] for name in table.columns if name.endswith("_x_m")})


def _lose(table: Table, rows: np.ndarray, names: Sequence[str]) -> Table:
    """The table without what is known of objects in some rows."""
    table = table.copy()
    columns = [c for c in table.columns if c.startswith(tuple(f"{name}_" for name in names))]
    table.loc[table.index[rows], columns] = np.nan
    return table


def _one_of(table: Table, generator: np.random.Generator) -> list[str]:
    return [str(generator.choice(_objects(table)))]


def _short(table: Table, generator: np.random.Generator) -> Table:
    begin = int(generator.integers(0, max(1, len(table) // 2)))
    return table.iloc[begin : begin + int(generator.integers(3, 12))]


def _unseen(table: Table, generator: np.random.Generator) -> Table:
    return _lose(table, np.arange(len(table)), _one_of(table, generator))


def _seen_at_rest(table: Table, generator: np.random.Generator) -> Table:
    """One object is seen in the first three frames alone."""
    return _lose(table, np.arange(3, len(table)), _one_of(table, generator))


def _gap(table: Table, generator: np.random.Generator) -> Table:
    begin, end = np.sort(generator.integers(0, len(table) + 1, 2))
    return _lose(table, np.arange(begin, end), _one_of(table, generator))


def _lost_frames(table: Table, generator: np.random.Generator) -> Table:
    return _lose(table, generator.random(len(table)) < 0.5, _one_of(table, generator))


def _missing_rows(table: Table, generator: np.random.Generator) -> Table:
    return table.loc[generator.random(len(table)) < 0.6]


def _still(table: Table, generator: np.random.Generator) -> Table:
    """Nothing moves at all."""
    table = table.copy()
    table.iloc[:, 1:] = table.iloc[0, 1:].to_numpy()
    return table


def _outlier(table: Table, generator: np.random.Generator) -> Table:
    table = table.copy()
    column = f"{_one_of(table, generator)[0]}_x_m"
    table.loc[generator.choice(table.index), column] += generator.uniform(0.05, 0.5)
    return table


def _misstated(table: Table, generator: np.random.Generator) -> Table:
    """The stated noise is far from that which is there."""
    table = table.copy()
    columns = [c for c in table.columns if c.endswith("_sd_m")]
    table[columns] *= float(generator.choice([0.01, 0.3, 3.0, 100.0]))
    return table


ODDITIES: dict[str, Oddity] = {
    "short": _short,
    "unseen": _unseen,
    "seen_at_rest": _seen_at_rest,
    "gap": _gap,
    "lost_frames": _lost_frames,
    "missing_rows": _missing_rows,
    "still": _still,
    "outlier": _outlier,
    "misstated": _misstated,
}


def _parser() -> command.Parser:
    parser = command.Parser(prog="fuzz_diagnose.py", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    add = parser.add_argument
    add("--out", type=Path, required=True, help="tracks and failures.txt")
    add("--cases", type=command.whole_number(1), default=200)
    add("--first", type=command.whole_number(0), default=0, help="the first seed")
    add("--minutes", type=float, default=15.0, help="no case is begun after so long")
    return parser


if __name__ == "__main__":
    raise SystemExit(command.run(main))

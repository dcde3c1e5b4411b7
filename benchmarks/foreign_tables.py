"""Tables as other programs write them: is each read as it is, and is what is found right?

    python -m benchmarks foreign_tables [--num 70] [--first 0] [--folder build/foreign] [--out F]

Motions with a known truth are simulated, and written with units, titles in several languages, marks
of decimals, origins, axes, clocks, first rows and last digits that are drawn at random; nothing of
our own csv is left. `gx.explain` is told the scenario, the angle of a slope, and the unit where no
title has one. Counted are tables that are refused, numbers more than `FAR_SDS` from the truth, and
motions in which something is found missing: nothing is.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import galileo_jax as gx
from benchmarks import tables
from benchmarks.journal import Journal
from galileo_jax.runtime.errors import InputError

SCENARIOS = (
    *("incline", "ramp", "flight", "fall", "spring", "pendulum"),
    *("ramp", "incline", "liquid"),
)
PER_METRE = {"m": 1.0, "cm": 100.0, "mm": 1000.0, "in": 1 / 0.0254, "ft": 1 / 0.3048}
LAST_DIGITS = {"m": 4, "cm": 2, "mm": 1, "in": 3, "ft": 4}
TITLES = {
    "bare": ("t", "x{}", "y{}"),
    "English": ("t ({t})", "x{} ({u})", "y{} ({u})"),
    "brackets": ("time [{t}]", "X{} [{u}]", "Y{} [{u}]"),
    "German": ("Zeit in {t}", "x{} in {u}", "y{} in {u}"),
    "French": ("temps ({t})", "abscisse{} ({u})", "ordonnée{} ({u})"),
}
MARKS = ((";", ","), ("\t", ","), (",", "."), ("\t", "."), (";", "."))  # of cells, of decimals
FRAME_RATES, NOISE_M = (30.0, 60.0, 120.0), (2e-4, 1.5e-3)
FAR_SDS = 3.3  # one in a thousand
OF_START = ("start_velocity_x", "start_velocity_y", "start_speed", "start_angle", "rest")
SIGNED_BY_AXIS = ("start_speed", "start_angle", "rest")


def main(
    *, num: int = 70, first: int = 0, folder: Path = Path("build/foreign"), out: Path | None = None
) -> dict[str, Any]:
    journal = Journal(out)
    tables.row("table", ("verdict", "far off"))
    rows = []
    for index in range(first, first + num):
        row = journal.tried(f"table {index}", lambda index=index: _explained(folder, index))
        tables.row(f"{index} {row.get('what')}", (row.get("verdict"), " ".join(row.get("far", ()))))
        if said := row.get("refused") or row.get("error"):
            print(f"    {said}")
        rows.append(row)
    return {
        "tables": len(rows),
        "refused": sum("refused" in row for row in rows),
        "failed": sum(bool(row.get("error")) for row in rows),
        "far off": sum(bool(row.get("far")) for row in rows),
        "numbers": sum(len(row.get("numbers", ())) for row in rows),
        "something missing": sum(row.get("verdict") not in (None, "none") for row in rows),
    }


def _explained(folder: Path, index: int) -> dict[str, Any]:
    """What is found in a table, beside the truth."""
    own, path = folder / f"{index}_own.csv", folder / f"{index}.csv"
    folder.mkdir(parents=True, exist_ok=True)
    generator = np.random.default_rng([index, 77])
    scenario = SCENARIOS[index % len(SCENARIOS)]
    gx.simulate(
        own,
        scenario=scenario,
        seed=40_000 + index,
        fps=float(generator.choice(FRAME_RATES)),
        track_noise=float(np.exp(generator.uniform(*np.log(NOISE_M)))),
        track_only=True,
    )
    path.with_suffix(".yaml").unlink(missing_ok=True)
    unit, is_titled, is_trimmed = _write(own, path, generator, can_begin_later=scenario != "ramp")
    declared = yaml.safe_load(own.with_suffix(".yaml").read_text())
    told = {
        "ramp_angle": declared.get("ramp_angle_deg"),
        "track_units": None if is_titled else unit,
    }
    row: dict[str, Any] = {"what": f"{scenario} {unit}"}
    try:
        found = gx.explain(path, scenario=scenario, **told)
    except InputError as error:
        return row | {"refused": str(error)}
    truth = _truth(own.with_suffix(".truth.json"))
    numbers = {}
    for name, entry in (found.fit.parameters | found.fit.result["derived"]).items():
        if name in truth and entry["identified"] and not (is_trimmed and name in OF_START):
            sign = abs if name in SIGNED_BY_AXIS else float
            numbers[name] = (sign(entry["mean"]) - sign(truth[name])) / entry["sd"]
    verdict = found.diagnosis.verdict.status if found.diagnosis is not None else "none"
    far = [f"{name} {z:+.1f}" for name, z in numbers.items() if abs(z) > FAR_SDS]
    return row | {"verdict": verdict, "numbers": numbers, "far": far}


def _write(
    own: Path, path: Path, generator: np.random.Generator, *, can_begin_later: bool
) -> tuple[str, bool, bool]:
    """Writes a track as another program does: its unit, whether titles say so, rows left out."""
    track = np.genfromtxt(own, delimiter=",", names=True)
    names = [name.removesuffix("_x_m") for name in track.dtype.names or () if name.endswith("_x_m")]
    unit = str(generator.choice(list(PER_METRE)))
    titles = str(generator.choice(list(TITLES)))
    between, decimal = MARKS[int(generator.integers(len(MARKS)))]
    sign, shift = 1 - 2 * int(generator.integers(2)), 0.3 * generator.uniform(-1, 1, 2)
    begins_s, clock = float(generator.choice([0.0, 3.27])), str(generator.choice(["s", "ms"]))
    later = int(generator.choice([0, 3])) if can_begin_later else 0
    head = [TITLES[titles][0].format(t=clock)]
    columns = [(track["time_s"] + begins_s) * (1000 if clock == "ms" else 1)]
    for number, name in enumerate(names, start=1):
        suffix = number if len(names) > 1 else ""
        head += [title.format(suffix, u=unit) for title in TITLES[titles][1:]]
        place = np.array([track[f"{name}_x_m"], sign * track[f"{name}_y_m"]]) + shift[:, None]
        columns += list(place * PER_METRE[unit])
    digits = [1 if clock == "ms" else 4] + [LAST_DIGITS[unit]] * (len(columns) - 1)
    lines = [between.join(head)]
    for row in np.array(columns).T[later:]:
        cells = [
            "" if np.isnan(value) else f"{value:.{places}f}"
            for value, places in zip(row, digits, strict=True)
        ]
        lines.append(between.join(cell.replace(".", decimal) for cell in cells))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return unit, titles != "bare", later > 0


def _truth(path: Path) -> Mapping[str, float]:
    """The parameters of a simulated motion, by the names of a fit."""
    truth = json.loads(path.read_text())
    found = {**truth, **truth.get("parameters", {})}
    if "m2" in truth:
        found["mass_ratio"] = truth["m1"] / truth["m2"]
    return {name: found[name] for name in found if name not in ("m1", "m2", "gravity")}

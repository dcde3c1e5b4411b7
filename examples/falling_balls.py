"""Which of eleven dropped balls felt the air? One `galileo diagnose` for each, and a table.

    python examples/falling_balls.py ../shared/data/real/falling_balls.csv balls

Writes NAME.csv and NAME.yaml of every ball into the folder, fits it under gravity alone
(`galileo fit`), diagnoses it (`galileo diagnose`), and prints what was found: the rms error of
the height (m) of a free fall and nothing else, of `galileo fit`, which allows for a camera that
looks up besides, and with what the diagnosis added; by which factors the first two are larger.

Data: falling_balls.csv (ball, time_s, height_m), falling_balls.objects.csv beside it (ball,
mass_kg, radius_m); B. de Silva et al. (2020), Discovery of Physics From Data, Frontiers in
Artificial Intelligence 3, 25.
"""

import argparse
import csv
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import yaml
from scipy.optimize import minimize_scalar

import galileo_jax as gx
from galileo_jax.commands import command
from galileo_jax.results.run import Run, load_run
from galileo_jax.runtime.errors import InputError

AIR_KG_M3, G_M_S2 = 1.2, 9.81
SMOOTH_DEGREE = 5  # of a polynomial in time: gravity's 2, what drag adds, and the release
SLOWED = 0.6  # of the speed just before: the ball is no longer falling freely
MOST_LATE_S = 1.0  # of a release
COLUMNS = (
    "ball",
    "verdict",
    "effects",
    "free fall",
    "gravity",
    "after",
    "factors",
    "c kg/m",
    "Cd",
)


def main(argv: Sequence[str]) -> int | None:
    """Writes, fits, diagnoses and tabulates the balls."""
    parser = command.Parser(prog="falling_balls.py", description=__doc__)
    parser.add_argument("data", type=Path, metavar="CSV", help="ball, time_s, height_m")
    parser.add_argument("folder", type=Path, help="where tracks and results go")
    parser.add_argument("--ball", action="append", help="only this one (may be repeated)")
    call = parser.parse_args(argv)
    drops, objects = read_drops(call.data), read_objects(call.data)
    for name in call.ball or ():
        if name not in drops:
            raise InputError(f"--ball: unknown {name!r}; known: {', '.join(drops)}")
    rows = [study(name, drops[name], objects.get(name, {}), call) for name in call.ball or drops]
    print("\n" + "\n".join(_line(row) for row in [COLUMNS, *rows]))
    return None


def read_drops(path: Path) -> dict[str, np.ndarray]:
    """Name to `[reading, 2]`: time (s) and height (m)."""
    found: dict[str, list[tuple[float, float]]] = {}
    for row in _rows(path, ("ball", "time_s", "height_m")):
        found.setdefault(row["ball"], []).append((float(row["time_s"]), float(row["height_m"])))
    return {name: np.array(readings) for name, readings in found.items()}


def read_objects(path: Path) -> dict[str, dict[str, float]]:
    """Name to `mass_kg` and `radius_m`; what nobody measured is left out."""
    beside = path.with_name(f"{path.stem}.objects.csv")
    keys = ("mass_kg", "radius_m")
    return {
        row["ball"]: {key: float(row[key]) for key in keys if row[key]}
        for row in _rows(beside, ("ball", *keys))
    }


def without_the_stop(drop: np.ndarray) -> np.ndarray:
    """The readings without a last one at which the ball has suddenly lost half of its speed."""
    times_s, height_m = drop.T
    speed = -np.diff(height_m) / np.diff(times_s)
    is_stopped = speed[-1] < SLOWED * np.median(speed[-4:-1])
    return drop[:-1] if is_stopped else drop


def rmse_of_free_fall_m(drop: np.ndarray) -> float:
    """How far readings are from y0 - g (t - t0)^2 / 2, released when it suits them best, m."""
    times_s, height_m = drop.T

    def rmse(release_s: float) -> float:
        fallen = np.maximum(times_s - times_s[0] - release_s, 0.0)
        return float(np.sqrt(np.mean((height_m - height_m[0] + G_M_S2 * fallen**2 / 2) ** 2)))

    best = minimize_scalar(rmse, bounds=(0.0, MOST_LATE_S), method="bounded")
    return rmse(float(best.x))


def noise_m(drop: np.ndarray) -> float:
    """The standard deviation of one reading, m: the scatter about a smooth curve.

    Differences of neighbours would tell less: in these data many readings were filled in half
    way between two others.
    """
    times_s, height_m = drop.T
    smooth = np.polynomial.Polynomial.fit(times_s, height_m, SMOOTH_DEGREE)
    miss = height_m - smooth(times_s)
    return float(np.sqrt(np.sum(miss**2) / (len(miss) - SMOOTH_DEGREE - 1)))


def write_clip(folder: Path, name: str, drop: np.ndarray, known: Mapping[str, float]) -> Path:
    """Writes NAME.csv and NAME.yaml and returns the csv; y is up, 0 at the first reading."""
    sd_m, top_m = noise_m(drop), drop[0, 1]
    track = folder / f"{name}.csv"
    lines = ["time_s,object1_x_m,object1_y_m,object1_sd_m"]
    lines += [f"{t:.6f},0,{y - top_m:.6f},{sd_m:.4f}" for t, y in drop]
    track.write_text("\n".join(lines) + "\n", encoding="utf-8")
    ball: dict[str, object] = {"name": "object1", "shape": "sphere"}
    if "radius_m" in known:
        ball["size_m"] = [known["radius_m"]]
    if "mass_kg" in known:
        ball["mass_kg"] = known["mass_kg"]
    clip = {"track": track.name, "scenario": "fall", "objects": [ball]}
    track.with_suffix(".yaml").write_text(yaml.safe_dump(clip, sort_keys=False), encoding="utf-8")
    return track


def study(
    name: str, drop: np.ndarray, known: Mapping[str, float], call: argparse.Namespace
) -> tuple[str, ...]:
    """One ball's row of the table."""
    call.folder.mkdir(parents=True, exist_ok=True)
    drop = without_the_stop(drop)
    track = str(write_clip(call.folder, name, drop, known))
    gravity, found = call.folder / f"{name}.gravity", call.folder / f"{name}.diagnosis"
    fitted = gx.fit(track)
    fitted.save(gravity)
    diagnosis = gx.diagnose(track)
    diagnosis.save(found)
    print(f"\n{name}: {fitted!r}\n{diagnosis.rounds.to_string()}\n{diagnosis.sentence}")
    document = json.loads((found / "diagnosis.json").read_text(encoding="utf-8"))
    verdict = document["verdict"]
    before, after = rmse_m(load_run(gravity)), rmse_m(load_run(found / "model"))
    drag = next((c for c in document["candidates"] if c["effect"] == "air_drag"), None)
    shown = ("", "")
    if drag is not None and verdict["status"] != "none":
        constant = drag["parameters"]["air_drag"]
        shown = (f"{constant['mean']:.2g} +- {constant['sd']:.1g}", "")
        if "radius_m" in known and "mass_kg" in known:
            per_cd = AIR_KG_M3 * math.pi * known["radius_m"] ** 2 / 2
            shown = (shown[0], f"{constant['mean'] / per_cd:.2f}")
    effects = " | ".join(verdict["effects"]) or "-"
    alone = rmse_of_free_fall_m(drop)
    factors = f"{alone / after:.1f}, {before / after:.1f}"
    errors = (f"{alone:.3f}", f"{before:.3f}", f"{after:.3f}", factors)
    return (name, verdict["status"], effects, *errors, *shown)


def rmse_m(run: Run) -> float:
    """How far measured heights and those of the posterior's median are apart, m."""
    columns = [run.posterior.names.index(name) for name in run.problem.model.names]
    theta = np.median(run.posterior.flat(), axis=0)[columns]
    seen = run.problem.observation.mask[0]
    miss = (run.problem.observation.position_m - run.problem.simulate(theta))[0, 1, seen]
    return float(np.sqrt(np.mean(miss**2)))


def _rows(path: Path, columns: Sequence[str]) -> list[dict[str, str]]:
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    if not rows or set(columns) - set(rows[0]):
        raise InputError(f"{path}: columns {', '.join(columns)} expected")
    return rows


def _line(cells: Sequence[str]) -> str:
    widths = (20, 10, 28, 9, 8, 7, 11, 20, 5)
    return " ".join(f"{cell:<{width}}" for cell, width in zip(cells, widths, strict=True)).rstrip()


if __name__ == "__main__":
    raise SystemExit(command.run(main))

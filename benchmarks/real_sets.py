"""What is found in sets of many real measurements: rows of docs/explanation/real_data.md.

    python -m benchmarks real_sets FOLDER [--set NAME ...] [--first 0] [--flights 60] [--out OUT]

FOLDER: spin_flights/, cube_tosses/. A set that is absent is skipped, and a line says so. What is
made goes into OUT (default: thrown away). Single films and tables: `python -m benchmarks people`.
"""

import csv
import math
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import galileo_jax as gx
from galileo_jax.runtime.errors import InputError

FAST_RAD_S = 100.0  # spins that bend a flight
MOST_RAD_S = 1000.0  # spins above were hardly measured: such flights do not curve
POOR_CHI2 = 3.0  # per degree of freedom
MOST_AMONG = 3  # effects that explain a flight equally well
FLIGHT = """track: {file}
track_up: z
scenario: flight
objects:
  - {{name: object1, shape: sphere, size_m: [0.02], mass_kg: 0.0027}}
"""
CUBE = """track: {file}
track_up: z
scenario: toss
objects:
  - {{name: object1, shape: box, size_m: [0.1048, 0.1048, 0.1048], mass_kg: 0.37}}
"""
EVERY_TOSS, EVERY_FITTED, WINDOW_S = 5, 3, 0.1
PER_C_D = 0.6 * math.pi * 0.02**2  # kg/m: half the density of air times the ball's section
SHOWN = 6  # candidates


def main(
    folder: Path,
    *,
    set: tuple[str, ...] = (),
    first: int = 0,
    flights: int = 10_000,
    out: Path | None = None,
) -> dict[str, str]:
    found = {}
    with tempfile.TemporaryDirectory() as scratch:
        out = out or Path(scratch)
        chosen = slice(first, first + flights)
        for name in set or SETS:
            needed, row = SETS[name]
            if missing := [one for one in needed if not (folder / one).exists()]:
                found[name] = f"skipped; {', '.join(missing)} not in {folder}"
            else:
                (out / name).mkdir(parents=True, exist_ok=True)
                try:
                    found[name] = row(folder, out / name, chosen)
                except InputError as error:  # the other rows are made all the same
                    found[name] = f"refused; {error}"
            print(f"{name}: {found[name]}", flush=True)
    return found


def spin_flights(folder: Path, out: Path, flights: slice) -> str:
    """Rms before the bounce; spins as inferred by the curve alone against the measured."""
    before, after, chi2, drags, lifts, held, asked = [], [], {}, [], [], 0, 0
    for path, spin in _flights(folder, out, flights):
        plain = gx.fit(path, seed=0)
        found = gx.fit(path, effects=["air_drag", "magnus"], seed=0)
        before.append(_rms_mm(plain))
        after.append(_rms_mm(found))
        chi2[path.stem] = found.result["error"]["chi2_per_dof"]
        told = found.result["parameters"]
        drags.append(told["air_drag"]["mean"] / PER_C_D)
        lifts.append(told["magnus_lift"]["mean"])
        true = dict(zip("xyz", (spin[0], spin[2], -spin[1]), strict=True))
        for axis, value in true.items() if FAST_RAD_S < np.linalg.norm(spin) < MOST_RAD_S else ():
            one = told[f"magnus_{axis}"]
            held += one["q025"] <= value <= one["q975"]
            asked += 1
    poor = [f"{name} ({value:.1f})" for name, value in chi2.items() if value > POOR_CHI2]
    return (
        f"{len(before)} flights, rms {np.median(before):.1f} -> {np.median(after):.1f} mm, "
        f"chi2 {np.median(list(chi2.values())):.2f}, over {POOR_CHI2:g}: "
        f"{', '.join(poor) or 'none'}; "
        f"C_d {np.median(drags):.2f}, lift {np.median(lifts):.2f}; {held} of {asked} components of "
        f"spins from {FAST_RAD_S:g} to {MOST_RAD_S:g} rad/s in their 95 % intervals"
    )


def spin_named(folder: Path, out: Path, flights: slice) -> str:
    """Whether `diagnose` finds the spin of fast flights, which nobody tells it."""
    named, among, asked = 0, 0, 0
    for path, spin in _flights(folder, out, flights):
        if np.linalg.norm(spin) <= FAST_RAD_S:
            continue
        document = gx.diagnose(path, seed=0).document
        verdict, first = document["verdict"], document["candidates"][0]
        effects = verdict["effects"]
        has_spin = any("magnus" in one for one in effects)
        asked += 1
        named += verdict["status"] == "named" and has_spin
        among += verdict["status"] == "ambiguous" and has_spin and len(effects) <= MOST_AMONG
        print(
            f"spin_named: {path.stem}, {np.linalg.norm(spin):.0f} rad/s: {verdict['status']} "
            f"{', '.join(effects)}; first {_with_p(first)}",
            flush=True,
        )
    return (
        f"magnus named in {named}, among {MOST_AMONG} at most in {among} of {asked} flights over "
        f"{FAST_RAD_S:g} rad/s"
    )


def cube_tosses(folder: Path, out: Path, _: slice) -> str:
    """The joint fit of every third toss, and the second half of each from its first."""
    tables = sorted((folder / "cube_tosses").glob("*.csv"))[::EVERY_FITTED]
    found = joint_fit(tables, window=WINDOW_S, ahead=True)
    told = [
        f"{name} {one['mean']:.5f} [{one['q025']:.5f}, {one['q975']:.5f}]"
        for name, one in found.parameters.items()
    ]
    rms = np.percentile(found.solution.rms, [25, 50, 75, 100]).round(2)
    second = found.document["second_half"]
    return (
        f"{len(found.solution.names)} tosses; {'; '.join(told)}; rms of whitened residuals (1 mm, "
        f"1 degree) {', '.join(map(str, rms))} (quartiles, largest); second half off by "
        f"{second['median_place_over_edge']:.1%} of the edge and "
        f"{second['median_turn_deg']:.1f} degrees"
    )


def joint_fit(tables: Sequence[Path], **options: Any) -> gx.TossFit:
    """`gx.fit_tosses` of tables of poses, with its options."""
    with tempfile.TemporaryDirectory() as folder:
        return gx.fit_tosses([_declared(one, Path(folder), CUBE) for one in tables], **options)


def cube_falls(folder: Path, out: Path, _: slice) -> str:
    """What `diagnose` says of the free flights of some tosses, as trials of one cube."""
    tables = sorted((folder / "cube_tosses").glob("*.csv"))[::EVERY_TOSS]
    found = gx.diagnose([_declared(table, out, CUBE) for table in tables], seed=0)
    leading = "; ".join(
        f"{_with_p(one)}, probability {one['probability']:.3f}, log odds {one['score']:.1f}"
        for one in found.document["candidates"][:SHOWN]
    )
    advice = found.document["verdict"].get("advice", ())
    status, p_value = found.document["verdict"]["status"], found.document["p_value"]
    return f"{len(tables)} flights: {status} (p {p_value:.2g} without effects); {leading}; " + (
        " ".join(map(str, advice))
    )


Row = Callable[[Path, Path, slice], str]
SETS: dict[str, tuple[tuple[str, ...], Row]] = {
    "spin_flights": (("spin_flights/index.csv",), spin_flights),
    "spin_named": (("spin_flights/index.csv",), spin_named),
    "cube_falls": (("cube_tosses",), cube_falls),
    "cube_tosses": (("cube_tosses",), cube_tosses),
}


def _declared(file: Path, out: Path, yaml: str) -> Path:
    """The yaml of a copy of a video or table."""
    copy = shutil.copy(file, out / file.name)
    path = Path(copy).with_suffix(".yaml")
    path.write_text(yaml.format(file=file.name))
    return path


def _flights(folder: Path, out: Path, chosen: slice) -> Iterator[tuple[Path, np.ndarray]]:
    """The yaml of each flight that can be read, and its measured spin in the file's axes."""
    rows = list(csv.DictReader((folder / "spin_flights" / "index.csv").open()))
    files = [folder / "spin_flights" / f"{int(row['traj_file']):03d}.csv" for row in rows]
    there = [(file, row) for file, row in zip(files, rows, strict=True) if file.is_file()]
    for file, row in there[chosen]:
        path = _declared(file, out, FLIGHT)
        try:
            gx.load(path)
        except InputError as error:
            print(error)
            continue
        yield path, np.array([float(row[f"{axis}_spin"]) for axis in "xyz"])


def _rms_mm(found: gx.Fit) -> float:
    """Of the distance between measured and fitted places, up to a constant offset."""
    (problem,) = found.problem.problems
    theta = found.problem.of_clip(found.problem.theta(np.asarray(found.z_best)), 0)
    left = problem.observation.position_m[0] - problem.simulate(np.asarray(theta))[0]
    left = left[:, problem.observation.mask[0]]
    left = left - left.mean(axis=1, keepdims=True)
    return 1e3 * float(np.sqrt(np.mean(np.sum(left**2, axis=0))))


def _with_p(candidate: dict[str, Any]) -> str:
    p = candidate["p_value"]
    return f"{candidate['effect']} (p {'not asked' if p is None else format(p, '.2g')})"

"""All rows of docs/explanation/real_data.md, from the real measurements in one folder.

    python -m benchmarks real_sets FOLDER [--set NAME ...] [--first 0] [--flights 60] [--out OUT]

FOLDER: falling_balls.csv, ball_toss.yaml, slide_r1.yaml, slide_r2.yaml, projectile_45.mp4,
spin_flights/, puck_head_on.mp4, cube_tosses/. A set that is absent, or that the program has no
scenario for, is skipped, and a line says so. What is made goes into OUT (default: thrown away).
"""

import argparse
import csv
import math
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import galileo_jax as gx
from galileo_jax.runtime.errors import InputError

FAST_RAD_S = 100.0  # spins that bend a flight
MOST_RAD_S = 1000.0  # spins above were hardly measured: such flights do not curve
POOR_CHI2 = 3.0  # per degree of freedom
MOST_AMONG = 3  # effects that explain a flight equally well
EVERY_FLIGHT = 10_000
PROJECTILE = """video: {video}
scenario: flight
fps: 240.0
pixels_per_metre: null
launch_angle_deg: 45.0
objects:
  - {{name: object1, shape: sphere, size_m: null, point_px: [48.5, 67.5], first_frame: 180}}
"""
FLIGHT = """track: {track}
track_up: z
scenario: flight
objects:
  - {{name: object1, shape: sphere, size_m: [0.02], mass_kg: 0.0027}}
"""


PUCKS = """video: {video}
scenario: from_above
fps: 240.0
pixels_per_metre: null
objects:
  - {{name: object1, shape: cylinder, size_m: null, point_px: [79.8, 72.0], first_frame: 168}}
  - {{name: object2, shape: cylinder, size_m: null, point_px: [150.3, 86.1], first_frame: 168}}
"""
CUBE = """track: {track}
track_up: z
scenario: toss
objects:
  - {{name: object1, shape: box, size_m: [0.1048, 0.1048, 0.1048], mass_kg: 0.37}}
"""
EVERY_TOSS = 5
SHOWN = 6  # candidates
BESIDE_HIT = 14  # frames on either side of a hit through which velocities are laid


def main() -> None:
    """Prints the rows."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--set", choices=SETS, nargs="+", default=list(SETS))
    parser.add_argument("--first", type=int, default=0, help="flight of spin_flights")
    parser.add_argument("--flights", type=int, default=EVERY_FLIGHT)
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        out = asked.out or Path(scratch)
        flights = slice(asked.first, asked.first + asked.flights)
        for name in asked.set:
            needed, row = SETS[name]
            if missing := [one for one in needed if not (asked.folder / one).exists()]:
                print(f"{name}: skipped; {', '.join(missing)} not in {asked.folder}", flush=True)
                continue
            (out / name).mkdir(parents=True, exist_ok=True)
            try:
                told = row(asked.folder, out / name, flights)
            except InputError as error:  # the other rows are made all the same
                told = f"refused; {error}"
            print(f"{name}: {told}", flush=True)


def falling_balls(folder: Path, out: Path, _: slice) -> str:
    """The example's own table."""
    script = Path(__file__).parents[1] / "examples" / "falling_balls.py"
    call = [sys.executable, str(script), str(folder / "falling_balls.csv"), str(out)]
    subprocess.run(call, check=True)
    return "see the table above"


def ball_toss(folder: Path, out: Path, _: slice) -> str:
    """What is wrong with the scale of the tossed ball?"""
    return _verdict(gx.diagnose(folder / "ball_toss.yaml"))


def slides(folder: Path, out: Path, _: slice) -> str:
    """Friction and scale of the board, from both runs."""
    found = gx.fit([folder / "slide_r1.yaml", folder / "slide_r2.yaml"])
    told = [_estimate(found, name) for name in ("k1", "pixels_per_metre")]
    speeds = [f"{name} {share:.1%}" for name, share in _speed_errors(found).items()]
    cuts = [str(cut) for one in found.measurements for cut in one.cuts]
    return f"{'; '.join(told)}; {_error(found)}; speeds off by {', '.join(speeds)} (rms); " + (
        "; ".join(cuts)
    )


def projectile(folder: Path, out: Path, _: slice) -> str:
    """The launch speed, from the clip alone."""
    path = out / "projectile_45.yaml"
    video = out / "projectile_45.mp4"
    video.write_bytes((folder / "projectile_45.mp4").read_bytes())
    path.write_text(PROJECTILE.format(video=video.name))
    found = gx.fit(path)
    told = [_estimate(found, name) for name in ("launch_speed", "pixels_per_metre")]
    return f"{'; '.join(told)}; {_error(found)}"


def spin_flights(folder: Path, out: Path, flights: slice) -> str:
    """Rms before the bounce; spins as inferred by the curve alone against the measured."""
    before, after, chi2, drags, lifts, skipped, held, asked = [], [], {}, [], [], [], 0, 0
    for path, spin in _flights(folder / "spin_flights", out)[flights]:
        try:
            plain = gx.fit(path, seed=0)
            found = gx.fit(path, effects=["air_drag", "magnus"], seed=0)
        except InputError as error:
            skipped.append(str(error))
            continue
        before.append(_rms_mm(plain))
        after.append(_rms_mm(found))
        chi2[path.stem] = found.result["error"]["chi2_per_dof"]
        told = found.result["parameters"]
        drags.append(told["air_drag"]["mean"] / (0.6 * math.pi * 0.02**2))
        lifts.append(told["magnus_lift"]["mean"])
        true = dict(zip("xyz", (spin[0], spin[2], -spin[1]), strict=True))
        for axis, value in true.items() if FAST_RAD_S < np.linalg.norm(spin) < MOST_RAD_S else ():
            one = told[f"magnus_{axis}"]
            held += one["q025"] <= value <= one["q975"]
            asked += 1
    for line in skipped:
        print(f"spin_flights: {line}")
    poor = [f"{name} ({value:.1f})" for name, value in chi2.items() if value > POOR_CHI2]
    return (
        f"{len(before)} flights, rms {np.median(before):.1f} -> {np.median(after):.1f} mm, "
        f"chi2 {np.median(list(chi2.values())):.2f}, over {POOR_CHI2:g}: "
        f"{', '.join(poor) or 'none'}; "
        f"C_d {np.median(drags):.2f}, lift {np.median(lifts):.2f}; {held} of {asked} components of "
        f"spins from {FAST_RAD_S:g} to {MOST_RAD_S:g} rad/s in their 95 % intervals; "
        f"{len(skipped)} not read"
    )


def spin_told(folder: Path, out: Path, flights: slice) -> str:
    """Drag and lift of the ball from flights together, their measured spins told."""
    paths = []
    for path, spin in _flights(folder / "spin_flights", out)[flights]:
        if np.linalg.norm(spin) < MOST_RAD_S:
            try:
                gx.load(path)
            except InputError as error:
                print(f"spin_told: {error}")
                continue
            told = ", ".join(f"{value:.1f}" for value in spin)
            text = path.read_text().replace("0.0027", f"0.0027, spin_rad_s: [{told}]")
            path.write_text(text)
            paths.append(path)
    found = gx.fit(paths, effects=["air_drag", "magnus"], seed=0)
    drag = found.result["parameters"]["air_drag"]
    area = 0.6 * math.pi * 0.02**2
    return (
        f"{len(paths)} flights together; {_estimate(found, 'magnus_lift')}; C_d "
        f"{drag['mean'] / area:.3f} [{drag['q025'] / area:.3f}, {drag['q975'] / area:.3f}]; "
        f"{_error(found)}"
    )


def spin_named(folder: Path, out: Path, flights: slice) -> str:
    """Whether `diagnose` finds the spin of fast flights, which nobody tells it."""
    named, among, asked = 0, 0, 0
    for path, spin in _flights(folder / "spin_flights", out)[flights]:
        if np.linalg.norm(spin) <= FAST_RAD_S:
            continue
        try:
            document = gx.diagnose(path, seed=0).document
        except InputError as error:
            print(f"spin_named: {error}")
            continue
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
    """Why the cube falls at 9.63 m/s^2, and what its impacts tell."""
    poses = str(folder / "cube_tosses")
    for call in (["cube_impacts.py", poses], ["cube_tosses.py", poses, "--fit"]):
        script = Path(__file__).with_name(call[0])
        subprocess.run([sys.executable, str(script), *call[1:]], check=True)
    return "see the lines above"


def cube_falls(folder: Path, out: Path, _: slice) -> str:
    """What `diagnose` says of the free flights of some tosses, as trials of one cube."""
    paths = []
    for table in sorted((folder / "cube_tosses").glob("*.csv"))[::EVERY_TOSS]:
        (out / table.name).write_bytes(table.read_bytes())
        paths.append((out / table.name).with_suffix(".yaml"))
        paths[-1].write_text(CUBE.format(track=table.name))
    found = gx.diagnose(paths, seed=0)
    leading = "; ".join(
        f"{_with_p(one)}, probability {one['probability']:.3f}, log odds {one['score']:.1f}"
        for one in found.document["candidates"][:SHOWN]
    )
    advice = found.document["verdict"].get("advice", ())
    status, p_value = found.document["verdict"]["status"], found.document["p_value"]
    return f"{len(paths)} flights: {status} (p {p_value:.2g} without effects); {leading}; " + (
        " ".join(map(str, advice))
    )


def puck_head_on(folder: Path, out: Path, _: slice) -> str:
    """Restitution, friction in radii and mass ratio; momentum before and after, by the track."""
    video = out / "puck_head_on.mp4"
    video.write_bytes((folder / video.name).read_bytes())
    path = video.with_suffix(".yaml")
    path.write_text(PUCKS.format(video=video.name))
    found = gx.fit(path)
    names = ("restitution", "mass_ratio", "deceleration1", "deceleration2")
    share, sd = _momentum_after(found)
    return (
        f"{'; '.join(_estimate(found, name) for name in names)}; {_error(found)}; momentum after "
        f"the hit over that before, of equal masses: along {share[0]:.3f} +- {sd[0]:.3f}, across "
        f"{share[1]:.3f} +- {sd[1]:.3f}"
    )


def _momentum_after(found: gx.Fit) -> tuple[np.ndarray, np.ndarray]:
    """Along the first puck's way and across it, as a share of its momentum, and the sd of both.

    From velocities at the hit by parabolas through the frames before and after it, errors from
    what these leave: no part of the model's.
    """
    seen = found.problem.problems[0].observation
    times, place = seen.times_s, seen.position_m[:, :2]
    both = seen.mask.all(axis=0)
    apart = np.where(both, np.linalg.norm(place[1] - place[0], axis=0), np.inf)
    hit = int(np.argmin(apart))
    before = np.arange(hit - BESIDE_HIT - 1, hit - 1)
    after = np.arange(hit + 2, hit + 2 + BESIDE_HIT)
    first, var = _velocity(times, place[0], before, times[hit])
    ahead, var1 = _velocity(times, place[0], after, times[hit])
    struck, var2 = _velocity(times, place[1], after, times[hit])
    along = first / np.linalg.norm(first)
    axes = np.stack([along, [-along[1], along[0]]])
    size = float(np.linalg.norm(first))
    return axes @ (ahead + struck) / size, np.full(2, math.sqrt(var + var1 + var2) / size)


def _velocity(
    times: np.ndarray, place: np.ndarray, frames: np.ndarray, at_s: float
) -> tuple[np.ndarray, float]:
    """At a time, m/s, and the variance of either component."""
    since = times[frames] - at_s
    design = np.vander(since, 3)
    solution = np.linalg.lstsq(design, place[:, frames].T, rcond=None)[0]
    left = place[:, frames].T - design @ solution
    variance = float(np.sum(left**2)) / (2 * (len(frames) - 3))
    return solution[1], variance * float(np.linalg.inv(design.T @ design)[1, 1])


def no_scenario(folder: Path, out: Path, _: slice) -> str:
    """Nothing yet."""
    return "skipped; the program has no scenario for it yet"


Row = Callable[[Path, Path, slice], str]
SETS: dict[str, tuple[tuple[str, ...], Row]] = {
    "falling_balls": (("falling_balls.csv", "falling_balls.objects.csv"), falling_balls),
    "ball_toss": (("ball_toss.yaml", "ball_toss.mp4"), ball_toss),
    "slides": (("slide_r1.yaml", "slide_r2.yaml"), slides),
    "projectile": (("projectile_45.mp4",), projectile),
    "spin_flights": (("spin_flights/index.csv",), spin_flights),
    "spin_told": (("spin_flights/index.csv",), spin_told),
    "spin_named": (("spin_flights/index.csv",), spin_named),
    "puck_head_on": (("puck_head_on.mp4",), puck_head_on),
    "cube_falls": (("cube_tosses",), cube_falls),
    "cube_tosses": (("cube_tosses",), cube_tosses),
}


def _flights(folder: Path, out: Path) -> list[tuple[Path, np.ndarray]]:
    """A yaml for each flight, and its measured spin in the file's axes."""
    found = []
    for row in csv.DictReader((folder / "index.csv").open()):
        track = folder / f"{int(row['traj_file']):03d}.csv"
        if track.is_file():
            (out / track.name).write_bytes(track.read_bytes())
            path = (out / track.name).with_suffix(".yaml")
            path.write_text(FLIGHT.format(track=track.name))
            found.append((path, np.array([float(row[f"{axis}_spin"]) for axis in "xyz"])))
    return found


def _residual_m(found: gx.Fit, clip: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times `[frame]`, and measured and fitted places `[axis, frame]` where it was seen, m."""
    problem = found.problem.problems[clip]
    theta = found.problem.of_clip(found.problem.theta(np.asarray(found.z_best)), clip)
    seen = problem.observation.mask[0]
    places = problem.observation.position_m[0], problem.simulate(np.asarray(theta))[0]
    return problem.observation.times_s[seen], places[0][:, seen], places[1][:, seen]


def _rms_mm(found: gx.Fit) -> float:
    """Of the distance, up to a constant offset."""
    _, measured, fitted = _residual_m(found)
    left = measured - fitted
    left = left - left.mean(axis=1, keepdims=True)
    return 1e3 * float(np.sqrt(np.mean(np.sum(left**2, axis=0))))


def _speed_errors(found: gx.Fit, frames: int = 24) -> dict[str, float]:
    """Of each clip the rms error of the speed over a tenth of a second, as a share of its mean."""
    errors = {}
    for clip, one in enumerate(found.measurements):
        times, *places = _residual_m(found, clip)
        lasted = times[frames:] - times[:-frames]
        seen, told = (
            np.linalg.norm(place[:, frames:] - place[:, :-frames], axis=0) / lasted
            for place in places
        )
        moves = seen > 0.2 * seen.max()
        errors[one.name] = float(np.sqrt(np.mean((told / seen - 1)[moves] ** 2)))
    return errors


def _estimate(found: gx.Fit, name: str) -> str:
    told = {**found.result["parameters"], **found.result["derived"]}[name]
    return f"{name} {told['mean']:.4g} [{told['q025']:.4g}, {told['q975']:.4g}] {told['unit']}"


def _error(found: gx.Fit) -> str:
    error: dict[str, Any] = found.result["error"]
    return f"chi2 per degree of freedom {error['chi2_per_dof']:.2f}"


def _with_p(candidate: dict[str, Any]) -> str:
    p = candidate["p_value"]
    return f"{candidate['effect']} (p {'not asked' if p is None else format(p, '.2g')})"


def _verdict(found: gx.Diagnosis) -> str:
    verdict, history = found.document["verdict"], found.document["history"]
    return (
        f"{verdict['status']} {', '.join(verdict['effects'])}; chi2 per degree of freedom "
        f"{history[0]['chi2_per_dof']:.2f} -> {history[-1]['chi2_per_dof']:.2f}"
    )

"""A cube that is thrown onto a board: why it falls at 9.63 m/s^2, and what its impacts tell.

    python -m benchmarks cube_tosses ../shared/data/real/cube_tosses [--fit] [--every 3]

FOLDER has one csv of poses per toss. Without --fit only what the poses say by themselves: gravity
of parabolas through the flights, with what else might bend them, and how high the centre is where
the cube touches, against how it is turned. With --fit the joint fit of every so-manieth toss, and
the second half of each from its first.
"""

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

import galileo_jax as gx
from galileo_jax.clip.poses_csv import read_poses_csv
from galileo_jax.measurement.toss_flight import Flight, flight_of
from galileo_jax.observation.poses import Poses

EDGE_M, GRAVITY = 0.1048, 9.81  # as published
FEWEST = 12  # frames: of shorter flights the acceleration is not known
FACE = 1.1  # of the cube's height over its edge: what lies flat on a face, and what does not
YAML = """track: {track}
track_up: z
scenario: toss
objects:
  - {{name: object1, shape: box, size_m: [0.1048, 0.1048, 0.1048], mass_kg: 0.37}}
"""


def main() -> None:
    """Prints the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--fit", action="store_true", help="fit the tosses, too (minutes)")
    parser.add_argument("--every", type=int, default=3, help="of --fit: every so-manieth toss")
    parser.add_argument("--window", type=float, default=0.1, help="of --fit: s after the impact")
    call = parser.parse_args()
    tables = sorted(call.folder.glob("*.csv"))
    tosses = [read_poses_csv(table, "z", EDGE_M) for table in tables]
    flights = [(one, flight_of(one, np.full(3, EDGE_M))) for one in tosses]
    flown = [(one, flight) for one, flight in flights if flight and flight.last >= FEWEST - 1]
    falls(flown)
    geometry(tosses)
    if call.fit:
        fit(tables[:: call.every], call.window)


def falls(flown: list[tuple[Poses, Flight]]) -> None:
    """What bends the flights: gravity, drag, a point that is not the centre, the poses' frame."""
    g = np.array([-flight.acceleration_m_s2[2] for _, flight in flown])
    print(f"{len(flown)} flights of {FEWEST} frames or more")
    print("gravity of parabolas:", *np.percentile(g, [25, 50, 75]).round(3), "m/s^2 (quartiles)")
    speeds = [np.linalg.norm(flight.velocity_m_s) for _, flight in flown]
    climbs = [flight.velocity_m_s[2] for _, flight in flown]
    spins = [np.linalg.norm(flight.spin_rad_s) for _, flight in flown]
    for name, values in (("speed", speeds), ("vertical speed", climbs), ("spin", spins)):
        told, sd = _slope(np.array(values), g)
        print(f"  per {name}: {told:+.3f} +- {sd:.3f}")
    print("all flights together; rms, mm, and coefficients with errors from the tosses' scatter")
    for name, extras in (
        ("gravity", []),
        ("and a point off the centre (m)", [_offset]),
        ("and drag, 1/s", [_drag]),
        ("and spin x velocity", [_magnus]),
        ("and up x velocity, 1/s", [_across]),
        ("and third power of time, m/s^3", [_jerk]),
    ):
        rms, told, sd = _together(flown, extras)
        shown = "  ".join(f"{a:+.4f} +- {b:.4f}" for a, b in zip(told, sd, strict=True))
        print(f"  {name:<32} {1e3 * rms:.4f}  {shown}")


def geometry(tosses: list[Poses]) -> None:
    """How high the centre is where the cube touches, against how it is turned.

    Of a sharp cube: floor + edge / 2 * h, h from 1 (on a face) to sqrt 3 (on a corner).
    """
    high = np.concatenate([one.position_m[:, 2] for one in tosses])
    turned = np.concatenate([_height(one) for one in tosses])
    rest = np.array([np.median(one.position_m[-5:, 2]) for one in tosses])
    print(f"at rest the centre is {1e3 * np.median(rest):.2f} mm high (sd {1e3 * rest.std():.2f})")
    share, sd = 2 * np.median(rest) / EDGE_M, 2 * rest.std() / EDGE_M / np.sqrt(len(rest))
    print(f"  over half of the published edge: {share:.4f} +- {sd:.4f}")
    tipped = turned > FACE
    for share in (0.01, 0.02, 0.05):
        floor, half = _lower_line(turned[tipped], high[tipped], share)
        print(
            f"  on edges and corners, {share:.0%} line: floor {1e3 * floor:+.2f} mm, "
            f"half edge {1e3 * half:.2f} mm; so a face would be at {1e3 * (floor + half):.2f} mm"
        )


def fit(tables: list[Path], window: float) -> None:
    """The joint fit, and the second halves."""
    found = joint_fit(tables, window=window, ahead=True)
    print(f"joint fit of {len(found.solution.names)} tosses, {window:g} s after the impact")
    for name, told in found.parameters.items():
        print(f"  {name:<12} {told['mean']:.5f} [{told['q025']:.5f}, {told['q975']:.5f}]")
    print("  rms of whitened residuals (1 mm, 1 degree):", end=" ")
    print(*np.percentile(found.solution.rms, [25, 50, 75, 100]).round(2), "(quartiles, largest)")
    second = found.document["second_half"]
    place, turn = 100 * second["median_place_over_edge"], second["median_turn_deg"]
    print(f"  second half from the first: {place:.1f} % of the edge, {turn:.1f} degrees (medians)")


def joint_fit(tables: Sequence[Path], **options: Any) -> gx.TossFit:
    """`gx.fit_tosses` of tables of poses, with its options."""
    with tempfile.TemporaryDirectory() as folder:
        clips = []
        for table in tables:
            clip = Path(folder) / f"{table.stem}.yaml"
            clip.write_text(YAML.format(track=table.resolve()))
            clips.append(clip)
        return gx.fit_tosses(clips, **options)


def _height(poses: Poses) -> np.ndarray:
    turned = Rotation.from_quat(poses.quaternion, scalar_first=True).as_matrix()
    return np.abs(turned[:, 2]).sum(axis=1)


def _lower_line(x: np.ndarray, y: np.ndarray, share: float) -> tuple[float, float]:
    """The line below which a share of the points is (quantile regression)."""
    count = len(x)
    weights = np.concatenate([[0, 0], np.full(count, share), np.full(count, 1 - share)])
    design = np.column_stack([np.ones(count), x, np.eye(count), -np.eye(count)])
    bounds = [(None, None)] * 2 + [(0, None)] * (2 * count)
    found = linprog(weights, A_eq=design, b_eq=y, bounds=bounds, method="highs").x
    return float(found[0]), float(found[1])


def _slope(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    told, covariance = np.polyfit(x - x.mean(), y, 1, cov=True)
    return float(told[0]), float(np.sqrt(covariance[0, 0]))


def _together(flown, extras) -> tuple[float, np.ndarray, np.ndarray]:
    """One gravity (vector) and more for all flights, each with its own start."""
    blocks = []
    for poses, flight in flown:
        use = slice(0, flight.last + 1)
        time = poses.times_s[use] - poses.times_s[use].mean()
        own = np.kron(np.stack([np.ones_like(time), time], axis=1), np.eye(3))
        shared = [np.kron((time**2 / 2)[:, None], np.eye(3))]
        shared += [extra(time, poses, flight).reshape(3 * len(time), -1) for extra in extras]
        left, _ = np.linalg.qr(own)
        design, place = np.column_stack(shared), poses.position_m[use].reshape(-1)
        blocks.append((design - left @ (left.T @ design), place - left @ (left.T @ place)))
    design, place = np.concatenate([b[0] for b in blocks]), np.concatenate([b[1] for b in blocks])
    told = np.linalg.lstsq(design, place)[0]
    count = len(place) - 6 * len(blocks) - len(told)
    rms = float(np.sqrt(np.sum((place - design @ told) ** 2) / count))
    bread = np.linalg.inv(design.T @ design)
    scores = np.array([one.T @ (seen - one @ told) for one, seen in blocks])
    return rms, told, np.sqrt(np.diag(bread @ scores.T @ scores @ bread))


def _offset(time: np.ndarray, poses: Poses, flight: Flight) -> np.ndarray:
    turned = Rotation.from_quat(poses.quaternion[: len(time)], scalar_first=True)
    return turned.as_matrix()


def _middle_velocity(time: np.ndarray, flight: Flight) -> np.ndarray:
    return flight.velocity_m_s + flight.acceleration_m_s2 * np.ptp(time) / 2


def _drag(time: np.ndarray, poses: Poses, flight: Flight) -> np.ndarray:
    bend = np.outer(time**2 / 2, -_middle_velocity(time, flight))
    return bend - np.outer(time**3 / 6, flight.acceleration_m_s2)


def _magnus(time: np.ndarray, poses: Poses, flight: Flight) -> np.ndarray:
    return np.outer(time**2 / 2, np.cross(flight.spin_rad_s, _middle_velocity(time, flight)))


def _across(time: np.ndarray, poses: Poses, flight: Flight) -> np.ndarray:
    return np.outer(time**2 / 2, np.cross([0, 0, 1], _middle_velocity(time, flight)))


def _jerk(time: np.ndarray, poses: Poses, flight: Flight) -> np.ndarray:
    return np.outer(time**3 / 6, [0, 0, 1])

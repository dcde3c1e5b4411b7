"""What single impacts of a cube's corners say without a law of impact.

    python benchmarks/cube_impacts.py ../shared/data/real/cube_tosses

Between two impacts the middle of the cube runs along a parabola and the cube turns evenly (five
frames or more on either side). What velocity and spin jump by is the impulse and its moment,

    K dw = r x dv,    r from the centre of mass to the corner, K = inertia / mass,

and this tells where the centre of mass is and K, by least squares over all impacts; with these, the
corner's own velocities before and after give restitution and friction one impact at a time.
"""

import argparse
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from galileo_jax.clip.poses_csv import read_poses_csv
from galileo_jax.observation.poses import Poses

EDGE_M, G = 0.979 * 0.1048, np.array([0, 0, -9.607])  # in the track's metres: see cube_tosses.py
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2
KICK_M_S, FEWEST = 0.1, 5  # of an impact, from frame to frame; frames of a flight
ALONE_M, TOGETHER_M, TURNED_RAD = 0.012, 4e-4, 0.01  # of other corners; of both flights at the hit
ROUND_M = 0.0047  # of the corners, as their heights at impacts say (last lines)
FAST_M_S = 0.5  # slower ones last for frames


class Impact(NamedTuple):
    """One: the cube at it, velocities and spins of its middle before and after."""

    place: np.ndarray
    turned: Rotation
    velocity: np.ndarray
    spin: np.ndarray


def main() -> None:
    """Prints the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folder", type=Path)
    tables = sorted(parser.parse_args().folder.glob("*.csv"))
    found = [one for table in tables for one in impacts(read_poses_csv(table, "z"))]
    found = [one for one in found if alone(one)]
    fitted = least_squares(
        lambda x: left_over(x, found), [0.25, 0, 0, 0], loss="soft_l1", f_scale=0.4
    )
    sd = np.sqrt(
        np.diag(np.linalg.inv(fitted.jac.T @ fitted.jac)) * 2 * fitted.cost / len(fitted.fun)
    )
    print(f"{len(found)} impacts of one corner")
    print(f"inertia / (m edge^2) {fitted.x[0]:.3f} +- {sd[0]:.3f}")
    for axis, value, error in zip("xyz", 1e3 * fitted.x[1:], 1e3 * sd[1:], strict=True):
        print(f"centre of mass from the middle, {axis}: {value:+.2f} +- {error:.2f} mm")
    table = np.array([bounce(one, fitted.x[1:]) for one in found])
    fast = table[table[:, 0] < -FAST_M_S]
    print(f"{len(fast)} faster than {FAST_M_S:g} m/s; quartiles")
    for name, column in (("restitution", 1), ("friction", 2)):
        print(f"  {name:<12}", *np.percentile(fast[:, column], [25, 50, 75]).round(3))
    design = np.stack([np.ones(len(fast)), -fast[:, 3], fast[:, 0]], axis=1)
    told = np.linalg.lstsq(design, fast[:, 4])[0]
    scatter = np.std(fast[:, 4] - design @ told)
    errors = scatter * np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    for name, value, error in zip(
        ("board, mm", "rounding, mm", "half the contact's time, ms"), told, errors, strict=True
    ):
        print(f"  {name:<28} {1e3 * value:.2f} +- {1e3 * error:.2f}")


def impacts(poses: Poses) -> list[Impact]:
    """The impacts with flights on both sides."""
    times, place = poses.times_s, poses.position_m
    turned = Rotation.from_quat(poses.quaternion, scalar_first=True)
    velocity = np.diff(place, axis=0) / np.diff(times)[:, None]
    kicks = np.linalg.norm(np.diff(velocity, axis=0) - G * np.diff(times)[1:, None], axis=1)
    kicked = np.flatnonzero(kicks > KICK_M_S) + 1
    groups = [list(g) for g in np.split(kicked, np.flatnonzero(np.diff(kicked) > 1) + 1) if len(g)]
    found = []
    for last, this, following in zip([[-1], *groups], groups, groups[1:], strict=False):
        one = len(this) == 1
        before = slice(last[-1] + 1, this[0] + (0 if one else 1))
        after = slice(this[-1] + (1 if one else 0), following[0])
        if len(this) > 2 or min(len(times[before]), len(times[after])) < FEWEST:
            continue
        at = times[this[0]]
        for _ in range(3):
            first, second = (
                _flight(times[part] - at, place[part], turned[part]) for part in (before, after)
            )
            jump, apart = second[1] - first[1], second[0] - first[0]
            shift = -(apart @ jump) / (jump @ jump)
            at += shift
        turn = (second[2] * first[2].inv()).as_rotvec()
        near = np.linalg.norm(apart) < TOGETHER_M and np.linalg.norm(turn) < TURNED_RAD
        if near and abs(at - times[this[0]]) < 1.1 * np.diff(times)[0]:
            velocities, spins = (np.array([first[i], second[i]]) for i in (1, 3))
            middle = Rotation.from_rotvec(turn / 2) * first[2]
            found.append(Impact((first[0] + second[0]) / 2, middle, velocities, spins))
    return found


def _flight(times: np.ndarray, place: np.ndarray, turned: Rotation):
    """Place, velocity, turning and spin at time 0."""
    design = np.stack([np.ones_like(times), times], axis=1)
    told = np.linalg.lstsq(design, place - 0.5 * times[:, None] ** 2 * G)[0]
    middle = turned[len(times) // 2]
    turning = np.linalg.lstsq(design, (turned * middle.inv()).as_rotvec())[0]
    return told[0], told[1], Rotation.from_rotvec(turning[0]) * middle, turning[1]


def alone(one: Impact) -> bool:
    """Whether one corner is the lowest by far."""
    low = np.sort(one.turned.apply(CORNERS * EDGE_M)[:, 2])
    return low[1] - low[0] > ALONE_M


def left_over(x: np.ndarray, found: list[Impact]) -> np.ndarray:
    """The equation's two sides, over a quarter of the edge squared: rad/s."""
    sides = []
    for one in found:
        lever, velocity = _corner(one, x[1:])
        jump = np.diff(one.spin, axis=0)[0]
        sides.append(4 * (x[0] * jump - np.cross(lever, np.diff(velocity, axis=0)[0]) / EDGE_M**2))
    return np.ravel(sides)


def _corner(one: Impact, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The lowest corner from the centre of mass, and the latter's velocities."""
    corners = one.turned.apply(CORNERS * (EDGE_M - 2 * ROUND_M) - centre)
    off = one.turned.apply(centre)
    return corners[np.argmin(corners[:, 2])] - [0, 0, ROUND_M], one.velocity + np.cross(
        one.spin, off
    )


def bounce(one: Impact, centre: np.ndarray) -> tuple[float, ...]:
    """The corner's climb before, restitution, friction, height over half the edge less 1, gap."""
    lever, velocity = _corner(one, centre)
    before, after = velocity + np.cross(one.spin, lever)
    push = velocity[1] - velocity[0]
    tilt = -2 * one.turned.apply(CORNERS)[:, 2].min()
    gap = one.place[2] - tilt * EDGE_M / 2
    rub = float(np.hypot(*push[:2]) / push[2])
    return before[2], -after[2] / before[2], rub, tilt - 1, gap


if __name__ == "__main__":
    main()

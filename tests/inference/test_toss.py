"""Joint fits of tosses: starts, the arrow, recovery of what was simulated, the public function."""

import json
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from galileo_jax.api.fit_tosses import fit_tosses
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.poses_csv import read_poses_csv
from galileo_jax.commands import command
from galileo_jax.commands import toss as toss_command
from galileo_jax.inference.toss.residuals import (
    CENTRE,
    COMMON,
    EDGE,
    FLOOR,
    Start,
    backward,
    between,
    forward,
    motion,
    small,
    times,
)
from galileo_jax.measurement.measure import measure
from galileo_jax.observation.poses import Poses
from galileo_jax.observation.toss_flight import flight_of, resting_height_m
from galileo_jax.rollout.body import box, thrown
from galileo_jax.rollout.engine_body import roll_out
from galileo_jax.runtime.errors import InputError
from tests.precision import in_64_bit

EDGE_M, FPS, FRAMES = 0.1, 148.0, 60
TRUE = {"friction": 0.25, "restitution": 0.2, "edge": 0.1, "floor": 0.001, "gravity": 9.7}
TRUE |= {"rounding": 0.003, "inertia": 0.22}
CENTRE_M = np.array([0.0, -0.002, 0.005])  # of mass, from the middle, along the cube's axes
YAML = """\
track: {track}
track_up: z
scenario: toss
objects: [{{name: object1, shape: box, size_m: {size}, mass_kg: 0.3}}]
"""


@pytest.fixture(autouse=True)
def precision():
    with in_64_bit():
        yield


@pytest.fixture(scope="module")
def tosses(tmp_path_factory) -> list[Path]:
    """Six tosses of one cube, as the engine makes them, with 0.1 mm and 0.05 degrees of noise."""
    folder, rng, count = tmp_path_factory.mktemp("tosses"), np.random.default_rng(8), 6
    with in_64_bit():
        solid = box(
            jnp.full(3, TRUE["edge"]),
            friction=jnp.asarray(TRUE["friction"]),
            restitution=jnp.asarray(TRUE["restitution"]),
            gravity=jnp.asarray(TRUE["gravity"]),
            floor_m=jnp.asarray(TRUE["floor"]),
            round_m=TRUE["rounding"],
        )
        solid = solid._replace(
            corners_m=solid.corners_m - CENTRE_M,
            inertia_m2=jnp.full(3, TRUE["inertia"] * TRUE["edge"] ** 2),
        )
        starts = [
            thrown(
                solid,
                jnp.array([0.2, 0.1, 0.17]),
                jnp.asarray(rng.normal(size=4)),
                jnp.array([*rng.normal(0, 0.7, 2), 0.2]),
                jnp.asarray(rng.normal(0, 4, 3)),
            )
            for _ in range(count)
        ]
        start = jax.tree.map(lambda *values: jnp.stack(values), *starts)
        solids = jax.tree.map(lambda value: jnp.stack([value] * count), solid)
        steps = jnp.full((count, FRAMES), 1 / FPS)
        poses = jax.tree.map(np.asarray, jax.jit(jax.vmap(roll_out))(solids, start, steps))
    return [
        write(
            folder / f"toss{i}.csv",
            poses.position_m[i]
            - Rotation.from_quat(poses.quaternion[i], scalar_first=True).apply(CENTRE_M)
            + rng.normal(0, 1e-4, (FRAMES + 1, 3)),
            (
                Rotation.from_rotvec(rng.normal(0, 1e-3, (FRAMES + 1, 3)))
                * Rotation.from_quat(poses.quaternion[i], scalar_first=True)
            ).as_quat(scalar_first=True),
        )
        for i in range(count)
    ]


def write(path: Path, place: np.ndarray, quaternion: np.ndarray, size: str = "[0.1, 0.1, 0.1]"):
    rows = np.column_stack([np.arange(len(place)) / FPS, place, quaternion])
    lines = [",".join(f"{value:.8f}" for value in row) for row in rows]
    path.write_text("\n".join(["time_s,x_m,y_m,z_m,qw,qx,qy,qz", *lines]) + "\n")
    path.with_suffix(".yaml").write_text(YAML.format(track=path.name, size=size))
    return path


def test_quaternions_multiply_as_turnings_do():
    one, other = Rotation.random(2, rng=np.random.default_rng(1))
    product = times(*(jnp.asarray(r.as_quat(scalar_first=True)) for r in (one, other)))
    same = Rotation.from_quat(np.array(product), scalar_first=True)
    assert (same * (one * other).inv()).magnitude() == pytest.approx(0.0, abs=1e-12)
    turn = jnp.array([0.1, -0.2, 0.3])
    start = jnp.asarray(one.as_quat(scalar_first=True))
    found = between(start, -times(small(turn), start))
    assert np.linalg.norm(found) == pytest.approx(2 * np.arctan(np.linalg.norm(turn) / 2))
    assert np.cross(found, turn) == pytest.approx(0.0, abs=1e-12)


def test_a_flight_tells_its_start(tosses):
    poses = read_poses_csv(tosses[0])
    flight = flight_of(poses, np.full(3, EDGE_M))
    assert flight is not None
    since = poses.times_s[: flight.last + 1] - poses.times_s[0]
    seen = poses.position_m[: flight.last + 1] + np.outer(since**2, [0, 0, TRUE["gravity"] / 2])
    assert flight.velocity_m_s == pytest.approx(np.polyfit(since, seen, 1)[0], abs=0.02)
    assert flight.position_m == pytest.approx(poses.position_m[0], abs=3e-4)


def test_to_other_commands_it_is_a_flight_to_the_first_impact(tosses):
    """The centre alone, in space, cut where it strikes the table."""
    measured = measure(load_clip(tosses[0]))
    poses = read_poses_csv(tosses[0])
    flight = flight_of(poses, np.full(3, EDGE_M))
    assert flight is not None
    assert measured.observation.position_m.shape[1] == 3
    (cut,) = measured.cuts
    assert cut.time_s == poses.times_s[flight.last]
    assert measured.observation.mask.sum() == flight.last + 1


@pytest.mark.slow
def test_a_joint_fit_finds_what_was_simulated(tosses, tmp_path):
    found = fit_tosses(tosses, window=0.1, ahead=True)
    centre = dict(zip(CENTRE, CENTRE_M, strict=True))
    for name, true in (TRUE | centre).items():
        told = found.parameters[name]
        assert abs(told["mean"] - true) < 4 * told["sd"] + 1e-3 * abs(true), name
    assert found.parameters["friction"]["sd"] < 0.02
    assert found.document["second_half"]["median_place_over_edge"] < 0.05
    document = json.loads((found.save(tmp_path) / "tosses.json").read_text())
    assert document["used"] == [path.stem for path in tosses]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda row: [*row[:4], 0.5, 0.5, 0.5, 0.1],
            r"line 4: qw, qx, qy, qz: no rotation.*0.8718",
        ),
        (lambda row: [0.0, *row[1:]], "line 4: time_s: 0 is not after 0.00675"),
        (
            lambda row: [row[0], *(1000 * v for v in row[1:4]), *row[4:]],
            "are these .*millimetres",
        ),
        (lambda row: [*row[:4], -row[5], row[4], -row[7], row[6]], r"line 4: turned by 1\d\d degr"),
        (lambda row: [*row[:3], "", *row[4:]], "line 4: object1: not all of x, y and z are given"),
    ],
    ids=["rotation", "time", "mm", "jump", "empty"],
)
def test_wrong_poses_are_one_line(change, message, tosses, tmp_path):
    lines = tosses[0].read_text().splitlines()
    row = [float(value) for value in lines[3].split(",")]
    lines[3] = ",".join(str(value) for value in change(row))
    path = tmp_path / "wrong.csv"
    path.write_text("\n".join(lines) + "\n")
    path.with_suffix(".yaml").write_text(YAML.format(track="wrong.csv", size=[0.1] * 3))
    with pytest.raises(InputError, match=message) as caught:
        fit_tosses(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("size", "scenario", "message"),
    [
        ("[104.8, 104.8, 104.8]", "toss", "104.8 m is too large .* did you mean 0.1048"),
        ("[0.1, 0.1, 0.2]", "toss", "three equal edges expected"),
        ("null", "toss", "a box of known size expected"),
        ("[0.1, 0.1, 0.1]", "flight", "scenario: flight; toss, with a csv track, expected"),
    ],
)
def test_wrong_yamls_are_one_line(size, scenario, message, tosses, tmp_path, capsys):
    path = tmp_path / "toss.csv"
    path.write_text(tosses[0].read_text())
    text = YAML.format(track="toss.csv", size=size).replace(": toss\n", f": {scenario}\n")
    path.with_suffix(".yaml").write_text(text)
    with pytest.raises(InputError, match=message):
        fit_tosses(path)
    assert command.run(toss_command.main, [str(path), "--out", str(tmp_path / "out")]) == 2
    assert not (tmp_path / "out").exists()
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_what_never_flies_is_said(tosses, tmp_path):
    poses = read_poses_csv(tosses[0])
    place = poses.position_m.copy()
    place[:, 2] = EDGE_M / 2
    path = write(tmp_path / "rests.csv", place, poses.quaternion)
    with pytest.raises(InputError, match="rests: none flies for some frames"):
        fit_tosses(path)


def test_poses_with_y_up_are_turned(tosses, tmp_path):
    poses = read_poses_csv(tosses[0])
    x, y, z = poses.position_m.T
    back = Rotation.from_rotvec([-np.pi / 2, 0, 0])
    turned = (back * Rotation.from_quat(poses.quaternion, scalar_first=True)).as_quat(
        scalar_first=True
    )
    path = write(tmp_path / "up.csv", np.column_stack([x, z, -y]), turned)
    again = read_poses_csv(path, up="y")
    assert again.position_m == pytest.approx(poses.position_m, abs=1e-7)
    apart = np.abs(np.sum(again.quaternion * poses.quaternion, axis=1))
    assert apart == pytest.approx(1.0, abs=1e-7)


def test_the_height_at_rest_counts_where_a_face_lies_down():
    frames, upright = 20, np.tile([1.0, 0.0, 0.0, 0.0], (20, 1))
    place = np.tile([0.1, 0.2, 0.05], (frames, 1))
    lies = Poses("lies", np.arange(frames) / FPS, place, upright)
    on_edge = np.tile(
        Rotation.from_euler("x", 45, degrees=True).as_quat(scalar_first=True), (20, 1)
    )
    stands = replace(lies, quaternion=on_edge, position_m=place + np.array([0, 0, 0.02]))
    moves = replace(lies, position_m=place + np.linspace(0, 0.01, frames)[:, None])
    assert resting_height_m([stands, lies, moves]) == pytest.approx(0.05)
    assert resting_height_m([stands, moves]) is None


def test_the_search_has_the_height_at_rest_in_place_of_the_edge():
    """Where the floor changes and that height stays, the edge changes with it."""
    values = jnp.array([0.2, 0.1, 0.1, 0.01, 9.8, 0.002, 0.2, 0.001, -0.002, 0.003])
    z = backward(values)
    assert np.asarray(forward(z)) == pytest.approx(np.asarray(values))
    lower = dict(zip(COMMON, np.asarray(forward(z.at[FLOOR].add(-0.004))), strict=True))
    assert lower["floor"] == pytest.approx(0.006)
    assert lower["edge"] == pytest.approx(0.108)
    higher = forward(z.at[EDGE].add(0.1))
    assert float(higher[EDGE] / 2 + higher[FLOOR]) == pytest.approx(0.06 * np.exp(0.1))


def test_the_middle_turns_about_the_centre_of_mass():
    """In flight that centre runs along a parabola, and what poses follow circles about it."""
    values = jnp.array([0.2, 0.1, 0.1, 0.0, 9.8, 0.002, 0.2, 0.0, -0.002, 0.005])
    start = Start(
        jnp.array([0.0, 0.0, 2.0]),
        jnp.array([1.0, 0.0, 0.0, 0.0]),
        jnp.array([0.5, 0.0, 0.0]),
        jnp.array([6.0, 0.0, 0.0]),
    )
    poses = motion(backward(values), jnp.zeros(12), start, jnp.full(30, 1 / FPS))
    time = np.arange(31) / FPS
    turned = Rotation.from_quat(np.asarray(poses.quaternion), scalar_first=True)
    centre = np.asarray(poses.position_m) + turned.apply(np.array(values[-3:]))
    rises = 6.0 * -0.002  # of the centre of mass: spin times its lever
    assert centre[:, 2] == pytest.approx(2.005 + rises * time - 4.9 * time**2, abs=1e-9)
    assert np.ptp(centre[:, 1] - centre[0, 1] + 6.0 * 0.005 * time) < 1e-9
    assert np.ptp(np.asarray(poses.position_m)[:, 1]) > 0.002

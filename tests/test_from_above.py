"""Pucks seen from above, from a simulated track to what a fit and a diagnosis say of it."""

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import galileo_jax as gx
from galileo_jax.measurement.infer_radii import distance_at_hit
from galileo_jax.measurement.measure import measure
from galileo_jax.runtime.errors import InputError

FPS = 120.0


def made(folder: Path, seed: int, **options) -> tuple[Path, dict[str, float]]:
    path = folder / f"pucks_{seed}.csv"
    done = gx.simulate(path, scenario="from_above", seed=seed, track_only=True, fps=FPS, **options)
    return path, done.truths[0]["parameters"]


def edited(path: Path, **keys) -> Path:
    """The clip with other values for keys of every object (or of the clip)."""
    at = path.with_suffix(".yaml")
    content = yaml.safe_load(at.read_text())
    for item in content["objects"]:
        item.update({key: value for key, value in keys.items() if key in item})
    at.write_text(yaml.safe_dump(content))
    return path


def test_what_was_simulated_is_found(tmp_path: Path) -> None:
    path, true = made(tmp_path, 51)
    result = gx.fit(path).result
    assert result["converged"]
    told = {**result["parameters"], **result["derived"]}
    true["mass_ratio"] = true["m1"] / true["m2"]
    for name in ("k1", "k2", "restitution", "mass_ratio", "start_turning1"):
        assert abs(told[name]["mean"] - true[name]) < 3.5 * told[name]["sd"], name
        assert told[name]["identified"], name
    assert told["k2"]["sd"] < 0.01


def test_radii_come_from_the_hit(tmp_path: Path) -> None:
    path, _ = made(tmp_path, 52)
    sizes = [(item.size_m or (0.0,))[0] for item in gx.load(path).objects]
    hit = distance_at_hit(measure(gx.load(path)).observation)
    assert hit is not None
    assert hit[2] == pytest.approx(sum(sizes), abs=1e-3)
    one = measure(gx.load(edited(path, size_m=None)))
    assert [(item.size_m or (0.0,))[0] for item in one.clip.objects] == pytest.approx(
        [hit[2] / 2] * 2
    )
    assert any("from the hit" in line for line in one.remarks)


def test_turning_is_read_and_only_from_above(tmp_path: Path) -> None:
    path, _ = made(tmp_path, 53)
    seen = measure(gx.load(path)).observation
    assert seen.axes == ("x", "y", "turning")
    content = yaml.safe_load(path.with_suffix(".yaml").read_text())
    content |= {"scenario": "multi", "ramp_angle_deg": 20.0}
    path.with_suffix(".yaml").write_text(yaml.safe_dump(content))
    with pytest.raises(InputError, match="angle_rad': means nothing in scenario multi"):
        gx.load(path)


@pytest.mark.parametrize(
    ("text", "said"),
    [("shape: cylinder", "a puck is a cylinder"), ("angle_rad", "are these degrees")],
)
def test_bad_input_is_one_line(tmp_path: Path, text: str, said: str) -> None:
    path, _ = made(tmp_path, 54)
    if text == "angle_rad":
        rows = [row.split(",") for row in path.read_text().splitlines()]
        at = rows[0].index("object1_sd_angle_rad")
        for row in rows[1:]:
            row[at] = "5.0"
        path.write_text("\n".join(",".join(row) for row in rows) + "\n")
    else:
        edited(path, shape="sphere", size_m=[0.02])
    with pytest.raises(InputError, match=said):
        gx.load(path)


def test_a_film_shows_the_pucks_where_the_track_has_them(tmp_path: Path) -> None:
    path = tmp_path / "film.mp4"
    options = {"scenario": "from_above", "seed": 58, "fps": 240.0, "seconds": 0.3}
    gx.simulate(path, size=(960, 540), **options)
    gx.simulate(tmp_path / "track.csv", track_only=True, track_noise=1e-6, **options)
    filmed = gx.track(path).observation
    true = measure(gx.load(tmp_path / "track.csv")).observation
    assert filmed.mask.mean() > 0.8
    apart = np.linalg.norm(filmed.position_m[:, :2] - true.position_m[:, :2], axis=1)[filmed.mask]
    assert np.median(apart) < 3e-4
    assert apart.max() < 2e-3  # where the hit falls into an exposure
    assert filmed.axes == ("x", "y") and filmed.turned_rad is not None
    turned = np.unwrap(filmed.turned_rad[0][filmed.mask[0]])
    expected = true.position_m[0, 2][filmed.mask[0]]
    assert np.ptp(expected) > 0.3
    assert np.abs(turned - expected).max() < 0.03


def filmed(folder: Path, seed: int) -> tuple[Mapping[str, Any], Mapping[str, float]]:
    path = folder / f"film_{seed}.mp4"
    done = gx.simulate(path, scenario="from_above", seed=seed, fps=60.0, size=(960, 540))
    return gx.fit(path).result, done.truths[0]["parameters"]


def test_a_puck_that_turns_is_braked_less_along_its_way(tmp_path: Path) -> None:
    result, true = filmed(tmp_path, 7723)  # turns at 9 rad/s
    for name in ("k1", "k2", "restitution"):
        told = result["parameters"][name]
        assert abs(told["mean"] - true[name]) < 3 * told["sd"], name
    assert "start_turning1" in result["nuisances"]


def test_what_grips_or_slips_does_not_lead_astray(tmp_path: Path) -> None:
    """Small grip with more restitution looks alike; the interval holds the truth."""
    result, true = filmed(tmp_path, 7905)
    told = result["parameters"]["restitution"]
    assert told["q025"] < true["restitution"] < told["q975"]
    assert not result["parameters"]["grip"]["identified"]


@pytest.fixture(scope="module")
def pucks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A track without walls, to be edited by nobody."""
    return made(tmp_path_factory.mktemp("pucks"), 54)[0]


@pytest.mark.parametrize(
    ("walls", "said"),
    [
        ("right", "walls: 'right' is not a list of walls, such as"),
        ([{"from_m": [0.0, 1.0]}], "walls[0]: to_m is missing; both ends"),
        ([{"from_m": [0.0, 1.0], "to_px": [9.0, 9.0]}], "either as from_m and to_m or as from_px"),
        ([{"from_m": [0, 900], "to_m": [1200, 900]}], "are these millimetres or pixels?"),
        ([{"from_m": [0.0, 1.0], "to_m": [0.0, 1.0]}], "is not a line; two ends that lie apart"),
        ([{"from_m": [0.0, "x"], "to_m": [0.0, 1.0]}], "walls[0].from_m[1]: 'x' is not a number"),
        ([{"from": [0.0, 1.0], "to_m": [0.0, 1.0]}], "walls[0].from: unknown key"),
        ([[0.0, 1.0]], "walls[0]: [0.0, 1.0] is not a mapping; from_m, to_m expected"),
        ([{"from_px": [0.0, 1.0], "to_px": [90.0, 1.0]}], "the clip is a track in metres"),
        ([{"from_m": [-1.0, 0.0], "to_m": [1.0, 0.0]}], "object1 reaches into it by"),
        ([{"from_m": [k, 2.0], "to_m": [k, 3.0]} for k in range(13)], "13 walls; 12 at most"),
    ],
)
def test_wrong_walls_are_one_line(pucks: Path, tmp_path: Path, walls: Any, said: str) -> None:
    path = Path(shutil.copy(pucks, tmp_path))
    content = yaml.safe_load(pucks.with_suffix(".yaml").read_text()) | {"walls": walls}
    path.with_suffix(".yaml").write_text(yaml.safe_dump(content))
    with pytest.raises(InputError) as caught:
        gx.load(path)
    assert said in str(caught.value) and "\n" not in str(caught.value)


def test_walls_are_of_this_scenario_only(tmp_path: Path) -> None:
    path = tmp_path / "ball.csv"
    gx.simulate(path, scenario="flight", seed=1, track_only=True)
    at = path.with_suffix(".yaml")
    wall = [{"from_m": [0.0, 1.0], "to_m": [1.0, 1.0]}]
    at.write_text(yaml.safe_dump(yaml.safe_load(at.read_text()) | {"walls": wall}))
    with pytest.raises(InputError, match="walls: means nothing in scenario flight, only in from_a"):
        gx.load(path)
    with pytest.raises(InputError, match="--walls: of scenario from_above only"):
        gx.simulate(tmp_path / "no.csv", scenario="flight", walls=True, track_only=True)


def test_bounces_off_walls_are_found(tmp_path: Path) -> None:
    """Also where the first search ends in a wrong valley: it goes on from bounce to bounce."""
    path, true = made(tmp_path, 304, walls=True)
    result = gx.fit(path).result
    assert result["converged"] and result["error"]["chi2_per_dof"] < 1.3
    told = result["parameters"]
    for name in ("k1", "k2", "restitution", "wall_restitution"):
        assert abs(told[name]["mean"] - true[name]) < 3.5 * told[name]["sd"], name
    assert told["wall_restitution"]["sd"] < 0.01


def test_walls_are_marked_in_a_film(tmp_path: Path) -> None:
    """In pixels and in metres they are the same walls, and a bounce is no track gone astray."""
    path = tmp_path / "walls.mp4"
    gx.simulate(path, scenario="from_above", seed=304, fps=120.0, size=(960, 540), walls=True)
    one = measure(gx.load(path))
    assert not one.astray
    at = path.with_suffix(".yaml")
    content = yaml.safe_load(at.read_text())
    scale, (x0, y0) = content["pixels_per_metre"], content["origin_px"]
    for wall in content["walls"]:
        for end in ("from", "to"):
            x, y = wall.pop(f"{end}_m")
            wall[f"{end}_px"] = [x0 + scale * x, y0 - scale * y]
    at.write_text(yaml.safe_dump(content))
    other = measure(gx.load(path))
    ends = [np.array([wall.ends_m for wall in each.clip.walls]) for each in (one, other)]
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)


@pytest.mark.slow
def test_intervals_hold_the_truth(tmp_path: Path) -> None:
    z = []
    for seed in range(61, 73):
        path, true = made(tmp_path, seed)
        told = gx.fit(path).result["parameters"]
        z += [
            (told[name]["mean"] - true[name]) / told[name]["sd"]
            for name in ("k1", "k2", "restitution", "start_turning1")
        ]
    assert np.sqrt(np.mean(np.square(z))) < 1.35
    assert np.max(np.abs(z)) < 4.5


@pytest.mark.slow
def test_a_tilted_table_is_named(tmp_path: Path) -> None:
    path, _ = made(tmp_path, 31, effects=["table_tilt"], strength=0.9)
    verdict = gx.diagnose(path).document["verdict"]
    assert verdict["effects"] == ["table_tilt"], verdict

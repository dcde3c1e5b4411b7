"""`track` from a clip on disk to its files; finding objects; wrong input."""

import csv

import cv2
import numpy as np
import pytest
import yaml

from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.commands import command
from galileo_jax.commands.track import main
from galileo_jax.runtime.errors import InputError
from galileo_jax.tracking.clip import track_clip
from tests.tracking.moving_box import Box, Labelled, film

pytestmark = pytest.mark.video

FIRST, SECOND = Box(seed=0), Box(seed=4)
SCALE = 400.0


def write_clip(folder, frames, points, size_m=(0.08, 0.06, 0.065)):
    video = folder / "clip.mp4"
    size = frames[0].shape[1::-1]
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"mp4v"), 30.0, size)
    for frame in frames:
        writer.write(frame)
    writer.release()
    objects = [
        {"name": f"object{k + 1}", "shape": "box", "size_m": size_m and list(size_m)}
        | ({"point_px": point} if point else {})
        for k, point in enumerate(points)
    ]
    content = {
        "video": video.name,
        "scenario": "multi",
        "ramp_angle_deg": 20.0,
        "fps": 30.0,
        "pixels_per_metre": SCALE,
        "origin_px": [20.0, 93.0],
        "objects": objects,
    }
    (folder / "clip.yaml").write_text(yaml.safe_dump(content))
    return folder / "clip.yaml"


@pytest.fixture
def paths():
    time = np.arange(30.0)
    zero = 0 * time
    first = np.stack([50 + 4.0 * np.clip(time - 3, 0, 16), 80 + zero, zero], axis=1)
    second = np.stack([160 + 1.5 * np.clip(time - 16, 0, 9), 80 + zero, zero], axis=1)
    return first, second


@pytest.fixture
def frames(paths):
    return film([(FIRST, paths[0]), (SECOND, paths[1])])


def test_files_are_written_and_read_back(tmp_path, frames, paths, capsys):
    clip = write_clip(tmp_path, frames, [[50.0, 80.0], [160.0, 80.0]])
    out = tmp_path / "out"
    assert command.run(main, [str(clip), "--out", str(out)]) == 0
    names = ["track_px.csv", "track_m.csv", "overlay.png", "overlay.mp4"]
    assert capsys.readouterr().out.split() == [str(out / name) for name in names]
    assert sorted(path.name for path in out.iterdir()) == sorted(names)
    with (out / "track_px.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(frames)
    seen = np.array([float(row["object1_x_px"]) for row in rows])
    assert np.sqrt(np.mean((seen - paths[0][:, 0]) ** 2)) < 0.1
    observation = read_observation_csv(out / "track_m.csv")
    np.testing.assert_allclose(observation.position_m[0, 0], (seen - 20) / SCALE, atol=1e-6)
    picture = cv2.imread(str(out / "overlay.png"))
    assert picture is not None and picture.shape[1] == 4 * 240
    capture = cv2.VideoCapture(str(out / "overlay.mp4"))
    assert capture.get(cv2.CAP_PROP_FRAME_COUNT) == len(frames)


def test_without_points_the_objects_are_found(tmp_path, frames, paths):
    track = track_clip(load_clip(write_clip(tmp_path, frames, [None, None])))
    for k, path in enumerate(paths):
        np.testing.assert_allclose(track.position_px[k, 0], path[0, :2], atol=2)
        travelled = track.position_px[k] - track.position_px[k, 0]
        np.testing.assert_allclose(travelled, path[:, :2] - path[0, :2], atol=0.15)


def test_one_declared_point_is_not_given_away_again(tmp_path, frames, paths):
    track = track_clip(load_clip(write_clip(tmp_path, frames, [None, [160.0, 80.0]])))
    np.testing.assert_allclose(track.position_px[0, 0], paths[0][0, :2], atol=2)
    # The first frame's noise is its own: where the object stood is the mean of its rest.
    np.testing.assert_allclose(track.position_px[1, 0], (160.0, 80.0), atol=0.03)


def test_a_box_of_unknown_size_is_compared_over_all_that_is_seen_of_it(tmp_path):
    """It is plain where it is marked: a window there would show nothing."""
    time = np.arange(40.0)
    gone = 5.0 * np.clip(time - 6, 0, 40)
    way = np.stack([70 + gone, 60 + 0.3 * gone, 0 * time], axis=1)
    frames = film([(Labelled((100, 70)), way)], size_px=(320, 180))
    clip = load_clip(write_clip(tmp_path, frames, [[71.0, 62.0]], size_m=None))
    track = track_clip(clip)
    assert track.is_visible.all()
    travelled = track.position_px[0] - track.position_px[0, 0]
    np.testing.assert_allclose(travelled, way[:, :2] - way[0, :2], atol=0.8)


def test_nothing_moves_and_no_point_asks_for_label(tmp_path, frames, capsys):
    clip = write_clip(tmp_path, [frames[0]] * 12, [None, None])
    assert command.run(main, [str(clip), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "object1" in error and "point_px" in error and "galileo label" in error
    assert not (tmp_path / "out").exists()


def test_csv_track_is_refused(tmp_path):
    table = tmp_path / "walk.csv"
    rows = "\n".join(f"{0.1 * i},{0.01 * i},0.0,0.001" for i in range(8))
    table.write_text(f"time_s,object1_x_m,object1_y_m,object1_sd_m\n{rows}\n")
    (tmp_path / "walk.yaml").write_text(
        "track: walk.csv\nscenario: multi\nramp_angle_deg: 20.0\n"
        "objects:\n  - {name: object1, shape: box}\n"
    )
    with pytest.raises(InputError, match="already tracked"):
        main([str(tmp_path / "walk.yaml")])

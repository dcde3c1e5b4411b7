import math
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from galileo_jax.clip.load import load_clip
from galileo_jax.commands import command, label
from galileo_jax.measurement.measure import measure
from tests.clip.broken_clips import build_good, build_good_track, good_track, good_video

NEW = shlex.split(
    "--scenario ramp --ramp 60 113.6 150 146.4 --scale 0 100 150 100 0.5 --origin 160 150 "
    "--fps 240 --point object1 73.1 108.8 --size object1 0.06 0.05 0.06 "
    "--point object2 205 141 --first-frame object2 3"
)


@pytest.fixture
def video(tmp_path: Path) -> Path:
    path = tmp_path / "clip.mp4"
    path.write_bytes(good_video())
    return path


def run(*argv: object) -> int:
    return command.run(label.main, [str(part) for part in argv])


def test_new_yaml(video: Path, capsys) -> None:
    assert run(video, *NEW) == 0
    clip = load_clip(video)
    assert clip.fps == 240
    assert clip.ramp_angle_deg == pytest.approx(20.024, abs=0.001)
    assert clip.direction == "right"
    assert clip.pixels_per_metre == 300
    assert clip.origin_px == (160, 150)
    assert clip.objects[0].size_m == (0.06, 0.05, 0.06)
    assert clip.objects[1].point_px == (205, 141)
    assert clip.objects[1].first_frame == 3
    # Half a pixel at either end of a base of 95.79 px, of 150 px for half a metre.
    assert clip.ramp_angle_sd_deg == pytest.approx(math.degrees(math.sqrt(0.5) / 95.79), rel=1e-2)
    assert clip.pixels_per_metre_sd == pytest.approx(math.sqrt(0.5) / 150 * 300, rel=1e-2)
    assert clip.origin_sd_px == 0.5
    output = capsys.readouterr()
    assert output.out.strip() == str(clip.path)
    assert "240 declared, the container says 30" in output.err


def test_what_the_user_says_of_uncertainties_goes_first(video: Path) -> None:
    told = ("--ramp-angle-sd", 0.3, "--pixels-per-metre-sd", 4, "--origin-sd", 2)
    assert run(video, *NEW, *told) == 0
    clip = load_clip(video)
    sds = (clip.ramp_angle_sd_deg, clip.pixels_per_metre_sd, clip.origin_sd_px)
    assert sds == (0.3, 4, 2)


def test_of_a_typed_angle_and_scale_nothing_is_said(video: Path) -> None:
    typed = ("--scenario", "incline", "--ramp-angle", 20, "--pixels-per-metre", 300)
    assert run(video, *typed, "--point", "object1", 73.1, 108.8) == 0
    clip = load_clip(video)
    assert (clip.ramp_angle_sd_deg, clip.pixels_per_metre_sd) == (0, None)


def test_a_new_value_is_not_known_as_well_as_the_old_one_was(video: Path) -> None:
    assert run(video, *NEW) == 0
    assert run(video, "--ramp-angle", 21, "--pixels-per-metre", 310) == 0
    clip = load_clip(video)
    assert (clip.ramp_angle_deg, clip.pixels_per_metre) == (21, 310)
    assert (clip.ramp_angle_sd_deg, clip.pixels_per_metre_sd) == (0, None)
    assert run(video, "--pixels-per-metre-sd", 2) == 0
    assert load_clip(video).pixels_per_metre_sd == 2


def test_frame_rate_of_the_container_is_noted(video: Path, capsys) -> None:
    without_fps = [*NEW[: NEW.index("--fps")], *NEW[NEW.index("--fps") + 2 :]]
    assert run(video, *without_fps) == 0
    assert "fps: 30 taken from the video file" in capsys.readouterr().err
    assert load_clip(video).fps == 30


def test_ramp_that_falls_to_the_left(tmp_path: Path) -> None:
    path = build_good(tmp_path)
    assert run(path, "--ramp", 250, 100, 160, 132.8, "--point", "object1", 246.9, 108.8,
               "--point", "object2", 115, 141) == 0  # fmt: skip
    assert load_clip(path).direction == "left"


def test_new_yaml_beside_a_csv_track(tmp_path: Path) -> None:
    path = tmp_path / "clip.csv"
    path.write_text(good_track())
    assert run(path, "--scenario", "ramp", "--ramp-angle", 20, "--shape", "object1", "box") == 0
    assert load_clip(path).track == path


def test_update_keeps_comments_and_other_keys(tmp_path: Path, capsys) -> None:
    path = build_good(tmp_path)
    before = "# A clip.\n" + path.read_text().replace("fps: 30.0", "fps: 30.0  # as declared")
    path.write_text(before)
    assert run(path, "--gravity", 9.8, "--point", "object1", 73, 109) == 0
    expected = before.replace("9.81", "9.8").replace("[73.1, 108.8]", "[73.0, 109.0]")
    assert path.read_text() == expected
    assert capsys.readouterr().err == ""


def test_new_keys_and_objects_are_added(tmp_path: Path) -> None:
    path = build_good(tmp_path)
    path.write_text(
        path.read_text().split("  - name: object2")[0].replace("direction: right\n", "")
    )
    assert run(path, "--direction", "right", "--first-frame", "object1", 2,
               "--point", "object2", 205, 141, "--shape", "object2", "sphere") == 0  # fmt: skip
    lines = path.read_text().splitlines()
    assert "direction: right" in lines
    assert "    first_frame: 2" in lines
    assert lines[-3:] == [
        "  - name: object2",
        "    shape: sphere",
        "    point_px: [205.0, 141.0]",
    ]


@pytest.mark.parametrize("layout", ["flow", "indented", "no newline", "block lists"])
def test_other_layouts(layout: str, tmp_path: Path) -> None:
    path = build_good(tmp_path)
    content = yaml.safe_load(path.read_text())
    path.write_text(
        {
            "flow": yaml.safe_dump(content, default_flow_style=True),
            "indented": yaml.safe_dump(content, indent=6),
            "no newline": path.read_text().rstrip("\n"),
            "block lists": yaml.safe_dump(content, default_flow_style=False),
        }[layout]
    )
    assert run(path, "--point", "object2", 206, 141, "--first-frame", "object2", 1,
               "--size", "object1", 0.06, 0.06, 0.06, "--gravity", 9.8) == 0  # fmt: skip
    content["gravity"] = 9.8
    content["objects"][0]["size_m"] = [0.06, 0.06, 0.06]
    content["objects"][1] |= {"point_px": [206.0, 141.0], "first_frame": 1}
    assert yaml.safe_load(path.read_text()) == content


def test_comments_stay_also_where_all_is_on_one_line(tmp_path: Path, capsys) -> None:
    path = build_good(tmp_path)
    path.write_text(
        "# all on one line\n"
        + yaml.safe_dump(yaml.safe_load(path.read_text()), default_flow_style=True)
    )
    assert run(path, "--point", "object3", 20, 20, "--scenario", "multi") == 0
    assert capsys.readouterr().err == ""
    assert path.read_text().startswith("# all on one line\n{")
    assert len(load_clip(path).objects) == 3


def test_lost_comments_are_noted(tmp_path: Path, capsys) -> None:
    """What a merge key takes over cannot change in one place alone."""
    path = build_good(tmp_path)
    before, objects = path.read_text().split("objects:")
    objects = objects.replace("  - name: object1", "  - &first  # the red one\n    name: object1")
    objects = objects.replace("  - name: object2", "  - <<: *first\n    name: object2")
    path.write_text(f"{before}objects:{objects}")
    assert run(path, "--first-frame", "object1", 2) == 0
    assert "clip.yaml was written anew; its comments are lost" in capsys.readouterr().err
    assert [item.first_frame for item in load_clip(path).objects] == [2, 0]


WRONG = {
    "nothing_to_write": ([], "nothing to write"),
    "unknown_option": (["--fsp", "30"], "--fsp"),
    "two_scales": (["--scale", "0", "0", "1", "0", "1", "--pixels-per-metre", "9"], "not allowed"),
    "scale_of_one_point": (["--scale", "5", "5", "5", "5", "1"], "--scale"),
    "scale_over_no_distance": (["--scale", "0", "0", "5", "5", "0"], "--scale"),
    "scale_in_mm": (["--scale", "0", "0", "270", "0", "300"], "pixels_per_metre"),
    "level_ramp": (["--ramp", "0", "9", "5", "9"], "--ramp"),
    "steep_ramp": (["--ramp", "5", "0", "5", "9"], "--ramp"),
    "ramp_of_nan": (["--ramp", "5", "0", "nan", "9"], "--ramp"),
    "point_is_a_word": (["--point", "object1", "left", "9"], "'left' is not a number"),
    "point_without_y": (["--point", "object1", "9"], "--point"),
    "point_outside": (["--point", "object1", "900", "9"], "objects[0].point_px"),
    "first_frame_is_negative": (["--first-frame", "object1", "-2"], "'-2'"),
    "first_frame_late": (["--first-frame", "object1", "99"], "objects[0].first_frame"),
    "size_in_mm": (["--size", "object1", "60", "60", "60"], "did you mean 0.06"),
    "size_of_nothing": (["--size", "object1"], "objects[0].size_m"),
    "shape": (["--shape", "object1", "cube"], "objects[0].shape"),
    "name": (["--point", "my object", "9", "9"], "objects[2].name"),
    "third_object": (["--point", "object3", "9", "9"], "at most 2"),
    "angle": (["--ramp-angle", "95"], "ramp_angle_deg"),
    "fps": (["--fps", "nan"], "fps"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_wrong_call_is_one_line_and_writes_nothing(name: str, tmp_path: Path, capfd) -> None:
    options, words = WRONG[name]
    path = build_good(tmp_path)
    before = path.read_bytes()
    assert run(path, *options) == 2
    output = capfd.readouterr()
    assert output.err.count("\n") == 1
    assert words in output.err
    assert output.out == ""
    assert path.read_bytes() == before
    assert sorted(item.name for item in tmp_path.iterdir()) == ["clip.mp4", "clip.yaml"]


def test_objects_that_are_no_list_are_not_replaced(tmp_path: Path, capfd) -> None:
    path = build_good(tmp_path)
    before = path.read_text().split("objects:")[0] + "objects:\n  name: object1\n"
    path.write_text(before)
    assert run(path, "--point", "object1", 73, 109) == 2
    assert "objects: a list" in capfd.readouterr().err
    assert path.read_text() == before


def test_incomplete_new_yaml_is_not_written(video: Path, capfd) -> None:
    assert run(video, "--point", "object1", 73, 108, "--fps", 30) == 2
    assert "scenario: missing" in capfd.readouterr().err
    assert list(video.parent.iterdir()) == [video]


def test_broken_video_gets_no_yaml(video: Path, capfd) -> None:
    video.write_bytes(b"not a video")
    assert run(video, *NEW) == 2
    assert "clip.mp4: cannot be decoded" in capfd.readouterr().err
    assert list(video.parent.iterdir()) == [video]


def test_module_runs(tmp_path: Path) -> None:
    path = build_good_track(tmp_path)
    done = subprocess.run(
        [sys.executable, "-m", "galileo_jax.label", str(path), "--gravity", "9.8"],
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{path}\n", "")
    assert load_clip(path).gravity == 9.8


def test_the_foot_of_a_track(tmp_path: Path) -> None:
    """In the unit and along the axes of another program's file."""
    rows = [f"{i / 30},0,{100 + 490 * (i / 30) ** 2}" for i in range(12)]
    (tmp_path / "fall.csv").write_text("\n".join(["t,x,y", *rows]))
    words = "--scenario fall --track-units cm --track-y down --track-origin 0 160"
    assert run(tmp_path / "fall.csv", *words.split(), "--shape", "ball", "sphere") == 0
    clip = load_clip(tmp_path / "fall.csv")
    assert clip.track_origin == (0, 160)
    assert measure(clip).observation.position_m[0, 1, 0] == pytest.approx(0.6)


def test_a_level_is_of_physics_101(tmp_path: Path, capfd) -> None:
    path = build_good(tmp_path)
    assert run(path, "--level", "object", "--gravity", "9.8") == 2
    assert "--level:" in capfd.readouterr().err

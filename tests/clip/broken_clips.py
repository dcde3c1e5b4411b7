"""Clips that are wrong in one way each, for every command that takes a CLIP.

@pytest.mark.parametrize("broken", BROKEN_CLIPS, ids=lambda broken: broken.id)
def test_fit_refuses(broken, tmp_path, capfd):
    path = broken.build(tmp_path)
    ...one line on stderr with every word of `broken.words`, exit code 2, nothing written
"""

import functools
import re
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from tests.clip import track_file_makers as make
from tests.video.make_video import SIZE_PX, with_index_first, write_video

GOOD_YAML = """\
video: clip.mp4
scenario: ramp
fps: 30.0
ramp_angle_deg: 20.0
direction: right
pixels_per_metre: 300.0
origin_px: [160.0, 150.0]
gravity: 9.81
objects:
  - name: object1
    shape: box
    size_m: [0.06, 0.05, 0.06]
    point_px: [73.1, 108.8]
  - name: object2
    shape: box
    size_m: [0.07, 0.05, 0.06]
    point_px: [205.0, 141.0]
"""

TRACK_YAML = """\
track: clip.csv
scenario: ramp
ramp_angle_deg: 20.0
objects:
  - name: object1
    shape: box
    size_m: [0.06, 0.05, 0.06]
"""


@dataclass(frozen=True)
class BrokenClip:
    """One wrong input."""

    id: str  # for pytest
    # makes the files in an empty folder and returns the CLIP argument
    build: Callable[[Path], Path]
    words: tuple[str, ...]  # what the one line must contain, beginning with the file's name


@functools.cache
def good_video() -> bytes:
    """An mp4 of 24 frames, 320 x 180, 30 frames per second."""
    with tempfile.TemporaryDirectory() as folder:
        return write_video(Path(folder) / "clip.mp4").read_bytes()


def build_good(folder: Path) -> Path:
    """A clip with nothing wrong; returns its yaml."""
    (folder / "clip.mp4").write_bytes(good_video())
    path = folder / "clip.yaml"
    path.write_text(GOOD_YAML)
    return path


def good_track() -> str:
    """A csv track: 20 frames of constant acceleration down a 20 degree ramp."""
    lines = ["time_s,object1_x_m,object1_y_m,object1_sd_m"]
    for index in range(20):
        time = index / 30
        along = -0.5 + 0.5 * 1.5 * time**2
        x, y = along * np.cos(0.349) + 0.0103, -along * np.sin(0.349) + 0.0282
        lines.append(f"{time:.6f},{x:.6f},{y:.6f},0.0005")
    return "\n".join(lines) + "\n"


def build_good_track(folder: Path) -> Path:
    """A csv track with nothing wrong; returns its yaml."""
    (folder / "clip.csv").write_text(good_track())
    path = folder / "clip.yaml"
    path.write_text(TRACK_YAML)
    return path


def _text(text: str | bytes, *words: str) -> tuple[Callable[[Path], Path], tuple[str, ...]]:
    def build(folder: Path) -> Path:
        path = build_good(folder)
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return build, ("clip.yaml", *words)


def _edit(old: str, new: str, *words: str) -> tuple[Callable[[Path], Path], tuple[str, ...]]:
    assert old in GOOD_YAML
    return _text(GOOD_YAML.replace(old, new, 1), *words)


def _of_object(lines: str, *words: str) -> tuple[Callable[[Path], Path], tuple[str, ...]]:
    """More lines about object 1; what is refused is the key of the last."""
    more = "".join(f"    {line}\n" for line in lines.split("; "))
    key = re.findall(r"(\w+):", lines)[-1]
    return _edit("    point_px", f"{more}    point_px", f"objects[0].{key}", *words)


def _without(line: str, *words: str) -> tuple[Callable[[Path], Path], tuple[str, ...]]:
    return _edit(f"{line}\n", "", *words)


def _video(
    change: Callable[[bytes], bytes], *words: str
) -> tuple[Callable[[Path], Path], tuple[str, ...]]:
    def build(folder: Path) -> Path:
        path = build_good(folder)
        (folder / "clip.mp4").write_bytes(change(good_video()))
        return path

    return build, ("clip.mp4", *words)


def _track(old: str, new: str, *words: str) -> tuple[Callable[[Path], Path], tuple[str, ...]]:
    assert old in good_track()

    def build(folder: Path) -> Path:
        path = build_good_track(folder)
        (folder / "clip.csv").write_text(good_track().replace(old, new))
        return path

    return build, ("clip.csv", *words)


def _foreign(
    name: str, content: str, keys: str, *words: str
) -> tuple[Callable[[Path], Path], tuple[str, ...]]:
    """A track file of another tool, and its yaml."""

    def build(folder: Path) -> Path:
        (folder / name).write_text(content)
        path = folder / "clip.yaml"
        path.write_text(TRACK_YAML.replace("clip.csv", name).replace("ramp", "incline", 1) + keys)
        return path

    return build, words


def _file(name: str, content: bytes | None) -> Callable[[Path], Path]:
    """Only the file `name`, without a yaml; None for no file at all."""

    def build(folder: Path) -> Path:
        if content is not None:
            (folder / name).write_bytes(content)
        return folder / name

    return build


def _picture(_: bytes) -> bytes:
    return cv2.imencode(".png", np.zeros((180, 320, 3), np.uint8))[1].tobytes()


def _without_frames(_: bytes) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        return write_video(Path(folder) / "clip.mp4", frame_count=0).read_bytes()


def _cut(share: float) -> Callable[[bytes], bytes]:
    return lambda mp4: with_index_first(mp4)[: int(len(mp4) * share)]


def _cut_avi(folder: Path) -> Path:
    avi = write_video(folder / "clip.avi")
    avi.write_bytes(avi.read_bytes()[: avi.stat().st_size // 2])
    path = folder / "clip.yaml"
    path.write_text(GOOD_YAML.replace("clip.mp4", "clip.avi"))
    return path


def _other_video(folder: Path) -> Path:
    build_good(folder)
    (folder / "clip.yaml").rename(folder / "copy.yaml")
    (folder / "copy.mp4").write_bytes(good_video())
    return folder / "copy.mp4"


_CORNERS = "[[20, 150], [300, 150], [300, 20], [20, 20]]"


def _rectangle(
    corners: str, *words: str, sides: str = "[1.0, 0.5]"
) -> tuple[Callable[[Path], Path], tuple[str, ...]]:
    text = f"rectangle: {{corners_px: {corners}, sides_m: {sides}}}"
    return _edit("pixels_per_metre: 300.0", text, "rectangle", *words)


def _beside_track(line: str, *words: str) -> tuple[Callable[[Path], Path], tuple[str, ...]]:
    def build(folder: Path) -> Path:
        path = build_good_track(folder)
        path.write_text(TRACK_YAML + f"{line}\n")
        return path

    return build, ("clip.yaml", *words)


_WIDTH, _HEIGHT = SIZE_PX
_CASES: dict[str, tuple[Callable[[Path], Path], tuple[str, ...]]] = {
    # keys
    "unknown_key": _edit("gravity:", "gravitiy:", "gravitiy", "did you mean gravity?"),
    "unknown_key_nothing_like_it": _edit("gravity:", "colour:", "colour", "known: video"),
    "unknown_object_key": _edit("size_m:", "size:", "objects[0].size", "did you mean size_m?"),
    "misspelt_required_key": _edit("fps:", "fsp:", "fsp", "did you mean fps?"),
    "misspelt_video_key": _edit("video:", "vidoe:", "vidoe", "did you mean video?"),
    "number_as_key": _edit("gravity:", "7:", "7", "unknown key"),
    "missing_fps": _without("fps: 30.0", "fps", "missing"),
    "missing_scenario": _without("scenario: ramp", "scenario", "missing"),
    "missing_video": _without("video: clip.mp4", "video", "missing"),
    "missing_objects": _text(GOOD_YAML.split("objects:")[0], "objects", "missing"),
    "missing_object_name": _edit("name: object1\n    ", "", "objects[0].name", "missing"),
    "missing_shape": _without("    shape: box", "objects[0].shape", "missing"),
    "missing_ramp_angle": _without("ramp_angle_deg: 20.0", "ramp_angle_deg", "needs it"),
    "repeated_key": _edit("fps: 30.0", "fps: 30.0\nfps: 25.0", "fps", "given twice"),
    "repeated_object_key": _edit("    shape: box\n", "    shape: box\n    shape: box\n", "shape"),
    "video_and_track": _edit("fps:", "track: clip.csv\nfps:", "video, track", "both given"),
    # types
    "fps_is_text": _edit("fps: 30.0", "fps: fast", "fps", "'fast'", "not a number"),
    "fps_is_quoted": _edit("fps: 30.0", "fps: '30'", "fps", "'30'", "leave out the quotes"),
    "scale_in_odd_notation": _edit("300.0", "3e2", "pixels_per_metre", "'3e2'", "1.0e+3"),
    "fps_is_a_bool": _edit("fps: 30.0", "fps: yes", "fps", "true", "not a number"),
    "fps_is_null": _edit("fps: 30.0", "fps: null", "fps", "null", "not a number"),
    "fps_is_nan": _edit("fps: 30.0", "fps: .nan", "fps", "nan", "not finite"),
    "angle_is_infinite": _edit("20.0", ".inf", "ramp_angle_deg", "inf", "not finite"),
    "origin_is_a_number": _edit("[160.0, 150.0]", "160.0", "origin_px", "[x, y]"),
    "origin_has_one_number": _edit("[160.0, 150.0]", "[160.0]", "origin_px", "[x, y]"),
    "point_has_three_numbers": _edit(
        "[73.1, 108.8]", "[73.1, 108.8, 0.0]", "objects[0].point_px", "too many"
    ),
    "objects_is_a_mapping": _text(
        GOOD_YAML.split("objects:")[0] + "objects:\n  name: object1\n", "objects", "list"
    ),
    "object_is_a_word": _text(
        GOOD_YAML.split("objects:")[0] + "objects: [object1]\n", "objects[0]", "not a mapping"
    ),
    "first_frame_is_a_fraction": _of_object("first_frame: 1.5", "1.5"),
    "first_frame_is_negative": _of_object("first_frame: -1", "-1"),
    "name_with_space": _edit("object1", "object 1", "objects[0].name", "object 1"),
    "video_is_a_number": _edit("clip.mp4", "5", "video", "5", "file name"),
    # the camera's geometry
    "rectangle_of_three_corners": _rectangle("[[20, 150], [300, 150], [300, 20]]", "3 corners"),
    "rectangle_whose_corners_cross": _rectangle(
        "[[20, 150], [300, 150], [20, 20], [300, 20]]", "sides cross"
    ),
    "rectangle_clockwise": _rectangle(
        "[[20, 20], [300, 20], [300, 150], [20, 150]]", "clockwise", "bottom left"
    ),
    "rectangle_with_three_corners_on_a_line": _rectangle(
        "[[20, 150], [160, 150], [300, 150], [20, 20]]", "on a line"
    ),
    "rectangle_without_a_side": _rectangle(_CORNERS, "0 is not the length", sides="[0, 0.5]"),
    "rectangle_with_one_side": _rectangle(_CORNERS, "[width, height]", sides="[0.5]"),
    "rectangle_and_scale": _edit(
        "gravity:",
        f"rectangle: {{corners_px: {_CORNERS}, sides_m: [1, 0.5]}}\ngravity:",
        "rectangle",
        "together with pixels_per_metre",
    ),
    "rectangle_beside_a_track": _beside_track(
        f"rectangle: {{corners_px: {_CORNERS}, sides_m: [1, 0.5]}}", "rectangle", "a track"
    ),
    "lens_too_strong": _edit("gravity:", "lens: {k1: -3}\ngravity:", "lens.k1", "-3", "half a"),
    "lens_without_number": _edit("gravity:", "lens: {k1_sd: 0.1}\ngravity:", "lens.k1", "missing"),
    # values and units
    "unknown_scenario": _edit(
        "scenario: ramp", "scenario: slope", "slope", "fall, flight, from_above, incline"
    ),
    "unknown_shape": _edit("shape: box", "shape: cube", "shape", "cube", "box, cylinder"),
    "box_that_rolls": _of_object("rolls: true", "a box slides"),
    "rolls_too_much": _of_object("rolls: 1.5", "1.5", "hollow ball"),
    "moving_perhaps": _edit(
        "gravity: 9.81", "starts_moving: perhaps", "starts_moving", "'perhaps' is not true or false"
    ),
    "unknown_direction": _edit("direction: right", "direction: up", "direction", "up", "left"),
    "fps_is_zero": _edit("fps: 30.0", "fps: 0", "fps", "0", "above 0"),
    "fps_is_negative": _edit("fps: 30.0", "fps: -30.0", "fps", "-30"),
    "fps_is_a_duration": _edit("fps: 30.0", "fps: 0.03333", "fps", "did you mean 30"),
    "angle_is_zero": _edit("20.0", "0.0", "ramp_angle_deg", "(0, 90)", "scenario: level"),
    "angle_is_ninety": _edit("20.0", "90", "ramp_angle_deg", "90", "(0, 90)"),
    "angle_is_negative": _edit("20.0", "-20.0", "ramp_angle_deg", "-20", "(0, 90)"),
    "angle_in_radians": _edit("20.0", "0.349", "ramp_angle_deg", "did you mean 20", "radians"),
    "gravity_in_cm": _edit("9.81", "981", "gravity", "did you mean 9.81"),
    "gravity_is_negative": _edit("9.81", "-9.81", "gravity", "did you mean 9.81"),
    "scale_per_millimetre": _edit("300.0", "0.9", "pixels_per_metre", "did you mean 900"),
    "scale_in_metres_per_pixel": _edit("300.0", "0.00333", "pixels_per_metre", "did you mean 300"),
    "scale_sd_is_a_share_too_large": _edit(
        "300.0", "300.0\npixels_per_metre_sd: 90", "pixels_per_metre_sd", "90", "20%", "300"
    ),
    "scale_sd_is_negative": _edit(
        "300.0", "300.0\npixels_per_metre_sd: -1.5", "pixels_per_metre_sd", "-1.5", "0 or more"
    ),
    "scale_sd_without_a_scale": _edit(
        "300.0", "null\npixels_per_metre_sd: 1.5", "pixels_per_metre_sd", "without pixels_per_metre"
    ),
    "origin_sd_is_no_pixels": _edit(
        "gravity", "origin_sd_px: 640\ngravity", "origin_sd_px", "640", "[0, 50] pixels"
    ),
    "scale_is_zero": _edit("300.0", "0", "pixels_per_metre", "0", "above 0"),
    "size_in_millimetres": _edit("[0.06, ", "[60, ", "objects[0].size_m[0]", "did you mean 0.06"),
    "size_in_centimetres": _edit("[0.06, ", "[6, ", "objects[0].size_m[0]", "did you mean 0.06"),
    "size_is_negative": _edit("[0.06, ", "[-0.06, ", "objects[0].size_m[0]", "-0.06"),
    "size_of_a_cylinder_for_a_box": _edit(
        "[0.06, 0.05, 0.06]", "[0.06, 0.05]", "objects[0].size_m", "2 values", "depth, height"
    ),
    "size_of_a_box_for_a_sphere": _edit(
        "shape: box", "shape: sphere", "objects[0].size_m", "3 values", "[radius]"
    ),
    "torus_thicker_than_its_ring": _edit(
        "shape: box\n    size_m: [0.06, 0.05, 0.06]",
        "shape: torus\n    size_m: [0.01, 0.05]",
        "objects[0].size_m",
        "ring radius",
    ),
    "size_does_not_fit_the_frame": _edit("300.0", "9000.0", "size_m", "pixels_per_metre"),
    "no_objects": _text(
        GOOD_YAML.split("objects:")[0] + "objects: []\n", "objects", "at least one"
    ),
    "same_name_twice": _edit("object2", "object1", "objects[1].name", "object1", "differ"),
    "three_objects_on_a_ramp": _text(
        GOOD_YAML + "  - {name: object3, shape: box}\n", "objects", "at most 2", "multi"
    ),
    "mass_in_grams": _of_object("mass_kg: 250", "did you mean 0.25 (250 g)?"),
    "mass_is_zero": _of_object("mass_kg: 0", "above 0"),
    "mass_with_its_unit": _of_object("mass_kg: 45 g", "not a number"),
    "fall_with_a_ramp": _edit("scenario: ramp", "scenario: fall", "ramp_angle_deg", "leave it out"),
    # places
    "point_outside_the_frame": _edit(
        "[205.0, 141.0]", "[2050.0, 141.0]", "objects[1].point_px", f"{_WIDTH} x {_HEIGHT}"
    ),
    "point_left_of_the_frame": _edit(
        "[73.1, 108.8]", "[-3.0, 108.8]", "objects[0].point_px", "outside the frame"
    ),
    "point_as_fractions": _edit(
        "[73.1, 108.8]", "[0.23, 0.6]", "objects[0].point_px", "pixels expected"
    ),
    "origin_far_outside": _edit("[160.0, 150.0]", "[1600.0, 150.0]", "origin_px", "far outside"),
    "objects_overlap": _edit("[73.1, 108.8]", "[195.0, 141.0]", "object2", "reaches into object1"),
    "object_inside_the_ramp": _edit("[73.1, 108.8]", "[73.1, 140.0]", "object1", "inside the ramp"),
    "object_inside_the_table": _edit(
        "[205.0, 141.0]", "[205.0, 158.0]", "object2", "inside the table"
    ),
    "object_in_the_air": _edit("[205.0, 141.0]", "[205.0, 60.0]", "object2", "above the table"),
    "wrong_direction": _edit("direction: right", "direction: left", "objects[0]", "direction"),
    "last_frame_beyond_the_end": _of_object(
        "last_frame: 24", "24 is not after first_frame (0) and within the clip (to 23)"
    ),
    "last_frame_before_the_first": _of_object(
        "first_frame: 5; last_frame: 5", "5 is not after first_frame (5)"
    ),
    "correction_is_a_point": _of_object(
        "corrections: [12, 70.0, 110.0]", "not a list of [frame, x, y]"
    ),
    "correction_of_a_frame_that_is_not_used": _of_object(
        "last_frame: 9; corrections: [[10, 70.0, 110.0]]",
        "frame 10 is not after the first that is used (0) and up to the last (9)",
    ),
    "correction_outside_the_frame": _of_object(
        "corrections: [[10, 70.0, 1100.0]]", "outside the frame"
    ),
    "correction_given_twice": _of_object(
        "corrections: [[10, 70.0, 110.0], [10, 71.0, 110.0]]", "a frame twice"
    ),
    "correction_with_text": _of_object(
        "corrections: [[10, 70.0, left]]", "[0][2]", "'left' is not a number"
    ),
    "first_frame_beyond_the_end": _of_object("first_frame: 24", "24", "24 frames"),
    # yaml files
    "empty_yaml": _text("", "empty"),
    "only_comments": _text("# nothing yet\n", "empty"),
    "yaml_is_a_list": _text("- video: clip.mp4\n", "not a mapping"),
    "yaml_is_a_word": _text("clip.mp4\n", "not a mapping"),
    "not_yaml": _text("video: [clip.mp4\nfps: 30\n", "not yaml", "line"),
    "tab_in_yaml": _text("video: clip.mp4\n\tfps: 30\n", "not yaml", "line 2"),
    "impossible_date": _text("video: 2020-99-99\n", "not yaml"),
    "binary_yaml": _text(b"\xff\xfe\x00\x01", "not a text file"),
    "missing_file": (_file("none.mp4", None), ("none.mp4", "no such file")),
    "missing_yaml_file": (_file("none.yaml", None), ("none.yaml", "no such file")),
    "folder": (lambda folder: folder, ("folder",)),
    "yaml_beside_another_video": (_other_video, ("copy.yaml", "video", "copy.mp4")),
    # videos
    "video_file_missing": _edit("clip.mp4", "other.mp4", "video", "other.mp4", "no such file"),
    "zero_bytes": _video(lambda _: b"", "empty file"),
    "text_as_video": _video(lambda _: b"not a video\n" * 100, "cannot be decoded"),
    "picture_as_video": _video(_picture, "1 frame"),
    "zero_frames": _video(_without_frames, "cannot be decoded"),
    "cut_off_before_the_index": _video(lambda mp4: mp4[: len(mp4) // 2], "cannot be decoded"),
    "cut_off_in_the_middle": _video(_cut(0.6), "cut off", "of 24 frames"),
    "cut_off_avi": (_cut_avi, ("clip.avi", "cut off", "of 24 frames")),
    # csv tracks
    "track_without_time": _track("time_s", "times", "times", "did you mean time_s?"),
    "track_in_pixels": _track(
        "0.033333,", "0.033333,312.5,0.1,0.0005\n0.05,", "object1", "metres expected"
    ),
    "track_is_empty": _track(good_track(), "", "empty"),
    # tracks of other tools
    "trk_cut_off": _foreign("a.trk", make.trk()[:3000], "", "a.trk", "not whole XML"),
}

BROKEN_CLIPS: tuple[BrokenClip, ...] = tuple(
    BrokenClip(name, build, words) for name, (build, words) in _CASES.items()
)

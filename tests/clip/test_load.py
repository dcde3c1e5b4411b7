import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from galileo_jax.clip.load import check_clip, load_clip
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import ClipFile
from galileo_jax.clip.yaml_file import read_mapping, yaml_text
from galileo_jax.commands import command, label
from galileo_jax.runtime.errors import InputError
from tests.clip.broken_clips import (
    BROKEN_CLIPS,
    GOOD_YAML,
    BrokenClip,
    build_good,
    build_good_track,
    good_video,
)

by_id = pytest.mark.parametrize("broken", BROKEN_CLIPS, ids=lambda broken: broken.id)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def check_refused(exit_code: int, stderr: str, words: tuple[str, ...]) -> None:
    assert exit_code == 2
    assert stderr.endswith("\n")
    assert stderr.count("\n") == 1, stderr
    assert len(stderr) < 500
    for word in words:
        assert word in stderr


@by_id
def test_broken_clip_gives_one_line(broken: BrokenClip, tmp_path: Path, capfd) -> None:
    path = broken.build(tmp_path)
    before = contents(tmp_path)

    def main(argv):
        load_clip(argv[0])

    exit_code = command.run(main, [str(path)])
    check_refused(exit_code, capfd.readouterr().err, broken.words)
    assert contents(tmp_path) == before


# A few: what checks the clip is the same. A wrong gravity is what --gravity is there to mend.
@pytest.mark.parametrize(
    "broken",
    [broken for broken in BROKEN_CLIPS if not broken.id.startswith("gravity")][::8],
    ids=lambda broken: broken.id,
)
def test_label_refuses_broken_clip(broken: BrokenClip, tmp_path: Path, capfd) -> None:
    path = broken.build(tmp_path)
    before = contents(tmp_path)
    exit_code = command.run(label.main, [str(path), "--gravity", "9.8"])
    check_refused(exit_code, capfd.readouterr().err, broken.words)
    assert contents(tmp_path) == before


@pytest.mark.parametrize("name", ["cut_off_in_the_middle", "unknown_key", "missing_file"])
def test_module_prints_one_line(name: str, tmp_path: Path) -> None:
    broken = next(broken for broken in BROKEN_CLIPS if broken.id == name)
    arguments = [str(broken.build(tmp_path)), "--pixels-per-metre", "310"]
    done = subprocess.run(
        [sys.executable, "-m", "galileo_jax.label", *arguments], capture_output=True, text=True
    )
    check_refused(done.returncode, done.stderr, broken.words)
    assert done.stdout == ""


def test_at_least_forty_broken_clips_with_different_names() -> None:
    assert len({broken.id for broken in BROKEN_CLIPS}) == len(BROKEN_CLIPS) >= 40


@pytest.mark.parametrize("suffix", [".yaml", ".mp4"])
def test_good_clip(suffix: str, tmp_path: Path) -> None:
    clip = load_clip(build_good(tmp_path).with_suffix(suffix))
    assert clip.path == tmp_path / "clip.yaml"
    assert clip.video == tmp_path / "clip.mp4"
    assert clip.track is None
    assert (clip.frame_count, clip.frame_size_px) == (24, (320, 180))
    assert clip.objects[0].size_m == (0.06, 0.05, 0.06)
    assert clip.objects[1].first_frame == 0
    assert clip.warnings == ()


def test_the_yaml_beside_a_film_need_not_name_it(tmp_path: Path) -> None:
    build_good(tmp_path)
    (tmp_path / "clip.yaml").write_text(GOOD_YAML.replace("video: clip.mp4\n", ""))
    assert "video" not in (tmp_path / "clip.yaml").read_text()
    assert load_clip(tmp_path / "clip.mp4").video == tmp_path / "clip.mp4"
    with pytest.raises(InputError, match="video, track: missing"):
        load_clip(tmp_path / "clip.yaml")


@pytest.mark.parametrize("suffix", [".yaml", ".csv"])
def test_good_track(suffix: str, tmp_path: Path) -> None:
    clip = load_clip(build_good_track(tmp_path).with_suffix(suffix))
    assert clip.video is None
    assert clip.track == tmp_path / "clip.csv"
    assert clip.frame_count == 20
    assert clip.fps == pytest.approx(30.0, rel=1e-4)


def test_csv_beside_the_yaml_of_its_video_wins(tmp_path: Path) -> None:
    build_good_track(tmp_path)
    text = GOOD_YAML.split("  - name: object2")[0]
    (tmp_path / "clip.yaml").write_text(text.replace("fps: 30.0", "fps: 60.0"))
    clip = load_clip(tmp_path / "clip.csv")
    assert clip.video is None
    assert len(clip.warnings) == 1
    assert "60 declared" in clip.warnings[0]


def test_what_may_be_left_open(tmp_path: Path) -> None:
    build_good(tmp_path)
    (tmp_path / "clip.yaml").write_text(
        "video: clip.mp4\nscenario: incline\nfps: 30\nramp_angle_deg: 20\npixels_per_metre: null\n"
        "objects:\n  - {name: object1, shape: box, size_m: null}\n"
    )
    clip = load_clip(tmp_path / "clip.yaml")
    assert clip.pixels_per_metre is None
    assert clip.origin_px is None
    assert clip.objects[0].size_m is None
    assert clip.objects[0].point_px is None
    assert clip.gravity == 9.81


def test_overrides_win_and_are_checked(tmp_path: Path) -> None:
    path = build_good(tmp_path)
    assert load_clip(path, pixels_per_metre=305.0, fps=None).pixels_per_metre == 305.0
    with pytest.raises(InputError, match=r"pixels_per_metre \(given in the call\): 0.9 is too"):
        load_clip(path, pixels_per_metre=0.9)
    with pytest.raises(InputError, match="unknown key; did you mean pixels_per_metre"):
        load_clip(path, pixels_per_meter=305.0)


def test_declared_frame_rate_wins_with_a_warning(tmp_path: Path) -> None:
    clip = load_clip(build_good(tmp_path), fps=240.0)
    assert clip.fps == 240.0
    assert len(clip.warnings) == 1
    assert "240 declared, the container says 30" in clip.warnings[0]


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_every_scenario_loads(scenario: str, tmp_path: Path) -> None:
    path = build_good(tmp_path)
    text = GOOD_YAML.replace("scenario: ramp", f"scenario: {scenario}")
    if not SCENARIOS[scenario].has_ramp or SCENARIOS[scenario].angle_deg is not None:
        text = text.replace("ramp_angle_deg: 20.0\n", "")
    if scenario == "from_above":
        text = text.replace("shape: box", "shape: cylinder").replace(
            "[0.06, 0.05, 0.06]", "[0.03, 0.01]"
        )
    path.write_text(text.split("  - name: object2")[0])
    assert load_clip(path).scenario == scenario


@pytest.mark.parametrize(
    "shape, size",
    [
        ("box", [0.06, 0.05, 0.06]),
        ("cylinder", [0.03, 0.06]),
        ("torus", [0.03, 0.01]),
        ("sphere", [0.03]),
    ],
)
def test_every_shape_loads(shape: str, size: list[float], tmp_path: Path) -> None:
    path = build_good(tmp_path)
    text = GOOD_YAML.replace("shape: box", f"shape: {shape}", 1)
    path.write_text(text.replace("[0.06, 0.05, 0.06]", str(size), 1))
    assert load_clip(path).objects[0].shape == shape


@pytest.mark.parametrize("shift_px", [-4.0, 4.0])
@pytest.mark.parametrize("angle_deg", [18.0, 22.0])
def test_clicks_and_angles_may_be_a_little_off(
    shift_px: float, angle_deg: float, tmp_path: Path
) -> None:
    path = build_good(tmp_path)
    text = GOOD_YAML.replace("[73.1, 108.8]", f"[{73.1 + shift_px}, {108.8 + shift_px}]")
    path.write_text(text.replace("[205.0, 141.0]", f"[205.0, {141.0 + shift_px}]"))
    load_clip(path, ramp_angle_deg=angle_deg)


def test_left_going_clip_is_the_mirror_image(tmp_path: Path) -> None:
    path = build_good(tmp_path)
    text = GOOD_YAML.replace("right", "left").replace("73.1", "246.9").replace("205.0", "115.0")
    path.write_text(text)
    assert load_clip(path).direction == "left"


def test_all_development_clips_load(shared_data: Path) -> None:
    paths = sorted(shared_data.glob("*/*.yaml"))
    assert paths
    for path in paths:
        clip = load_clip(path)
        is_slow_motion = clip.fps == 240.0
        assert len(clip.warnings) == is_slow_motion


GARBAGE = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from(["ramp", "box", "clip.mp4", "clip.csv", "right", 10**400, "\0", "a" * 300]),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(
            st.text(max_size=5) | st.sampled_from(["name", "shape"]), inner, max_size=4
        )
    ),
    max_leaves=8,
)
KEYS = st.sampled_from(sorted(ClipFile.model_fields))


@settings(max_examples=200)
@given(changes=st.dictionaries(KEYS | st.text(max_size=4), GARBAGE, max_size=3))
def test_garbage_values_give_one_line(changes, tmp_path_factory) -> None:
    folder = tmp_path_factory.getbasetemp() / "garbage"
    folder.mkdir(exist_ok=True)
    content = read_mapping(build_good(folder)) | changes
    try:
        check_clip(folder / "clip.yaml", content)
    except InputError as error:
        assert "clip." in str(error)


@settings(max_examples=200)
@given(text=st.text(alphabet=st.sampled_from("ab:-[]{}&*!|>'\"#%@`?,. \n\t012<=~"), max_size=40))
def test_garbage_yaml_gives_one_line(text, tmp_path_factory) -> None:
    path = tmp_path_factory.getbasetemp() / "garbage.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"garbage\.yaml"):
        load_clip(path)


def test_aliases_and_deep_nesting_give_one_line(tmp_path: Path) -> None:
    path = build_good(tmp_path)
    laughs = "".join(
        f"{b}: &{b} [{', '.join([f'*{a}'] * 9)}]\n" for a, b in pairwise("abcdefghijk")
    )
    for text in (
        "&a [*a]",
        "[" * 3000,
        "objects: &a [*a]\nvideo: clip.mp4",
        "1: " + "9" * 5000,
        f"video: clip.mp4\nscenario: &a [x]\n{laughs}".replace("k:", "objects:"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=r"clip\.yaml"):
            load_clip(path)


def test_dumped_yaml_reads_back(tmp_path: Path) -> None:
    content = read_mapping(build_good(tmp_path))
    (tmp_path / "new.yaml").write_text(yaml_text(content))
    assert read_mapping(tmp_path / "new.yaml") == content
    assert good_video()

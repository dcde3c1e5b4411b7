"""Physics 101: a tree of its shape, with videos of our own; angle and objects from the folders."""

import shlex
import shutil
from pathlib import Path

import pytest
import yaml

import galileo_jax.physics101  # noqa: F401  # a source of clips
from galileo_jax.api.simulate import simulate
from galileo_jax.clip.checks import check_same_objects
from galileo_jax.clip.load import load_clip
from galileo_jax.commands import command, label
from galileo_jax.runtime.errors import InputError
from tests.clip.broken_clips import good_video

LABELS = {
    "objects": {
        "c_block_01": {"size_m": [0.06, 0.05, 0.06]},
        "w_block_02": {"shape": "box", "size_m": [0.07, 0.05, 0.06], "mass_kg": 0.2},
    },
    "clips": {
        "ramp": {"origin_px": [150.0, 150.0], "fps": 25.0},
        "ramp/20_01": {"origin_px": [160.0, 150.0], "target": "w_block_02"},
        "ramp/20_01/c_block_01/03": {
            "point_px": {"c_block_01": [73.1, 108.8], "w_block_02": [205.0, 141.0]},
            "pixels_per_metre": 300.0,
        },
    },
}


def add_clip(root: Path, *folders: str) -> Path:
    path = root.joinpath("phys101", "scenarios", *folders, "Camera_1.mp4")
    path.parent.mkdir(parents=True)
    path.write_bytes(good_video())
    return path


def write_labels(root: Path, content: object) -> Path:
    path = root / "phys101" / "scenarios" / "labels.yaml"
    path.write_text(content if isinstance(content, str) else yaml.safe_dump(content))
    return path


def run(*argv: object) -> int:
    return command.run(label.main, [str(part) for part in argv])


def test_folders_and_labels_declare_the_clip(tmp_path: Path) -> None:
    path = add_clip(tmp_path, "ramp", "20_01", "c_block_01", "03")
    write_labels(tmp_path, LABELS)
    clip = load_clip(path)
    assert (clip.scenario, clip.ramp_angle_deg, clip.fps) == ("ramp", 20.0, 25.0)
    assert (clip.pixels_per_metre, clip.origin_px) == (300.0, (160.0, 150.0))
    assert clip.video == path
    assert clip.path.stem == "20_01-c_block_01-03"
    first, second = clip.objects
    assert (first.name, first.shape, first.point_px) == ("c_block_01", "box", (73.1, 108.8))
    assert (second.name, second.mass_kg, second.point_px) == ("w_block_02", 0.2, (205.0, 141.0))


def test_scale_of_the_thesis_is_the_default(tmp_path: Path) -> None:
    path = add_clip(tmp_path, "ramp", "10_02", "c_block_01", "01")
    clip = load_clip(path)
    # 107.5 px are 6.35 cm in a picture of 1920; these are 320 wide.
    assert clip.pixels_per_metre == pytest.approx(107.5 / 0.0635 * 320 / 1920, abs=1e-3)
    assert clip.ramp_angle_deg == 10.0
    assert [item.name for item in clip.objects] == ["c_block_01"]
    assert "107.5 pixels to 6.35 cm" in clip.warnings[-1]
    assert load_clip(path, pixels_per_metre=290.0).pixels_per_metre == 290.0


def test_object_before_set_up_and_other_scenarios(tmp_path: Path) -> None:
    clip = load_clip(add_clip(tmp_path, "ramp", "c_block_01", "20_01", "03"))
    assert (clip.ramp_angle_deg, clip.objects[0].name) == (20.0, "c_block_01")
    fall = load_clip(add_clip(tmp_path, "fall", "table", "w_block_05", "01"))
    assert (fall.scenario, fall.pixels_per_metre) == ("fall", None)
    assert fall.objects[0].name == "w_block_05"


def test_trials_have_different_names(tmp_path: Path) -> None:
    paths = [add_clip(tmp_path, "ramp", "20_01", "c_block_01", trial) for trial in ("01", "02")]
    write_labels(tmp_path, LABELS)
    clips = [load_clip(path) for path in paths]
    check_same_objects(clips)
    assert [clip.path.stem for clip in clips] == ["20_01-c_block_01-01", "20_01-c_block_01-02"]


def test_yaml_beside_the_video_wins(tmp_path: Path) -> None:
    path = add_clip(tmp_path, "ramp", "20_01", "c_block_01", "03")
    path.with_suffix(".yaml").write_text(
        "video: Camera_1.mp4\nscenario: incline\nfps: 30.0\nramp_angle_deg: 12.0\n"
        "objects: [{name: a, shape: box}]\n"
    )
    assert load_clip(path).ramp_angle_deg == 12.0


def test_label_writes_the_table(tmp_path: Path, capsys) -> None:
    path = add_clip(tmp_path, "ramp", "20_01", "c_block_01", "03")
    other = add_clip(tmp_path, "ramp", "20_01", "c_block_01", "04")
    assert run(path, *shlex.split("--level setup --origin 160 150 --scale 0 100 150 100 0.5")) == 0
    assert run(path, *shlex.split(
        "--point c_block_01 73.1 108.8 --size c_block_01 0.06 0.05 0.06 --point w_block_02 205 141"
    )) == 0  # fmt: skip
    labels = path.parents[4] / "labels.yaml"
    assert capsys.readouterr().out.split() == [str(labels)] * 2
    content = yaml.safe_load(labels.read_text())
    assert content["clips"]["ramp/20_01"] == {
        "origin_px": [160.0, 150.0],
        "origin_sd_px": 0.5,
        "pixels_per_metre": 300,
        "pixels_per_metre_sd": 1.41,
    }
    trial = content["clips"]["ramp/20_01/c_block_01/03"]
    assert trial["point_px"]["c_block_01"] == [73.1, 108.8]
    clip = load_clip(path)
    assert clip.objects[1].name == "w_block_02"
    assert clip.objects[0].size_m == (0.06, 0.05, 0.06)
    assert load_clip(other).origin_px == (160.0, 150.0)
    assert load_clip(other).objects[0].point_px is None


def test_label_keeps_the_tables_comments(tmp_path: Path, capsys) -> None:
    path = add_clip(tmp_path, "ramp", "20_01", "c_block_01", "03")
    text = f"# measured in May\n{yaml.safe_dump(LABELS)}"
    labels = write_labels(tmp_path, text)
    assert run(path, "--gravity", 9.8) == 0
    assert "comments" not in capsys.readouterr().err
    assert labels.read_text().startswith("# measured in May\n")
    assert load_clip(path).gravity == 9.8


@pytest.mark.parametrize("labels, words", [
    ("clips: [1]", "clips: [1] is not a mapping"),
    ("clips:\n  ramp: 3", "clips.'ramp': 3 is not a mapping"),
    ("clip: {}", "'clip': unknown key; known: objects, clips"),
    ("objects: {c_block_01: {size_m: [60, 50, 60]}}", "objects[0].size_m[0]: 60 m is too large"),
    ("clips: {ramp: {gravitiy: 9.8}}", "gravitiy: unknown key; did you mean gravity?"),
    ("clips: {ramp: {point_px: {ball: [1, 2]}}}", "'ball' is not in ramp/20_01/c_block_01/03"),
    ("clips: {ramp: {point_px: 3}}", "point_px: 3 is not a mapping"),
    ("clips: {ramp: [", "not yaml"),
])  # fmt: skip
def test_broken_labels_are_one_line(labels: str, words: str, tmp_path: Path) -> None:
    path = add_clip(tmp_path, "ramp", "20_01", "c_block_01", "03")
    write_labels(tmp_path, labels)
    with pytest.raises(InputError) as caught:
        load_clip(path)
    assert words in str(caught.value)
    assert "labels.yaml" in str(caught.value)
    assert "03.yaml" not in str(caught.value)


def test_label_refuses_what_the_folders_say(tmp_path: Path, capsys) -> None:
    path = add_clip(tmp_path, "ramp", "20_01", "c_block_01", "03")
    assert run(path, "--scenario", "incline") == 2
    assert "say ramp" in capsys.readouterr().err
    assert run(path, "--size", "c_block_01", 60, 50, 60) == 2
    assert not (path.parents[4] / "labels.yaml").exists()


@pytest.mark.slow
@pytest.mark.video
def test_simulated_clip_in_the_tree_is_fitted(tmp_path: Path) -> None:
    """The whole way: simulate, folders, label, fit; friction comes back."""
    import json

    from galileo_jax.commands import fit

    made = tmp_path / "clip.mp4"
    simulate(made, seed=5, k1=0.2, k2=0.3, m1=0.2, m2=0.2)
    declared = yaml.safe_load(made.with_suffix(".yaml").read_text())
    path = tmp_path.joinpath("scenarios", "ramp", "20_01", "object1", "01", "Camera_1.mp4")
    path.parent.mkdir(parents=True)
    shutil.move(made, path)
    argv = ["--pixels-per-metre", declared["pixels_per_metre"], "--origin", *declared["origin_px"]]
    for item in declared["objects"]:
        argv += ["--point", item["name"], *item["point_px"], "--size", item["name"]]
        argv += item["size_m"]
    assert run(path, *argv) == 0
    out = tmp_path / "run"
    assert command.run(fit.main, [str(path), "--out", str(out)]) == 0
    found = json.loads((out / "result.json").read_text())["parameters"]["k1"]
    assert found["mean"] == pytest.approx(0.2, abs=0.02)

"""`label`: the function and the command write the same bytes; comments and layout stay."""

from pathlib import Path

import pytest
import yaml

from galileo_jax.api.label import label
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.yaml_update import updated_text
from galileo_jax.commands import command
from galileo_jax.commands import label as label_command
from galileo_jax.runtime.errors import InputError
from tests.clip.broken_clips import build_good, good_video

NEW = (
    "--scenario ramp --ramp 60 113.6 150 146.4 --scale 0 100 150 100 0.5 --origin 160 150 "
    "--point object1 73.1 108.8 --size object1 0.06 0.05 0.06 --point object2 205 141 "
    "--first-frame object2 3"
)
NEW_GIVEN = {
    "scenario": "ramp",
    "ramp": (60, 113.6, 150, 146.4),
    "scale": (0, 100, 150, 100, 0.5),
    "origin": (160, 150),
    "point": {"object1": (73.1, 108.8), "object2": (205, 141)},
    "size": {"object1": (0.06, 0.05, 0.06)},
    "first_frame": {"object2": 3},
}
UPDATE = (
    "--gravity 10 --direction right --first-frame object1 null --shape object2 box "
    "--last-frame object2 20 --correct object1 12 80 112.5 --correct object1 9 77 111"
)
UPDATE_GIVEN = {
    "gravity": 10,
    "direction": "right",
    "first_frame": {"object1": None},
    "shape": {"object2": "box"},
    "last_frame": {"object2": 20},
    "correct": {"object1": [(12, 80, 112.5), (9, 77, 111)]},
}


def run(*argv: object) -> int:
    return command.run(label_command.main, [str(part) for part in argv])


def test_a_new_yaml_is_the_commands(tmp_path: Path, capsys) -> None:
    paths = [tmp_path / name / "clip.mp4" for name in ("function", "command")]
    for path in paths:
        path.parent.mkdir()
        path.write_bytes(good_video())
    done = label(paths[0], **NEW_GIVEN)
    assert capsys.readouterr() == ("", "")
    assert run(paths[1], *NEW.split()) == 0
    assert done.path == paths[0].with_suffix(".yaml")
    assert done.path.read_bytes() == paths[1].with_suffix(".yaml").read_bytes()
    assert done.clip.pixels_per_metre == 300
    assert done.notes == (
        "fps: 30 taken from the video file; slow-motion files often state a wrong rate",
    )
    assert f"note: {done.notes[0]}\n" in capsys.readouterr().err


def test_an_update_is_the_commands(tmp_path: Path) -> None:
    texts = []
    for name in ("function", "command"):
        (tmp_path / name).mkdir()
        path = build_good(tmp_path / name)
        path.write_text(path.read_text().replace("[205.0, 141.0]", "[205.0, 141.0]  # guessed"))
        if name == "function":
            label(path, **UPDATE_GIVEN)
        else:
            assert run(path, *UPDATE.split()) == 0
        texts.append(path.read_text())
    assert texts[0] == texts[1]
    assert "gravity: 10.0\n" in texts[0]
    clip = load_clip(path)
    assert clip.objects[1].last_frame == 20
    assert clip.objects[0].corrections == ((9, 77, 111), (12, 80, 112.5))
    assert "# guessed" in texts[0]


def test_a_correction_is_replaced_and_taken_back(tmp_path: Path) -> None:
    path = build_good(tmp_path)
    label(path, correct={"object1": [(9, 77, 111), (12, 80, 112)]})
    found = label(path, correct={"object1": [(12, 81, 113), (9,)]}).clip
    assert found.objects[0].corrections == ((12, 81, 113),)
    for wrong, words in (
        ({"object1": [(3, 1)]}, "not a frame, x and y"),
        ({"object1": [(2.5, 1, 1)]}, "not a frame, x and y"),
        ({"object7": [(2, 1, 1)]}, "there is no 'object7' to correct"),
    ):
        with pytest.raises(InputError, match=words):
            label(path, correct=wrong)


@pytest.mark.parametrize(
    ("words", "given"),
    [
        ("", {}),
        (
            "--scale 0 0 1 0 1 --pixels-per-metre 9",
            {"scale": (0, 0, 1, 0, 1), "pixels_per_metre": 9},
        ),
        ("--ramp 0 0 1 1 --ramp-angle 9", {"ramp": (0, 0, 1, 1), "ramp_angle": 9}),
        ("--scale 5 5 5 5 1", {"scale": (5, 5, 5, 5, 1)}),
        ("--ramp 0 9 5 9", {"ramp": (0, 9, 5, 9)}),
        ("--point object1 left 9", {"point": {"object1": ("left", 9)}}),
        ("--point object1 900 9", {"point": {"object1": (900, 9)}}),
        ("--first-frame object1 -2", {"first_frame": {"object1": -2}}),
        ("--size object1 60 60 60", {"size": {"object1": (60, 60, 60)}}),
        ("--shape object1 cube", {"shape": {"object1": "cube"}}),
        ("--scenario rmap", {"scenario": "rmap"}),
        ("--level object --gravity 9.8", {"level": "object", "gravity": 9.8}),
        ("--level folder --gravity 9.8", {"level": "folder", "gravity": 9.8}),
    ],
)
def test_wrong_calls_are_refused_with_the_commands_sentence(
    words: str, given: dict, tmp_path: Path, capsys
) -> None:
    path = build_good(tmp_path)
    before = path.read_bytes()
    assert run(path, *words.split()) == 2
    sentence = capsys.readouterr().err
    with pytest.raises(InputError) as caught:
        label(path, **given)
    assert f"error: {caught.value}\n" == sentence
    assert path.read_bytes() == before


COMMENTED = """\
---
# A clip.
video: clip.mp4   # the file
scenario: ramp
fps: 30.0  # as declared
# how steep

ramp_angle_deg: 20.0
gravity: 9.810
objects:
  # down the ramp
  - name: 'object1'  # red
    size_m: [0.06, 0.05, 0.06]  # by a ruler
    # by eye
    point_px: [73.1, 108.8]  # twice
  # waits
  - name: object2
    point_px:
      - 1.0
      - 2.0  # down
# the end
"""


def test_comments_quotes_and_order_stay() -> None:
    content = yaml.safe_load(COMMENTED)
    content["direction"] = "right"
    content["objects"][0] |= {"point_px": [73.0, 109.0], "first_frame": 2}
    content["objects"][1]["point_px"] = [1.0, 3.0]
    text, has_comments = updated_text(
        COMMENTED, content, ("fps", "ramp_angle_deg", "direction", "gravity", "objects")
    )
    assert has_comments
    expected = COMMENTED.replace(
        "[73.1, 108.8]  # twice\n", "[73.0, 109.0]  # twice\n    first_frame: 2\n"
    )
    expected = expected.replace("gravity", "direction: right\ngravity").replace("- 2.0", "- 3.0")
    assert text == expected


def test_a_comment_stays_above_what_it_is_about() -> None:
    content = {**yaml.safe_load(COMMENTED), "direction": "left"}
    text, _ = updated_text(COMMENTED, content, ("fps", "direction", "ramp_angle_deg"))
    assert text == COMMENTED.replace("declared\n", "declared\ndirection: left\n")


@pytest.mark.parametrize("indent", ["", "    "])
def test_lists_stay_indented_as_they_are(indent: str) -> None:
    text = f"fps: 30.0\nobjects:\n{indent}- name: a\n{indent}  shape: box\n"
    content = yaml.safe_load(text)
    content["objects"].append({"name": "b", "shape": "box", "point_px": [1.0, 2.0]})
    new = f"{indent}- name: b\n{indent}  shape: box\n{indent}  point_px: [1.0, 2.0]\n"
    assert updated_text(text, content) == (text + new, True)


def test_tables_of_labels_keep_their_comments() -> None:
    objects = "# ours\nobjects:\n    a: {size_m: [0.1]}  # small\n"
    text = f"{objects}clips:\n    ramp:\n        fps: 25.0\n"
    content = yaml.safe_load(text)
    content["objects"]["b"] = {"shape": "box", "size_m": [0.2]}
    content["clips"]["ramp/20_01"] = {"direction": "right"}
    new, has_comments = updated_text(text, content)
    assert has_comments
    assert yaml.safe_load(new) == content
    assert new.startswith(f"{objects}    b:\n")
    assert new.endswith("        fps: 25.0\n    ramp/20_01: {direction: right}\n")

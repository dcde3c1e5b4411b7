"""What is asked of a person: no more than the file and its yaml leave open."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from galileo_jax.api.clips import load
from galileo_jax.api.look import look
from galileo_jax.api.proposed_clip import clip_of, write_yaml, yaml_of
from galileo_jax.api.questions import check_answered, parsed, questions
from galileo_jax.api.understand import _likely_between_rests, is_declared, understand
from galileo_jax.clip.schema import ClipFile
from galileo_jax.observation.observation import PointPath
from galileo_jax.runtime.errors import InputError
from tests.tracking.moving_box import RELEASE, Box, film, throw

T = np.arange(30) / 25
FLIGHT = ("t (s);x (m);y (m)", (T, 2 * T, 3 * T - 4.905 * T**2))
SLOPE = ("t (s);s", (T, 0.4 * T**2))


def table(path: Path, titles: str, columns) -> Path:
    rows = "\n".join(";".join(f"{v:.4f}" for v in row) for row in zip(*columns, strict=True))
    path.write_text(f"{titles}\n{rows}\n")
    return path


def keys(path: Path, **answers) -> list[str]:
    return [one.key for one in questions(understand(path).with_answers(answers))]


@pytest.mark.parametrize(
    ("titles", "columns", "asked"),
    [
        (*FLIGHT, []),
        (*SLOPE, ["scenario", "track_units", "ramp_angle_deg"]),
        ("t (s);s (m)", (T, 0.4 * T**2), ["scenario", "ramp_angle_deg"]),
        ("t (s);x (m);y (m)", (T, 0.9 * T**2, -0.5 * T**2), ["ramp_angle_deg"]),
        ("t (s);x (m);y (m)", (T, 0.9 * T**2, 0.01 * T**2), ["scenario", "ramp_angle_deg"]),
        ("t (s);x (m);y (m)", (T, 0 * T, 5 - 4.905 * T**2), []),
        ("t (s);x (m);y (m)", (T, 0 * T, 0.1 * T**2), ["scenario"]),
        ("t (s);x (m);y (m)", (T, 0.01 * T**2, 0.2 * T**2), ["scenario", "ramp_angle_deg"]),
        ("t (s);x;y", (T, 2 * T, 3 * T - 4.905 * T**2), ["track_units"]),
        ("frame;x (m);y (m)", (T * 25, 2 * T, 3 * T - 4.905 * T**2), ["fps"]),
        ("t (s);x (px);y (px)", (T, 90 * T**2, 50 * T**2), ["ramp_angle_deg", "pixels_per_metre"]),
        ("t (s);x (px);y (px)", (T, 200 * T, 981 * T**2 / 2), []),
    ],
)
def test_what_is_asked_of_a_table(titles, columns, asked, tmp_path):
    assert keys(table(tmp_path / "a.csv", titles, columns)) == asked


def test_an_answer_settles_its_question_and_what_hangs_on_it(tmp_path):
    path = table(tmp_path / "a.csv", *SLOPE)
    assert keys(path, scenario="incline") == ["track_units", "ramp_angle_deg"]
    assert keys(path, scenario="fall") == ["track_units"], "a fall has no ramp"
    assert keys(path, scenario="incline", track_units="m", ramp_angle_deg=20.0) == []
    assert keys(path, scenario="incline", pixels_per_metre=500.0, ramp_angle_deg=20.0) == []


@pytest.mark.parametrize(
    ("metres", "unit"), [(1.0, "m"), (0.01, "cm"), (0.001, "mm"), (0.3048, "ft")]
)
def test_what_falls_tells_its_unit(metres, unit, tmp_path):
    columns = (T, 2 * T / metres, (3 * T - 4.905 * T**2) / metres)
    known = understand(table(tmp_path / "a.csv", "t (s);x;y", columns))
    (one,) = questions(known)
    assert (one.default, one.is_open) == (unit, False)
    assert clip_of(known).track_units == unit, "nobody has to be asked"
    assert f"track_units: {unit}  # it falls with" in yaml_of(known), "but it is said"


def test_a_slope_that_the_path_shows_is_used_and_one_that_it_does_not_is_missing(tmp_path):
    titles = "t (s);x (m);y (m)"
    seen = understand(table(tmp_path / "a.csv", titles, (T, 0.9 * T**2, -0.5 * T**2)))
    assert clip_of(seen).ramp_angle_deg is None, "to be taken from the path"
    assert "29.1 degrees" in questions(seen)[0].why
    unseen = understand(table(tmp_path / "b.csv", "t (s);s (m)", (T, 0.4 * T**2)))
    with pytest.raises(InputError, match="ramp_angle_deg"):
        clip_of(unseen.with_answers({"scenario": "incline"}))


def test_one_line_names_all_that_is_missing_and_a_call_that_would_do(tmp_path):
    path = table(tmp_path / "a.csv", *SLOPE)
    with pytest.raises(InputError) as error:
        clip_of(understand(path))
    line = str(error.value)
    assert "\n" not in line
    assert f"{path}: there is no a.yaml" in line
    for word in ("scenario", "track_units", "ramp_angle_deg"):
        assert word in line
    call = f"galileo {path} --scenario incline --track-units m --ramp-angle 20"
    assert line.endswith(call)


def test_the_yaml_declares_what_was_said_and_a_second_call_asks_nothing(tmp_path):
    path = table(tmp_path / "a.csv", *SLOPE)
    known = understand(path)
    answers = {"scenario": "incline", "track_units": "cm", "ramp_angle_deg": 21.5}
    assert not is_declared(path)
    assert write_yaml(known.with_answers(answers)) == tmp_path / "a.yaml"
    written = yaml.safe_load((tmp_path / "a.yaml").read_text())
    ClipFile.model_validate(written | {"fps": 25.0})
    assert written | answers == written and written["track"] == "a.csv"
    assert is_declared(path) and keys(path) == []
    assert load(path).ramp_angle_deg == 21.5


def test_a_yaml_that_is_there_is_never_written_to(tmp_path):
    path = table(tmp_path / "a.csv", *SLOPE)
    text = "# mine\ntrack: a.csv\nscenario: incline\ngravity: 9.8\n"
    (tmp_path / "a.yaml").write_text(text)
    known = understand(path)
    assert [one.key for one in questions(known)] == ["track_units", "ramp_angle_deg"]
    answers = {"track_units": "m", "ramp_angle_deg": 20.0}
    clip = clip_of(known.with_answers(answers))
    assert (clip.gravity, clip.ramp_angle_deg, len(clip.objects)) == (9.8, 20.0, 1)
    assert write_yaml(known.with_answers(answers)) is None
    assert (tmp_path / "a.yaml").read_text() == text


def test_what_is_said_in_the_call_goes_before_the_yaml(tmp_path):
    path = table(tmp_path / "a.csv", *SLOPE)
    (tmp_path / "a.yaml").write_text("track: a.csv\nscenario: incline\nramp_angle_deg: 20.0\n")
    clip = clip_of(understand(path).with_answers({"track_units": "m", "ramp_angle_deg": 25.0}))
    assert clip.ramp_angle_deg == 25.0


@pytest.mark.parametrize(
    ("key", "text", "found"),
    [
        ("scenario", "", {"scenario": "incline"}),
        ("track_units", "cm", {"track_units": "cm"}),
        ("track_units", "parsec", "one of m, cm"),
        ("ramp_angle_deg", "21,5", {"ramp_angle_deg": 21.5}),
        ("ramp_angle_deg", "", "an answer is needed"),
        ("ramp_angle_deg", "steep", "'steep' is not a number"),
        ("ramp_angle_deg", "nan", "'nan' is not a number"),
    ],
)
def test_answers_as_they_are_typed(key, text, found, tmp_path):
    known = understand(table(tmp_path / "a.csv", *SLOPE))
    (one,) = [one for one in questions(known) if one.key == key]
    if isinstance(found, str):
        with pytest.raises(InputError, match=found):
            parsed(one, text, known)
    else:
        assert parsed(one, text, known) == found


@pytest.mark.parametrize("name", ["none.csv", "none.yaml"])
def test_what_is_not_there_is_one_line(name, tmp_path):
    with pytest.raises(InputError, match="no such file"):
        understand(tmp_path / name)


def test_the_yaml_of_a_table_in_which_nothing_is_open_has_no_comment_left(tmp_path):
    known = understand(table(tmp_path / "a.csv", *SLOPE))
    answers = {"scenario": "incline", "track_units": "m", "ramp_angle_deg": 20.0}
    assert "#" not in yaml_of(known.with_answers(answers))


def filmed(folder: Path, *paths: np.ndarray) -> Path:
    """A film of boxes that move as paths `[frame, 3]` say."""
    return written(folder, film([(Box(seed=4 * n), path) for n, path in enumerate(paths)]))


def upright(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A path `[frame, 3]` of what does not turn; either may be one number for all frames."""
    return np.stack([x + 0 * y, y + 0 * x, 0 * (x + y)], axis=1)


def written(folder: Path, frames: list[np.ndarray]) -> Path:
    video = folder / "clip.mp4"
    size = frames[0].shape[1::-1]
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"mp4v"), 30.0, size)
    for frame in frames:
        writer.write(frame)
    writer.release()
    return video


@pytest.mark.video
def test_a_film_of_one_thing_on_a_slope_asks_for_angle_and_scale(tmp_path):
    run = 5.0 * np.clip(np.arange(30.0) - 3, 0, 18)
    path = filmed(tmp_path, np.stack([50 + run, 40 + 0.5 * run, 0 * run], axis=1))
    known = understand(path)
    (point,) = known.things
    assert np.hypot(point[0] - 50, point[1] - 40) < 5
    asked = {one.key: one for one in questions(known)}
    assert list(asked) == ["ramp_angle_deg", "pixels_per_metre"], "scenario: a straight way"
    assert asked["ramp_angle_deg"].default == "path" and not asked["ramp_angle_deg"].is_open
    told = float(asked["ramp_angle_deg"].why.split()[-2])
    assert told == pytest.approx(26.6, abs=1.0)
    with pytest.raises(InputError, match="pixels_per_metre"):
        clip_of(known)
    said = parsed(asked["pixels_per_metre"], "0.08 m", known)
    assert said["pixels_per_metre"] == pytest.approx(32 / 0.08, rel=0.3)
    assert said["pixels_per_metre_sd"] > 0.05 * said["pixels_per_metre"], "ends of texture"
    clip = clip_of(known.with_answers(said))
    assert (clip.scenario, clip.direction, clip.ramp_angle_deg) == ("incline", "right", None)
    assert write_yaml(known.with_answers(said)) is not None and is_declared(path)


@pytest.mark.video
def test_of_two_things_a_person_chooses(tmp_path):
    time = np.arange(30.0)
    first = 4.0 * np.clip(time - 3, 0, 12)
    second = 3.0 * np.clip(time - 12, 0, 12)
    path = filmed(
        tmp_path,
        upright(40 + first, np.array(40)),
        upright(150 + second, np.array(90)),
    )
    known = understand(path)
    assert len(known.things) == 2
    one = questions(known)[0]
    assert one.key == "points" and "2 things move" in one.why
    (x, y) = parsed(one, "2", known)["points"][0]
    assert np.hypot(x - 150, y - 90) < 5
    assert parsed(one, "both", known)["points"] == list(known.things)
    assert parsed(one, "31 41.5", known) == {"points": [(31.0, 41.5)]}
    said = {"points": list(known.things), "scenario": "ramp", "pixels_per_metre": 900.0}
    listed = yaml.safe_load(yaml_of(known.with_answers(said)))["objects"]
    assert listed[0]["first_frame"] is None, "its motion says when it is let go"
    assert "first_frame" not in listed[1]
    with pytest.raises(InputError, match="x and y expected"):
        parsed(one, "the red one", known)


@pytest.mark.video
def test_two_things_that_meet_are_followed_together(tmp_path):
    """From above: what is struck beside its middle goes off at an angle."""
    time = np.arange(40.0)
    first = 5.0 * np.clip(time - 3, 0, 16) + 1.0 * np.clip(time - 19, 0, 8)
    second = 4.0 * np.clip(time - 19, 0, 12)
    struck = upright(142 + second, 66 + 0.6 * second)
    path = filmed(tmp_path, upright(30 + first, np.array(60)), struck)
    known = understand(path)
    asked = {one.key: one for one in questions(known)}
    assert asked["points"].default == "both"
    assert asked["scenario"].default == "from_above"
    assert asked["pixels_per_metre"].is_open, "friction cannot be told without"


@pytest.mark.video
def test_of_a_hand_and_what_it_lets_go_the_latter_is_the_default(tmp_path):
    """The hand moves first, to and fro; the other thing goes down a slope."""
    time = np.arange(40.0)
    hand, run = np.clip(time - 2, 0, 24), 4.0 * np.clip(time - 8, 0, 20)
    path = filmed(
        tmp_path,
        upright(150 + 12 * np.sin(hand / 2), 30 + 8 * np.cos(hand / 3)),
        upright(50 + run, 60 + 0.5 * run),
    )
    known = understand(path)
    assert len(known.things) == 2 and known.likeliest is not None
    asked = questions(known)
    assert [one.key for one in asked][:1] == ["points"]
    number = int(asked[0].default or 0)
    x, y = list(known.things)[number - 1]
    assert np.hypot(x - 50, y - 60) < 8
    assert asked[0].option == f"--point {x:.0f} {y:.0f}", "a call that would do"
    assert "scenario" not in [one.key for one in asked], "that of the default"


@pytest.mark.video
def test_a_thrown_ball_is_followed_from_when_it_leaves_the_hand(tmp_path):
    frames, ball = throw()
    seen = look(written(tmp_path, frames))
    known = seen.understood
    asked = questions(known)
    assert (asked[0].key, asked[0].default) == ("points", "1")
    said = parsed(asked[0], "1", known)
    first = known.first_frame(said["points"][0])
    assert RELEASE <= first < RELEASE + 5 and f"from frame {first} on" in asked[0].why
    rough = [(round(x), round(y)) for x, y in said["points"]]  # as `--point` is written
    for points in (said["points"], rough):
        content = yaml.safe_load(yaml_of(known.with_answers({"points": points})))
        (declared,) = content["objects"]
        assert content["scenario"] == "flight" and declared["first_frame"] == first
        np.testing.assert_allclose(declared["point_px"], ball[first], atol=1.5)
    said = seen.summary()
    assert "2 things move" in said and f"1 is at {ball[first, 0]:.0f} " in said
    assert "clip.yaml would be:" in said and "scenario: flight" in seen.yaml


@pytest.mark.video
def test_a_film_in_which_nothing_moves_asks_for_a_point(tmp_path):
    still = np.tile([[50.0, 40.0, 0.0]], (20, 1))
    seen = look(filmed(tmp_path, still))
    assert "No moving thing was found: nothing moves in it" in seen.summary() and not seen.yaml
    known = seen.understood
    asked = questions(known)
    assert asked[0].key == "points" and asked[0].default is None
    with pytest.raises(InputError, match="nothing moves in it; film with a camera that rests"):
        clip_of(known)


def test_a_slide_before_a_hand_takes_the_thing_away_is_a_slide():
    """It slides, rests at the board's end, and is carried round a bend to where it began."""
    t = np.arange(150) / 30
    slide = np.clip(t - 0.5, 0, 1) ** 2 * 300
    carried = np.clip(t - 3.0, 0, 1) * 0.9 * np.pi
    turn = 200 * np.stack([np.cos(carried) - 1, -np.sin(carried)])
    place = np.stack([slide, 0.4 * slide]) + turn
    place = place + 0.05 * np.random.default_rng(1).standard_normal(place.shape)
    found = _likely_between_rests(PointPath(np.arange(150), t, place, np.full(150, 0.05**2)))
    assert found.scenario == "incline" and found.is_clear
    assert found.why.endswith("it moves 2 times, with rests between")


def test_what_was_said_is_in_the_call_that_is_proposed(tmp_path):
    film = filmed(tmp_path, np.tile([[50.0, 40.0, 0.0]], (20, 1)))
    with pytest.raises(InputError, match="--scenario incline --point 50 40 --ramp-angle 20"):
        check_answered(
            understand(film).with_answers({"scenario": "incline", "points": [(50.0, 40.0)]})
        )

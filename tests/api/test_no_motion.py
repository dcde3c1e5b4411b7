"""Files from which no motion can be read: one line says what was seen, and what to do."""

import math
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from galileo_jax import __main__
from galileo_jax.api.propose import propose
from galileo_jax.api.understand import understand
from galileo_jax.commands import command
from galileo_jax.runtime.errors import InputError
from tests.api.test_understand import filmed

SAID = ("--scenario", "incline", "--ramp-angle", "20")


def said_of(path: Path, monkeypatch, capsys, *more: str) -> str:
    """The one line that is said of a file; nothing else is said or written."""
    monkeypatch.chdir(path.parent)
    before = sorted(path.parent.iterdir())
    assert command.run(__main__.main, [path.name, *more]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and err.startswith(f"error: {path.name}: ")
    assert sorted(path.parent.iterdir()) == before
    return err


@pytest.mark.video
@pytest.mark.parametrize("more", [(), SAID])
def test_a_film_in_which_nothing_moves(more, tmp_path, monkeypatch, capsys):
    told = said_of(
        filmed(tmp_path, np.tile([[50.0, 40.0, 0.0]], (20, 1))), monkeypatch, capsys, *more
    )
    assert "nothing moves in it; film with a camera that rests" in told
    assert "--point X Y" in told


@pytest.mark.video
@pytest.mark.parametrize("more", [(), SAID])
def test_a_film_whose_camera_pans(more, tmp_path, monkeypatch, capsys):
    world = np.random.default_rng(3).integers(20, 230, (10, 60)).astype(np.uint8)
    world = cv2.resize(world, (720, 120), interpolation=cv2.INTER_CUBIC)
    path = tmp_path / "pan.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 30.0, (240, 120))
    for n in range(40):
        writer.write(
            cv2.cvtColor(np.ascontiguousarray(world[:, 4 * n : 4 * n + 240]), cv2.COLOR_GRAY2BGR)
        )
    writer.release()
    told = said_of(path, monkeypatch, capsys, *more)
    assert "the whole picture moves alike, as it does where the camera moves" in told
    with pytest.raises(InputError, match="whole picture moves"):
        propose(path)


@pytest.mark.video
def test_a_face_that_wobbles_is_no_slide(tmp_path, monkeypatch, capsys):
    n = np.arange(60.0)
    wobble = np.stack([110 + 9 * np.sin(n / 4), 60 + 3 * np.sin(n / 3 + 1), 0 * n], axis=1)
    path = filmed(tmp_path, wobble)
    told = said_of(path, monkeypatch, capsys, *SAID)
    assert "scenario: incline, but what moves turns back" in told and "nothing slides so" in told
    assert "scenario (perhaps " in said_of(path, monkeypatch, capsys)


@pytest.mark.video
def test_a_film_that_is_much_longer_than_a_motion_is_not_looked_through(
    tmp_path, monkeypatch, capsys
):
    path = tmp_path / "lesson.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=30)
        stream.width = stream.height = 32
        frame = av.VideoFrame.from_ndarray(np.zeros((32, 32, 3), np.uint8))
        for _ in range(6100):
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    told = said_of(path, monkeypatch, capsys, *SAID)
    assert "3 minutes of film, 6100 pictures; one motion is wanted" in told and "ffmpeg" in told


@pytest.mark.parametrize("more", [(), SAID])
@pytest.mark.parametrize(
    ("titles", "row", "said"),
    [
        ("time (h),temperature (°C)", "{h:.2f},{value:.1f}", "which columns are places"),
        ("time (h),inside", "{h:.2f},{value:.1f}", "its rows are 900 s apart"),
        ("time,inside,outside", "{c},{value:.1f},{value:.2f}", "its rows are 900 s apart"),
    ],
)
def test_a_table_of_temperatures(titles, row, said, more, tmp_path, monkeypatch, capsys):
    path = tmp_path / "room.csv"
    rows = [
        row.format(h=n / 4, c=f"{n // 4:02d}:{15 * (n % 4):02d}:00", value=20 + 5 * math.sin(n / 9))
        for n in range(60)
    ]
    path.write_text("\n".join((titles, *rows)) + "\n")
    assert said in said_of(path, monkeypatch, capsys, *more)


@pytest.mark.video
def test_a_thing_that_shows_later_is_followed_from_then_on(tmp_path):
    """As what a hand covers in the first picture."""
    t = np.clip((np.arange(60) - 20) / 30, 0.0, None)
    way = np.stack([60 + 90 * t**2, 50 + 40 * t**2, np.zeros(60)], axis=1)
    way[:12] = [-300.0, -300.0, 0.0]
    known = understand(filmed(tmp_path, way))
    (point,) = known.things
    first = known.first_frame(point)
    assert 12 <= first <= 24
    np.testing.assert_allclose(point, way[first, :2], atol=3.0)

"""The worker's process: what it says, how it is cancelled, and what happens when it dies."""

import os
import queue
import signal
from pathlib import Path

import pytest

from galileo_jax.studio.jobs import Message, Worker
from tests.studio.clips import clip_in

pytestmark = pytest.mark.video
PATIENCE_S = 120


class Ear:
    """Collects what a worker says."""

    def __init__(self, folder: Path):
        self.said: queue.Queue[Message] = queue.Queue()
        self.worker = Worker(str(folder), self.said.put)

    def until(self, *kinds: str) -> list[Message]:
        """The messages up to the first of a kind."""
        found = [self.said.get(timeout=PATIENCE_S)]
        while found[-1].kind not in kinds:
            found.append(self.said.get(timeout=PATIENCE_S))
        return found


@pytest.fixture
def ear(tmp_path):
    clip_in(tmp_path)
    ear = Ear(tmp_path)
    yield ear
    ear.worker.close()


def test_a_job_streams_progress_and_ends_with_its_result(ear, tmp_path):
    ear.worker.start("track", clips=["slide.mp4"])
    with pytest.raises(RuntimeError, match="track is running"):
        ear.worker.start("track", clips=["slide.mp4"])
    *before, last = ear.until("done", "error", "cancelled")
    assert last.kind == "done", last.content
    shares = [message.content[1] for message in before if message.kind == "progress"]
    assert shares and shares == sorted(shares)
    (view,) = last.content["tracks"]
    assert view["objects"] == ["object1", "object2"]
    assert (tmp_path / "slide_track" / "track_px.csv").is_file()
    assert (tmp_path / "slide_track" / "track_m.csv").is_file()


def test_what_is_wrong_is_one_line_and_the_worker_goes_on(ear):
    for clip, text in (("none.mp4", "no such file"), ("slide.yaml.bak", "no such file")):
        ear.worker.start("track", clips=[clip])
        (*_, last) = ear.until("done", "error", "cancelled")
        assert last.kind == "error" and text in last.content and "\n" not in last.content


def test_a_job_is_cancelled_between_two_batches(ear):
    ear.worker.start("propose", video="slide.mp4")
    ear.until("progress")
    ear.worker.cancel()
    assert ear.until("done", "error", "cancelled")[-1].kind == "cancelled"
    ear.worker.start("track", clips=["slide.mp4"])
    assert ear.until("done", "error", "cancelled")[-1].kind == "done", "the next is not cancelled"


def test_a_worker_that_dies_is_an_error_and_another_is_started(ear):
    ear.worker.start("propose", video="slide.mp4")
    ear.until("progress")
    os.kill(ear.worker.pid, signal.SIGKILL)
    last = ear.until("done", "error", "cancelled")[-1]
    assert last.kind == "error" and "has ended" in last.content
    ear.worker.start("track", clips=["slide.mp4"])
    assert ear.until("done", "error", "cancelled")[-1].kind == "done"

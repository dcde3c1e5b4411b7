"""Ctrl-C in `galileo FILE`: soon, one line, nothing half-written, and the track is kept."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tests.api.test_understand import filmed

SAID = ("--scenario", "incline", "--ramp-angle", "20", "--pixels-per-metre", "300")
SOON_S = 20.0  # of a machine that does other things, too; by itself it takes 4
AT = """
import sys, time
import {module} as module
from galileo_jax import __main__
def wait(*_, **__):
    print("{name} now", flush=True)
    {waits}
module.{name} = wait
__main__.cli()
"""
LISTENS, IS_DEAF = (
    "time.sleep(60)",
    """
    end = time.monotonic() + 60
    while time.monotonic() < end:
        try:
            time.sleep(1)
        except KeyboardInterrupt:  # as in a callback of a library
            pass""",
)


def started(folder: Path, module: str, name: str, waits: str = LISTENS) -> subprocess.Popen[str]:
    """`galileo clip.mp4 ...`, which waits where it calls a function."""
    code = AT.format(module=module, name=name, waits=waits)
    return subprocess.Popen(
        [sys.executable, "-c", code, "clip.mp4", *SAID], cwd=folder, text=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        env={**os.environ, "GALILEO_JAX_CACHE": str(folder / "cache")},
    )  # fmt: skip


def interrupted(process: subprocess.Popen[str]) -> tuple[int, str, float]:
    """(exit code, last line, s) of a program that is interrupted where it waits."""
    assert process.stdout is not None
    while not process.stdout.readline().endswith(" now\n"):
        assert process.poll() is None, process.communicate()
    process.send_signal(signal.SIGINT)
    begun = time.monotonic()
    try:
        _, told = process.communicate(timeout=SOON_S)
    finally:
        process.kill()
    return process.returncode, told.strip().splitlines()[-1], time.monotonic() - begun


def files(folder: Path) -> list[str]:
    found = folder.rglob("*")
    return sorted(str(one.relative_to(folder)) for one in found if one.is_file())


@pytest.fixture
def folder(tmp_path) -> Path:
    way = 0.09 * np.maximum(np.arange(30.0) - 4, 0) ** 2
    filmed(tmp_path, np.stack([40 + way, 30 + 0.36 * way, 0 * way], axis=1))
    return tmp_path


@pytest.mark.video
def test_while_it_tracks_nothing_is_left(folder):
    process = started(folder, "galileo_jax.tracking.clip", "track_clip")
    code, told, _ = interrupted(process)
    assert code == 130
    assert told == "stopped; nothing was written: the next run begins anew"
    assert files(folder) == ["clip.mp4"]


@pytest.mark.video
def test_while_it_fits_the_track_is_kept_and_not_made_again(folder):
    code, told, _ = interrupted(started(folder, "galileo_jax.api.compare", "compare"))
    kept = "stopped; kept: clip.yaml, the track of clip.mp4: the next run goes on from there"
    assert (code, told) == (130, kept)
    own = [one for one in files(folder) if not one.startswith("cache")]
    assert own == ["clip.mp4", "clip.yaml"]
    # The next run comes as far without tracking: a tracker that is called would wait and say so.
    again = """
import galileo_jax.tracking.clip as tracking
def never(*_, **__):
    raise AssertionError("tracked again")
tracking.track_clip = never
from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import measure
print(len(measure(load_clip("clip.mp4")).observation.times_s))
"""
    environment = {**os.environ, "GALILEO_JAX_CACHE": str(folder / "cache")}
    done = subprocess.run(
        [sys.executable, "-c", again], cwd=folder, env=environment, capture_output=True, text=True
    )
    assert done.stdout == "30\n", done.stderr


@pytest.mark.video
def test_what_does_not_listen_is_left_behind(folder):
    process = started(folder, "galileo_jax.api.propose", "find_movers", IS_DEAF)
    code, told, seconds = interrupted(process)
    assert code == 130 and told.startswith("stopped; ")
    assert seconds < SOON_S
    assert files(folder) == ["clip.mp4"]


def test_who_is_refused_does_not_wait_for_what_still_compiles():
    """Nor does Python end a thread that is in XLA, which aborts the process."""
    code = (
        "import threading\n"
        "from galileo_jax.commands.stop import end\n"
        "threading.Thread(target=threading.Event().wait).start()\n"
        "end(2)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], timeout=120, check=False)
    assert done.returncode == 2

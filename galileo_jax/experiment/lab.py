"""A laboratory: a program that is given settings and makes an experiment with them.

`LAB --describe` prints JSON: `{"settings": {"height_m": {"low": 0.1, "high": 0.5}, "fps":
{"choices": [30, 60]}}, "clip": {what a clip's yaml declares}}`. Without arguments it reads one JSON
object of settings from standard input and writes a csv track to standard output. Exit code 0: done;
2 and a line on standard error: the settings are refused. What it answered becomes a clip, or a line
that says why it is none.
"""

import contextlib
import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any, Protocol, runtime_checkable

import numpy as np

from galileo_jax.clip.load import check_clip, load_clip
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.track_csv import read_observation_csv
from galileo_jax.clip.track_noise import position_noise_m
from galileo_jax.clip.yaml_file import yaml_text
from galileo_jax.experiment.settings import Can, known_as, parse_can
from galileo_jax.observation.digest import digest
from galileo_jax.runtime.atomic_write import write_text
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.progress import check_cancelled

DECLARED = {"angle": "ramp_angle_deg", "fps": "fps"}
MOST_NOISE_M = 0.05  # of a coordinate: no camera is so bad, and random numbers are worse
DESCRIBE = "--describe"
REFUSED = 2
LOOK_S = 0.1  # between two looks at whether it is done, must be stopped, or goes on for ever
LINE = 200  # characters of what a lab says that are shown
MOST_BYTES = 20_000_000  # of a track; one of ten minutes at 1000 frames per second is as long


class LabError(Exception):
    """An experiment came to nothing; the message is one line."""


@dataclass(frozen=True)
class Described:
    """What a lab says of itself."""

    can: Can  # what can be set, by its own names
    clip: Mapping[str, Any]  # the declared part of a clip's yaml

    @property
    def document(self) -> dict[str, Any]:
        """As JSON, in the lab's own form."""
        settings = {name: kind.document for name, kind in self.can.items()}
        return {"settings": settings, "clip": dict(self.clip)}


@runtime_checkable
class Lab(Protocol):
    """Anything that makes experiments."""

    def describe(self) -> Described:
        """What can be set. Raises `LabError`."""
        ...

    def measure(self, settings: Mapping[str, Any]) -> str:
        """The csv track of one experiment. Raises `LabError`."""
        ...


@dataclass(frozen=True)
class Program:
    """A lab that is a program of its own."""

    words: tuple[str, ...]  # of its command line
    timeout_s: float  # after so long it is stopped

    def describe(self) -> Described:
        """What `LAB --describe` prints."""
        text = self._run([DESCRIBE], "")
        try:
            return described(json.loads(text))
        except InputError as error:
            raise LabError(f"{DESCRIBE}: {_line(str(error))}") from error
        except ValueError as error:
            said = f"it printed {_line(text)!r}" if text.strip() else "it printed nothing"
            raise LabError(f"{DESCRIBE}: a JSON object expected; {said}") from error

    def measure(self, settings: Mapping[str, Any]) -> str:
        """The track that the program writes."""
        return self._run([], json.dumps(dict(settings)) + "\n")

    def _run(self, arguments: Sequence[str], given: str) -> str:
        """Runs the program in a group of its own, so that what it started ends with it.

        Through files: a pipe would wait for whoever holds its other end.
        """
        with TemporaryFile() as to, TemporaryFile() as out, TemporaryFile() as complaint:
            to.write(given.encode())
            to.seek(0)
            try:
                process = subprocess.Popen(
                    [*self.words, *arguments],
                    stdin=to,
                    stdout=out,
                    stderr=complaint,
                    start_new_session=True,
                )
            except OSError as error:
                raise LabError(f"cannot be started: {error.strerror or error}") from error
            try:
                self._wait(process, out)
            finally:
                with contextlib.suppress(ProcessLookupError, PermissionError):
                    os.killpg(process.pid, signal.SIGKILL)
                process.wait()
            out.seek(0)
            complaint.seek(0)
            answer, said = out.read(), _line(complaint.read(MOST_BYTES).decode("utf-8", "replace"))
        if process.returncode == REFUSED:
            raise LabError(f"refused: {said or 'no reason given'}")
        if process.returncode:
            ended = f"exit code {process.returncode}"
            if process.returncode < 0:
                ended = f"ended by signal {-process.returncode}"
            raise LabError(f"{ended}{': ' if said else ''}{said}")
        try:
            return answer.decode("utf-8")
        except UnicodeDecodeError:
            raise LabError("the answer is not text; a csv track expected") from None

    def _wait(self, process: "subprocess.Popen[bytes]", out: IO[bytes]) -> None:
        ends_s = time.monotonic() + self.timeout_s
        while process.poll() is None:
            check_cancelled()
            if time.monotonic() > ends_s:
                raise LabError(f"no answer within {self.timeout_s:g} s")
            if os.fstat(out.fileno()).st_size > MOST_BYTES:
                raise LabError(f"more than {MOST_BYTES} bytes; a csv track expected")
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(LOOK_S)


def described(content: Any) -> Described:
    """Checks what a lab says of itself.

    Raises:
      InputError: a part is missing or wrong.
    """
    if not isinstance(content, Mapping):
        raise InputError("a JSON object expected")
    for key in ("settings", "clip"):
        if not isinstance(content.get(key), Mapping):
            raise InputError(f"{key}: missing; a JSON object expected")
    if not content["settings"]:
        raise InputError("settings: empty; what can be set expected")
    return Described(parse_can(content["settings"]), dict(content["clip"]))


def program_of(lab: str | Path, timeout_s: float) -> Program:
    """The lab behind a path, or behind a command line.

    Raises:
      InputError: there is no such program.
    """
    path = Path(lab)
    if path.is_dir():
        raise InputError(f"LAB: {lab} is a folder; a program expected")
    if path.is_file():
        if os.access(path, os.X_OK):
            return Program((str(path.resolve()),), timeout_s)
        if path.suffix == ".py":
            return Program((sys.executable, str(path.resolve())), timeout_s)
        raise InputError(f"LAB: {lab} cannot be run; make it executable: chmod +x {lab}")
    try:
        words = shlex.split(str(lab))
    except ValueError as error:
        raise InputError(f"LAB: {lab}: {error}") from error
    if not words or shutil.which(words[0]) is None:
        raise InputError(f"LAB: {lab}: no such program")
    return Program(tuple(words), timeout_s)


def _line(text: str) -> str:
    """The last line of what was said, cut."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return " ".join(lines[-1].split())[:LINE] if lines else ""


def write_clip(
    path: Path,
    text: str,
    declared: Mapping[str, Any],
    settings: Mapping[str, Any],
    others: Mapping[int, Path] | None = None,
) -> Clip:
    """Writes a track and the yaml beside it.

    Angle and frame rate of the settings are declared, too. The track may be none of the `others`,
    by the number of their experiment.

    Raises:
      LabError: it is no track, no clip, or the same as before; nothing is left of it then.
    """
    update = {
        DECLARED[known_as(name)]: value
        for name, value in settings.items()
        if known_as(name) in DECLARED
    }
    scenario = declared.get("scenario")  # one that is not known is for `check_clip` to refuse
    if scenario in SCENARIOS and not SCENARIOS[str(scenario)].is_sloped:
        update.pop("ramp_angle_deg", None)
    content = {key: value for key, value in declared.items() if key != "video"}
    content |= {"track": path.name, **update}
    if not text.strip():
        raise LabError("an empty answer; a csv track expected")
    write_text(path, text)
    yaml = path.with_suffix(".yaml")
    try:
        # Before the clip is: at another angle the same track has no place.
        _check_track(path, others or {})
        check_clip(yaml, content)
        write_text(yaml, yaml_text(content))
        return load_clip(yaml)
    except InputError as error:
        path.unlink(missing_ok=True)
        yaml.unlink(missing_ok=True)
        said = str(error).removeprefix(f"{path}: ").removeprefix(f"{yaml}: ")
        raise LabError(" ".join(said.split())) from error


def _check_track(path: Path, others: Mapping[int, Path]) -> None:
    """Raises `InputError` where its numbers are those of no motion, or of another track's."""
    seen = read_observation_csv(path)
    for name, place in zip(seen.names, seen.position_m, strict=True):
        noise = max(position_noise_m(seen.times_s, row) for row in place)
        if noise > MOST_NOISE_M:
            raise InputError(
                f"{path}: {name}: places scatter by {noise:.2g} m from frame to frame; a track in "
                "metres expected"
            )
        if not np.isfinite(place).any():
            raise InputError(f"{path}: {name}: is never seen")
    own = digest(seen)
    for number, other in others.items():
        if digest(read_observation_csv(other)) == own:
            raise InputError(f"{path}: the same track as in experiment {number}")

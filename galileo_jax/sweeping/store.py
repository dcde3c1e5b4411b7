"""A sweep's folder: what is done, and what failed.

    DIR/cells/NAME/result.json    one cell's numbers
    DIR/cells/NAME/failure.json   or why there are none
    DIR/clips/DIGEST.track.npz    a clip as it was tracked
    DIR/summary.csv ...           all cells in one table

Every file is written under another name first, and only the sweep's own process writes: at a
kill what was in flight is missing, and nothing is there in part.
"""

import fcntl
import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from galileo_jax import __version__
from galileo_jax.clip.schema import Clip
from galileo_jax.measurement.measure import Measurement
from galileo_jax.measurement.path_direction import OtherWay
from galileo_jax.measurement.segments.segments import Segments
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.atomic_write import check_folder, replacing, write_json
from galileo_jax.runtime.errors import InputError
from galileo_jax.sweeping.task import Failure
from galileo_jax.sweeping.work import PAGE, CellResult, MeasuredClip

RESULT, FAILURE = "result.json", "failure.json"
APART = ("clip", "observation", "whole", "pixels")  # fields of a measurement that stand elsewhere
SEGMENTS, WAY = TypeAdapter(Segments), TypeAdapter(OtherWay | None)


class Store:
    """Results by name."""

    def __init__(self, folder: Path):
        self.folder = folder

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keeps a second sweep out of the folder, and clears away what a kill left.

        Raises:
          InputError: another sweep is at work there, or the folder is a file.
        """
        check_folder(self.folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        with (self.folder / ".lock").open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise InputError(
                    f"--out: {self.folder}: another sweep is running there; use another folder"
                ) from None
            for pattern in ("cells/**/.*", "clips/.*.npz", ".summary.*", ".report.*"):
                for left in self.folder.glob(pattern):
                    left.unlink()
            for folder in self.folder.glob("simulated/.simulate.*"):
                shutil.rmtree(folder)
            yield

    def has_result(self, name: str) -> bool:
        """Whether a cell is done."""
        return self._cell(name, RESULT).is_file()

    def result(self, name: str, file: str = RESULT) -> dict[str, Any]:
        """A cell's result.json, or what lies beside it; empty where that is not there."""
        path = self._cell(name, file)
        if file != RESULT and not path.is_file():
            return {}
        return json.loads(path.read_text(encoding="utf-8"))

    def failure(self, name: str) -> Failure | None:
        """Why a cell has no result; None where it has one, or was not tried."""
        path = self._cell(name, FAILURE)
        if not path.is_file() or self.has_result(name):
            return None
        return Failure(**json.loads(path.read_text(encoding="utf-8")))

    def save_result(self, name: str, result: CellResult) -> None:
        """Writes what came of a cell, result.json last; a failure before it is forgotten."""
        for file, content in result.files.items():
            with replacing(self._cell(name, file)) as path:
                path.write_bytes(content)
        write_json(self._cell(name, RESULT), result.document)
        self.forget_failure(name)

    def cell_folder(self, name: str) -> Path:
        """Where a cell's files are."""
        return self.folder / "cells" / name

    def page(self, name: str, clip: str = "") -> Path | None:
        """A cell's page, of several clips that of one of them; None where it has none."""
        folders = (self.cell_folder(name) / clip, self.cell_folder(name))
        return next((f / PAGE for f in folders if (f / PAGE).is_file()), None)

    def save_failure(self, name: str, failure: Failure) -> None:
        """Keeps why a cell has no result."""
        write_json(self._cell(name, FAILURE), vars(failure))

    def forget_failure(self, name: str) -> None:
        """Has a cell tried again."""
        self._cell(name, FAILURE).unlink(missing_ok=True)

    def has_clip(self, key: str) -> bool:
        """Whether a clip was tracked."""
        return self._clip(key).is_file()

    def clip(self, key: str) -> MeasuredClip:
        """A tracked clip, to the last digit."""
        with np.load(self._clip(key)) as file:
            arrays = {name: file[name] for name in file.files}
        notes, picture = json.loads(str(arrays.pop("notes"))), arrays.pop("thumbnail").tobytes()
        names = tuple(notes["seen"].pop("names"))
        seen = Observation(names=names, **notes["seen"], **arrays)
        own = notes["own"]
        own |= {name: tuple(own[name]) for name in ("doubts", "remarks")}
        own["segments"] = SEGMENTS.validate_python(own["segments"])
        own["way"] = WAY.validate_python(own["way"])
        measured = Measurement(Clip.model_validate(notes["clip"]), seen, seen, None, **own)
        return MeasuredClip(measured, picture or None)

    def save_clip(self, key: str, measured: MeasuredClip) -> None:
        """Keeps a tracked clip."""
        one, seen = measured.measurement, vars(measured.measurement.observation)
        arrays = {name: value for name, value in seen.items() if isinstance(value, np.ndarray)}
        notes = {
            "clip": one.clip.model_dump(mode="json"),
            "seen": {name: value for name, value in seen.items() if name not in arrays},
            "own": {name: value for name, value in vars(one).items() if name not in APART},
        }
        picture = np.frombuffer(measured.thumbnail or b"", np.uint8)
        with replacing(self._clip(key)) as path:
            text = np.array(json.dumps(notes, default=asdict))
            np.savez_compressed(path, notes=text, thumbnail=picture, **arrays)  # pyright: ignore

    def _cell(self, name: str, file: str) -> Path:
        return self.cell_folder(name) / file

    def _clip(self, key: str) -> Path:
        return self.folder / "clips" / f"{key[:32]}-{__version__}.track.npz"

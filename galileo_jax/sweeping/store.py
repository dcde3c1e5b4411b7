"""A sweep's folder: what is done, and what failed.

    DIR/cells/NAME/result.json    one cell's numbers
    DIR/cells/NAME/failure.json   or why there are none
    DIR/clips/DIGEST.npz          a clip as it was tracked
    DIR/summary.csv ...           all cells in one table

Every file is written under another name first, and only the sweep's own process writes: at a
kill what was in flight is missing, and nothing is there in part.
"""

import fcntl
import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax import __version__
from galileo_jax.clip.schema import Clip
from galileo_jax.measurement.measure import Measurement
from galileo_jax.measurement.path_direction import OtherWay
from galileo_jax.measurement.segments.segments import Cut, Segments
from galileo_jax.measurement.segments.track_failure import Astray
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.atomic_write import check_folder, replacing, write_json
from galileo_jax.runtime.errors import InputError
from galileo_jax.sweeping.task import Failure
from galileo_jax.sweeping.work import PAGE, CellResult, MeasuredClip

RESULT, FAILURE = "result.json", "failure.json"
ARRAYS = ("times_s", "position_m", "covariance_m2", "mask")
COUNTS = ("frames_used", "frames", "frames_of_scene")  # of a measurement
FLAGS = ("is_squared", "is_turning")


class Store:
    """Results by name.

    Attributes:
      folder: of the sweep.
    """

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
        for path in (self.cell_folder(name) / clip / PAGE, self.cell_folder(name) / PAGE):
            if path.is_file():
                return path
        return None

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
            arrays = {name: file[name] for name in ARRAYS}
            names = tuple(str(name) for name in file["names"])
            clip = Clip.model_validate(json.loads(str(file["clip"])))
            notes = json.loads(str(file["notes"]))
            picture = file["thumbnail"].tobytes()
            modes, turned = file.get("modes_m"), file.get("turned_rad")
        seen = replace(
            Observation(names=names, **arrays),
            modes_m=modes,
            turned_rad=turned,
            **{name: bool(notes.get(name, False)) for name in FLAGS},
            num_errors=int(notes.get("num_errors", 0)),
            wander_m=notes.get("wander_m"),
            noise_known_to=notes.get("noise_known_to", 0.0),
        )
        own: dict[str, Any] = {key: tuple(notes[key]) for key in ("doubts", "remarks")}
        own |= {key: notes.get(key, 0) for key in COUNTS}
        own["way"] = OtherWay(**notes["way"]) if notes.get("way") else None
        astray = tuple(Astray(**entry) for entry in notes.get("astray", []))
        cuts = tuple(Cut(**entry) for entry in notes.get("cuts", []))
        segments = Segments(cuts, astray)
        measured = Measurement(clip, seen, seen, None, notes["inferred"], segments, **own)
        return MeasuredClip(measured, picture or None)

    def save_clip(self, key: str, measured: MeasuredClip) -> None:
        """Keeps a tracked clip."""
        one = measured.measurement
        seen = one.observation
        notes = {name: getattr(one, name) for name in ("inferred", "doubts", "remarks")}
        notes["cuts"] = [vars(entry) for entry in one.cuts]
        notes["astray"] = [vars(entry) for entry in one.astray]
        notes |= {name: getattr(one, name) for name in COUNTS}
        notes["way"] = one.way and vars(one.way)
        notes |= {name: getattr(seen, name) for name in FLAGS}
        notes |= {"num_errors": seen.num_errors, "wander_m": seen.wander_m}
        notes |= {"noise_known_to": seen.noise_known_to}
        arrays = {name: getattr(seen, name) for name in ARRAYS}
        if seen.modes_m is not None:
            arrays["modes_m"] = seen.modes_m
        if seen.turned_rad is not None:
            arrays["turned_rad"] = seen.turned_rad
        with replacing(self._clip(key)) as path:
            np.savez_compressed(
                path,
                names=np.array(seen.names),
                clip=np.array(one.clip.model_dump_json()),
                notes=np.array(json.dumps(notes)),
                thumbnail=np.frombuffer(measured.thumbnail or b"", np.uint8),
                **arrays,
            )

    def _cell(self, name: str, file: str) -> Path:
        return self.cell_folder(name) / file

    def _clip(self, key: str) -> Path:
        return self.folder / "clips" / f"{key[:32]}-{__version__}.npz"

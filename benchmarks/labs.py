"""Labs: objects with a sealed effect, or a sealed law, that can be measured at other settings.

A law (`exotic_effects.py`) is simulated in a process of its own: what registers it there stays
unknown to the diagnosis here.
"""

import functools
import json
import math
import multiprocessing
import zlib
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

import galileo_jax as gx
from benchmarks.hidden_cases import TRACK
from galileo_jax.experiment.lab import Described, described

SETTINGS = {
    "height_m": {"low": 0.08, "high": 0.25},
    "angle_deg": {"low": 12.0, "high": 28.0},
    "fps": {"choices": [30]},
}
Noise = Literal["px", "speed"]
PIXEL_M = 0.3 / 900  # 0.3 px at 900 px/m
SPEED_SHARE = 0.075  # of the range of object 1's speed, as the noise of a velocity
LEAST_NOISE_M = 1e-5  # where static friction holds all
NONE = "none"
HIDDEN = "hidden_"  # what the effects of `exotic_effects.py` are called before their names


@dataclass(frozen=True)
class SimulatedLab:
    """Simulated by the integrator that does not fit, with the small faults of real clips."""

    folder: Path  # of its files
    effect: str  # hidden, of the library or `hidden_LAW`; "none"
    seed: int  # of objects, strength and noise
    noise: Noise  # "px": 0.3 px; "speed": velocities known to 7.5 % of the speed's range

    @property
    def truth(self) -> Path:
        """What is sealed; made when first asked for."""
        path = self.folder / "sealed.truth.json"
        if not path.is_file():
            told: dict[str, Any] = {"effects": {} if self.effect == NONE else {self.effect: {}}}
            if self._is_law:
                told["strength"] = 0.5  # as in laws.py
            self._simulate(
                self.folder / "sealed.csv", seed=self._seed("objects"), track_only=True, **told
            )
        return path

    def describe(self) -> Described:
        """As the protocol has it."""
        truth = json.loads(self.truth.read_text())
        objects = [
            {"name": f"object{i}", "shape": shape, "size_m": truth[f"size{i}_m"]}
            for i, shape in enumerate(truth["shapes"], 1)
        ]
        return described({"settings": SETTINGS, "clip": {"scenario": "ramp", "objects": objects}})

    def measure(self, settings: Mapping[str, Any]) -> str:
        """A track; each time with other noise and other faults."""
        number = len(list(self.folder.glob("m*.csv"))) + 1
        path = self.folder / f"m{number:03}.csv"
        angle = float(settings["angle_deg"])
        options: dict[str, Any] = {
            "like": self.truth,
            "release": settings["height_m"] / math.sin(math.radians(angle)),
            "angle": angle,
            "fps": float(settings["fps"]),
            "seed": self._seed(number),
            **TRACK,
        }
        noise_m = PIXEL_M
        if self.noise == "speed":
            made = self._simulate(path, **options)
            speed = np.hypot(*(made.truths[0]["trajectory"]["object1"][v] for v in ("vy", "vz")))
            noise_m = SPEED_SHARE * float(np.ptp(speed)) / (math.sqrt(2) * options["fps"])
            noise_m = max(noise_m, LEAST_NOISE_M)
        self._simulate(path, **options, track_noise=noise_m)
        return path.read_text()

    def is_right(self, law: Mapping[str, Any]) -> bool:
        """Whether a formula (of discover.json) is that of the hidden law; see `laws.py`."""
        if not self._is_law:
            return False
        name = self.effect.removeprefix(HIDDEN)
        return _process().submit(_judged, name, law["family"], law["constants"]).result()

    @property
    def _is_law(self) -> bool:
        return self.effect.startswith(HIDDEN)

    def _simulate(self, path: Path, **options: Any) -> gx.Simulated:
        if not self._is_law:
            return gx.simulate(path, **options)
        return _process().submit(_with_laws, path, options).result()

    def _seed(self, what: object) -> int:
        return zlib.crc32(f"{self.effect} {self.seed} {what}".encode())


@functools.cache
def _process() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(1, multiprocessing.get_context("spawn"))


def _with_laws(path: Path, options: Mapping[str, Any]) -> gx.Simulated:
    from benchmarks import exotic_effects  # noqa: F401  registers them, for this process only

    return gx.simulate(path, **options)


def _judged(name: str, family: str, constants: Mapping[str, Any]) -> bool:
    from benchmarks.laws import is_right

    return is_right(name, family, constants)

"""A lab with a sealed effect, for `galileo discover examples/lab.py`.

A lab is a program. Asked to describe itself it says what can be set; given settings as JSON it
answers with a track. This one measures with `galileo_jax.simulate`. What is hidden in it stands in
lab/sealed.truth.json: to be opened when the discovery is over.

    python examples/lab.py --describe
    echo '{"height_m": 0.2, "angle_deg": 20, "fps": 60}' | python examples/lab.py
"""

import json
import math
import sys
import tempfile
from pathlib import Path

import galileo_jax as gx

SEALED = Path("lab") / "sealed.csv"
HIDDEN = {"air_drag": {}}
SETTINGS = {
    "height_m": {"low": 0.08, "high": 0.3},
    "angle_deg": {"low": 12.0, "high": 30.0},
    "fps": {"choices": [30, 60]},
}
NOISE_M = 0.0004  # 0.3 px at some 800 px per metre


def sealed() -> Path:
    """The truth of the lab, drawn when it is first asked for anything."""
    truth = SEALED.with_suffix(".truth.json")
    if not truth.is_file():
        gx.simulate(SEALED, seed=5, effects=HIDDEN, strength=0.6, track_only=True)
    return truth


def describe() -> dict:
    """What can be set, and what a clip's yaml would declare."""
    sealed()
    declared = dict(gx.load(SEALED).model_dump(mode="json", exclude_defaults=True))
    objects = [
        {"name": one["name"], "shape": one["shape"], "size_m": one["size_m"]}
        for one in declared["objects"]
    ]
    return {"settings": SETTINGS, "clip": {"scenario": "ramp", "objects": objects}}


def measure(settings: dict) -> str:
    """The track of one experiment; the noise is another one each time, at the same setting, too."""
    for name, value in settings.items():
        known = SETTINGS.get(name, {})
        is_there = value in known.get("choices", ()) or (
            "low" in known and known["low"] <= value <= known["high"]
        )
        if not is_there:
            print(f"{name}: {value} cannot be set here", file=sys.stderr)
            sys.exit(2)
    asked = SEALED.with_name("asked.jsonl")  # every experiment, one line each
    before = asked.read_text().count("\n") if asked.is_file() else 0
    with tempfile.TemporaryDirectory() as folder:
        track = Path(folder) / "track.csv"
        gx.simulate(
            track,
            like=sealed(),
            release=settings["height_m"] / math.sin(math.radians(settings["angle_deg"])),
            angle=settings["angle_deg"],
            fps=settings["fps"],
            seed=before,
            track_only=True,
            track_noise=NOISE_M,
        )
        with asked.open("a") as file:
            file.write(json.dumps(settings) + "\n")
        return track.read_text(encoding="utf-8")


if __name__ == "__main__":
    if sys.argv[1:] == ["--describe"]:
        print(json.dumps(describe()))
    else:
        sys.stdout.write(measure(json.load(sys.stdin)))

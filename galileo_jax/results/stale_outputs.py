"""Which outputs of other commands a new fit makes out of date.

A prediction belongs to the previous fit, so its files are removed; one command makes it again. A
comparison or a diagnosis is a statement about the clip and is kept, with a warning if it was made
from a different track.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from galileo_jax.observation.digest import digest
from galileo_jax.observation.observation import Observation

PREDICTION = "prediction.json"
PICTURES = ("prediction.svg", "prediction.html", "first_and_last.png")  # those of `predict`
PREDICTION_KEYS = {"run", "seconds_beyond_clip_s", "version"}  # what makes the file one of ours
DOCUMENTS = {"compare": "compare/compare.json", "diagnose": "diagnosis/diagnosis.json"}
TRACKS = "tracks"  # key of those documents: the digests of what they were made of
RUN_FILES = ("clip.yaml", "observation.csv", "errors.npz", "report.html")


def remove_stale_prediction(folder: Path) -> None:
    """Removes what `predict` wrote of the fit that lay in `folder`."""
    if document(folder / PREDICTION).keys() >= PREDICTION_KEYS:
        for name in (PREDICTION, *PICTURES):
            (folder / name).unlink(missing_ok=True)


def remove_single_clip_run(folder: Path) -> None:
    """Removes what makes `folder` the run of one clip, where now several are fitted together."""
    if (folder / "result.json").is_file() and (folder / "clip.yaml").is_file():
        for name in RUN_FILES:
            (folder / name).unlink(missing_ok=True)


def stale_documents(folder: Path, observations: Sequence[Observation]) -> list[str]:
    """One sentence for every comparison and diagnosis below `folder` of other tracks."""
    now = [digest(observation) for observation in observations]
    sentences = []
    for verb, name in DOCUMENTS.items():
        made = document(folder / name)
        if made.get(TRACKS, now) != now:
            clips = " ".join(map(str, made.get("clips", [])))
            sentences.append(
                f"{(folder / name).parent}: made from an earlier track; "
                f"make it again: galileo {verb} {clips}"
            )
    return sentences


def document(path: Path) -> dict[str, Any]:
    """A JSON document; empty where there is none."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}

"""The journal of a discovery: every experiment with its reason, every verdict; on disk at once.

What is done is in the file before the next thing is begun, so that an interrupted discovery goes on
where it was.
"""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from galileo_jax.diagnosis.diagnosis import Law
from galileo_jax.runtime.atomic_write import write_json
from galileo_jax.runtime.errors import InputError

FILE = "discover.json"


@dataclass
class Journal:
    """What has been done so far."""

    folder: Path  # it stands there, with the clips
    lab: dict[str, Any]  # of the lab: `{"settings": ..., "clip": ...}`, as it describes itself
    seed: int
    # `{number, settings, reason, outcome, line, clip}` each; outcome: None while it is being made,
    # "track", or "lost" with the line that says why.
    experiments: list[dict[str, Any]] = field(default_factory=list)
    # A verdict each: `{clips, status, effects, form, law, sentence, hypotheses}`.
    rounds: list[dict[str, Any]] = field(default_factory=list)
    held: dict[str, Any] = field(default_factory=dict)  # settings that are left alone, by name
    ended: str | None = None  # why nothing more is done; None while something is

    @property
    def tracks(self) -> list[dict[str, Any]]:
        """The experiments that gave a track."""
        return [one for one in self.experiments if one["outcome"] == "track"]

    @property
    def last(self) -> dict[str, Any] | None:
        """The last verdict."""
        return self.rounds[-1] if self.rounds else None

    def add(self, settings: dict[str, Any], reason: str) -> None:
        """Writes down that an experiment is to be made, and why."""
        number = len(self.experiments) + 1
        row = {"number": number, "settings": settings, "reason": reason}
        self.experiments.append(row | {"outcome": None, "line": None, "clip": None})
        self.write()

    def close(self, row: dict[str, Any], *, clip: str | None = None, line: str = "") -> None:
        """Writes down what became of an experiment."""
        row.update(outcome="track" if clip else "lost", clip=clip, line=line or None)
        self.write()

    @property
    def document(self) -> dict[str, Any]:
        """discover.json."""
        keys = ("lab", "held", "seed", "experiments", "rounds", "ended")
        return {key: getattr(self, key) for key in keys}

    def write(self) -> None:
        """Writes discover.json."""
        write_json(self.folder / FILE, self.document)


def law_row(law: Law) -> dict[str, Any]:
    """A formula as a round has it: its text, its shape and its constants."""
    constants = {name: float(value) for name, value in law.constants.items()}
    return {"text": law.text, "family": law.family, "constants": constants}


def open_journal(folder: Path, lab: dict[str, Any], seed: int) -> Journal:
    """A new journal, or that of the same lab which is there.

    Raises:
      InputError: the folder has another lab's, or one that is damaged.
    """
    path = folder / FILE
    if not path.exists():
        return Journal(folder, lab, seed)
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        journal = Journal(
            folder,
            content["lab"],
            int(content["seed"]),
            list(content["experiments"]),
            list(content["rounds"]),
            dict(content["held"]),
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: not the journal of a discovery ({error})") from error
    # Through JSON, as what is on disk went.
    if journal.lab != json.loads(json.dumps(lab)):
        raise InputError(f"{path}: of another lab; give another --out, or remove it")
    return journal

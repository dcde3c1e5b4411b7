"""What lies in a run's folder, as the page shows it; nothing in it is run or trusted."""

import csv
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from galileo_jax.clip.yaml_file import read_mapping
from galileo_jax.results.stale_outputs import document
from galileo_jax.runtime.errors import InputError
from galileo_jax.studio.paths import below, check_declared

BESIDE = re.compile(r'<p><a href="[\w/.-]+\.html">[^<]*</a></p>\n')


def program_of(run: Path) -> str | None:
    """The file of effects that loading a run would run; None: there is none."""
    files = document(run / "result.json").get("effects_from")
    return str(files[0]) if isinstance(files, list) and files else None


def check_run(root: Path, run: Path, may_run: bool = False) -> None:
    """Refuses to open a run that leads out of the folder, or would run a file of effects.

    `may_run`: somebody has pressed the button for its effects, which lie in the folder.

    Raises:
      InputError: says why.
    """
    below(root, run)
    if (program := program_of(run)) is not None:
        below(root, program)
        if not may_run:
            raise InputError(
                f"{run.name}: its model has effects of {program}, which is a program; it is "
                "opened when you press for it"
            )
    for path in (run / "clip.yaml", *run.glob("*/clip.yaml")):
        if path.is_file():
            below(root, path)
            check_declared(root, path.parent, read_mapping(path))


def pixel_track(path: Path) -> dict[str, Any] | None:
    """A track in pixels that `galileo track` wrote; None where there is none."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        names = [key.removesuffix("_x_px") for key in rows[0] if key.endswith("_x_px")]
        names = [name for name in names if not name.endswith("_sd")]
        pairs = {
            kind: [
                [[_number(row[f"{name}_{prefix}{axis}_px"]) for axis in "xy"] for row in rows]
                for name in names
            ]
            for kind, prefix in (("seen_px", ""), ("sd_px", "sd_"))
        }
        for places in pairs["seen_px"]:
            places[:] = [[None, None] if None in place else place for place in places]
        times = [float(row["time_s"]) for row in rows]
    except (OSError, KeyError, ValueError, IndexError, csv.Error):
        return None
    return {"clip": "", "objects": names, "times": times, "warnings": [], **pairs}


def round_of(result: Mapping[str, Any]) -> dict[str, Any]:
    """A round of the loop, from result.json."""
    error, known = result["error"], result["parameters"]
    frictions = {
        name: {key: known[name][key] for key in ("mean", "sd", "mcse") if key in known[name]}
        for name in ("k1", "k2")
        if name in known
    }
    keys = ("rmse", "noise", "chi2_per_dof")
    return {"effects": list(result["effects"]), **{k: error[k] for k in keys}, **frictions}


def with_round(rounds: Sequence[Mapping[str, Any]], new: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The rounds with one more; those whose model is not a part of the new one's are over."""
    own = set(new["effects"])
    return [dict(one) for one in (*(r for r in rounds if set(r["effects"]) < own), new)]


def alone(page: str) -> str:
    """A run's page as one file to be kept: without the links to pages beside it."""
    return BESIDE.sub("", page)


def _number(text: str) -> float | None:
    return float(text) if text else None

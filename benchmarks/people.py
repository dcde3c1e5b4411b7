"""Files as people have them: is each read right, or refused for the right reason?

    python -m benchmarks people run [--only WORD] [--journal FILE]    # goes on where it was
    python -m benchmarks people table [--journal FILE]                # the markdown of the docs
    python -m benchmarks people gallery [--journal FILE] [--docs DIR] # docs/explanation/gallery.md

What is right for each file stands in people.yaml. Every case is a command of its own, as a user
would type it; `--package` is the checkout that is tried. The journal is of one version: delete it
to measure another. `gallery` runs what its page shows and the journal lacks.
"""

import json
import math
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import yaml

from benchmarks import gallery
from benchmarks.journal import Journal
from galileo_jax.api.questions import NUMBERS, answered
from galileo_jax.api.understand import understand
from galileo_jax.runtime.errors import InputError

FOLDER = Path(__file__).parents[1] / ".." / "shared" / "data" / "people"
PACKAGE = Path(__file__).parents[1]
JOURNAL = PACKAGE / "build" / "people.jsonl"
CASES = Path(__file__).with_suffix(".yaml")
TOO_LONG_S = 300.0  # of a processor
DISTRUST = "See where it fails|No known effect explains the data"
NEAR_PX = 15.0  # two marks of one thing
IMPLIED = ("track", "video", "objects")  # keys that say nothing but which file


def main(
    do: Literal["run", "table", "gallery"],
    *,
    folder: Path = FOLDER,
    journal: Path = JOURNAL,
    only: str = "",
    package: Path = PACKAGE,
    docs: Path = PACKAGE / "docs",
) -> dict[str, int]:
    cases = [one for one in yaml.safe_load(CASES.read_text()) if only in one["file"]]
    cases = [one for one in cases if do != "gallery" or "by" in one]
    kept = Journal(journal)
    for case in cases if do != "table" else ():
        row = kept.row(name_of(case), lambda case=case: tried(folder, package, case))
        print(
            f"{row['judged']:<24} {row['wall_s']:5.0f} s  {row['case']}: {_found(row)}", flush=True
        )
    done = [kept.rows[name_of(case)] for case in cases if name_of(case) in kept.rows]
    if do == "table":
        print("\n".join(markdown(done)))
    if do == "gallery":
        gallery.write(docs, cases, done)
    return dict(Counter(row["judged"] for row in done))


def name_of(case: Mapping[str, Any]) -> str:
    """A case's name in the journal."""
    return f"{case['file']}: {case['what']}"


def tried(folder: Path, package: Path, case: Mapping[str, Any]) -> dict[str, Any]:
    """A row: what the command said of a case, in how long, and how that is judged."""
    ask = case.get("ask", "fit")
    with tempfile.TemporaryDirectory() as scratch:
        path, declared = _written(folder, Path(scratch) / "in", case)
        out = Path(scratch) / "out"
        files = [str(path), *(str(path.parent / one) for one in case.get("and", ()))]
        call = [sys.executable, "-m", f"galileo_jax.{ask}", *files, "--out", str(out)]
        call += ["--free", case["free"]] if "free" in case else []
        began, cpu_began = time.monotonic(), _cpu_s()
        code, said = _run(call, package)
        wall_s, cpu_s = time.monotonic() - began, _cpu_s() - cpu_began
        model = out / "model" if ask == "diagnose" else out
        document = _read(model / "result.json") | _read(out / "diagnosis.json")
        export = [sys.executable, "-m", "galileo_jax.export", str(model), "--to", "csv"]
        if "by" in case and not code:
            _run([*export, "--fitted", "--out", scratch], package)
        typed = num_typed(path.parent, case["file"], declared)
        motions = gallery.motions(Path(scratch) / "track.csv", case.get("until_s", math.inf))
    values: dict[str, Any] = {}
    for part in ("nuisances", "derived", "parameters"):
        values |= document.get(part, {})
    wanted = [*case.get("right", {}), *case.get("shown", ())]
    row = {"file": case["file"], "what": case["what"], "code": code,
           "values": {name: values[name] for name in wanted if name in values},
           "right": _right(case), "wall_s": round(wall_s, 1), "cpu_s": round(cpu_s, 1),
           "keys": _num_keys(declared), "typed": typed,
           "sentence": document.get("sentence", ""),
           "motions": motions,
           "said": said.replace(scratch, "").strip().splitlines()[-25:]}  # fmt: skip
    return row | {"judged": judged(case, row, values, said)}


def judged(
    case: Mapping[str, Any], row: Mapping[str, Any], values: Mapping[str, Any], said: str
) -> str:
    """In a word or two, how a case went."""
    if row["cpu_s"] > TOO_LONG_S:
        return "too long"
    if row["code"] == 2 and "refused" in case and re.search(case["refused"], said):
        return "refused, rightly"
    if row["code"] == 2:
        return "refused"
    if row["code"]:
        return "failed"
    is_right = all(_is_near(values.get(name), goal) for name, goal in case.get("right", {}).items())
    is_said = re.search(case.get("words", ""), said) is not None
    is_quiet = "never" not in case or re.search(case["never"], said) is None
    is_only_refusal = not {"right", "words", "never"} & set(case)
    is_trusted = re.search(DISTRUST, said) is None
    if is_right and is_said and is_quiet and not is_only_refusal:
        return "right" if is_trusted or not case.get("trusted") else "right, not trusted"
    return "wrong" if is_trusted else "wrong, not trusted"


def num_typed(folder: Path, name: str, declared: Mapping[str, Any]) -> int | None:
    """Answers that `galileo FILE` needs and Enter does not give, of a file that a person made.

    Args:
      folder: in which the clip's file is.
      name: of the case's file; None is returned where no person made it, or it cannot be read.
      declared: what is right to answer.
    """
    if not name.removeprefix("../").startswith("real/"):
        return None
    with tempfile.TemporaryDirectory() as alone:
        source = folder / (declared.get("track") or declared["video"])
        try:
            known = understand(Path(shutil.copy(source, alone)))
        except InputError:
            return None
        points = [item["point_px"] for item in declared["objects"] if "point_px" in item]
        texts = {key: f"{declared[key]:g}" for key in NUMBERS if declared.get(key) is not None}
        texts |= {key: declared[key] for key in ("scenario", "track_units") if key in declared}
        if declared.get("pixels_per_metre"):
            texts["pixels_per_metre"] = f"{declared['pixels_per_metre']:g} px"
        if points:
            texts["points"] = f"{points[0][0]} {points[0][1]}"
        asked = answered(known, texts).questions
        told = next((one.default or "" for one in asked if one.key == "points"), "")
        usual = [list(known.things)[int(told) - 1]] if told.isdigit() else []
    if usual and points and math.dist(usual[0], points[0]) < NEAR_PX:
        texts.pop("points")
    return sum(
        one.default is None or texts.get(one.key, one.default) != one.default for one in asked
    )


def markdown(rows: list[dict[str, Any]]) -> list[str]:
    """The rows as a table for the docs."""
    lines = ["| File | What it is | Right | Found, 95 % interval | Judged | s | Keys | Typed |",
             "|---|---|---|---|---|---|---|---|"]  # fmt: skip
    for row in rows:
        name = row["file"].removesuffix(".yaml").removesuffix(".wanted")
        typed = "" if row.get("typed") is None else row["typed"]
        lines.append(
            f"| `{name}` | {row['what'].removeprefix('real: ')} | {row['right']} | {_found(row)} | "
            f"{row['judged']} | {row['wall_s']:.0f} | {row['keys']} | {typed} |"
        )
    return lines


def _written(folder: Path, place: Path, case: Mapping[str, Any]) -> tuple[Path, dict[str, Any]]:
    """The clip's yaml in a copy of its folder, without what a case drops, with what it sets."""
    source = folder / case["file"]
    place.mkdir()
    for file in (one for one in source.parent.iterdir() if one.is_file()):
        shutil.copy(file, place)
    path = (place / source.name).with_suffix(".yaml")
    declared = case.get("clip") or yaml.safe_load(path.read_text())
    for key in case.get("drop", ()):
        declared.pop(key, None)
        for item in declared["objects"]:
            item.pop(key, None)
    if "rows" in case:
        kept = [one for one in source.read_text().splitlines() if one.startswith(case["rows"])]
        lines = [case["titles"], *(one.partition(",")[2] for one in kept)]
        (place / declared["track"]).write_text("\n".join(lines))
    path.write_text(yaml.safe_dump(declared | case.get("set", {})))
    return path, declared | case.get("set", {})


def _read(path: Path) -> dict[str, Any]:
    return json.loads(path.read_text()) if path.is_file() else {}


def _run(call: list[str], package: Path) -> tuple[int, str]:
    """The exit code, and what was printed."""
    try:
        done = subprocess.run(
            call, capture_output=True, text=True, timeout=4 * TOO_LONG_S, check=False, cwd=package,
            env={**os.environ, "PYTHONPATH": str(package)},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return 124, "stopped by the benchmark"
    return done.returncode, f"{done.stdout}\n{done.stderr}"


def _cpu_s() -> float:
    """The processor time of all commands that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _is_near(found: Mapping[str, Any] | None, goal: Any) -> bool:
    if found is None or not found["identified"]:
        return False
    low, high = found["q025"], found["q975"]
    if isinstance(goal, Mapping):
        return low <= goal["holds"] <= high and high - low <= goal["width"]
    return abs(found["mean"] - goal[0]) <= goal[1]


def _right(case: Mapping[str, Any]) -> str:
    goals = [
        f"{name} {goal['holds']:g}" if isinstance(goal, Mapping)
        else f"{name} {goal[0]:g} ± {goal[1]:g}"
        for name, goal in case.get("right", {}).items()
    ]  # fmt: skip
    words = [f"says `{case['words']}`"] if "words" in case else []
    never = [f"never `{case['never']}`"] if "never" in case else []
    or_else = [f"or refuses: `{case['refused']}`"] if "refused" in case else []
    return "; ".join(goals + words + never + or_else).replace("|", " or ")


def _num_keys(declared: Mapping[str, Any]) -> int:
    items = sum(len(set(item) - {"name", "shape"}) for item in declared["objects"])
    return len(set(declared) - set(IMPLIED)) + items


def _found(row: Mapping[str, Any]) -> str:
    """The values with their intervals; where none was asked for, what was said."""
    return "; ".join(f"{name} {_shown(one)}" for name, one in row["values"].items()) or _line(row)


def _shown(value: Mapping[str, Any]) -> str:
    if not value["identified"]:
        return "not determined"
    return f"{value['mean']:.4g} [{value['q025']:.4g}, {value['q975']:.4g}]"


def _line(row: Mapping[str, Any]) -> str:
    """What was said, where no number is asked for."""
    said = [line for line in row["said"] if "galileo: error" in line or "warning:" in line]
    return (said[-1] if row["code"] and said else "-").replace("|", "/")[:160]

"""The frozen corpus: the same data through two commits, or two processors, and who differs.

    python -m benchmarks corpus run A.jsonl --num 300 [--task fit|mh|compare|diagnose] [--videos]
    PYTHONPATH=../other:. python -P -m benchmarks corpus run B.jsonl --num 300  # another checkout
    XLA_FLAGS=--xla_cpu_max_isa=SSE4_2 XDG_CACHE_HOME=build/sse \
        python -m benchmarks corpus run C.jsonl --num 300                       # another processor
    python -m benchmarks corpus differences A.jsonl B.jsonl

Cases are seeds, not files: scenarios in turn, two in three with an effect of the library hidden in
them, noise and frame rate drawn. `run` makes each clip once in --clips, and appends its outcome to
the file; what is there is not done again. `differences` counts means and ends of intervals in
standard deviations of the first file, log evidences against the best hypothesis in nats, verdicts,
and processor seconds. Only the public API is called, so that older commits run, too.
"""

import json
import math
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

import galileo_jax as gx
from benchmarks import tables
from benchmarks.journal import Journal, finished
from galileo_jax.runtime.errors import InputError

SCENARIOS = (
    *("ramp", "incline", "ramp", "fall", "multi", "ramp", "flight", "spring"),
    *("ramp", "liquid", "ramp", "pendulum", "from_above"),
)
FRAME_RATES, NOISE_M, STRENGTHS = (30.0, 60.0, 120.0), (1e-4, 1e-3), (0.3, 1.0)
ENDS = ("q025", "q975")
SETTLED_SD = 0.02  # what differs by more is printed


def main(
    do: Literal["run", "differences"],
    files: tuple[Path, ...],
    *,
    num: int = 300,
    first: int = 0,
    task: Literal["fit", "mh", "compare", "diagnose"] = "fit",
    videos: bool = False,
    clips: Path = Path("build/corpus"),
) -> dict[str, Any] | None:
    if do == "differences":
        return _differences(*(finished(path) for path in files))
    journal = Journal(files[0])
    for index in range(first, first + num):
        name = f"{'video' if videos else 'track'}{index}"
        path, recipe = _clip(clips / f"{name}.{'mp4' if videos else 'csv'}", index)
        row = journal.row(f"{task} {name}", lambda path=path: _timed(path, task))
        rises = "error rises" if row.get("rises") else ""
        said = (recipe["scenario"], *recipe.get("effects", ()), row["cpu_s"], rises)
        tables.row(row["case"], said)
    return None


def recipes(index: int, is_video: bool) -> Iterator[dict[str, Any]]:
    """Arguments of `simulate` for a case; the next ones where an effect has no place."""
    generator = np.random.default_rng([index, 50])
    scenario = "ramp" if is_video else SCENARIOS[index % len(SCENARIOS)]
    plain: dict[str, Any] = {
        "seed": 600_000 + index,
        "scenario": scenario,
        "track_only": not is_video,
        "fps": float(generator.choice(FRAME_RATES)),
    }
    if is_video:
        plain |= {"fps": 30.0, "faults": True, "solver": "fine"}
    else:
        plain["track_noise"] = float(np.exp(generator.uniform(*np.log(NOISE_M))))
    if index // len(SCENARIOS) % 3:
        for effect in generator.permutation(sorted(gx.effects().index)):
            strength = float(generator.uniform(*STRENGTHS))
            yield plain | {"effects": {str(effect): {}}, "strength": strength}
    yield plain


def _clip(path: Path, index: int) -> tuple[Path, dict[str, Any]]:
    """The yaml of a case and its recipe; what is not there is made."""
    kept = path.with_suffix(".recipe.json")
    if not kept.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        for recipe in recipes(index, path.suffix == ".mp4"):
            try:
                gx.simulate(path, **recipe)
            except InputError:  # the effect has no place in this scene
                continue
            kept.write_text(json.dumps(recipe))
            break
    return path.with_suffix(".yaml"), json.loads(kept.read_text())


def _timed(path: Path, task: str) -> dict[str, Any]:
    """The outcome or the failure of a task, and its processor seconds."""
    began = time.process_time()
    try:
        row = _outcome(path, task)
    except Exception as error:
        row = {"failed": f"{type(error).__name__}: {error}"}
    return row | {"cpu_s": time.process_time() - began}


def _outcome(path: Path, task: str) -> dict[str, Any]:
    if task in ("fit", "mh"):
        fit = gx.fit(path, method="mh" if task == "mh" else "grad")
        assert fit.gradient is not None
        return {
            "values": fit.parameters | fit.result["derived"],
            "log_evidence": {"fit": fit.gradient.log_evidence},
            "chi2": fit.gradient.chi2,
            "verdict": str(fit.gradient.code.name),
        }
    if task == "compare":
        check = gx.compare(path)
        return {"log_evidence": {"p": math.log(check.p_value)}, "verdict": check.p_value > 0.01}
    found = gx.diagnose(path)
    candidates = found.document["candidates"]
    best = max(candidate["score"] for candidate in candidates)
    errors = [row["rmse"] for row in found.document["history"]]
    return {
        "rises": bool(errors[-1] > errors[0]),  # whether what was added makes the error larger
        "log_evidence": {
            "+".join(candidate["effects"]) if "effects" in candidate else candidate["effect"]: (
                candidate["score"] - best
            )
            for candidate in candidates
        },
        "verdict": f"{found.verdict.status} {' '.join(sorted(found.verdict.effects))}",
    }


def _differences(first: Mapping[str, Any], second: Mapping[str, Any]) -> dict[str, Any]:
    tables.row("case", ("mean, sd", "ends, sd", "nats", "verdicts"))
    both = [case for case in first if case in second]
    rows = np.array([_difference(first[case], second[case]) for case in both])
    for case, (mean, end, nats, is_other) in zip(both, rows, strict=True):
        if not max(mean, end, nats) < SETTLED_SD or is_other:
            words = [
                str(run[case].get("verdict", run[case].get("failed"))) for run in (first, second)
            ]
            tables.row(case, (mean, end, nats, words[0] if not is_other else " / ".join(words)))
    quantiles = {str(q): np.nanquantile(rows[:, :3], q, axis=0).tolist() for q in (0.5, 0.9, 1.0)}
    for name, values in quantiles.items():
        tables.row(f"quantile {name}", values)
    seconds = [sum(run[case]["cpu_s"] for case in both) for run in (first, second)]
    figures = {"cases": len(both), "other_verdicts": int(rows[:, 3].sum()), "cpu_s": seconds}
    return figures | {"quantiles": quantiles}


def _difference(one: Mapping[str, Any], other: Mapping[str, Any]) -> tuple[float, ...]:
    """Of means and ends in sds, of log evidence in nats, and whether the verdicts differ."""
    if "failed" in one or "failed" in other:
        return (math.nan,) * 3 + (float(one.get("failed") != other.get("failed")),)
    means, ends = [0.0], [0.0]
    for name, value in one.get("values", {}).items():
        sd, there = value["sd"], other["values"].get(name)
        if there is None or not sd > 0:
            continue
        means.append(abs(there["mean"] - value["mean"]) / sd)
        ends += [abs(there[end] - value[end]) / sd for end in ENDS]
    nats = [
        abs(other["log_evidence"][name] - own) if name in other["log_evidence"] else math.inf
        for name, own in one["log_evidence"].items()
    ]
    return max(means), max(ends), max(nats), float(one["verdict"] != other["verdict"])

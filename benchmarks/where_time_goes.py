"""Where do the CPU seconds of `fit` and `diagnose` go?

    python -m benchmarks where_time_goes

Every call runs in a process of its own, with compiled programs in the cache: of `--repeats` runs
the one with the fewest seconds counts. Five csv tracks that `simulate` makes (nothing hidden,
one effect, another, a pair, one that the library has not), and one 640x360 video for `fit`, which
is tracked anew each time. Seconds are those of all threads of the process. Beside them a fixed
calculation, so that hosts can be compared.

Columns: `reading` decodes a video once to check it; `programs` reads or makes compiled code (in a
diagnosis it is part of the base fit); `second` is the second search of the base fit; forms without
a name are among the `candidates`; `replicates` of all comparisons, those of pairs, too; `leads`:
whether a clip like this would tell what is named from its rivals; `force`: the missing force.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

from benchmarks import tables
from galileo_jax.runtime.precision import in_float64

ROOT = Path(__file__).resolve().parents[1]
EXOTIC_FILE = ROOT / "benchmarks" / "exotic_effects.py"
TRACKS = {
    "none": (),
    "air_drag": ("air_drag",),
    "friction_patch": ("friction_patch",),
    "pair": ("air_drag", "friction_patch"),
    "unknown": ("exotic_bump",),
}
VIDEO, VERBS = "video", ("fit", "diagnose")
ANGLE_DEG, STRENGTH = 20.0, 0.7
FIXED_ROLLOUTS, FIXED_BATCH = 10_000, 200

# What `on_progress` is told, by its beginning, and the column of the table. What follows a fitted
# candidate is the comparison of the best; what follows the last comparison is the document.
STAGES = {
    "compiling": "programs",
    "fitting the model": "base fit",
    "searching on": "second",
    "searching": "base fit",
    "refining": "base fit",
    "fitting pairs": "pairs",
    "fitting": "candidates",
    "comparing": "replicates",
    "compared": "document",
    "fitted": "replicates",
    "looking at pairs": "pairs",
    "looking at what": "leads",
    "inferring": "force",
    "looking for": "force",
}
COLUMNS = ("start-up", "imports", "reading", "tracking", *dict.fromkeys(STAGES.values()), "report")


class StageClock:
    """Divides the seconds of a process among stages: each lasts until the next begins.

    Args:
      now: seconds so far; those before the first stage are of "start-up".
    """

    def __init__(self, now: Callable[[], float] = time.process_time):
        self._now, self._stage, self._since = now, "start-up", 0.0
        self.seconds: dict[str, float] = {}

    def begin(self, stage: str) -> None:
        """Ends the stage before."""
        now = self._now()
        self.seconds[self._stage] = self.seconds.get(self._stage, 0.0) + now - self._since
        self._stage, self._since = stage, now

    def on_progress(self, told: str, share_done: float, partial: Any) -> None:
        """Begins what the public functions say that they begin."""
        del partial
        stage = next((stage for words, stage in STAGES.items() if told.startswith(words)), None)
        if stage is not None and share_done < 1:
            self.begin(stage)


def main(
    *,
    case: tuple[str, ...] = (*TRACKS, VIDEO),
    verb: tuple[str, ...] = VERBS,
    seed: int = 7001,
    repeats: int = 2,
    one: tuple[str, ...] = (),
) -> dict[str, Any] | None:
    if one:
        return _print_one(*one)
    figures: dict[str, Any] = {"fixed_before": fixed_calculation()}
    with tempfile.TemporaryDirectory() as folder:
        clips = {name: _simulated(Path(folder), name, seed) for name in case}
        for asked in verb:
            tables.row(f"{asked}, CPU s", [*COLUMNS, "whole"])
            figures[asked] = {}
            for name, clip in clips.items():
                if asked == "fit" or name != VIDEO:
                    figures[asked][name] = measured = _measured(asked, clip, repeats)
                    spent = measured["cpu_s"]
                    tables.row(f"  {name}", [*map(spent.get, COLUMNS), sum(spent.values())])
                    print(f"    {' '.join(measured['result'])}", flush=True)
    figures["fixed_after"] = fixed_calculation()
    tables.summary(figures)
    return figures


@in_float64
def fixed_calculation() -> float:
    """CPU seconds of `FIXED_ROLLOUTS` rollouts with the rigid engine, once it is compiled."""
    from benchmarks import rollouts

    run = rollouts.batch_of("rigid", FIXED_BATCH)
    run()
    began = time.process_time()
    for _ in range(FIXED_ROLLOUTS // FIXED_BATCH):
        run()
    return time.process_time() - began


def _simulated(folder: Path, case: str, seed: int) -> Path:
    """A clip; what `exotic_effects.py` registers stays out of this process."""
    if case == VIDEO:
        recipe: dict[str, Any] = {"out": f"{VIDEO}.mp4"}
    else:
        hidden = {name: {} for name in TRACKS[case]}
        recipe = {"out": f"{case}.csv", "track_only": True, "solver": "fine", "effects": hidden}
        recipe["strength"] = STRENGTH if hidden else None
        recipe["effects_from"] = [str(EXOTIC_FILE)] if case == "unknown" else []
    recipe |= {"seed": seed, "angle": ANGLE_DEG, "faults": True}
    code = "import json, sys, galileo_jax as gx; gx.simulate(**json.loads(sys.argv[1]))"
    subprocess.run([sys.executable, "-c", code, json.dumps(recipe)], cwd=folder, check=True)
    return folder / recipe["out"]


def _measured(verb: str, clip: Path, repeats: int) -> dict[str, Any]:
    """What `_print_one` says of the run with the fewest seconds."""
    words = [sys.executable, "-m", "benchmarks", "where_time_goes", "--one", verb, str(clip)]
    runs = []
    for _ in range(repeats):
        done = subprocess.run(words, stdout=subprocess.PIPE, text=True, check=True, cwd=ROOT)
        runs.append(json.loads(done.stdout.splitlines()[-1]))
    return min(runs, key=lambda run: sum(run["cpu_s"].values()))


def _print_one(verb: str, path: str) -> None:
    """Carries one call out; prints the seconds of its stages, and what came of it, as JSON."""
    clock = StageClock()
    clock.begin("imports")
    import galileo_jax as gx
    from galileo_jax.runtime import jax_setup

    load, track, function = gx.load, gx.track, getattr(gx, verb)
    jax_setup.set_up()  # now: below the cache of compiled programs would be switched off, too
    clock.begin("reading")
    clip = load(path)
    clock.begin("tracking")
    with mock.patch.dict(os.environ, GALILEO_JAX_CACHE="off"):  # which would know the track
        followed = track(clip)
    found = function(followed, on_progress=clock.on_progress)
    clock.begin("report")
    found.save(Path(path).with_suffix(f".{verb}"))
    clock.begin("end")
    said = found.verdict if verb == "diagnose" else None
    result = [said.status, *said.effects] if said else [found.result["status"]]
    print(json.dumps({"cpu_s": clock.seconds, "result": result}))

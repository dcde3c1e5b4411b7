"""A sweep killed at random moments, and one left in peace: `python -m tests.sweeping.killed`.

Each of the kills is a `kill -9` of the sweep's process, at a moment drawn between its start and
the time that a whole sweep takes. At the end the sweep is taken up once more.
"""

import argparse
import json
import random
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Killed:
    """What came of it.

    Attributes:
      undisturbed, disturbed: the folders.
      seconds: that the undisturbed sweep took.
      done: how many cells there were after each kill.
      partial: files that could not be read after a kill.
      left_alive: workers that outlived the sweep by more than a second.
    """

    undisturbed: Path
    disturbed: Path
    seconds: float
    done: list[int]
    partial: list[Path]
    left_alive: int

    @property
    def is_same(self) -> bool:
        """Whether the summaries are the same, byte for byte."""
        names = [path.name for path in self.undisturbed.glob("summary.*")]
        return bool(names) and all(
            (self.undisturbed / name).read_bytes() == (self.disturbed / name).read_bytes()
            for name in names
        )


def kill_and_resume(folder: Path, words: list[str], kills: int, seed: int = 0) -> Killed:
    """Runs `galileo sweep WORDS` undisturbed and with kills."""
    rng = random.Random(seed)
    base = [sys.executable, "-m", "galileo_jax.sweep", *words, "--out"]
    whole, broken = folder / "whole", folder / "broken"
    began = time.monotonic()
    subprocess.run([*base, str(whole)], check=True, capture_output=True)
    seconds = time.monotonic() - began
    done, partial, left_alive = [], [], 0
    for _ in range(kills):
        process = subprocess.Popen(
            [*base, str(broken)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        try:
            process.wait(rng.uniform(0.0, seconds))
        except subprocess.TimeoutExpired:
            workers = _children(process.pid)
            process.send_signal(signal.SIGKILL)
            process.wait()
            time.sleep(1.0)
            left_alive += sum(Path(f"/proc/{worker}").exists() for worker in workers)
        results = list(broken.glob("cells/*/result.json"))
        done.append(len(results))
        partial += [path for path in results if not _is_whole(path)]
    subprocess.run([*base, str(broken)], check=True, capture_output=True)
    return Killed(whole, broken, seconds, done, partial, left_alive)


def _children(process: int) -> list[str]:
    tasks = Path(f"/proc/{process}/task").glob("*/children")
    return [child for path in tasks for child in path.read_text().split()]


def _is_whole(path: Path) -> bool:
    try:
        return "method" in json.loads(path.read_text())
    except ValueError:
        return False


def main() -> None:
    """Prints what came of it; exit code 1 where the summaries differ."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("words", nargs="+", help="of galileo sweep, without --out")
    parser.add_argument("--kills", type=int, default=10)
    call, more = parser.parse_known_args()
    found = kill_and_resume(call.folder, [*call.words, *more], call.kills)
    print(
        f"undisturbed {found.seconds:.1f} s; cells after each kill {found.done}; half-written "
        f"{len(found.partial)}; workers left {found.left_alive}; same summary {found.is_same}"
    )
    sys.exit(not found.is_same)


if __name__ == "__main__":
    main()

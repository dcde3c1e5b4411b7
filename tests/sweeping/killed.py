"""A sweep killed at random moments, and one left in peace: `python -m tests.sweeping.killed`.

Each of the kills is a `kill -9` of the sweep's process, within a second after it has finished none
to five more cells, both drawn. At the end the sweep is taken up once more.
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

MOST_CELLS = 5  # between two kills


@dataclass(frozen=True)
class Killed:
    """What came of it."""

    # folders
    undisturbed: Path
    disturbed: Path
    seconds: float  # that the undisturbed sweep took
    num_killed: int  # runs that were not at their end already
    done: list[int]  # how many cells there were after each kill
    partial: list[Path]  # files that could not be read after a kill
    left_alive: int  # workers that outlived the sweep by half a second

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
    done, partial, left_alive, num_killed = [], [], 0, 0
    for _ in range(kills):
        process = subprocess.Popen(
            [*base, str(broken)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        wanted = len(_results(broken)) + rng.randint(0, MOST_CELLS)
        while process.poll() is None and len(_results(broken)) < wanted:
            time.sleep(0.01)
        time.sleep(rng.uniform(0.0, 1.0))
        workers = _children(process.pid)
        process.send_signal(signal.SIGKILL)
        num_killed += process.wait() == -signal.SIGKILL
        time.sleep(0.5)
        left_alive += sum(map(_is_alive, workers))
        results = _results(broken)
        done.append(len(results))
        partial += [path for path in results if not _is_whole(path)]
    subprocess.run([*base, str(broken)], check=True, capture_output=True)
    return Killed(whole, broken, seconds, num_killed, done, partial, left_alive)


def _results(folder: Path) -> list[Path]:
    return list(folder.glob("cells/*/result.json"))


def _is_alive(process: str) -> bool:
    """Whether it runs; what is dead and not yet buried does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def _children(process: int) -> list[str]:
    try:
        tasks = list(Path(f"/proc/{process}/task").glob("*/children"))
        return [child for path in tasks for child in path.read_text().split()]
    except (FileNotFoundError, ProcessLookupError):
        return []


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
    print(f"undisturbed {found.seconds:.1f} s; {found.num_killed} kills, then {found.done} cells")
    print(f"half-written {len(found.partial)}, workers left {found.left_alive}")
    print(f"same summary: {found.is_same}")
    sys.exit(not found.is_same)


if __name__ == "__main__":
    main()

"""Falls whose errors follow each other: what does `diagnose` find in them?

    python benchmarks/errors_in_time.py --kind follow --num 40 --seed 5000

35 m, 15 Hz, errors of 6 cm: independent (`white`), of an autoregression (`follow`, 0.8 from row to
row), or smooth over two rows (`smooth`). Nothing is hidden, or a drag of `--drag` kg/m.
"""

import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import yaml

import galileo_jax as gx
from galileo_jax.commands import command

ROWS, RATE_HZ, SD_M, MASS_KG, GRAVITY = 42, 15.0, 0.06, 0.15, 9.81
STEPS = 200  # between two rows


def main(argv: Sequence[str]) -> int | None:
    """Diagnoses tracks of as many seeds and counts the verdicts."""
    parser = command.Parser(prog="errors_in_time.py", description=__doc__)
    parser.add_argument("--kind", choices=("white", "follow", "smooth"), default="follow")
    parser.add_argument("--drag", type=float, default=0.0, help="kg/m")
    parser.add_argument("--num", type=int, default=40)
    parser.add_argument("--seed", type=int, default=5000)
    call = parser.parse_args(argv)
    statuses: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(call.seed, call.seed + call.num):
            found = gx.diagnose(str(_clip(Path(folder), seed, call.kind, call.drag)))
            said = (
                found.verdict.law.text if found.verdict.law else " | ".join(found.verdict.effects)
            )
            print(seed, found.verdict.status, said, flush=True)
            statuses[found.verdict.status] += 1
    print(dict(statuses))
    return None


def _clip(folder: Path, seed: int, kind: str, drag: float) -> Path:
    times = np.arange(ROWS) / RATE_HZ
    height, speed, fallen, step_s = [0.0], 0.0, 0.0, 1 / RATE_HZ / STEPS
    for _ in range((ROWS - 1) * STEPS):
        speed += step_s * (GRAVITY - drag / MASS_KG * speed**2)
        fallen += step_s * speed
        height.append(-fallen)
    apart = np.abs(np.subtract.outer(np.arange(ROWS), np.arange(ROWS)))
    cover = {
        "white": np.eye(ROWS),
        "follow": 0.8**apart,
        "smooth": 0.95 * np.exp(-0.5 * (apart / 2.0) ** 2) + 0.05 * np.eye(ROWS),
    }[kind]
    drawn = np.linalg.cholesky(cover) @ np.random.default_rng(seed).standard_normal(ROWS)
    rows = zip(times, np.array(height)[::STEPS] + SD_M * drawn, strict=True)
    track = folder / f"{kind}_{seed}.csv"
    head = "time_s,object1_x_m,object1_y_m,object1_sd_m\n"
    track.write_text(head + "".join(f"{t:.6f},0,{y:.6f},{SD_M}\n" for t, y in rows), "utf-8")
    ball = {"name": "object1", "shape": "sphere", "mass_kg": MASS_KG}
    clip = {"track": track.name, "scenario": "fall", "objects": [ball]}
    track.with_suffix(".yaml").write_text(yaml.safe_dump(clip), "utf-8")
    return track


if __name__ == "__main__":
    raise SystemExit(command.run(main))

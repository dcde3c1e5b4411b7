"""Two pucks that both move at first: before they meet is a phase, whatever rows are missing."""

from pathlib import Path

import numpy as np
import pytest

import galileo_jax as gx
from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import measure
from galileo_jax.search.moves.prefix import phases

FPS, G, K, RATIO, RESTITUTION, NOISE_M = 50, 9.81, 0.03, 0.6, 0.9, 5e-4
RADIUS_M, FRAMES = 0.03, 80


def paths() -> np.ndarray:
    """Discs without grip, by small steps: `[puck, 2, frame]`, m."""
    place = np.array([[0.0, 0.0], [0.55, -0.012]])
    speed = np.array([[0.8, -0.045], [-0.2, 0.0]])
    steps, found = 40, [place.copy()]
    dt, is_hit = 1 / FPS / steps, False
    for k in range(1, (FRAMES - 1) * steps + 1):
        size = np.linalg.norm(speed, axis=1, keepdims=True)
        speed = speed * np.maximum(1 - K * G * dt / np.maximum(size, 1e-9), 0.0)
        place = place + speed * dt
        apart = place[1] - place[0]
        if not is_hit and np.linalg.norm(apart) <= 2 * RADIUS_M:
            is_hit, normal = True, apart / np.linalg.norm(apart)
            closing = (speed[0] - speed[1]) @ normal
            impulse = (1 + RESTITUTION) * closing / (1 / RATIO + 1.0)
            speed = speed + np.array([[-impulse / RATIO], [impulse]]) * normal
        if k % steps == 0:
            found.append(place.copy())
    return np.stack(found, axis=-1)


def write(folder: Path) -> Path:
    rng = np.random.default_rng(7)
    places = paths() + NOISE_M * rng.standard_normal((2, 2, FRAMES))
    is_missing = rng.random((2, FRAMES)) < 0.08
    rows = ["time_s," + ",".join(f"puck{i}_{c}" for i in (1, 2) for c in ("x_m", "y_m", "sd_m"))]
    for k in range(FRAMES):
        cells = [f"{k / FPS}"]
        for i in range(2):
            x, y = places[i, :, k]
            cells += ["", "", ""] if is_missing[i, k] else [f"{x}", f"{y}", f"{NOISE_M}"]
        rows.append(",".join(cells))
    (folder / "pucks.csv").write_text("\n".join(rows) + "\n")
    path = folder / "pucks.yaml"
    path.write_text(
        "track: pucks.csv\nscenario: from_above\nobjects:\n"
        "- {name: puck1, shape: cylinder, size_m: [0.03, 0.01]}\n"
        "- {name: puck2, shape: cylinder, size_m: [0.03, 0.01]}\n"
    )
    return path


def test_before_they_meet_is_a_phase(tmp_path):
    measured = measure(load_clip(write(tmp_path)))
    trials = make_joint_problem([measured.clip], [measured.observation])
    first = next(phases(trials)).problems[0].observation
    apart = np.linalg.norm(paths()[1] - paths()[0], axis=0)
    last = int(np.flatnonzero(first.mask.any(axis=0))[-1])
    assert last == pytest.approx(int(np.argmin(apart)), abs=2)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_no_seed_is_luckier(tmp_path, seed):
    found = gx.fit(write(tmp_path), seed=seed)
    assert found.result["error"]["chi2_per_dof"] < 1.6
    assert abs(found.result["derived"]["mass_ratio"]["mean"] - RATIO) < 0.03
    assert abs(found.parameters["k1"]["mean"] - K) < 0.004

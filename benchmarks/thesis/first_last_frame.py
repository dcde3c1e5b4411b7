"""First and last frame: the scene as seen, and as the thesis's estimate simulates it.

Reported: how far simulated centres are from the seen ones in the first frame and in the last, mean
over --num truths, in m; beside it the naive guesser. The picture is of the first truth.
`python benchmarks/thesis/first_last_frame.py`
"""

import math
from collections.abc import Sequence

import numpy as np
import setting

from galileo_jax.commands import command
from galileo_jax.report.style import object_colour, palette
from galileo_jax.rollout.motion import pitch
from galileo_jax.thesis.task import RELEASE_M, SIZE_M


def main(argv: Sequence[str]) -> int | None:
    call = setting.start(argv, __doc__, num=30)
    cases = setting.experiments(call.seed, call.num, call.frames)
    estimates = np.array([setting.infer(case, i) for i, case in enumerate(cases)])
    seen = np.array([case.seen_m for case in cases])
    simulated = setting.task(call.frames).positions(estimates)
    guessed = np.array(
        [setting.task(call.frames).positions(setting.guesses(i)) for i in range(len(cases))]
    )
    setting.row("distance of centres, m", ("first 1", "first 2", "last 1", "last 2"))
    found = {}
    for name, positions in (("fitted", simulated), ("guess", guessed.swapaxes(0, 1))):
        off = np.linalg.norm(positions - seen, axis=-2)
        off = off.reshape(-1, *off.shape[-2:]).mean(0)
        found[name] = off[:, [0, -1]].T
        setting.row(name, list(found[name].ravel()))
    with setting.figure(call, "first_last_frame", columns=2, rows=2, row_in=1.25) as axes:
        for i, (name, positions) in enumerate((("seen", seen[0]), ("simulated", simulated[0]))):
            for j, frame in enumerate((0, -1)):
                draw_scene(axes[i, j], positions[..., frame])
                axes[i, j].set(title=f"{name}, {'first' if frame == 0 else 'last'} frame")
    setting.finish(call, "first_last_frame", found)
    return None


def draw_scene(axes, centres: np.ndarray) -> None:
    """Ramp, table and the two boxes at `[object, 2]`."""
    from matplotlib.patches import Polygon

    scene = setting.task(60).surroundings
    up = RELEASE_M + 0.1
    foot = (-up * math.cos(scene.angle_rad), 0.0)
    axes.plot((*foot, 1.2), (up * math.sin(scene.angle_rad), 0.0, 0.0), color="0.6")
    turned = np.asarray(pitch(centres, scene))
    half = 0.5 * np.array([SIZE_M[0], SIZE_M[2]])
    for i, (centre, angle) in enumerate(zip(centres, turned, strict=True)):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
        axes.add_patch(Polygon(centre + corners @ turn.T, color=palette()[object_colour(i)]))
    axes.set(aspect="equal", xlim=(-0.65, 1.2), ylim=(-0.05, 0.35))


if __name__ == "__main__":
    raise SystemExit(command.run(main))
